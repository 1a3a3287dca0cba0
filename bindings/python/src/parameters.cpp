// SPDX-License-Identifier: Apache-2.0
#include <charconv>

#include <revisit/config/parameter_file.hpp>
#include <revisit/config/parameters.hpp>

#include "bind.hpp"

namespace revisit::python {
namespace {

// Values of Python as set_parameter() reads them.
std::string to_text(const py::handle& value) {
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "true" : "false";
  return py::str(value).cast<std::string>();
}

py::object value_of(const Parameters& parameters, const ParameterInfo& info) {
  const std::string text = get_parameter(parameters, info.name);
  if (info.is_switch) return py::bool_(text == "true");
  if (info.is_text) return py::str(text);
  if (info.is_integer) return py::int_(std::stoll(text));
  double number = 0.0;  // as it was written, whatever locale Python has set
  std::from_chars(text.data(), text.data() + text.size(), number);
  return py::float_(number);
}

void check(const Status& status) {
  if (!status) throw py::value_error(status.error().message);
}

}  // namespace

void bind_parameters(py::module_& module) {
  py::class_<ParameterInfo>(module, "ParameterInfo", "One parameter as docs/parameters.md lists it.")
      .def_readonly("name", &ParameterInfo::name)
      .def_readonly("help", &ParameterInfo::help)
      .def_readonly("default", &ParameterInfo::default_value)
      .def_readonly("min", &ParameterInfo::min)
      .def_readonly("max", &ParameterInfo::max)
      .def_readonly("choices", &ParameterInfo::choices);
  module.def("parameter_infos", &parameter_infos, "All parameters, in the order of docs/parameters.md.");
  py::class_<Parameters>(module, "ParameterValues", "Behind revisit.Parameters.")
      .def(py::init([](const std::string& name) { return unwrap(preset(name)); }), py::arg("preset") = "default")
      .def("set", [](Parameters& self, const std::string& name,
                     const py::object& value) { check(set_parameter(self, name, to_text(value))); })
      .def("get",
           [](const Parameters& self, const std::string& name) {
             for (const ParameterInfo& each : parameter_infos())
               if (each.name == name) return value_of(self, each);
             throw py::attribute_error(name);
           })
      .def("validate", [](const Parameters& self) { check(validate(self)); })
      .def("read",
           [](Parameters& self, const std::filesystem::path& file) { self = unwrap(read_parameters(file, self)); })
      .def("to_toml", [](const Parameters& self) { return to_toml(self); })
      .def("copy", [](const Parameters& self) { return self; });
}

}  // namespace revisit::python
