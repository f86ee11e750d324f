"""``memo cluster`` and the history commands from the shell: once, dry, beside a running robot, killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from memo_core.cli.main import main
from memo_core.skillbook import history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from tests.support.cluster_books import ARC, approve, teach, teach_general, texts

SCENE = """## Scene
Scene: table. The table's top is at z = 0.000.

| name | kind | part of | centre x y z | size along own axes | turned | opens towards |
|---|---|---|---|---|---|---|
| oven | fixture |  | 0.825 0.124 0.535 | 0.320 0.340 0.270 |  |  |
| oven door | part | oven | 0.653 0.134 0.535 | 0.018 0.340 0.264 |  |  |
"""


def memo(capsys, *arguments: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


def started(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def fill(path: Path, keys: int = 1) -> None:
    with Skillbook(str(path)).open() as book:
        for number in range(keys):
            key = f"OPEN(oven {number})" if number else "OPEN(oven)"
            teach(book, key, "Swing it open around its hinge.", "Lead the handle along an arc about the hinge.")
            teach(book, key, "Pull it straight out.", who="ben")
            approve(book, key)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    fill(tmp_path / "book.db")
    return tmp_path / "book.db"


def notes(path: Path) -> list[str]:
    with Skillbook(str(path), read_only=True).open() as book:
        return texts(book)


def test_a_dry_run_shows_a_diff_and_writes_nothing(capsys, path) -> None:
    before = path.read_bytes()
    code, out, _ = memo(capsys, "cluster", "--book", str(path), "--dry-run")
    assert code == 0 and len(notes(path)) == 3
    assert "- 3: Pull it straight out.   [contradicts template 4" in out
    assert "+ Swing it open around its hinge.   [from 1, 2]" in out and "3 entries would become 1" in out
    assert path.read_bytes() == before


def test_clustering_reports_what_it_did_and_what_it_cost(capsys, path, tmp_path) -> None:
    code, out, _ = memo(capsys, "cluster", "--book", str(path), "--json", "--keep", str(tmp_path / "kept"))
    done = json.loads(out)
    assert (code, done["entries_before"], done["entries_after"], done["calls"]) == (0, 3, 1, 1)
    [outcome] = done["outcomes"]
    assert [gone["entry"] for gone in outcome["dropped"]] == [3] and outcome["entries"][0]["from"] == [1, 2]
    assert done["prompt_tokens"] > 100 and list((tmp_path / "kept" / "calls").iterdir())
    assert notes(path) == ["Swing it open around its hinge."]
    code, out, _ = memo(capsys, "cluster", "--book", str(path))
    assert (code, out) == (0, "nothing to condense\n")


def test_what_cannot_be_is_said_before_anything_is_asked(capsys, path) -> None:
    assert "there is no file" in memo(capsys, "cluster", "--book", str(path.with_name("none.db")))[2]
    assert "'memo-c' does not cluster" in memo(capsys, "cluster", "--book", str(path), "--set", "method=memo-c")[2]
    assert "one of them" in memo(capsys, "cluster", "--book", str(path), "--watch", "--dry-run")[2]
    code, _, err = memo(capsys, "cluster", "--book", str(path), "--set", "clustering.llm.backend=nobody")
    assert code != 0 and "nobody" in err
    code, _, err = memo(capsys, "cluster", "--book", str(path), "--set", "clustering.members=1")
    assert code != 0 and "clustering.members" in err


def test_near_keys_are_joined_unless_the_config_says_no(capsys, tmp_path) -> None:
    path = tmp_path / "book.db"
    with Skillbook(str(path)).open() as book:
        teach(book, "PLACE(cube, cabinet)", "Gently.", "Slowly.")
        teach(book, "put(cubes, the cabinet)", "Gently!")
    memo(capsys, "cluster", "--book", str(path), "--set", "clustering.join_keys=false")
    assert len(notes(path)) == 3
    _, out, _ = memo(capsys, "cluster", "--book", str(path))
    assert "PUT(cubes, cabinet) is merged into PLACE(cube, cabinet)" in out


def test_the_history_commands_agree(capsys, path) -> None:
    book = ("--book", str(path))
    memo(capsys, "cluster", *book)
    shown = json.loads(memo(capsys, "skillbook", "history", "OPEN(oven)", "--json", *book)[1])
    last = shown["revisions"][-1]
    assert last["reason"] == "cluster by offline" and shown["templates"][0]["state"] == "served"
    changed = json.loads(memo(capsys, "skillbook", "diff", str(last["revision"]), "--json", *book)[1])
    assert (len(changed["removed"]), len(changed["added"])) == (3, 1)
    assert "+ Swing it open" in memo(capsys, "skillbook", "diff", "1", str(last["revision"]), *book)[1].replace(
        " 5 [OPEN(oven)]", ""
    )
    code, out, _ = memo(capsys, "skillbook", "rollback", str(last["revision"]), *book)
    assert code == 0 and "1 entries gone, 3 there again" in out and len(notes(path)) == 3
    code, _, err = memo(capsys, "skillbook", "rollback", str(last["revision"]), *book)
    assert code == 2 and "already" in err
    assert memo(capsys, "skillbook", "history", "*", *book)[0] == 0


def test_a_book_with_nothing_to_condense_is_said_in_one_line(capsys, tmp_path) -> None:
    with Skillbook(str(tmp_path / "empty.db")).open():
        pass
    for more in ([], ["--dry-run"]):
        code, out, err = memo(capsys, "cluster", "--book", str(tmp_path / "empty.db"), *more)
        assert (code, out, err) == (0, "nothing to condense\n", "")


def test_options_that_would_do_nothing_or_cannot_be_met_are_named(capsys, path, tmp_path) -> None:
    book = ("--book", str(path))
    code, _, err = memo(capsys, "cluster", "--interval", "5", *book)
    assert code == 2 and err.startswith("memo: --interval: ") and "--watch" in err
    (tmp_path / "file").write_text("")
    code, _, err = memo(capsys, "cluster", "--keep", str(tmp_path / "file"), *book)
    assert code == 2 and err.startswith(f"memo: --keep: {tmp_path / 'file'} ")


def test_asking_again_about_what_was_set_aside_says_what_became_of_it(capsys, path, tmp_path) -> None:
    with Skillbook(str(path)).open() as book:
        for words in ("Hm.", "Swing the door around its hinge."):
            aside = book.record_feedback(words, "ana", task="open the oven", subtask="OPEN(oven)", scene_graph=SCENE)
            book.park(aside, "nobody was asked")
    code, out, _ = memo(capsys, "skillbook", "retry", "--book", str(path), "--json")
    assert code == 0 and [one["outcome"] for one in json.loads(out)["feedback"]] == ["set aside", "learnt"]
    unreachable = ("--set", "llm.backend=replay", "--set", f"llm.file={tmp_path / 'r.jsonl'}")
    (tmp_path / "r.jsonl").write_text('{"memo_recording": 1}\n')
    code, out, _ = memo(capsys, "skillbook", "retry", "--book", str(path), "--json", *unreachable)
    assert code == 1 and [one["outcome"] for one in json.loads(out)["feedback"]] == ["pending"]


def test_why_gives_each_term_the_rank_and_what_was_cut(capsys, path) -> None:
    with Skillbook(str(path)).open() as book:
        teach(book, "CLOSE(oven)", "Push it shut.")
        teach_general(book, "Doors swing.")
    by_key = ("--set", "retrieval.ranking=key")
    found = json.loads(memo(capsys, "skillbook", "why", "OPEN(fridge)", "--book", str(path), "--json", *by_key)[1])
    first = found["corrections"][0]
    weights = found["lambda_action"], found["lambda_objects"]
    mean = (weights[0] * first["action_cosine"] + weights[1] * first["objects_cosine"]) / sum(weights)
    assert first["score"] == pytest.approx(mean) and [one["rank"] for one in found["corrections"]] == [1, 2, 3]
    assert {"key": "CLOSE(oven)", "rule": "opposite action"}.items() <= found["cut"][0].items()
    assert found["threshold"] == RetrievalSettings().cut and found["cut"][0]["score"] < 1
    _, out, _ = memo(capsys, "skillbook", "why", "OPEN(fridge)", "--book", str(path))
    assert "opposite action" in out and "r = (0.75 action + 0.25 objects)" in out


@pytest.mark.process
def test_watching_condenses_what_a_robot_learns_meanwhile_and_ends_with_ctrl_c(path) -> None:
    watching = started("cluster", "--watch", "--interval", "0.1", "--book", str(path), "--json")
    try:
        assert json.loads(watching.stdout.readline())["entries_after"] == 1
        with Skillbook(str(path)).open() as robot:
            teach(robot, "OPEN(oven)", "Draw it straight out in one line.")
        assert json.loads(watching.stdout.readline())["dropped"]
        watching.send_signal(signal.SIGINT)
        assert watching.wait(20) == 0
    finally:
        watching.kill()
        watching.communicate()
    assert notes(path) == ["Swing it open around its hinge."]


@pytest.mark.process
def test_killed_at_any_moment_the_book_is_valid_and_the_next_call_goes_on(tmp_path) -> None:
    path = tmp_path / "book.db"
    fill(path, keys=10)
    for _ in range(2):
        working = started("cluster", "--book", str(path), "--set", "clustering.join_keys=false")
        deadline = time.monotonic() + 60
        begun = len(notes(path))
        while len(notes(path)) == begun and working.poll() is None and time.monotonic() < deadline:
            time.sleep(0.005)
        os.kill(working.pid, signal.SIGKILL)
        working.communicate()
        left = notes(path)
        assert len(left) < begun and "Swing it open around its hinge." in left
        assert (len(left) - 10) % 2 == 0, "a cluster is condensed whole or not at all"
    with Skillbook(str(path), read_only=True).open() as book:
        assert len(history.revisions(book)) > 40 and ARC in {entry.text for entry in book.entries()}
