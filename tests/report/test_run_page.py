"""The page of a run, from its events."""

from __future__ import annotations

import json

from memo_core.report.writing import write_run_page


def page_of(folder, *events):
    folder.mkdir()
    started = {"event": "RunStarted", "instruction": "open the door"}
    begun = {"event": "SubtaskStarted", "subtask": "OPEN(door)", "number": 1, "attempt": 1}
    lines = (json.dumps({"time": 1.0} | event) for event in (started, begun, *events))
    (folder / "events.jsonl").write_text("\n".join(lines) + "\n")
    return write_run_page(folder).page.read_text(encoding="utf-8")


def noted(entry, text):
    return {"event": "EntryStored", "entry": entry, "kind": "correction", "key": "OPEN(door)", "text": text}


def test_a_note_that_was_struck_is_shown_as_struck(tmp_path):
    notes = [noted(1, "Pull it.") | {"feedback": 1}, noted(2, "Push it.") | {"feedback": 2}]
    struck = noted(1, "Pull it.") | {"event": "EntryStruck", "feedback": 1}
    page = page_of(tmp_path / "run", *notes, struck)
    assert "struck (correction, OPEN(door)): Pull it." in page and "noted (correction, OPEN(door)): Push it." in page


def test_the_score_and_r_of_what_was_retrieved_are_told_apart_and_older_logs_have_no_r(tmp_path):
    row = {"entry": 1, "kind": "template", "key": "OPEN(oven)", "text": "pull", "score": 0.68}
    row |= {"action_cosine": 1.0, "objects_cosine": 0.7}
    served = {"event": "Retrieved", "subtask": "OPEN(door)", "cut": []}
    now = page_of(tmp_path / "now", served | {"served": [row | {"key_score": 0.92, "hint": True}]})
    assert "<td>0.68</td><td>0.92</td><td>template, hint</td>" in now
    assert "<td>0.68</td><td></td><td>template</td>" in page_of(tmp_path / "before", served | {"served": [row]})
