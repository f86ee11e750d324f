"""The journal says how far a history is, and what had been said by which hour."""

from __future__ import annotations

import pytest

from memo_core.errors import InvalidArgument
from memo_core.study.journal import FILE, read_journal

LINES = [
    {"history": 0, "book": "skillbook.db"},
    {"session": 1, "participant": "S01", "consent": "simulated"},
    {"begin": 1, "session": 1, "participant": "S01", "task": "open", "seed": 0},
    {"end": 1, "active_s": 1800.0, "feedback": 3},
    {"begin": 2, "session": 1, "participant": "S01", "task": "shut", "seed": 1},
    {"end": 2, "active_s": 1800.0, "feedback": 7},
    {"session_end": 1, "active_s": 3600.0, "revision": 9},
    {"session": 2, "participant": "S02", "consent": "simulated"},
    {"begin": 3, "session": 2, "participant": "S02", "task": "open", "seed": 2},
]


def journal_with(folder, lines):
    journal = read_journal(folder)
    for line in lines:
        journal.note(line)
    return journal


def test_what_was_noted_is_read_again(tmp_path):
    written = journal_with(tmp_path, LINES)
    read = read_journal(tmp_path)
    assert read == written
    assert [session.runs for session in read.sessions] == [2, 1]
    assert read.sessions[0].revision == 9 and read.open_session is read.sessions[1]
    assert read.open_run is read.runs[2] and read.open_run.folder == "runs/0003-open"


@pytest.mark.parametrize(("hours", "feedback"), [(0.0, 0), (0.49, 0), (0.5, 3), (0.99, 3), (1.0, 7), (5.0, 7)])
def test_the_book_of_an_hour_holds_what_was_said_in_runs_that_had_ended_by_then(tmp_path, hours, feedback):
    assert journal_with(tmp_path, LINES).feedback_until(hours) == feedback


def test_a_line_that_a_killed_process_left_half_written_does_not_count(tmp_path):
    journal_with(tmp_path, LINES[:3])
    with (tmp_path / FILE).open("a") as file:
        file.write('{"end": 1, "active')
    journal = read_journal(tmp_path)
    assert journal.open_run is not None
    journal.note(LINES[3])
    assert read_journal(tmp_path).open_run is None


def test_a_damaged_line_is_named(tmp_path):
    (tmp_path / FILE).write_text('{"history": 0, "book": "b.db"}\n{"end": 1, "active_s": 3}\n')
    with pytest.raises(InvalidArgument, match="line 2 is damaged"):
        read_journal(tmp_path)
