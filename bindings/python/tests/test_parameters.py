# SPDX-License-Identifier: Apache-2.0
import pytest

import revisit


def test_names_defaults_and_checks_are_the_librarys():
    parameters = revisit.Parameters(retrieval={"top_k": 5})
    assert parameters.retrieval.top_k == 5 and parameters.geometric.overhead_search is True
    assert repr(parameters) == "Parameters(retrieval={'top_k': 5})"
    for info in revisit.parameter_infos():
        section, _, field = info.name.partition(".")
        assert field in dir(getattr(revisit.Parameters(), section))
    parameters.retrieval.top_k = 7
    assert parameters.copy() == parameters and revisit.Parameters() != parameters
    assert revisit.Parameters(preset="paper").descriptor.levels == 0
    assert parameters.to_dict()["retrieval"]["top_k"] == 7


@pytest.mark.parametrize("wrong", [{"retrieval": {"top_k": 0}}, {"retrieval": {"topk": 5}}, {"retreival": {"top_k": 5}},
                                   {"geometric": {"min_probability": "much"}}, {"preset": "best"}])
def test_what_is_not_allowed_is_a_value_error(wrong):
    with pytest.raises(ValueError, match="allowed|unknown|top_k|best"):
        revisit.Parameters(**wrong)


def test_files_are_those_of_the_program(tmp_path):
    parameters = revisit.Parameters(geometric={"features": "fallback"}, slam={"map_voxel_m": 0.5})
    (tmp_path / "p.toml").write_text(parameters.to_toml())
    assert revisit.Parameters(file=tmp_path / "p.toml") == parameters
    parameters.retrieval = {"top_k": 9}
    assert parameters.retrieval.top_k == 9
    with pytest.raises(AttributeError):
        parameters.topk = 3
    with pytest.raises(AttributeError):
        parameters.nothing
    with pytest.raises(AttributeError):
        parameters.slam.nothing
