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
