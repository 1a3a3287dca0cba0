# SPDX-License-Identifier: Apache-2.0
"""Parameters by the names, defaults and checks of the library."""
import os

from . import _core

parameter_infos = _core.parameter_infos
_INFOS = {info.name: info for info in parameter_infos()}


class _Section:
    def __init__(self, values, name):
        object.__setattr__(self, "_values", values)
        object.__setattr__(self, "_name", name)

    def __getattr__(self, field):
        if field.startswith("__"):
            raise AttributeError(field)
        return self._values.get(f"{self._name}.{field}")

    def __setattr__(self, field, value):
        self._values.set(f"{self._name}.{field}", value)

    def __dir__(self):
        return [name.partition(".")[2] for name in _INFOS if name.startswith(self._name + ".")]

    def to_dict(self):
        return {field: getattr(self, field) for field in dir(self)}

    def __repr__(self):
        return repr(self.to_dict())


class Parameters:
    """Every parameter of the system: Parameters(retrieval={"top_k": 5}, preset="paper"), p.retrieval.top_k = 7.

    docs/parameters.md lists them; a name or value that is not allowed is ValueError.
    """

    def __init__(self, preset="default", file=None, **sections):
        if preset not in ("default", "paper", "grid20x60"):
            raise ValueError(f"preset is {preset!r}; allowed: 'default', 'paper', 'grid20x60'")
        self._values = _core.ParameterValues(preset)
        if file is not None:
            self._values.read(os.fspath(file))
        for section, fields in sections.items():
            for field, value in dict(fields).items():
                self._values.set(f"{section}.{field}", value)
        self._values.validate()

    def __getattr__(self, section):
        if section.startswith("_") or not any(name.startswith(section + ".") for name in _INFOS):
            raise AttributeError(section)
        return _Section(self._values, section)

    def __setattr__(self, section, fields):
        if section == "_values":
            object.__setattr__(self, section, fields)
            return
        target = getattr(self, section)  # AttributeError where there is none
        for field, value in dict(fields).items():
            setattr(target, field, value)

    def __dir__(self):
        return sorted({name.partition(".")[0] for name in _INFOS}) + ["copy", "to_dict", "to_toml"]

    def copy(self):
        other = Parameters()
        other._values = self._values.copy()
        return other

    def to_dict(self):
        return {section: getattr(self, section).to_dict()
                for section in dict.fromkeys(name.partition(".")[0] for name in _INFOS)}

    def to_toml(self):
        """The file that Parameters(file=...) and `revisit --parameters` read."""
        return self._values.to_toml()

    def __eq__(self, other):
        return isinstance(other, Parameters) and self.to_toml() == other.to_toml()

    def __repr__(self):
        changed = {}
        default = Parameters._default()
        for name in _INFOS:
            if self._values.get(name) != default.get(name):
                section, _, field = name.partition(".")
                changed.setdefault(section, {})[field] = self._values.get(name)
        return f"Parameters({', '.join(f'{section}={fields}' for section, fields in changed.items())})"

    @staticmethod
    def _default():
        return _core.ParameterValues()
