"""``memo config explain``: what a setting means, by its path, its section or its name alone."""

from __future__ import annotations

import json
import re
from pathlib import Path

import attrs
import pytest
import yaml

from memo_core.cli.app import run_app
from memo_core.config.experiment import DRIVERS, SECTION_KINDS, load_experiment
from memo_core.config.explanations import UnknownSetting, all_settings, settings_named
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.plugins.registry import Registry


@pytest.fixture(scope="module")
def settings():
    return all_settings(Registry(), ALL_SECTIONS)


def explained(capsys, *arguments):
    assert run_app(["config", "explain", *arguments]) == 0
    return capsys.readouterr().out


def test_every_value_of_an_experiment_has_a_meaning(settings):
    meanings = {one.path: one.meaning for one in settings if one.path.partition(".")[0] != "evaluation"}
    values = load_experiment(Registry(), None, (), ALL_SECTIONS).values
    shown = [value.path for value in values if value.path.partition(".")[0] != "evaluation"]
    assert len(shown) > 100
    assert not [path for path in shown if not meanings.get(path)]


def test_a_key_is_explained_with_type_and_default(capsys):
    text = explained(capsys, "run.attempts")
    assert "run.attempts  (a whole number; default 4)" in text and "tries of one subtask" in text
    assert "here:" not in text


def test_a_key_is_found_without_its_section(settings):
    assert [one.path for one in settings_named("subtask_limit_s", settings)] == ["run.subtask_limit_s"]
    assert "study.timing.model_s" in {one.path for one in settings_named("timing", settings)}


def test_a_section_with_backends_shows_the_keys_of_each(settings):
    found = {(one.path, one.backend) for one in settings_named("perception", settings)}
    assert {
        ("perception.backend", ""),
        ("perception.source", "cameras"),
        ("perception.position_noise", "ground-truth"),
    } <= found


def test_with_a_file_the_value_and_its_line_are_shown_for_the_chosen_backend_alone(capsys, tmp_path: Path):
    file = tmp_path / "kitchen.yaml"
    file.write_text(yaml.safe_dump({"perception": {"backend": "ground-truth", "position_noise": 0.005}}))
    text = explained(capsys, "perception", "--config", str(file))
    assert f"here: 0.005, from {file}:3" in text
    data = json.loads(explained(capsys, "perception", "--config", str(file), "--json"))["settings"]
    assert not [one for one in data if one["backend"] == "cameras" and "value" in one]


@pytest.mark.parametrize(
    ("name", "nearest"), [("atempts", "run.attempts"), ("run.atempts", "run.attempts"), ("retreival", "retrieval")]
)
def test_an_unknown_name_is_refused_with_the_nearest(settings, name, nearest):
    with pytest.raises(UnknownSetting) as refused:
        settings_named(name, settings)
    assert nearest in refused.value.nearest and refused.value.exit_code == 2


def test_a_backend_of_a_section_is_explained_by_its_own_keys(settings):
    found = settings_named("teacher.simulated", settings)
    assert found and {one.backend for one in found} == {"simulated"}
    assert {one.path.partition(".")[0] for one in found} == {"teacher"}
    assert settings_named("robot.driver.franka", settings)[0].backend == "franka"


@pytest.mark.parametrize(
    ("words", "listed"),
    [
        ("speed", "hardware.safety.tool_speed"),
        ("cost", "run.max_cost"),
        ("limit", "run.time_limit_s"),
        ("top_k", "retrieval.corrections"),
        ("notes shown", "retrieval.corrections"),
    ],
)
def test_words_that_are_no_key_list_the_settings_that_speak_of_them(capsys, words, listed):
    assert run_app(["config", "explain", words]) == 0
    printed = capsys.readouterr()
    rows = [line.split()[0] for line in printed.out.splitlines()[2:]]
    assert listed in rows and len(rows) < 60
    assert f"no key and no section is called {words!r}" in printed.err


def test_limits_of_real_robots_are_said_to_be_of_real_robots(settings):
    assert all("real robot" in one.meaning for one in settings_named("hardware.safety", settings))


def test_help_texts_say_retrieved(settings):
    assert not [one.path for one in settings if "served" in one.meaning]


def test_secrets_are_not_settings(settings):
    secret = {
        field.name
        for backend in Registry().backends("llm")
        for field in attrs.fields(backend.config)
        if field.metadata.get("secret")
    }
    assert not secret & {one.path.partition(".")[2] for one in settings}


ROOT = Path(__file__).parents[2]
SECTIONS = "|".join(sorted({*SECTION_KINDS, *ALL_SECTIONS}))
NAMED = re.compile(rf"(?<![\w./-])((?:{SECTIONS})(?:\.[a-z_]+)+)=")


def test_every_setting_that_a_message_or_a_page_names_exists(settings):
    short = {f"robot.{key}" for key in DRIVERS.values()}
    known = {one.path for one in settings} | short
    files = [
        *ROOT.glob("memo_core/**/*.py"),
        *ROOT.glob("plugins/**/*.py"),
        *ROOT.glob("docs/**/*.md"),
        ROOT / "README.md",
    ]
    named = {(name, str(file.relative_to(ROOT))) for file in files for name in NAMED.findall(file.read_text("utf-8"))}
    assert len(named) > 50
    assert not sorted(one for one in named if one[0].replace("clustering.llm.", "llm.") not in known)
