"""``memo suites``: says what it would take, leaves alone what is there, and counts what verification wrote."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import memo_libero.installing as installing
import pytest
from memo_libero.commands import app
from memo_libero.counting import counted, rows_of
from memo_libero.installing import Recipe, found, make
from memo_libero.tasks import AT_END, EVER
from typer.testing import CliRunner

from memo_core.errors import BackendUnavailable, InvalidArgument, UnknownName


def run(*arguments: str):
    return CliRunner().invoke(app, list(arguments), catch_exceptions=True)


def test_what_is_not_installed_is_listed_with_its_size_and_what_is_left_out(tmp_path):
    told = json.loads(run("list", "--folder", str(tmp_path), "--json").stdout)["suites"][0]
    assert told["installed"] == {} and len(told["parts"]) == 21
    assert "cut off" in told["left_out"]["libero_study_table"]
    assert "not installed (2.1 GB)" in " ".join(run("list", "--folder", str(tmp_path)).stdout.split())


def test_an_unknown_suite_is_named():
    assert isinstance(run("install", "metaworld").exception, UnknownName)


def test_nothing_is_installed_without_a_yes(tmp_path, monkeypatch):
    monkeypatch.setattr(installing, "_run", lambda *_: pytest.fail("it was installed"))
    done = run("install", "libero", "--newest", "--folder", str(tmp_path / "new"))
    assert done.exit_code != 0 and not (tmp_path / "new").exists()
    assert "2.1 GB" in done.output


def test_what_is_complete_is_left_as_it_is(tmp_path, monkeypatch):
    (tmp_path / "memo-installed.json").write_text('{"mujoco": "2.3.7"}')
    monkeypatch.setattr(installing, "_run", lambda *_: pytest.fail("it was installed again"))
    told = json.loads(run("install", "libero", "--folder", str(tmp_path), "--json").stdout)
    assert told["versions"] == {"mujoco": "2.3.7"} and told["python"] == str(tmp_path / "bin" / "python")


def test_a_folder_with_something_else_is_never_removed(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InvalidArgument, match="holds something else"):
        make(tmp_path, Path(sys.executable), Recipe())
    assert (tmp_path / "thesis.txt").read_text() == "mine"


def test_an_installation_that_fails_is_not_complete_and_begins_anew(tmp_path, monkeypatch):
    at = tmp_path / "env"
    at.mkdir()
    (at / "pyvenv.cfg").write_text("left by an installation that was interrupted")

    def fails(command: list[str], what: str) -> None:
        assert not (at / "pyvenv.cfg").exists(), "what was left is removed first"
        raise BackendUnavailable("suite", "libero", f"{what} ended with exit code 1")

    monkeypatch.setattr(installing, "_run", fails)
    with pytest.raises(BackendUnavailable):
        make(at, Path(sys.executable), Recipe())
    assert found(at) == {}


def test_too_little_disk_is_said_before_anything_is_made(tmp_path, monkeypatch):
    monkeypatch.setattr(installing.shutil, "disk_usage", lambda _: type("Usage", (), {"free": 1e9}))
    with pytest.raises(InvalidArgument, match=r"has 1\.0 GB left, 2\.5 are needed"):
        make(tmp_path / "new", Path(sys.executable), Recipe())


@pytest.mark.process
def test_a_python_that_does_not_run_is_refused(tmp_path):
    with pytest.raises(InvalidArgument, match="no Python that runs"):
        Recipe(python=tmp_path / "python").interpreter()


def test_the_published_stack_needs_its_python(monkeypatch):
    monkeypatch.setattr(installing.sys, "version_info", (3, 13, 0))
    monkeypatch.setattr(installing.shutil, "which", lambda _: None)
    with pytest.raises(InvalidArgument, match=r"needs Python 3\.10 or 3\.11, this is 3\.13"):
        Recipe().interpreter()
    assert Recipe(newest=True).interpreter() == Path(sys.executable)


def test_counts_tell_both_rules_apart_and_count_no_trial_twice(tmp_path):
    verdicts = [(1.0, 1.0), (1.0, 0.0), (0.0, 0.0), (0.0, 0.0)]
    rows = [
        {"task": "goal-task-turn-on-the-stove", "seed": n, "measures": {EVER: ever, AT_END: end}, "null": False}
        for n, (ever, end) in enumerate(verdicts)
    ]
    file = tmp_path / "out.jsonl"
    unsolved = {"task": "goal-task-put-the-wine-bottle-on-the-rack", "seed": 0, "measures": {}, "null": False}
    file.write_text("".join(json.dumps(row) + "\n" for row in [*rows, rows[0], unsolved]))
    [row] = counted(rows_of([file]), "two cameras")["rows"]
    assert row["part"] == "`libero_goal_task`" and row["tasks"] == "1"
    assert (row["held at some moment"], row["holds at the end"]) == ("2 of 4", "1 of 4")
    done = run("count", str(file), "--out", str(tmp_path / "table.json"))
    assert done.exit_code == 0 and json.loads((tmp_path / "table.json").read_text())["rows"] == [row]


def test_counts_name_the_command_whose_episodes_they_are():
    variants, files = ("goal", "goal-swap"), ("put-the-bowl-on-the-stove", "put-the-bowl-on-the-plate")
    rows = [
        {"task": f"{variant}-{file}", "part": f"libero_{variant.replace('-', '_')}", "seed": seed, "null": False}
        | {"measures": {EVER: 1.0, AT_END: 1.0}}
        for variant in variants
        for file in files
        for seed in (0, 1)
    ]
    told = counted(rows, "two cameras", ["suite.cameras=[agentview]"])
    names = "goal-{,swap-}put-the-bowl-on-the-{plate,stove}"
    verify = "memo tasks verify --config examples/libero.yaml --seeds 0,1 -s 'suite.cameras=[agentview]'"
    assert told["command"] == f"{verify} --out FILE {names}; memo suites count FILE"
    assert told["note"].startswith("episodes by part. Poses from two cameras")
    assert counted(rows[1:], "two cameras")["note"].startswith("7 of these 8 episodes by part")


def test_a_file_of_something_else_is_named(tmp_path):
    file = tmp_path / "other.jsonl"
    file.write_text('{"task": "open-the-fridge", "seed": 0, "measures": {"held_at_some_moment": 1}}\n')
    with pytest.raises(InvalidArgument, match=r"line 1 of .*other\.jsonl is of 'open-the-fridge'"):
        list(rows_of([file]))
