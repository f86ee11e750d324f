"""A preset is one word in an experiment, lies below all that is said there, and is shown as where values are from."""

from __future__ import annotations

import attrs
import pytest

from memo_core.api import registry
from memo_core.config.errors import ConfigErrors
from memo_core.config.experiment import load_experiment
from memo_core.config.layers import presets
from memo_core.policy.settings import TeachingSettings
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook.retrieval.retriever import RetrievalSettings


def load(tmp_path, text: str, *overrides: str):
    file = tmp_path / "e.yaml"
    file.write_text(text)
    return load_experiment(registry(), file, overrides, SECTIONS)


def test_the_papers_method_is_one_word_and_switches_every_extension_off(tmp_path):
    experiment = load(tmp_path, "preset: paper\n")
    teaching = experiment.section("teaching")
    assert not any(getattr(teaching, field.name) for field in attrs.fields(TeachingSettings))
    assert (experiment.section("run").repairs, experiment.section("run").attempts) == (0, 6)
    assert experiment.section("policy").images
    clustering = experiment.section("clustering")
    assert not clustering.join_keys and not clustering.groups and clustering.drop_covered
    retrieval = experiment.section("retrieval")
    assert (retrieval.cut, retrieval.corrections, retrieval.general) == (0.8, 1000, 1000)
    assert retrieval.template_characters is None and not retrieval.fold_templates
    assert not retrieval.shipped_actions and retrieval.wording.action == "{}"


def test_what_a_file_or_the_command_line_says_wins_and_values_tell_where_they_are_from(tmp_path):
    experiment = load(tmp_path, "preset: paper\nrun:\n  max_feedback: 7\n", "teaching.merge=true")
    shown = {one.path: (one.value, str(one.origin)) for one in experiment.values}
    assert shown["run.max_feedback"][0] == 7 and "e.yaml:3" in shown["run.max_feedback"][1]
    assert shown["teaching.merge"] == (True, "--set")
    assert shown["teaching.replan"][0] is False and "preset paper" in shown["teaching.replan"][1]
    assert shown["preset"][0] == "paper"


def test_a_preset_that_does_not_exist_is_named_with_its_line_and_the_closest(tmp_path):
    with pytest.raises(ConfigErrors, match=r"e\.yaml:2: preset: there is no preset 'papr'; did you mean 'paper'"):
        load(tmp_path, "seed: 1\npreset: papr\n")


@pytest.mark.parametrize("name", presets())
def test_every_preset_that_ships_is_in_order(tmp_path, name):
    load(tmp_path, f"preset: {name}\n")


def test_a_section_can_be_one_word_for_what_a_preset_says_of_it(tmp_path):
    experiment = load(tmp_path, "retrieval: paper\n")
    assert experiment.section("retrieval") == RetrievalSettings.preset("paper")
    assert experiment.section("run").max_feedback == load(tmp_path, "seed: 0\n").section("run").max_feedback
    on_top = load(tmp_path, "retrieval: paper\n", "retrieval.cut=0.7").section("retrieval")
    assert on_top == attrs.evolve(RetrievalSettings.preset("paper"), cut=0.7)
    assert load(tmp_path, "seed: 0\n", "retrieval=paper", "retrieval.cut=0.7").section("retrieval") == on_top
    shown = {value.path: str(value.origin) for value in experiment.values}
    assert "e.yaml:1" in shown["retrieval.ranking"] and shown["retrieval.reach"] == "default"
    with pytest.raises(ConfigErrors, match=r"e\.yaml:1: retrieval: 'papr' is no preset of it; did you mean 'paper'"):
        load(tmp_path, "retrieval: papr\n")


def test_the_papers_preset_has_the_papers_retrieval(tmp_path):
    assert load(tmp_path, "preset: paper\n").section("retrieval") == RetrievalSettings.preset("paper")
