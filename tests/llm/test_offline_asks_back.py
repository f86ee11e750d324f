"""What the offline backend does not surely understand it asks about, and what it cannot do it says to people."""

from __future__ import annotations

import json

import attrs
import pytest
from memo_llm.offline.feedback import TOO_LONG
from memo_llm.offline.prompt import LONGEST_READ
from memo_llm.offline.questions import OFFERS
from memo_llm.plugin import memo_language_models
from offline_prompts import MODEL, box_with_door, plan, request, scene, thing

from memo_core.errors import InvalidArgument
from memo_core.interfaces.llm import LanguageModelError
from memo_core.llm.measured import measured_of
from memo_core.llm.readers import Unreadable

CRATE, *_ = box_with_door()
PEN = scene(thing("pen"), thing("mug", (0.5, 0.2, 0.05), (0.1, 0.1, 0.1)))


def said(words, graph=CRATE, subtask="OPEN(crate)"):
    asked = request("feedback", graph, task="t", subtask=subtask, code="open_gripper()", ended="done", words=words)
    return json.loads(MODEL.answer(asked).text)


@pytest.mark.parametrize("words", ["Yes, that's right.", "Great job, thanks!", "Well done", "That wasn't bad at all."])
def test_praise_is_asked_back_as_praise_and_never_noted(words):
    answer = said(words)
    assert answer["corrections"] == answer["general"] == []
    assert "right as it was" in answer["unclear"]


@pytest.mark.parametrize(
    ("words", "noted"),
    [
        ("you were too far to the left", "to the right"),
        ("that's 2 cm too high", "2 cm lower"),
        ("slow down!", "slower"),
        ("ten centimetres further", "10 cm further"),
        ("it's only half open", "further"),
        ("the hinge is on the left side", "about the left edge"),
        ("you can't just pull, push it in first", "Push it in"),
        ("don't squeeze it so hard", "gently"),
    ],
)
def test_what_is_said_as_a_fault_does_not_come_out_as_its_opposite(words, noted):
    assert noted in " ".join(said(words)["corrections"])


@pytest.mark.parametrize("words", ["go left, no, go right", "do it like I showed you yesterday", "Stop!"])
def test_what_may_mean_two_things_or_nothing_is_asked(words):
    answer = said(words, PEN, "PICK_UP(pen)")
    assert answer["corrections"] == [] and answer["unclear"]


def test_of_several_alike_the_one_on_the_named_side_is_meant():
    jars = scene(thing("red jar", (0.4, 0.2, 0.05)), thing("green jar", (0.4, -0.2, 0.05)))
    assert plan(jars, "pick up the left jar") == "PICK_UP(red jar)"
    assert plan(jars, "pick up the right jar") == "PICK_UP(green jar)"


def test_a_task_that_names_nothing_to_be_seen_is_said_to_people():
    with pytest.raises(LanguageModelError) as caught:
        plan(PEN, "pull out the tray")
    assert "'tray'" in str(caught.value) and "pen, mug" in str(caught.value) and "ACTION(" not in str(caught.value)


def test_an_answer_that_cannot_be_used_is_told_without_the_form_meant_for_a_model():
    error = Unreadable("plan", "it names no subtask; answer with one line, ACTION(object) or DONE", "pull out the tray")
    assert "pull out the tray" in error.told and "ACTION(" not in error.told


def test_the_tasks_it_was_measured_at_are_declared_and_what_is_beyond_it_is_said():
    offline = next(backend for backend in memo_language_models() if backend.name == "offline")
    measured = measured_of(offline)
    assert measured is not None and set(measured.tasks.values()) == {"untaught", "taught", "no"} and measured.commands
    for task, reach in measured.tasks.items():
        assert bool(measured.warning("offline", task)) == (reach != "untaught")
    assert measured.warning("offline", "never-measured") == ""
    with pytest.raises(InvalidArgument, match="tasks"):
        measured_of(attrs.evolve(offline, measured="memo_llm/offline/habits.yaml"))


@pytest.mark.parametrize(
    ("words", "subtask"),
    [
        (
            "handles first, doors last, else you reach over them all the time",
            "OPEN(crate)",
        ),  # a reason asks for nothing
        ("Why are you shutting it?", "OPEN(crate)"),
        ("check that nothing sticks out before you shut any lid or door", "OPEN(crate)"),  # says only when
        ("Up, then in.", "OPEN(crate)"),
        ("pull it out towards you first and lift afterwards", "PICK_UP(pen)"),
        ("Oh how lovely, not even a crack. Exactly like that, please.", "PICK_UP(pen)"),
        ("Come lower and mind the whatnot on the thingummy", "PICK_UP(pen)"),
    ],
)
def test_what_is_not_accounted_for_is_asked_and_not_guessed(words, subtask):
    answer = said(words, PEN if "pen" in subtask else CRATE, subtask)
    assert answer["corrections"] == answer["general"] == [] and answer["unclear"]


@pytest.mark.parametrize(
    ("words", "subtask", "noted"),
    [
        ("Come from above, not sideways!", "PICK_UP(pen)", ["Approach from top."]),
        ("Easy, easy! Slower please, you're slamming it.", "OPEN(crate)", ["Move slower."]),
        ("The hinges are on the left, so swing it round.", "OPEN(crate)", ["about the left edge"]),
        ("You need another half turn.", "UNSCREW(pen)", ["180 degrees further"]),
    ],
)
def test_contrast_small_talk_and_facts_stand_beside_a_request(words, subtask, noted):
    corrections = said(words, PEN if "pen" in subtask else CRATE, subtask)["corrections"]
    assert all(any(part in one for one in corrections) for part in noted), corrections


@pytest.mark.parametrize(
    ("answer", "noted"),
    [
        ("yes", "Go lower than in that attempt."),
        ("Yes, that's right.", "Go lower than in that attempt."),
        ("no, 3 cm higher", "Go 3 cm higher than in that attempt."),
    ],
)
def test_the_answer_to_a_question_stands_for_what_it_was_asked_about(answer, noted):
    words = "come lower and mind the thingummy on the whatsit"
    question = said(words, PEN, "PICK_UP(pen)")["unclear"]
    assert question.startswith("is this what you mean: Go lower.")
    # As memo_core.policy.feedback_processing puts an answer beside what it answers.
    assert said(f"{words}\n(asked back: {question})\n{answer}", PEN, "PICK_UP(pen)")["corrections"] == [noted]


@pytest.mark.parametrize(
    ("answer", "noted"),
    [
        ("Yes, go lower, and mind the whatsit.", ["Go lower than in that attempt."]),  # said again is meant once
        ("Yes, lower. And more slowly.", ["Go lower than in that attempt.", "Move slower."]),
        ("Where you take hold. Go 2 cm lower.", ["Go 2 cm lower than in that attempt."]),
        ("None of that. Grip it more gently.", ["Use the gripper gently."]),
        ("Yes.", ["Go lower than in that attempt."]),
    ],
)
def test_yes_with_more_words_is_a_yes_and_no_praise(answer, noted):
    words = "come lower and mind the thingummy on the whatsit"
    question = said(words, PEN, "PICK_UP(pen)")["unclear"]
    assert said(f"{words}\n(asked back: {question})\n{answer}", PEN, "PICK_UP(pen)")["corrections"] == noted


def test_a_yes_with_a_reservation_that_is_not_understood_is_asked_about():
    words = "come lower and mind the thingummy on the whatsit"
    question = said(words, PEN, "PICK_UP(pen)")["unclear"]
    heard = said(
        f"{words}\n(asked back: {question})\nYes, but mind the whatsit on the gizmo and go left of it.",
        PEN,
        "PICK_UP(pen)",
    )
    assert heard["corrections"] == [] and heard["unclear"]


@pytest.mark.parametrize(
    ("answer", "noted"),
    [
        (
            "No. Mind the whatsit on the doodah while you take it.",
            ["Mind the whatsit on the doodah while you take it."],
        ),
        ("I mean put the doohickey beside the whatsit.", ["Put the doohickey beside the whatsit."]),
        ("I don't know, never mind.", []),
        ("What do you mean by that?", []),
        ("The whatsit was wobbling.", []),
    ],
)
def test_who_was_asked_and_asks_for_it_again_is_noted_as_it_was_said(answer, noted):
    """Nothing is read in it, so nothing follows from it here; a question a second time would help nobody."""
    words = "do the thingummy with the whatsit"
    question = said(words, PEN, "PICK_UP(pen)")["unclear"]
    heard = said(f"{words}\n(asked back: {question})\n{answer}", PEN, "PICK_UP(pen)")
    assert heard["corrections"] == noted and bool(heard["unclear"]) == (not noted)


def test_no_that_belongs_to_a_request_is_no_answer():
    words = "do the thingummy with the whatsit"
    question = said(words, PEN, "TURN(pen)")["unclear"]
    heard = said(f"{words}\n(asked back: {question})\nNo turning, please.", PEN, "TURN(pen)")
    assert "Turn" not in " ".join(heard["corrections"])


SUBTASKS = {
    "open": "OPEN(crate)",
    "close": "CLOSE(crate)",
    "pull": "PULL(crate)",
    "pick": "PICK(pen)",
    "place": "PLACE(pen, mug)",
    "push": "PUSH(pen)",
    "turn": "TURN(pen)",
    "pour": "POUR(pen, mug)",
    "wipe": "WIPE(mug)",
    "stir": "STIR(mug)",
    "": "KNEAD(pen)",
}


@pytest.mark.parametrize(("kind", "offer"), [(kind, one) for kind, some in OFFERS.items() for one in some.split("; ")])
def test_what_a_question_offers_to_say_is_understood(kind, offer):
    held = scene(thing("pen"), thing("mug", (0.5, 0.2, 0.05), (0.1, 0.1, 0.1)), relations=[("pen", "held")])
    graph = {
        "pour": held,
        "wipe": held,
        "stir": held,
        "pick": PEN,
        "turn": PEN,
        "push": PEN,
        "place": PEN,
        "": PEN,
    }.get(kind, CRATE)
    question = said("do the thingummy with the whatsit", graph, SUBTASKS[kind])["unclear"]
    assert offer in question
    answer = said(offer, graph, SUBTASKS[kind])
    assert answer["corrections"] and not answer["unclear"]


@pytest.mark.parametrize(
    ("words", "subtask", "noted"),
    [
        ("lift it 5 cm higher", "PICK_UP(pen)", "Lift it 5 cm higher"),  # not: farther from the robot
        ("to the right!", "UNSCREW(pen)", "Turn it clockwise."),  # what is turned in place goes nowhere
        ("Gently! Everything falls over.", "OPEN(crate)", "Move slower."),  # a soft grip would let go of the handle
    ],
)
def test_what_a_remark_is_about_depends_on_what_the_subtask_does(words, subtask, noted):
    assert any(one.startswith(noted) for one in said(words, PEN if "pen" in subtask else CRATE, subtask)["corrections"])


@pytest.mark.parametrize(
    ("words", "noted"),
    [
        ("Whoa, too far! About twenty centimetres is plenty.", "Go 20 cm in all."),
        ("slow down with that door, it comes back and hits you", "Move slower."),
        ("it's still open about an inch, keep pushing til you feel it click", "Go all the way."),
    ],
)
def test_what_only_tells_or_bounds_does_not_stop_a_request_from_being_heard(words, noted):
    assert noted in said(words)["corrections"]


def test_what_another_sentence_says_better_is_not_noted_beside_it():
    words = "Whoa, too far! About twenty centimetres is plenty."
    assert said(words)["corrections"] == ["Go 20 cm in all."]


def test_what_is_said_looking_back_is_noted_for_the_subtask_it_is_about():
    context = {"task": "t", "code": "open_gripper()", "ended": "done", "subtasks": ["OPEN(crate)", "PICK_UP(pen)"]}

    def of_placing(words):
        asked = request("feedback", CRATE, subtask="PLACE(pen, crate)", words=words, **context)
        return json.loads(MODEL.answer(asked).text)

    answer = of_placing("you should have opened it further")
    assert answer["elsewhere"] == [{"subtask": "OPEN(crate)", "note": "Go further."}] and answer["corrections"] == []
    assert "elsewhere" not in of_placing("open your hand before you go lower"), "that is about placing"
    assert "elsewhere" not in of_placing("2 cm lower")
    unclear = of_placing("you should have opened the thingummy of the whatsit")
    assert "elsewhere" not in unclear and unclear["unclear"]


@pytest.mark.parametrize(
    "words",
    ["nein, zieh den Griff in einem Bogen", "non, tire la poignée en arc de cercle", "no, tira del asa en arco",
     "нет, тяни ручку по дуге", "いや、もっとゆっくり", "langsamer", "plus doucement", "más despacio por favor"],
)  # fmt: skip
def test_another_language_is_told_what_reads_it_and_teaches_nothing(words):
    answer = said(words)
    assert not answer["corrections"] and not answer["general"]
    assert "English only" in answer["unclear"] and "llm.backend=litellm" in answer["unclear"]


@pytest.mark.parametrize("words", ["slwoer", "dont squeeze", "pull it in an arc", "no, pull in an arc!", "lower"])
def test_english_in_a_hurry_is_read_as_english(words):
    assert said(words)["corrections"]


@pytest.mark.parametrize("mark", ["!", "!!!", "."])
@pytest.mark.parametrize("words", ["no", "stop", "pull it in an arc", "lower", "that was wrong"])
def test_an_exclamation_mark_changes_nothing_of_what_is_understood(words, mark):
    marked, plain = said(words + mark), said(words)
    assert (marked["corrections"], bool(marked["unclear"])) == (plain["corrections"], bool(plain["unclear"]))


def test_a_remark_that_is_too_long_for_this_reader_is_asked_about_and_its_short_answer_understood():
    long = "no, pull the handle around in an arc, and mind the edge " * 40
    assert f"at most {LONGEST_READ} characters" in said(long)["unclear"]
    assert said(f"{long}\n(asked back: {TOO_LONG})\npull it in an arc")["corrections"]
