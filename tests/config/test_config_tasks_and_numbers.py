"""A misspelt task is one of all mistakes; numbers may come from the environment; the schema knows the tasks."""

from __future__ import annotations

import jsonschema
import pytest

from memo_core.config import ConfigErrors, load_experiment
from memo_core.config.schema import experiment_schema
from memo_core.plugins.registry import Registry
from memo_core.runs.sections import SECTIONS


@pytest.fixture(scope="module")
def registry() -> Registry:
    return Registry()


def load(registry, tmp_path, text: str):
    file = tmp_path / "experiment.yaml"
    file.write_text(text)
    return load_experiment(registry, file, (), SECTIONS)


def test_a_misspelt_task_is_in_the_list_of_all_mistakes_with_its_line(registry, tmp_path):
    with pytest.raises(ConfigErrors) as raised:
        load(registry, tmp_path, "seed: -1\ntask: open-the-frigde\nrun: {atempts: 2}\n")
    lines = str(raised.value).splitlines()
    assert len(lines) == 3
    assert "experiment.yaml:2: task: unknown task 'open-the-frigde'; did you mean 'open-the-fridge'?" in lines[1]


def test_a_task_is_looked_for_in_the_suite_that_is_chosen(registry, tmp_path):
    assert load(registry, tmp_path, "suite: quirks\ntask: open-the-safe\n").task == "open-the-safe"
    with pytest.raises(ConfigErrors, match=r"unknown task 'open-the-safe'.*'quirks' has it: suite.backend=quirks"):
        load(registry, tmp_path, "suite: tabletop\ntask: open-the-safe\n")


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("seed: ${oc.env:LAB_SEED}", "seed", 7),
        ("run: {attempts: '${oc.env:LAB_SEED}'}", "run.attempts", 7),
        ("retrieval: {cut: '${oc.env:LAB_CUT}'}", "retrieval.cut", 0.85),
        ("skillbook: {read_only: '${oc.env:LAB_YES}'}", "skillbook.read_only", True),
        ("seed: ${oc.env:LAB_SEED}\nrun: {attempts: '${seed}'}", "run.attempts", 7),
        ("run: {attempts: '${oc.env:LAB_NONE,3}'}", "run.attempts", 3),
    ],
)
def test_numbers_and_switches_may_come_from_the_environment(registry, tmp_path, monkeypatch, text, path, value):
    for name, said in (("LAB_SEED", "7"), ("LAB_CUT", "0.85"), ("LAB_YES", "true")):
        monkeypatch.setenv(name, said)
    experiment = load(registry, tmp_path, text)
    section, _, key = path.partition(".")
    found = getattr(experiment.section(section), key) if key else experiment.seed
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize("said", ["seven", "7.5", "1:30", "[7]", "0x"])
def test_what_is_no_number_in_the_environment_is_a_mistake_that_does_not_repeat_it(
    registry, tmp_path, monkeypatch, said
):
    monkeypatch.setenv("LAB_SEED", said)
    with pytest.raises(ConfigErrors) as raised:
        load(registry, tmp_path, "seed: ${oc.env:LAB_SEED}")
    assert "seed" in str(raised.value) and "${oc.env:LAB_SEED}" in str(raised.value)
    assert f"'{said}'" not in str(raised.value)


def test_text_in_a_file_is_still_no_number(registry, tmp_path):
    with pytest.raises(ConfigErrors, match="seed"):
        load(registry, tmp_path, "seed: '7'")


def test_text_that_looks_like_a_number_stays_text_where_text_is_wanted(registry, tmp_path, monkeypatch):
    monkeypatch.setenv("LAB_BOOK", "7")
    assert load(registry, tmp_path, "skillbook: {url: '${oc.env:LAB_BOOK}'}").section("skillbook").url == "7"


def test_the_schema_knows_the_names_of_the_tasks(registry):
    schema = experiment_schema(registry, SECTIONS)
    jsonschema.validate({"task": "open-the-fridge"}, schema)
    jsonschema.validate({"task": "open-the-safe", "suite": "quirks"}, schema)
    jsonschema.validate({"task": "${oc.env:TASK}"}, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"task": "open-the-frigde"}, schema)
