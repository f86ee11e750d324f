"""A key that takes a section or a list of sections says exactly what is wrong in either."""

from __future__ import annotations

import pytest

from memo_core.config import ConfigErrors, load_experiment
from memo_core.plugins.registry import Registry
from memo_core.runs.sections import SECTIONS


def problems(tmp_path, text):
    file = tmp_path / "lab.yaml"
    file.write_text(f"perception:\n  backend: cameras\n  {text}\n")
    with pytest.raises(ConfigErrors) as errors:
        load_experiment(Registry(), file, (), SECTIONS)
    return {issue.path: issue for issue in errors.value.issues}


def test_a_mistake_in_a_section_and_in_a_list_of_sections_is_told_where_it_is(tmp_path):
    one = problems(tmp_path, "simulated: {nois: d435}")["perception.simulated.nois"]
    assert "'noise'" in one.problem and one.origin.line == 3
    several = problems(tmp_path, "simulated: [{noise: d435}, {noise: femtoo}]")["perception.simulated[1].noise"]
    assert "'femto'" in several.problem


def test_a_word_in_a_list_of_detectors_that_is_none_is_told_with_the_nearest(tmp_path):
    assert "'points'" in problems(tmp_path, "detector: [pints, tags]")["perception.detector"].problem
    assert "different names" in problems(tmp_path, "source: [realsense, realsense]")["perception.source"].problem


def test_an_empty_list_of_sections_is_refused_since_it_would_see_nothing(tmp_path):
    assert "no source" in problems(tmp_path, "simulated: []")["perception.simulated"].problem
