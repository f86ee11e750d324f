"""``memo cluster`` makes functions of the programs of several keys: without a model where they differ in defaults only,
else by a model whose calls are run; stopped, it reports what it stored."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from memo_offline.model import OfflineModel

from memo_core.cli import cluster
from memo_core.cli.main import main
from memo_core.cli.signal_handling import INTERRUPTED
from memo_core.errors import Stopped
from memo_core.maintenance.paired_trials import PairedTrials, Verdict
from memo_core.process.stop_switch import StopSwitch
from memo_core.skillbook import history
from memo_core.skillbook.book import Skillbook
from memo_core.testing.fake_llm import ScriptedModel
from tests.support.cluster_books import approve, teach
from tests.support.generalising_books import active, state
from tests.support.groups import CALLS, OPENED, answered

KEYS = ("OPEN(microwave)", "OPEN(oven)")
PROGRAM = '''\
def open_{0}(name="{0} door", angle={1}):
    """Open a door."""
    turn_about(name, angle)
    look()
'''
OPENS = OPENED.replace("turn_about(door, angle, room=0.02)", "move_straight(get_position(door))")
OTHER = '''\
def pull_open_{0}(name="{0} door"):
    """Pull a door open with all the strength there is, and look what came of it."""
    # {1}
    move_straight(get_position(name))
    look()
'''


def memo(capsys, *arguments: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A book with two templates that differ in their defaults."""
    with Skillbook(str(tmp_path / "book.db")).open() as book:
        for key, name, angle in zip(KEYS, ("microwave", "oven"), (80, 85), strict=True):
            approve(book, key, PROGRAM.format(name, angle))
    return tmp_path / "book.db"


@pytest.fixture
def unlike(tmp_path: Path) -> Path:
    """A book whose two programs a model has to make one of."""
    with Skillbook(str(tmp_path / "unlike.db")).open() as book:
        approve(book, KEYS[0], PROGRAM.format("microwave", 80) + f"    # {'x' * 300}\n")
        approve(book, KEYS[1], OTHER.format("oven", "y" * 300))
    return tmp_path / "unlike.db"


@pytest.fixture
def generalises(monkeypatch):
    """The offline model answers as a model that makes functions; the questions that it was asked."""
    functions = [{"name": "open_hinged", "calls": {"1": CALLS[0], "2": CALLS[1]}}]
    said = answered(OPENS, functions=functions, left=[], notes=[], inside=[])
    model = ScriptedModel({"generalise": [said] * 3})
    monkeypatch.setattr(OfflineModel, "calls_functions", True)
    monkeypatch.setattr(OfflineModel, "answer", lambda self, *given, **more: model.answer(*given, **more))
    return model


def contents(path: Path):
    with Skillbook(str(path), read_only=True).open() as book:
        return state(book)


def calls(path: Path) -> dict[str, str]:
    with Skillbook(str(path), read_only=True).open() as book:
        return active(book, "call")


# -- without a model ---------------------------------------------------------------------------------------------------


def test_a_dry_run_shows_the_function_and_the_calls_and_writes_nothing(capsys, path):
    before = path.read_bytes()
    code, out, err = memo(capsys, "cluster", "--book", str(path), "--dry-run")
    assert (code, err) == (0, "") and path.read_bytes() == before
    lines = out.splitlines()
    assert lines[0].startswith("OPEN(microwave), OPEN(oven): 2 -> 3 entries, ")
    assert "  + def open_oven(name, angle=85):" in lines and "  + open_oven('microwave door', angle=80)" in lines
    assert any(line.startswith("  - 1: OPEN(microwave) open_microwave") for line in lines)
    assert "clusters:" not in out and lines[-1].startswith("0 calls")


def test_it_is_stored_in_one_revision_each_and_a_second_call_finds_nothing_to_do(capsys, path):
    code, out, _ = memo(capsys, "cluster", "--book", str(path))
    assert code == 0 and "+ open_oven('oven door')" in out
    assert calls(path) == {KEYS[0]: "open_oven('microwave door', angle=80)", KEYS[1]: "open_oven('oven door')"}
    with Skillbook(str(path), read_only=True).open() as book:
        assert history.revisions(book)[-1].reason == "functions"
        assert not book.entries("template") and not book.problems()
    for more in ([], ["--dry-run"], ["--all"]):
        assert memo(capsys, "cluster", "--book", str(path), *more)[:2] == (0, "nothing to condense\n")


def test_as_json_it_has_the_functions_with_their_calls_and_what_became_shorter(capsys, path):
    code, out, _ = memo(capsys, "cluster", "--book", str(path), "--json")
    done = json.loads(out)
    [programs] = done["groups"]
    assert (code, done["calls"], done["clusters"], done["dry_run"]) == (0, 0, 0, False)
    assert programs["keys"] == list(KEYS)
    [function] = programs["functions"]
    assert function["name"] == "open_oven" and function["code"].startswith("def open_oven(name, angle=85):")
    assert [one["entry"] for one in function["calls"]] == [1, 2]
    assert (programs["status"], programs["entries_before"], programs["entries_after"]) == ("generalised", 2, 3)
    assert programs["characters_after"] < programs["characters_before"] and programs["revision"] is not None
    again = json.loads(memo(capsys, "cluster", "--book", str(path), "--json")[1])
    assert again["groups"] == again["outcomes"] == []


def test_a_dry_run_as_json_has_no_revision(capsys, path):
    done = json.loads(memo(capsys, "cluster", "--book", str(path), "--json", "--dry-run")[1])
    assert done["dry_run"] and [one["revision"] for one in done["groups"]] == [None]


def test_the_same_words_of_two_keys_become_one_note(capsys, path):
    with Skillbook(str(path)).open() as book:
        for key in KEYS:
            teach(book, key, "Be gentle.")
    _, out, _ = memo(capsys, "cluster", "--book", str(path), "--dry-run")
    assert "OPEN(microwave), OPEN(oven): 2 -> 1 entries, 20 -> 10 characters" in out.splitlines()
    assert "  + Be gentle.   [under all these keys]" in out.splitlines()
    notes, programs = json.loads(memo(capsys, "cluster", "--book", str(path), "--json")[1])["groups"]
    assert notes["notes"] == [{"text": "Be gentle.", "from": [3, 4]}] and len(programs["functions"]) == 1
    assert memo(capsys, "cluster", "--book", str(path))[1] == "nothing to condense\n"


def test_groups_can_be_switched_off(capsys, path):
    before = contents(path)
    assert memo(capsys, "cluster", "--book", str(path), "-s", "clustering.groups=false")[1] == "nothing to condense\n"
    assert contents(path) == before


def test_what_was_rolled_back_is_made_again_only_when_asked_for(capsys, path):
    memo(capsys, "cluster", "--book", str(path))
    with Skillbook(str(path)).open() as book:
        history.roll_back(book, history.revisions(book)[-1].id)
    assert memo(capsys, "cluster", "--book", str(path))[1] == "nothing to condense\n" and not calls(path)
    memo(capsys, "cluster", "--book", str(path), "--all")
    assert len(calls(path)) == 2


def test_a_model_whose_programs_call_nothing_is_not_asked(capsys, unlike):
    assert memo(capsys, "cluster", "--book", str(unlike))[1] == "nothing to condense\n" and not calls(unlike)


# -- with one ----------------------------------------------------------------------------------------------------------


def test_what_a_model_makes_is_shown_with_how_it_was_tested(capsys, unlike, generalises):
    code, out, err = memo(capsys, "cluster", "--book", str(unlike))
    assert (code, err) == (0, "") and f"  + {CALLS[0]}" in out.splitlines()
    assert "not tested: no start is stored: it was not approved in a run" in out
    assert calls(unlike) == dict(zip(KEYS, CALLS[:2], strict=True)) and len(generalises.asked) == 1
    assert memo(capsys, "cluster", "--book", str(unlike))[1] == "nothing to condense\n"


@pytest.mark.process
def test_a_function_that_the_sandbox_refuses_is_not_stored(capsys, unlike, generalises):
    functions = [{"name": "open_hinged", "calls": {"1": CALLS[0], "2": CALLS[1]}}]
    hostile = OPENS.replace("    look()", "    import os\n    os.remove(door)\n    look()")
    generalises._script["generalise"] = [answered(hostile, functions=functions)] * 3
    code, out, _ = memo(capsys, "cluster", "--book", str(unlike))
    assert code == 0 and "2 programs are unchanged: open_hinged cannot be run: line " in out and not calls(unlike)


def test_what_is_left_is_said_with_the_reason(capsys, unlike, generalises, monkeypatch):
    monkeypatch.setattr(PairedTrials, "compare", lambda *_: Verdict(False, "it hit the door"))
    done = json.loads(memo(capsys, "cluster", "--book", str(unlike), "--json")[1])
    [group] = done["groups"]
    assert (group["status"], group["calls"], group["functions"]) == ("unchanged", 3, [])
    assert [one["entry"] for one in group["left"]] == [1, 2] and "it hit the door" in group["left"][0]["reason"]
    assert not calls(unlike)


def test_ctrl_c_while_programs_run_reports_what_is_stored(capsys, path, generalises, monkeypatch):
    with Skillbook(str(path)).open() as book:
        approve(book, "OPEN(cabinet)", OTHER.format("cabinet", "y" * 300))

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(PairedTrials, "compare", interrupted)
    one = answered(
        OPENS.replace("open_hinged", "open_oven"),
        functions=[{"name": "open_oven", "calls": {str(n): "open_oven('door')" for n in (1, 2, 3)}}],
        left=[],
        notes=[],
        inside=[],
    )
    generalises._script["generalise"] = [one]
    code, out, err = memo(capsys, "cluster", "--book", str(path), "--json")
    done = json.loads(out)
    assert code == INTERRUPTED and [group["status"] for group in done["groups"]] == ["generalised"]
    assert "the next memo cluster continues" in err and "0 left" not in err
    assert set(calls(path)) == set(KEYS)


def test_a_stop_between_two_trials_ends_them(monkeypatch):
    started = []

    def compare(self, template, program, progress):
        for start in ("one", "two"):
            progress(start)
            started.append(start)
            stop.press()
        return Verdict(True)

    stop = StopSwitch()
    monkeypatch.setattr(PairedTrials, "compare", compare)
    with pytest.raises(Stopped):
        cluster.StoppableTrials(PairedTrials.__new__(PairedTrials), stop).compare(None, "look()")
    assert started == ["one"]
