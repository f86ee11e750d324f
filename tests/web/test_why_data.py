"""Data of the Why pages: sentences, programs, tests and uses of an entry, search by words, and withdrawing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from memo_web.why import RunRecords, run_folders, search, uses_in

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.plugin import check_quiet
from memo_core.runlog.event_log import EventLog, goes_on
from memo_core.skillbook import explain
from memo_core.skillbook.functions import functions_of
from memo_core.skillbook.track_record import note_trial
from tests.support.cluster_books import new_book, teach, teach_general
from tests.support.function_books import MICROWAVE, OVEN, merged, teach_doors


@pytest.fixture
def book():
    with new_book() as opened:
        yield opened


def served(*entries: int) -> list[dict[str, object]]:
    return [{"entry": one, "score": 0.9} for one in entries]


def attempt(number: int, *entries: int, code: str = "", error: str = "", words: str = "") -> list[dict[str, object]]:
    """The events of one attempt at MICROWAVE."""
    events: list[dict[str, object]] = [
        {"event": "SubtaskStarted", "subtask": MICROWAVE, "attempt": number},
        {"event": "Retrieved", "subtask": MICROWAVE, "served": served(*entries), "time": 10.0 * number},
        {"event": "CodeWritten", "subtask": MICROWAVE, "code": code},
        {"event": "CodeEnded", "subtask": MICROWAVE, "error": error},
    ]
    return events + ([{"event": "FeedbackGiven", "words": words}] if words else [])


STARTED = {"event": "RunStarted", "run": "r1", "instruction": "warm the soup"}
APPROVED = {"event": "SubtaskEnded", "subtask": MICROWAVE, "status": "approved"}


def test_each_attempt_of_an_entry_says_what_came_of_it():
    events = [STARTED, *attempt(1, 7, code="pull()", error="slipped", words="pull in an arc"),
              *attempt(2, 7, 8, code="arc()"), APPROVED]  # fmt: skip
    first, second = uses_in(events)[7]
    assert (first.run, first.task, first.subtask, first.time, first.score) == (
        "r1",
        "warm the soup",
        MICROWAVE,
        10,
        0.9,
    )
    assert (first.outcome, first.words, first.code, first.error) == (
        "corrected",
        ("pull in an arc",),
        "pull()",
        "slipped",
    )
    assert (second.outcome, second.attempt, second.words, second.error) == ("approved", 2, (), "")
    assert [one.outcome for one in uses_in(events)[8]] == ["approved"], "it was not retrieved for the first attempt"


@pytest.mark.parametrize(
    ("end", "outcome"),
    [
        ([], "not over"),
        ([{"event": "SubtaskEnded", "status": "unobserved"}], "unobserved"),
        ([{"event": "SubtaskEnded", "status": "corrected"}], "unobserved"),
        ([{"event": "RunEnded"}], "unobserved"),
        ([APPROVED], "approved"),
    ],
)
def test_silence_is_no_approval(end, outcome):
    assert [one.outcome for one in uses_in([STARTED, *attempt(1, 7), *end])[7]] == [outcome]


def test_a_retrieval_for_a_plan_has_no_attempt():
    plan = {"event": "Retrieved", "subtask": "PLAN(warm the soup)", "served": served(3)}
    [use] = uses_in([STARTED, *attempt(1, 7), APPROVED, plan, *attempt(1, 7), APPROVED])[3]
    assert (use.attempt, use.outcome) == (0, "unobserved")


def test_damaged_events_are_passed_over():
    events = [
        {"event": "Retrieved", "served": [None, {"entry": "x"}, {"entry": 3, "score": None}]},
        {"event": "CodeEnded"},
    ]
    assert list(uses_in(events)) == [3]


def test_a_run_is_read_again_when_it_has_grown(book, tmp_path: Path):
    file = tmp_path / "events.jsonl"
    lines = [json.dumps(one) for one in [STARTED, *attempt(1, 7)]]
    file.write_text("".join(f"{line}\n" for line in lines))
    book.note_place("run", tmp_path)
    records = RunRecords()
    assert [one.outcome for one in records.of(book, 7)] == ["not over"]
    with file.open("a") as more:
        more.write(json.dumps(APPROVED) + "\n")
    assert [one.outcome for one in records.of(book, 7)] == ["approved"]
    assert records.of(book, 8) == []


def test_an_entry_has_its_sentences_and_people(book):
    [entry] = teach(book, MICROWAVE, "pull in an arc", who="ana")
    found = explain(book, entry)
    assert [one.words for one in found.said] == ["pull in an arc"] and found.people == ("ana",)
    assert (found.keys, found.title, found.retired, found.function) == ((MICROWAVE,), "pull in an arc", "", None)
    with pytest.raises(UnknownName):
        explain(book, entry + 1)


def test_an_edited_entry_says_what_took_its_place_and_why(book):
    [entry] = teach(book, MICROWAVE, "pull in an arc")
    new = book.edit(entry, "pull in a wide arc", "ben")
    before, after = explain(book, entry), explain(book, new.id)
    assert before.gave_way_to == new and before.retired
    assert [one.id for one in after.made_of] == [entry] and "ben" in after.people


def test_a_function_has_its_programs_and_tests_and_each_call_leads_to_it(book):
    one, other = teach_doors(book)
    merged(book)
    [learnt] = functions_of(book)
    note_trial(book, learnt.calls[0].id, "OPEN seed 3", True)
    found = explain(book, learnt.entry.id)
    assert found.function is not None and found.function_name == "open_hinged" and found.people == ("ana", "ben")
    assert [program.id for program in found.function.replaced] == [one, other]
    [trial] = found.function.trials[learnt.calls[0].id]
    assert (trial.start, trial.success) == ("OPEN seed 3", True)
    call = explain(book, learnt.calls[0].id)
    assert call.function is not None and call.function.learnt.entry == learnt.entry and call.trials == (trial,)
    assert explain(book, one).gave_way_to == learnt.calls[0]


def test_uses_are_counted_by_key(book):
    [entry] = teach(book, MICROWAVE, "pull in an arc")
    book.note_use([entry], True, MICROWAVE)
    book.note_use([entry], False, OVEN)
    assert [(str(one.key), one.served, one.approved) for one in explain(book, entry).evidence] == [
        (MICROWAVE, 1, 1),
        (OVEN, 1, 0),
    ]


def test_search_finds_entries_by_text_key_sentence_and_person(book):
    said = book.record_feedback("Nicht so schnell, bitte", "ana", subtask=MICROWAVE)
    [slow] = book.add_lessons(said, MICROWAVE, ["move slowly"])
    [far] = teach(book, OVEN, "stay away from the lamp", who="ben")
    [general] = teach_general(book, "be gentle", who="cleo")
    found = lambda words, **given: [one.id for one in search(book, words, **given)]
    assert found("") == [general, far, slow.id], "newest first"
    assert found("slowly MOVE") == found("microwave") == found("schnell") == found("ana") == [slow.id]
    assert found("slowly schnell") == [slow.id] and found("slowly lamp") == []
    assert found("", kind="general") == [general] and found("e", kind="template") == []
    book.remove(far, "ben")
    assert found("lamp") == [] and found("lamp", superseded=True) == [far]
    with pytest.raises(InvalidArgument, match="at most 200"):
        search(book, "x" * 201)


def test_nobody_is_forgotten_in_files_that_a_run_writes_to(book, tmp_path: Path):
    check_quiet(run_folders(book), "person")
    book.note_place("run", tmp_path)
    log = EventLog(tmp_path, "--out")
    assert goes_on(tmp_path)
    with pytest.raises(InvalidArgument, match="still going on"):
        check_quiet(run_folders(book), "person")
    log.close()
    check_quiet(run_folders(book), "person")
    assert not goes_on(tmp_path / "nowhere")
