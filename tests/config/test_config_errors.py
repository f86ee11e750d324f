"""A mistake in an experiment file is never a silent default: all are told at once, each with file, line and path."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from memo_core.cli.app import run_app
from memo_core.cli.main import main
from memo_core.config import ConfigErrors, load_experiment
from memo_core.config.layers import FromOption
from memo_core.plugins.registry import Registry
from memo_core.runs.sections import SECTIONS
from tests.support.config_backends import Budget, load, registry


def issues(text: str | None, *overrides: str, folder: Path | None = None) -> list[tuple[int | None, str, str]]:
    with pytest.raises(ConfigErrors) as caught:
        load(text, *overrides, folder=folder)
    return [(issue.origin.line, issue.path, issue.problem) for issue in caught.value.issues]


def one_issue(*args, **kwargs) -> tuple[int | None, str, str]:
    [issue] = issues(*args, **kwargs)
    return issue


def test_all_mistakes_are_told_at_once(tmp_path):
    text = """\
seed: one
percepton: {}
perception:
  backend: camera
  widht: 3
  mode: colour
  noise:
    position: far
    axes: [1, 2, 3]
llm:
  backend: hostd
  temperatur: 1
budget:
  seconds: "5"
"""
    found = {(line, path) for line, path, _ in issues(text, folder=tmp_path)}
    assert found == {
        (1, "seed"),
        (2, "percepton"),
        (5, "perception.widht"),
        (6, "perception.mode"),
        (8, "perception.noise.position"),
        (9, "perception.noise.axes"),
        (11, "llm.backend"),
        (12, "llm.temperatur"),
        (10, "llm.model"),
        (14, "budget.seconds"),
    }


@pytest.mark.parametrize(
    ("text", "line", "path", "said"),
    [
        ("perception: {widht: 3}", 1, "perception.widht", "did you mean 'width'"),
        ("\nbudgte: {}", 2, "budgte", "did you mean 'budget'"),
        ("perception: {mode: colour}", 1, "perception.mode", "did you mean 'color'"),
        ("llm: locl", 1, "llm.backend", "did you mean 'local'"),
        ("llm: {backend: hosted}", 1, "llm.model", "missing value"),
        ("llm:\n  backend: hosted\n  model: ???", 3, "llm.model", "missing value"),
        ("perception: {width: }", 1, "perception.width", "missing value"),
        ("perception: {width: 3.0}", 1, "perception.width", "3.0 is not a whole number"),
        ("perception: {width: '3'}", 1, "perception.width", "'3' is not a whole number; write 3, without the quotes"),
        ("budget: {seconds: '2.5'}", 1, "budget.seconds", "not a number; write 2.5, without the quotes"),
        ("budget:\n  seconds: 0,85", 2, "budget.seconds", "'0,85' is not a number; write 0.85"),
        ("llm: {backend: local, temperature: 1}", 1, "llm.temperature", "llm.backend=hosted has it"),
        ("perception: {width: true}", 1, "perception.width", "True is not a whole number"),
        ("perception: {note: no}\nbudget: {seconds: yes}", 2, "budget.seconds", "'yes' is not a number"),
        ("perception: {labels: cup}", 1, "perception.labels", "'cup' is not a list"),
        ("perception: {labels: [cup, 3]}", 1, "perception.labels[1]", "3 is not text"),
        ("perception: {width: -1}", 1, "perception.width", "not above 0"),
        ("perception: 5", 1, "perception", "name of a backend"),
        ("perception: {backend: 5}", 1, "perception.backend", "name of a backend"),
        ("budget: 5", 1, "budget", "not a section"),
        ("seed: -1", 1, "seed", "negative"),
        ("seed: 1\nllm: local\nseed: 2", 3, "seed", "given twice (first in line 1)"),
        ("perception:\n  width: 1\n  width: 2", 3, "perception.width", "given twice"),
        ("seed: ${perception.height}\nperception: {height: 'x'}", 1, "seed", "not a whole number"),
        ("seed: ${nowhere}", 1, "seed", "cannot be resolved"),
        ("seed: ${oc.env:NO_SUCH_VARIABLE_X}", 1, "seed", "NO_SUCH_VARIABLE_X"),
        ("seed: 1\n  llm: local", 2, "", "not YAML"),
        ("seed: [1, 2", 1, "", "not YAML"),
        ("- seed", 1, "", "top level"),
        ("seed: &a [*a]", 1, "seed[0]", "alias"),
        ("skills: 3", 1, "skills", "name of a skills backend"),
        ("extends: 3", 1, "extends", "path"),
        ("extends: nowhere.yaml", 1, "extends", "no file"),
    ],
)
def test_a_mistake_is_told_with_its_line_and_path(tmp_path, text, line, path, said):
    found = issues(text, folder=tmp_path)
    assert any((at, where) == (line, path) and said in problem for at, where, problem in found), found


def test_two_values_that_a_validator_refuses_are_both_told(tmp_path):
    found = issues("perception: {width: 0, height: -2}", folder=tmp_path)
    assert {path for _, path, _ in found} == {"perception.width", "perception.height"}


def test_files_that_extend_each_other_are_an_error(tmp_path):
    (tmp_path / "a.yaml").write_text("extends: b.yaml\n")
    (tmp_path / "b.yaml").write_text("seed: 1\nextends: a.yaml\n")
    with pytest.raises(ConfigErrors) as caught:
        load_experiment(registry(), tmp_path / "a.yaml")
    [issue] = caught.value.issues
    assert issue.origin.file.endswith("b.yaml") and issue.origin.line == 2 and "circle" in issue.problem


def test_a_mistake_in_an_extended_file_is_told_of_that_file(tmp_path):
    (tmp_path / "base.yaml").write_text("seed: 0\nperception: {width: wide}\n")
    with pytest.raises(ConfigErrors) as caught:
        load("extends: base.yaml\nseed: 3\n", folder=tmp_path)
    [issue] = caught.value.issues
    assert issue.origin.file.endswith("base.yaml") and issue.origin.line == 2


@pytest.mark.parametrize(
    ("override", "path", "said"),
    [
        ("perception.width=wide", "perception.width", "'wide' is not a whole number"),
        ("perception.widht=1", "perception.widht", "did you mean 'width'"),
        ("perception", "", "section.key=value"),
        ("=3", "", "section.key=value"),
        ("seed=[1", "seed", "not YAML"),
        ("extends=a.yaml", "extends", "only be set in a file"),
    ],
)
def test_a_mistake_in_an_override_is_shown_as_set(override, path, said):
    with pytest.raises(ConfigErrors) as caught:
        load(None, override)
    [issue] = caught.value.issues
    assert issue.origin.file == "--set" and issue.path == path and said in issue.problem


def test_a_file_that_is_not_there_or_not_text_is_an_error(tmp_path):
    with pytest.raises(ConfigErrors, match="no such file"):
        load_experiment(registry(), tmp_path / "nowhere.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigErrors, match=r"UTF-8"):
        load_experiment(registry(), tmp_path / "binary.yaml")


# -- secrets -----------------------------------------------------------------------------------------------------------
SECRET = "sk-very-secret-0815"


@pytest.mark.parametrize(
    "text",
    [
        f"llm: {{backend: hosted, model: m, token: {SECRET}}}",
        f"llm: {{backend: hosted, model: m, api_key: {SECRET}}}",
        f"llm: {{backend: hosted, model: {SECRET}}}",
        f"llm: {{backend: hosted, model: m, temperature: {SECRET}}}",
        f"perception: {{note: 'postgresql://me:{SECRET}@host/db'}}",
    ],
)
def test_a_secret_in_a_file_is_refused_and_never_repeated(tmp_path, monkeypatch, text):
    monkeypatch.setenv("HOSTED_API_KEY", SECRET)
    with pytest.raises(ConfigErrors) as caught:
        load(text, folder=tmp_path)
    if "temperature" not in text:
        assert "environment" in str(caught.value)
        assert SECRET not in str(caught.value)


def test_what_comes_from_the_environment_is_shown_as_its_expression(tmp_path, monkeypatch):
    monkeypatch.setenv("LAB_NOTE", SECRET)
    text = "perception: {note: '${oc.env:LAB_NOTE}', labels: ['${perception.note}', 'x ${perception.note}']}"
    experiment = load(text, folder=tmp_path)
    assert experiment.choice("perception").settings.note == SECRET
    assert experiment.choice("perception").settings.labels == [SECRET, f"x {SECRET}"]
    assert SECRET not in repr(experiment.values) and SECRET not in json.dumps(experiment.public())
    assert experiment.public()["perception.note"] == "${oc.env:LAB_NOTE}"


# -- the shell ---------------------------------------------------------------------------------------------------------
MISTAKEN = "retrieval: {cutt: 0.9}\nsandbx: {}\nrun: {attempts: many}\nmethod: memmo\n"


def run(*arguments: str) -> object:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return ended.value.code


def test_checking_a_file_prints_every_mistake_and_exits_2(tmp_path, capsys):
    file = tmp_path / "bad.yaml"
    file.write_text(MISTAKEN)
    assert run("config", "check", str(file)) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert [line.split("bad.yaml:")[1][0] for line in said.err.splitlines() if "bad.yaml" in line] == list("1234")
    assert "did you mean 'cut'" in said.err and "did you mean 'sandbox'" in said.err
    assert "Traceback" not in said.err


def test_checking_a_file_for_a_program_prints_json_and_exits_2(tmp_path, capsys):
    file = tmp_path / "bad.yaml"
    file.write_text(MISTAKEN)
    assert run("config", "check", str(file), "--json") == 2
    report = json.loads(capsys.readouterr().out)
    assert report["valid"] is False
    assert [(error["line"], error["path"]) for error in report["errors"]] == [
        (1, "retrieval.cutt"),
        (2, "sandbx"),
        (3, "run.attempts"),
        (4, "method.backend"),
    ]


def test_a_file_in_order_exits_0(tmp_path, capsys):
    file = tmp_path / "good.yaml"
    file.write_text("seed: 3\nretrieval: {cut: 0.9}\n")
    assert run("config", "check", str(file)) == 0
    assert run("config", "check", str(file), "--json") == 0


@given(st.text(max_size=60))
def test_no_text_whatever_is_more_than_an_error(tmp_path_factory, text):
    file = tmp_path_factory.mktemp("any") / "any.yaml"
    file.write_bytes(text.encode("utf-8", "replace"))
    try:
        load_experiment(registry(), file, (), {"budget": Budget})
    except ConfigErrors as errors:
        assert errors.issues


def test_without_a_file_the_defaults_are_checked_with_what_the_options_say(capsys, tmp_path):
    assert run("config", "check", "--task", "open-the-fridge", "--seed", "3", "--set", "run.attempts=2") == 0
    assert capsys.readouterr().out.startswith("the defaults: in order")
    assert run("config", "check", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["file"], told["valid"]) == (None, True)
    assert run("config", "check", "--task", "open-the-frigde", "--json") == 2
    told = json.loads(capsys.readouterr().out)
    assert told["file"] is None and [one["path"] for one in told["errors"]] == ["task"]
    assert run("config", "check", "--set", "run.atempts=2") == 2
    assert "--set: run.atempts" in capsys.readouterr().err
    file = tmp_path / "good.yaml"
    file.write_text("task: open-the-fridge\n")
    assert run("config", "check", "--config", str(file), "--task", "open-the-frigde") == 2
    assert "--task" in capsys.readouterr().err


def test_a_misspelt_task_is_found_when_a_file_is_checked(tmp_path, capsys):
    file = tmp_path / "experiment.yaml"
    file.write_text("seed: 1\ntask: open-the-fridg\n")
    assert run("config", "check", str(file)) == 2
    assert f"{file}:2: task: unknown task 'open-the-fridg'; did you mean 'open-the-fridge'" in capsys.readouterr().err
    assert run("config", "check", str(file), "--set", "task=open-the-fridge") == 0


def test_the_file_of_a_study_is_told_with_the_command_for_it(tmp_path):
    found = issues("study: {rounds: 3}\nevaluation: {}\n", folder=tmp_path)
    assert [(path, problem.partition(": ")[2]) for _, path, problem in found] == [
        ("study", "memo study run FILE, or memo reproduce FILE for all of it"),
        ("evaluation", "memo evaluate FILE, or memo reproduce FILE for all of it"),
    ]


def real(*overrides: str, **typed: str) -> list[str]:
    """What is said of overrides of the installed backends, a line each."""
    with pytest.raises(ConfigErrors) as caught:
        load_experiment(Registry(), None, overrides, SECTIONS, **typed)
    return str(caught.value).splitlines()


def test_a_misspelt_key_hides_no_wrong_value_beside_it():
    said = real("teacher.backend=simulated", "teacher.misjudge=0.1", "teacher.misjudges=3")
    assert len(said) == 2
    assert any("teacher.misjudge: unknown key" in line for line in said)
    assert any(line.startswith("--set: teacher.misjudges: ") for line in said)


def test_a_share_in_per_cent_is_told_as_a_number():
    [said] = real("teacher.backend=simulated", "teacher.misjudges='10%'")
    assert said.endswith("'10%' is not a number; write 0.1")


def test_a_backend_in_capitals_is_meant():
    [said] = real("method=MEMO")
    assert "did you mean 'memo'?" in said


def test_a_file_in_the_place_of_a_section_is_told_with_the_key_it_belongs_to():
    [said] = real("skillbook=lab.db")
    assert "'lab.db' is not a section" in said and said.endswith("such as url: 'lab.db'")


def test_a_mistake_in_another_option_than_set_names_that_option():
    [said] = real(task="open-the-frigde")
    assert said.startswith("--task: task: unknown task 'open-the-frigde'")
    [said] = real(pickle.loads(pickle.dumps(FromOption("suite.backend=tabeltop", "--suite"))))
    assert said.startswith("--suite: suite.backend: ")


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("robot.base_rpy=[0, 0, 90]", "[0.0, 0.0, 90.0] looks like degrees; expected radians: [0, 0, 1.5708]"),
        ("robot.base_position=[0, 0, 100]", "[0.0, 0.0, 100.0] looks like millimetres; expected metres, 3 at most"),
    ],
)
def test_a_base_in_other_units_is_told_with_what_is_meant(setting, said):
    [line] = real("robot.backend=panda", setting)
    assert line.endswith(f": {said}")


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("seed: 1\n  llm: local", 2, "indented further"),
        ("llm:\n  backend: local\n seed: 1", 3, "not indented as the lines of its section"),
        ("llm:\n\tbackend: local", 2, "indent with spaces"),
    ],
)
def test_wrong_indentation_is_told_in_plain_words(text, line, said, tmp_path):
    found = one_issue(text, folder=tmp_path)
    assert found[0] == line and said in found[2]


@pytest.mark.parametrize("setting", ["run.max_cost", "run.study_max_cost"])
def test_a_limit_in_dollars_that_cannot_be_kept_is_said_before_the_run(setting, capsys, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("llm: {backend: litellm, model: openai/my-model, api_base: 'http://127.0.0.1:9/v1'}\n")
    assert run_app(["config", "check", str(file)]) == 0
    assert "price" not in capsys.readouterr().err
    limit = ["--set", f"{setting}=2", "--set", "run.study_ledger=study.ledger"]
    assert run_app(["config", "check", str(file), *limit]) == 0
    printed = capsys.readouterr()
    assert "cannot be run here yet" in printed.out
    assert f"{setting} cannot be kept" in printed.err and "llm.prompt_price" in printed.err
