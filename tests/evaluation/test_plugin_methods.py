"""A plugin's method is evaluated beside MEMO's as its descriptor declares, with its settings; its faults are errors."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pytest
import yaml

from memo_core.cli.main import main
from memo_core.config import ConfigErrors, load_experiment
from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.evaluation.evaluating import evaluate, unread
from memo_core.evaluation.grid import memory_of, trials_of
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.evaluation.table import ERRORS, read_table
from memo_core.evaluation.trial import experiment_of
from memo_core.interfaces.backend import Memory
from memo_core.plugins.registry import Registry
from memo_core.process.stop_switch import StopSwitch
from memo_core.report.writing import write_report
from memo_core.runs.folder import nested
from memo_core.study.study import loader, shared_settings

PAGE = Path(__file__).parents[2] / "docs" / "plugins" / "method.md"
LAB = """
import attrs
from memo_core.plugin import Backend, LanguageMethod, Memory, Method, RunResult, hookimpl

@attrs.frozen
class Settings:
    checkpoint: str = "base"
    steps: int = 1

class Policy(Method):
    name = "policy"
    def __init__(self, settings):
        self.settings = settings
    def run(self, session):
        if self.settings.checkpoint == "unreachable":
            raise ConnectionRefusedError("nobody listens")
        if self.settings.checkpoint == "wrong":
            return "done"
        return RunResult(f"{self.settings.steps} steps, book {session.book}", finished=True)

FIRST = Memory(general=False, templates=False, clusters=False)

def make_notes(settings):
    return LanguageMethod("notes", FIRST)

@hookimpl
def memo_methods():
    return [
        Backend("method", "policy", "neither remembers nor listens", Policy, Settings),
        Backend("method", "listener", "listens", Policy, Settings, takes_feedback=True),
        Backend("method", "reader", "reads a book", Policy, Settings, memory=Memory()),
        Backend("method", "notes", "notes", make_notes, memory=FIRST, takes_feedback=True),
    ]
"""
FILE = """
llm: offline
suite: quirks
run: {video: "off"}
evaluation:
  methods: [memo, METHODS]
  tasks: [open-the-nightstand]
  hours: []
  books: [empty]
  scenes: 1
  corrected: {corrections: 0}
"""


def install(site: Path, module: str, source: str) -> None:
    """A plugin as an installer leaves it."""
    (site / f"{module}.py").write_text(source)
    info = site / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[memo]\n{module} = {module}\n")


@pytest.fixture
def site(tmp_path, monkeypatch):
    folder = tmp_path / "site"
    folder.mkdir()
    install(folder, "lab_methods", LAB)
    monkeypatch.syspath_prepend(str(folder))
    return folder


def experiment(*overrides: str):
    return load_experiment(Registry(), None, ["suite.backend=tabletop", *overrides], ALL_SECTIONS)


def load_of(folder: Path, methods: str, *overrides: str):
    folder.mkdir(exist_ok=True)
    (folder / "e.yaml").write_text(FILE.replace("METHODS", methods))
    settings = shared_settings(folder / "evaluation")
    return loader(Registry(), folder / "e.yaml", ALL_SECTIONS, [*settings, *overrides])


def test_a_method_is_tried_as_its_descriptor_declares(site):
    loaded = experiment("evaluation.methods=[policy, listener, reader, notes]", "evaluation.hours=[0, 2]")
    trials = trials_of(loaded, histories=1)
    planned = {(trial.method, trial.mode, trial.hours) for trial in trials}
    assert planned == {
        ("policy", "zero-shot", None),
        ("listener", "zero-shot", None),
        ("listener", "corrected", None),
        ("reader", "zero-shot", 0.0),
        ("reader", "zero-shot", 2.0),
        ("notes", "zero-shot", 0.0),
        ("notes", "zero-shot", 2.0),
        ("notes", "corrected", 2.0),
    }
    assert {trial.method for trial in trials if trial.has_memory} == {"reader", "notes"}
    assert memory_of(loaded, "notes") == Memory(general=False, templates=False, clusters=False)


def test_an_entry_has_keys_of_its_own_and_the_others_of_the_section(site):
    section = ("method.backend=policy", "method.steps=4", "method.checkpoint=tuned")
    loaded = experiment("evaluation.methods=[memo, {backend: policy, steps: 9}, listener]", *section)
    entries = {one.backend.name: one.settings for one in loaded.section("evaluation").methods}
    assert (entries["policy"].steps, entries["policy"].checkpoint) == (9, "tuned")
    assert (entries["listener"].steps, entries["listener"].checkpoint) == (1, "base"), (
        "the section is of another method"
    )
    assert not [said for said in unread(loaded) if "method.backend" in said]


def test_a_trial_gets_the_settings_and_keeps_what_comes_from_the_environment_out_of_its_files(
    site, tmp_path, monkeypatch
):
    monkeypatch.setenv("POLICY_AT", "checkpoint-nobody-may-see")
    load = load_of(tmp_path / "e", "{backend: policy, checkpoint: '${oc.env:POLICY_AT}', steps: 3}")
    [trial] = [one for one in trials_of(load(), 0) if one.method == "policy"]
    tried = experiment_of(load, trial)
    assert tried.choice("method").settings.checkpoint == "checkpoint-nobody-may-see"
    assert tried.choice("method").settings.steps == 3
    assert "checkpoint-nobody-may-see" not in json.dumps(tried.public())


@pytest.mark.parametrize(
    ("listed", "said"),
    [
        ("[{backend: policy, stepps: 3}]", r"evaluation\.methods\[0\]\.stepps.*did you mean 'steps'"),
        ("[policy, {backend: policy, steps: 2}]", r"'policy' twice.*--compare"),
        ("[memo, 3]", r"evaluation\.methods: must be a list"),
        ("memo", r"evaluation\.methods: must be a list"),
        ("null", r"evaluation\.methods: must be a list"),
    ],
)
def test_a_wrong_list_of_methods_is_refused_with_its_place(site, listed, said):
    with pytest.raises(ConfigErrors, match=said):
        experiment(f"evaluation.methods={listed}")


@pytest.mark.sim
def test_the_plugin_of_the_page_stands_beside_memo_in_evaluation_and_report(site, tmp_path):
    source = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[1]
    assert len([line for line in source.splitlines() if line.strip()]) <= 10
    install(site, "page_method", source)
    folder = tmp_path / "e"
    evaluate(load_of(folder, "go-home", "evaluation.corrected.corrections=1"), folder, StopSwitch())
    rows = {(row["method"], row["mode"]): row for row in read_table(folder / "evaluation")}
    assert set(rows) == {("memo", "zero-shot"), ("memo", "corrected"), ("go-home", "zero-shot")}
    home = rows["go-home", "zero-shot"]
    assert home["ended"] == "went home" and home["success"] is False and home["robot_s"] >= 0
    assert (home["memory"], home["takes_feedback"], home["same_as"]) == (False, False, home["trial"])
    assert rows["memo", "zero-shot"]["memory"] is True
    write_report(Registry(), folder)
    with (folder / "report" / "table-2-success.csv").open(encoding="utf-8") as file:
        shown = {row["method"]: row for row in csv.DictReader(file)}
    assert shown["go-home"]["success zero-shot"].startswith("0 %") and shown["go-home"]["trials"] == "1"
    for column in ("hours", "success with corrections", "corrections a trial", "programs zero-shot", "watched"):
        assert shown["go-home"][column] == "–" != shown["memo"][column], column


@pytest.mark.sim
def test_a_method_of_a_plugin_shares_no_run_and_has_a_book_only_if_it_declares_one(site, tmp_path):
    folder = tmp_path / "e"
    evaluate(load_of(folder, "policy, reader, notes"), folder, StopSwitch())
    rows = {row["method"]: row for row in read_table(folder / "evaluation")}
    assert rows["policy"]["ended"] == "1 steps, book None"
    assert rows["reader"]["ended"].startswith("1 steps, book <")
    assert rows["reader"]["same_as"] == rows["reader"]["trial"], "its run may depend on more than what it retrieves"
    assert rows["notes"]["same_as"] == rows["memo"]["trial"], "MEMO's loop, and both books are empty"

    with pytest.raises(InvalidArgument, match=r"evaluation\.methods\.policy\.steps was 1, is 2"):
        evaluate(load_of(folder, "{backend: policy, steps: 2}"), folder, StopSwitch())
    assert evaluate(load_of(folder, "policy, listener"), folder, StopSwitch()).planned == 3, "other methods may come"


@pytest.mark.sim
@pytest.mark.parametrize(
    ("checkpoint", "said"),
    [
        ("unreachable", r"run\(\) raised ConnectionRefusedError: nobody listens at .*lab_methods.py:\d+"),
        ("wrong", r"run\(\) returned str, not RunResult"),
    ],
)
def test_a_fault_of_a_method_is_an_error_and_in_no_rate(site, tmp_path, checkpoint, said):
    folder = tmp_path / "e"
    evaluated = evaluate(load_of(folder, f"{{backend: policy, checkpoint: {checkpoint}}}"), folder, StopSwitch())
    assert [row["method"] for row in evaluated.rows] == ["memo"], "the other method's trials are done"
    [failed] = read_table(folder / "evaluation", ERRORS)
    assert (failed["method"], failed["cause"]) == ("policy", "method")
    assert re.search(said, failed["problem"])


def test_a_method_that_lacks_what_it_needs_is_refused_before_any_trial(site, tmp_path, capsys):
    needy = 'Backend("method", "needy", "needs a module", str, needs=Needs(modules={"no_such_module": "no-such"}))'
    imports = "from memo_core.plugin import Backend, Needs, hookimpl"
    install(site, "lab_needy", f"{imports}\n@hookimpl\ndef memo_methods():\n    return [{needy}]\n")
    folder = tmp_path / "e"
    with pytest.raises(BackendUnavailable, match="no_such_module"):
        evaluate(load_of(folder, "needy"), folder, StopSwitch())
    assert not (folder / "evaluation").exists()
    with pytest.raises(SystemExit):
        main(["config", "check", str(folder / "e.yaml")])
    assert "no_such_module" in capsys.readouterr().err


def test_the_kept_configuration_is_one_that_can_be_read_again(site, tmp_path):
    skills = "from memo_core.plugin import Backend, hookimpl\n@hookimpl\ndef memo_skills():\n"
    install(site, "lab_skills", skills + "    return [Backend('skills', 'none', 'no skill', lambda settings: [])]\n")
    loaded = experiment("evaluation.methods=[memo, {backend: policy, steps: 7}]", "skills=none")
    kept = tmp_path / "config.yaml"
    kept.write_text(yaml.safe_dump(nested(loaded.public())))
    again = load_experiment(Registry(), kept, (), ALL_SECTIONS)
    assert again.public() == loaded.public()
    assert [one.backend.name for one in again.skills] == ["none"]
    assert [one.backend.name for one in again.section("evaluation").methods] == ["memo", "policy"]
