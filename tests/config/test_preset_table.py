"""The table of a preset comes from the settings, knows all of the method's, and says what the paper says of each."""

from __future__ import annotations

import json
from pathlib import Path

import attrs
import pytest

from memo_core.api import registry
from memo_core.cli.app import run_app
from memo_core.config.experiment import load_experiment
from memo_core.config.layers import _read_preset
from memo_core.errors import UnknownName
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.policy.settings import RunSettings
from memo_core.runs.preset_table import SILENT, preset_table
from memo_core.runs.sections import SECTIONS

METHOD = ("skillbook", "retrieval", "run", "policy", "teaching", "clustering")
# Limits, recording and places: they do not change what is learnt or shown to a model.
TECHNICAL = {
    "skillbook": {"url", "read_only"},
    "clustering": {"interval_s"},
    "run": {field.name for field in attrs.fields(RunSettings)}
    - {"attempts", "subtasks", "repeats", "max_feedback", "repairs", "repairs_from", "reasks"},
}


def table() -> dict:
    return {row.path: row for row in preset_table("paper")}


def test_every_setting_of_the_method_is_in_the_table():
    named = {
        f"{section}.{field.name}"
        for section in METHOD
        for field in attrs.fields(SECTIONS[section])
        if field.name not in TECHNICAL.get(section, ())
    }
    assert set(table()) == named


def test_the_preset_changes_nothing_that_the_table_does_not_show():
    values = _read_preset("paper").values
    assert {f"{section}.{key}" for section in values for key in values[section]} <= set(table())


def test_the_values_are_those_of_an_experiment(tmp_path):
    shown = {}
    for name, text in (("preset", "preset: paper\n"), ("default", "seed: 0\n")):
        file = tmp_path / f"{name}.yaml"
        file.write_text(text)
        shown[name] = load_experiment(registry(), file, (), SECTIONS)
    for path, row in table().items():
        section, key = path.split(".")
        assert row.preset == getattr(shown["preset"].section(section), key), path
        assert row.default == getattr(shown["default"].section(section), key), path


def test_each_value_that_the_preset_changes_has_its_place_in_the_paper():
    changed = [row for row in table().values() if row.preset != row.default]
    assert len(changed) >= 25
    assert [row.path for row in changed if not row.paper] == []


def test_where_the_paper_says_nothing_the_default_stays():
    silent = [row for row in table().values() if row.cells[-1] == SILENT]
    assert silent and all(row.preset == row.default for row in silent)


def test_the_command_prints_it_and_names_a_preset_that_is_not_there(capsys):
    assert run_app(["config", "preset", "paper", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert {
        key: value
        for row in told["settings"]
        if row["path"] == "run.repairs"
        for key, value in row.items()
        if key != "paper"
    } == {"path": "run.repairs", "preset": 0, "default": 2}
    with pytest.raises(UnknownName, match="did you mean 'paper'"):
        preset_table("papr")


@pytest.mark.parametrize("file", ["paper.yaml", "paper-defaults.yaml"])
def test_the_examples_are_one_experiment_with_and_without_the_preset(file):
    examples = Path(__file__).parents[2] / "examples"
    experiment = load_experiment(registry(), examples / file, (), ALL_SECTIONS)
    other = load_experiment(registry(), examples / "paper-defaults.yaml", (), ALL_SECTIONS)
    both = [
        {path: value for path, value in one.public().items() if path.startswith(("study.", "books.", "evaluation."))}
        for one in (experiment, other)
    ]
    assert both[0] == both[1] and both[0]
    assert experiment.section("teaching").replan == (file == "paper-defaults.yaml")
