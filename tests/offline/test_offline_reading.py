"""The remarks that the offline backend understands by keywords, and what it asks back instead of guessing."""

from __future__ import annotations

import json
from pathlib import Path

import attrs
import pytest
import yaml
from memo_offline.phrases import load
from memo_offline.reading import Edit, read

from memo_core.llm.readers.notes import MAX_NOTE
from memo_core.teachers import simulated_teacher
from tests.support.offline_prompts import MODEL, box_with_door, request, thing, write

PHRASES = load()
NAMES = [phrase.name for phrase in PHRASES.all]
EXAMPLES = {"cm": "3 cm", "degrees": "30 degrees", "percent": "40 percent", "seconds": "2 seconds", "times": "3 times"}
CRATE = box_with_door()[0]
FAULTS = yaml.safe_load(Path(simulated_teacher.__file__).with_name("phrases.yaml").read_text())
# Faults of motions that the demo and the training tasks show; `understood` phrasings of each have to be read.
OF_MOTIONS = {
    "straight-on-swing": 5,
    "wrong-way-round": 5,
    "not-far-enough": 5,
    "arc-on-slide": 5,
    "slide-not-far-enough": 5,
    "not-closed": 5,
    "missed-grip": 5,
    "untouched-handle": 5,
    "closed-beside": 5,
    "lost-on-lift": 5,
    "still-held": 5,
    "dropped-short": 5,
    "landed-beside": 4,
    "refused": 5,
    "too-hard": 5,
}


def names(text: str, *nodes) -> list[str]:
    return [edit.phrase.name for edit in read(text, nodes).edits]


def noted(words: str, graph=CRATE, subtask: str = "OPEN(crate)", code: str = "look()", **more) -> dict:
    asked = request("feedback", graph, task="do it", subtask=subtask, words=words, code=code, ended="well", **more)
    return json.loads(MODEL.answer(asked).text)


@pytest.mark.parametrize("name", NAMES)
def test_a_note_is_read_as_the_edit_it_was_made_of(name):
    phrase = PHRASES.named(name)
    amounts = [PHRASES.tokens(EXAMPLES[unit]).amounts[0] for unit in phrase.takes]
    for amount in [*amounts, *([] if name == "through an angle" else [None])]:
        edit = Edit(phrase, amount)
        again = read(edit.note).edits
        assert [(one.phrase.name, one.amount and one.amount.value) for one in again] == [
            (name, amount and amount.value)
        ]


@pytest.mark.parametrize("name", NAMES)
def test_each_of_its_keywords_alone_is_understood(name):
    phrase = PHRASES.named(name)
    for words in phrase.words:
        said = words.replace("AMOUNT", EXAMPLES[phrase.takes[0]] if phrase.takes else "")
        assert names(said) == [name], words


@pytest.mark.parametrize("cause", OF_MOTIONS)
def test_the_simulated_teachers_words_are_understood(cause):
    box = thing("toy box")
    said = [one.format(object="toy box", place="crate", side="left", amount="3 cm") for one in FAULTS[cause]]
    understood = [one for one in said if names(one, box, *CRATE.nodes)]
    assert len(understood) >= OF_MOTIONS[cause], sorted(set(said) - set(understood))


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("no, come from above, not from the side", ["from above"]),
        ("Move it left, not right.", ["left"]),
        ("pull straight, not in an arc, and slower", ["straight", "slower"]),
        ("lift it, not too high", []),
        ("not from the side, come from above", []),
    ],
)
def test_what_is_said_instead_of_its_opposite_is_followed(words, expected):
    assert names(words) == expected


@pytest.mark.parametrize(
    "words",
    [
        "the door is hinged so you can't just yank it toward you, move your hand in a curve",
        "You pulled straight but the door rotates. Follow the door as it turns.",
        "move your hand sideways in a curve while you pull so that you don't lose the handle",
    ],
)
def test_the_lesson_beside_what_did_not_work_is_followed(words):
    assert names(words, thing("fridge"), thing("fridge door", kind="part", part_of="fridge")) == ["arc"]


@pytest.mark.parametrize(
    "words",
    [
        "you can't pull it in an arc",
        "move sideways, don't lose it",
        "don't pull it higher while you pull",
        "you can't yank it higher",
    ],
)
def test_what_is_denied_beside_it_stays_in_doubt(words):
    assert names(words) == []


@pytest.mark.parametrize("words", FAULTS["unclear"])
def test_a_remark_that_teaches_nothing_teaches_nothing(words):
    assert names(words.format(object="toy box"), thing("toy box")) == []


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("the door rotates about a vertical axis on its left side, so follow a circle", ["arc"]),
        ("grip it on the right side", []),
        ("the hinge is on its left side", ["hinge on the left"]),
        ("come from the left side", ["from the left"]),
    ],
)
def test_a_side_of_a_thing_is_no_direction(words, expected):
    assert names(words) == expected


@pytest.mark.parametrize(
    ("words", "doubt"),
    [
        ("don't lift it higher", "denied"),
        ("no higher", "denied"),
        ("pull it, but never gently", "denied"),
        ("if it sticks, pull harder", "condition"),
        ("a bit lower when it is full", "condition"),
        ("should it go higher?", "question"),
        ("higher, no, lower", "do not go together"),
        ("in an arc, straight", "do not go together"),
        ("2 cm higher and 5 cm higher", "do not go together"),
        ("gently, 3 cm", "3 cm"),
        ("higher, next to the cup", "beside something else"),
        ("frobnicate the latch", "none of these words"),
        ("", "none of these words"),
    ],
)
def test_what_is_not_sure_is_never_guessed(words, doubt):
    reading = read(words)
    assert reading.edits == () and doubt in reading.doubt


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("2 cm higher and 3 cm to the left", [("higher", 0.02), ("left", 0.03)]),
        ("open it by 90 degrees", [("through an angle", 90)]),
        ("turn it a quarter turn to the left", [("counterclockwise", 90)]),
        ("20 percent further", [("further", 20)]),
        ("5 mm lower", [("lower", 0.005)]),
        ("three times", [("again", 3)]),
        ("wait two seconds", [("wait", 2)]),
        ("no, lower and more gently", [("lower", None), ("gentler", None)]),
    ],
)
def test_amounts_go_with_what_they_are_said_of(words, wanted):
    assert [(e.phrase.name, e.amount and pytest.approx(e.amount.value)) for e in read(words).edits] == wanted


@pytest.mark.parametrize(
    ("lesson", "understood"),
    [
        ("Push the cupboard door in first, then it springs open by itself.", ["push in first"]),
        ("You have to lift the locker's handle up before you pull the door.", ["lift first"]),
        ("The can is very thin, grip it only lightly or it gets crushed.", ["gentler"]),
        ("Hold the carton gently, it collapses if you squeeze it.", ["gentler"]),
        ("Keep the safe's button pressed for two seconds, then the door opens by itself.", ["press the button"]),
        ("The wardrobe door sticks halfway, let it come back a little and pull a second time.", ["again"]),
    ],
)
def test_lessons_about_quirks_are_understood(lesson, understood):
    things = [thing(name) for name in ("cupboard", "locker", "can", "carton", "safe", "wardrobe")]
    assert names(lesson, *things, thing("cupboard door", kind="part", part_of="cupboard")) == understood


def test_a_name_in_the_scene_is_no_keyword():
    assert names("open the lower drawer further", thing("lower drawer")) == ["further"]
    assert names("hold the arc lamp by its rim", thing("arc lamp")) == ["by the rim"]


def test_an_explained_lesson_holds_for_other_things_too():
    found = noted("the door swings, so follow a curve around its hinge")
    assert " arc " in found["corrections"][0] and found["general"][0].startswith("Doors swing")
    assert noted("pull it in an arc")["general"] == []


@pytest.mark.parametrize(
    ("words", "asked"),
    [
        ("frobnicate the latch", "arc, straight, "),
        ("no, that was wrong", "What should be different?"),
        ("don't lift it higher", "say only what to do"),
        ("higher, next to the cup", "say which way and how far"),
    ],
)
def test_what_is_not_understood_is_asked_back_in_a_line_or_two(words, asked):
    found = noted(words)
    assert found["corrections"] == found["general"] == []
    assert asked in found["unclear"] and words not in found["unclear"]
    assert len(found["unclear"]) < 200


@pytest.mark.parametrize("kind", ["", "open", "close", "pick", "place", "push", "pull", "turn"])
def test_what_is_offered_fits_into_a_question(kind):
    assert len(PHRASES.offers(kind)) < MAX_NOTE - 150


def test_an_answer_that_is_no_clearer_is_kept_as_it_was_said():
    answered = noted("frobnicate it\n(asked back: what should be different?)\nYou have to frobnicate the latch")
    assert answered["corrections"] == ["Frobnicate the latch."]
    assert noted("hm\n(asked back: what?)\n2 cm lower")["corrections"] == ["Go 2 cm lower than the plain way."]
    code, answer = write(CRATE, "OPEN(crate)", ["Frobnicate the latch."])
    assert "Not understood: Frobnicate the latch." in code and answer.not_understood == ("Frobnicate the latch.",)


def test_praise_teaches_nothing():
    assert "praise" in noted("Well done, thank you!")["unclear"]


@pytest.mark.parametrize(
    ("words", "twice"),
    [
        ("2 cm lower", "Go 4 cm lower than the plain way."),
        ("a little to the left", "Go 4 cm to the left of the plain way."),
        ("further", "Go 96 percent further than the plain way."),
    ],
)
def test_said_twice_a_relative_remark_is_noted_from_the_plain_way(words, twice):
    once = noted(words, code=write(CRATE, "OPEN(crate)")[0])["corrections"]
    assert noted(words, code=write(CRATE, "OPEN(crate)", once)[0])["corrections"] == [twice]


@pytest.mark.parametrize(
    ("words", "plan"),
    [
        ("the crate is closed, open it first", True),
        ("open the crate first", True),
        ("you forgot the pear", True),
        ("open your hand first", False),
        ("push it in first", False),
    ],
)
def test_what_asks_for_a_step_is_noted_for_plans(words, plan):
    graph = attrs.evolve(CRATE, nodes=(*CRATE.nodes, thing("pear")))
    found = noted(words, graph, "PICK_UP(pear)", plans=True)
    assert bool(found.get("plan")) == plan


def test_the_page_lists_what_is_understood():
    page = (Path(__file__).parents[2] / "docs" / "offline-backend.md").read_text(encoding="utf-8")
    ways: dict[str, list[str]] = {}
    for one in PHRASES.all:
        ways.setdefault(one.matter, []).append(one.words[min(1, len(one.words) - 1)])
    rows = [f"| {matter} | {'; '.join(said)} |" for matter, said in ways.items()]
    missing = [row for row in rows if row not in page]
    assert not missing, "these rows belong into docs/offline-backend.md:\n" + "\n".join(rows)


@pytest.mark.parametrize(
    "said",
    [
        "hold it a little tighter, I thought you were going to drop it",
        "um, my hand was right there, please leave me more room",
        "it almost came right out",
    ],
)
def test_what_nearly_happened_and_where_a_person_was_is_asked_about(said):
    assert names(said) == []
