"""Relative remarks are about the attempt they were said of: two in a row do not add up by accident."""

from __future__ import annotations

import ast
import json

import attrs
import pytest
from offline_prompts import MODEL, Entry, box_with_door, code_request, held_poses, request, run, scene, thing, unfenced

CRATE, *_ = box_with_door()
PEN = scene(thing("pen", (0.45, -0.2, 0.06), (0.12, 0.02, 0.12)))


@attrs.frozen
class Corrected:
    """An attempt that was found fault with, as the code prompt shows it."""

    code: str
    words: str
    notes: tuple[Entry, ...]
    subtask: str = "PICK_UP(pen)"
    printed: str = ""
    ended: str = "done"


def notes(words, code, graph=PEN, subtask="PICK_UP(pen)"):
    asked = request("feedback", graph, task="t", subtask=subtask, code=code, ended="done", words=words)
    said = json.loads(MODEL.answer(asked).text)
    assert not said["unclear"], said
    return [Entry(text, subtask) for text in said["corrections"]]


def write(corrections=(), corrected=(), graph=PEN, subtask="PICK_UP(pen)"):
    made = code_request(graph, subtask, corrections)
    if corrected:
        made = request(
            "code",
            graph,
            task="do it",
            subtask=subtask,
            done=[],
            skills="",
            subset="",
            corrections=list(corrections),
            general=[],
            templates=[],
            attempts=[],
            corrected=list(corrected),
        )
    return unfenced(MODEL.answer(made).text)


def grip(code, graph=PEN):
    return next(e.pose.position for e in run(code, graph) if e.kind == "close")


def test_two_equal_remarks_in_a_row_move_the_hand_once_each():
    first = write()
    one = notes("a centimetre lower", first)
    second = write(one)
    two = notes("a centimetre lower", second)
    assert one != two  # each says relative to what
    assert grip(second)[2] == pytest.approx(grip(first)[2] - 0.01, abs=1e-4)
    for both in ([*one, *two], [*two, *one]):  # however they are ranked
        assert grip(write(both))[2] == pytest.approx(grip(first)[2] - 0.02, abs=1e-4)


def test_a_note_that_is_shown_twice_is_followed_once():
    first = write()
    said = notes("3 cm to the left", first)
    once = grip(write(said))
    assert once[1] == pytest.approx(grip(first)[1] + 0.03, abs=1e-4)
    assert grip(write([*said, *said])) == once
    again = [Corrected(first, "3 cm to the left", tuple(said))]
    assert grip(write(said, again)) == once


def test_notes_of_two_people_who_saw_the_same_attempt_do_not_add_up():
    first = write()
    assert notes("3 cm lower", first) == notes("Three centimetres lower, please!", first)


def test_back_to_where_it_was_is_back():
    first = write()
    down = notes("2 cm lower", first)
    up = notes("2 cm higher", write(down))
    assert grip(write([*up, *down])) == pytest.approx(grip(first), abs=1e-4)  # the better ranked comes first


def test_further_is_further_than_that_attempt_went():
    first = write(graph=CRATE, subtask="OPEN(crate)")
    said = notes("10 cm further", first, CRATE, "OPEN(crate)")
    assert "14 cm" in said[0].text

    def length(code):
        poses = held_poses(run(code, CRATE))
        return abs(poses[-1].position[0] - poses[0].position[0])

    told = write(said, graph=CRATE, subtask="OPEN(crate)")
    assert length(told) == pytest.approx(0.24, abs=1e-3)
    second = notes("10 cm further", told, CRATE, "OPEN(crate)")
    for both in ([*said, *second], [*second, *said]):
        assert length(write(both, graph=CRATE, subtask="OPEN(crate)")) == pytest.approx(0.34, abs=1e-3)


def test_words_without_a_note_are_followed_from_the_code_they_were_said_of():
    """A method without a book shows the words alone."""
    first = write()
    lower = write([Entry("Go 1 cm lower.", "PICK_UP(pen)")])
    assert grip(lower)[2] == pytest.approx(grip(first)[2] - 0.01, abs=1e-4)
    retry = write(corrected=[Corrected(lower, "1 cm lower", ())])
    assert grip(retry)[2] == pytest.approx(grip(first)[2] - 0.02, abs=1e-4)


def test_words_that_were_asked_about_are_not_followed_by_guessing():
    first = write()
    retry = write(corrected=[Corrected(first, "Not like that, go left or go right or whatever", ())])
    assert grip(retry) == grip(first)


def test_the_newest_remark_wins_over_what_was_said_before_it():
    first = write(graph=CRATE, subtask="OPEN(crate)")
    straight = Entry("Pull the handle straight out, in one line.", "OPEN(crate)")
    arc = notes("no, an arc!", first, CRATE, "OPEN(crate)")
    code = write([straight], [Corrected(first, "no, an arc!", tuple(arc), "OPEN(crate)")], CRATE, "OPEN(crate)")
    assert "arc(" in code


def test_the_other_way_round_than_an_attempt_at_another_thing_reverses_nothing_here():
    arc = Entry("Lead the handle along an arc about the hinge edge.", "OPEN(microwave)")

    def led(*notes):
        return ast.dump(ast.parse(write([arc, *notes], graph=CRATE, subtask="OPEN(crate)")))  # without the comments

    for text in ("Lead the handle the other way round.", "Turn it in the opposite direction."):
        assert led(Entry(text, "OPEN(bottle)")) == led(), text
        for key in ("OPEN(crate)", "OPEN(crate door)", ""):
            assert led(Entry(text, key)) != led(), (text, key)


def test_of_a_note_made_of_another_thing_what_is_said_beside_the_other_way_round_is_followed():
    note = "Lead the handle the other way round, along an arc about the hinge edge."
    arc = Entry("Lead the handle along an arc about the hinge edge.", "OPEN(bottle)")
    codes = [write([one], graph=CRATE, subtask="OPEN(crate)") for one in (Entry(note, "OPEN(bottle)"), arc)]
    led, plain = (ast.dump(ast.parse(code)) for code in codes)
    assert led == plain
