"""Several processes make functions of one book at the same time, or are killed while they do."""

from __future__ import annotations

import multiprocessing
import os
import signal
from multiprocessing.synchronize import Barrier
from pathlib import Path

import pytest
import sqlalchemy as sa

from memo_core.skillbook import history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import functions_of, merge_notes, merge_programs
from memo_core.skillbook.writing.functions import FUNCTIONS, SAME_WORDS
from tests.support.cluster_books import new_book, teach
from tests.support.function_books import FRIDGE, MICROWAVE, OVEN, approve_call, programs, teach_doors

pytestmark = pytest.mark.process

KEYS = (MICROWAVE, OVEN, FRIDGE)
AT_ONCE = 4
fork = multiprocessing.get_context("fork")


def taught(path: Path) -> dict[str, set[str]]:
    """A book with three programs and three notes of which one each is made; what its programs do."""
    with new_book(str(path)) as book:
        teach_doors(book, *KEYS)
        for key in KEYS:
            teach(book, key, "Slowly.")
        return programs(book)


def merge(book: Skillbook) -> None:
    merge_notes(book)
    merge_programs(book, ())


def check(book: Skillbook, does: dict[str, set[str]]) -> None:
    """One function and one note, however often it was begun."""
    assert book.problems() == [] and programs(book) == does
    [learnt] = functions_of(book)
    assert len(learnt.calls) == 3 and book.entries("template") == []
    [note] = book.entries("correction")
    assert [book.entries("correction", key) for key in KEYS] == [[note]] * 3
    reasons = [one.reason for one in history.revisions(book)]
    assert reasons.count(FUNCTIONS) == reasons.count(SAME_WORDS) == 1


# -- at the same time --------------------------------------------------------------------------------------------------
def _merge_at_once(path: str, barrier: Barrier) -> None:
    with new_book(path) as book:
        barrier.wait(30)
        merge(book)


@pytest.mark.parametrize("time", range(3))
def test_of_processes_that_merge_at_once_one_makes_the_function(tmp_path: Path, time: int) -> None:
    path = tmp_path / "book.db"
    does, barrier = taught(path), fork.Barrier(AT_ONCE)
    processes = [fork.Process(target=_merge_at_once, args=(str(path), barrier)) for _ in range(AT_ONCE)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(60)
    assert [process.exitcode for process in processes] == [0] * AT_ONCE
    with new_book(str(path)) as book:
        check(book, does)


def _approve_calls(path: str, barrier: Barrier, function: int) -> None:
    with new_book(path) as book:
        barrier.wait(30)
        for number in range(10):
            thing = "".join(chr(ord("a") + int(digit)) for digit in f"{number}")
            approve_call(book, f"OPEN(box {thing}{thing})", f"open_hinged('box {thing}')", "dora", function)


def _merge_on(path: str, barrier: Barrier) -> None:
    with new_book(path) as book:
        barrier.wait(30)
        for _ in range(10):
            merge_programs(book, (), again=True)


def test_calls_that_are_approved_while_their_function_is_replaced_keep_a_program(tmp_path: Path) -> None:
    path = tmp_path / "book.db"
    with new_book(str(path)) as book:
        teach_doors(book)
        merge_programs(book, ())
        [learnt] = functions_of(book)
        teach_doors(book, FRIDGE)
        before = len(programs(book))
    barrier = fork.Barrier(2)
    given = (str(path), barrier)
    processes = [
        fork.Process(target=_approve_calls, args=(*given, learnt.entry.id)),
        fork.Process(target=_merge_on, args=given),
    ]
    for process in processes:
        process.start()
    for process in processes:
        process.join(60)
    assert [process.exitcode for process in processes] == [0, 0]
    with new_book(str(path)) as book:
        assert len(programs(book)) == before + 10 and len(functions_of(book)) == 1 and book.problems() == []
        merge_programs(book, (), again=True)
        assert len(functions_of(book)[0].calls) == before + 10


# -- killed ------------------------------------------------------------------------------------------------------------
def _merge_until(path: str, commit: int) -> None:
    """Merge, and be killed before this commit."""
    with new_book(path) as book:
        left = [commit]

        def count(connection: sa.Connection) -> None:
            left[0] -= 1
            if not left[0]:
                os.kill(os.getpid(), signal.SIGKILL)

        sa.event.listen(book.database.engine, "commit", count)
        merge(book)


def test_a_process_that_is_killed_at_any_commit_leaves_a_book_that_the_next_one_completes(tmp_path: Path) -> None:
    killed = 0
    while True:
        path = tmp_path / f"{killed}.db"
        does = taught(path)
        process = fork.Process(target=_merge_until, args=(str(path), killed + 1))
        process.start()
        process.join(60)
        with new_book(str(path)) as book:
            assert book.problems() == [] and programs(book) == does, f"before commit {killed + 1}"
            reasons = [one.reason for one in history.revisions(book)]
            assert reasons.count(FUNCTIONS) == len(functions_of(book)) <= 1
            merge(book)
            check(book, does)
        if process.exitcode == 0:
            break
        assert process.exitcode == -signal.SIGKILL
        killed += 1
    assert killed >= 2, "the notes and the function are committed apart"
