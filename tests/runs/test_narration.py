"""What people are shown of a run: whole lines of code, and templates by what they do."""

from __future__ import annotations

import io

from rich.console import Console

from memo_core.cli.narration import Narrator
from memo_core.events import CodeWritten, EntryServed, ModelCalled, Problem, Retrieved, RunEnded, WorldPutBack
from memo_core.skillbook.model.entries import headline

TEMPLATE = (
    'import math\n\n\ndef open_by_an_arc(door="door"):\n'
    '    """Lead the handle along an arc.\n\n    More."""\n    look()\n'
)


def test_no_line_of_code_is_cut_off_at_the_edge():
    line = "hold = side_orientation([0.0, 1.0, 0.0], 'horizontal')  # " + "so that the fingers close on flat sides " * 5
    for terminal in (False, True):
        shown = io.StringIO()
        Narrator(Console(file=shown, width=60, force_terminal=terminal, no_color=True, highlight=False))(
            CodeWritten(subtask="OPEN(door)", attempt=1, code=line)
        )
        assert "flat sides" in shown.getvalue() and shown.getvalue().count("flat sides") == 5


def test_no_retrieved_entry_is_cut_off_at_the_edge():
    key, text = "PUT_ON(block from the long shelf, the large green kitchen mat)", "Grasp it from above, then lift it."
    shown = io.StringIO()
    Narrator(Console(file=shown, width=80, no_color=True, highlight=False))(
        Retrieved("PUT_ON(block, mat)", (EntryServed(1, "correction", key, text, 0.91, 0.92, 0.93, 0.94),))
    )
    assert "…" not in shown.getvalue()
    for word in f"{key} {text} 0.91 0.92 0.93 0.94 correction".split():
        assert word in shown.getvalue()


def test_what_a_model_writes_is_folded_where_it_is_not_asked_for_and_never_streamed():
    for terminal in (False, True):
        shown = io.StringIO()
        console = Console(file=shown, width=100, force_terminal=terminal, no_color=True, highlight=False)
        narrator = Narrator(console, code=False)
        if terminal:
            assert narrator.on_text is not None
            for piece in ("look()\n", "close_gripper()\n"):
                narrator.on_text("code", piece)
            narrator.on_text("feedback", '{"general": "go slowly"}')
            narrator.on_text("template", "def open_by_an_arc():")
        narrator(CodeWritten(subtask="OPEN(door)", attempt=1, code="look()\nclose_gripper()\n"))
        assert "close_gripper" not in shown.getvalue()
        assert "code: 2 lines" in shown.getvalue() and "--verbose" in shown.getvalue()
        assert "slowly" not in shown.getvalue() and "def " not in shown.getvalue()
        assert shown.getvalue().count("being written …") == (3 if terminal else 0)


def narrated(*events) -> str:
    shown = io.StringIO()
    narrator = Narrator(Console(file=shown, width=300, no_color=True, highlight=False), code=False)
    for event in events:
        narrator(event)
    return shown.getvalue()


def test_an_answer_that_cannot_be_used_has_its_reason_in_one_line():
    reason = "it has no program\n" + "at all " * 100
    shown = narrated(ModelCalled("code", "m", 5, 1, None, 0.6, unusable=reason))
    [line] = [line for line in shown.splitlines() if "cannot be used" in line]
    assert "it has no program at all" in line and line.endswith("…") and len(line) < 200
    assert "cannot be used" not in narrated(ModelCalled("code", "m", 5, 1, None, 0.6))


def test_a_server_that_stays_away_is_said_to_once_and_each_retry_in_a_short_line():
    why = "m: http://127.0.0.1:9 cannot be reached: refused; check llm.api_base"
    events = []
    for attempt, problem in enumerate((why, "the same again", "the same again"), start=1):
        events += [ModelCalled("plan", "m", 0, 0, None, 0.1, problem=why)]
        events += [Problem("asking for the plan", f"{problem}; asked again in 1.0 s ({attempt} of 3)")]
    shown = narrated(*events)
    assert shown.count(why) == 1
    assert all(f"asked again in 1.0 s ({attempt} of 3)" in shown for attempt in (1, 2, 3))


def test_that_the_world_was_put_back_is_said():
    assert "put back: as at the start of OPEN(door)" in narrated(WorldPutBack("OPEN(door)", "simulator"))
    assert "a person" in narrated(WorldPutBack("OPEN(door)", "person"))


def test_a_template_is_listed_by_a_whole_sentence():
    wrapped = 'def f():\n    """Lead the handle, e.g. of a door, along\n    an arc. Slowly.\n\n    More."""\n'
    assert headline("template", wrapped) == "f: Lead the handle, e.g. of a door, along an arc."
    assert headline("template", 'def f():\n    """No full stop\n    here"""\n') == "f: No full stop here"


def test_a_template_is_listed_by_what_it_does():
    assert headline("template", TEMPLATE) == "open_by_an_arc: Lead the handle along an arc."
    assert headline("template", "def (") == "def ("
    assert headline("template", "") == ""
    assert headline("correction", "Pull\n it  in an arc.") == "Pull it in an arc."


def test_a_success_that_the_teacher_never_approved_contradicts_nothing():
    shown = io.StringIO()
    reason = "PLACE(cup, table) was corrected 4 times and never approved"
    Narrator(Console(file=shown, width=200, no_color=True, highlight=False))(RunEnded("r", True, reason, 3.0, 9.0))
    assert shown.getvalue().strip() == f"success by the task's own check (3.0 s). Why the run ended: {reason}"


def test_a_replay_tells_recorded_times_and_once_how_the_answers_fit():
    shown, changed = io.StringIO(), "recorded with a prompt that has changed since"
    narrator = Narrator(Console(file=shown, width=200, no_color=True, highlight=False), replay=True)
    for seconds in (13.65, 2.0):
        narrator(ModelCalled("plan", "relay", 0, 0, None, seconds, note=changed))
    assert "plan: relay, recorded: 13.65 s" in shown.getvalue() and changed not in shown.getvalue()
    narrator.tell_matches()
    assert shown.getvalue().count(changed) == 1 and f"2 answers: {changed}" in shown.getvalue()


def table_of(*served):
    shown = io.StringIO()
    console = Console(file=shown, width=200, no_color=True, highlight=False)
    Narrator(console)(Retrieved("OPEN(oven)", served, (("PUT(pan, oven)", 0.74, "below the cut 0.85"),)))
    return [line.split() for line in shown.getvalue().splitlines()]


def test_the_score_and_the_keys_likeness_are_told_apart_and_hints_are_marked():
    near = EntryServed(1, "correction", "OPEN(fridge)", "In an arc.", 0.684, 1.0, 0.66, 0.915)
    hint = EntryServed(2, "template", "PULL(drawer)", "def pull(): ...", 0.7, 0.8, 0.7, 0.775, hint=True)
    general = EntryServed(3, "general", "*", "Go slowly.", 0.41, 0.0, 0.0)
    head, *rows, cut = table_of(near, hint, general)
    assert head == ["served", "s", "r", "action", "objects", "key", "text"]
    assert rows[0][:6] == ["correction", "0.68", "0.92", "1.00", "0.66", "OPEN(fridge)"]
    assert rows[1][:5] == ["template,", "hint", "0.70", "0.78", "0.80"]
    assert rows[2][:4] == ["general", "0.41", "*", "Go"], "a general statement has no key"
    assert cut[:5] == ["not", "served:", "PUT(pan,", "oven)", "(r"]
