"""Everyday phrasings of a closed vocabulary become edits; what is outside it is said."""

from __future__ import annotations

import random
import re
import tracemalloc
from importlib import resources
from pathlib import Path

import memo_llm
import pytest
import yaml
from memo_llm.offline.reading import read_sentence
from memo_llm.offline.typos import in_full
from memo_llm.offline.vocabulary import Vocabulary

from memo_core.errors import InvalidArgument

VOCABULARY = Vocabulary.load()
KNOWN = ("crate", "crate door", "crate handle", "brick", "shelf")


def read(text):
    return read_sentence(text, VOCABULARY, KNOWN)


def shown(text):
    found = []
    for e in read(text).edits:
        amount = f" {e.amount.metres:g}m" if e.amount and e.amount.exact else ""
        angle = f" {e.degrees:g}deg" if e.degrees is not None else ""
        count = f" x{e.count}" if e.kind == "repeat" else ""
        found.append(
            ("not " if e.negated else "") + e.kind + (f"={e.value}" if e.value else "") + amount + angle + count
        )
    return found


PHRASINGS = {
    # path shape
    "pull the handle along an arc": ["arc"],
    "Follow a curve around its hinge.": ["arc"],
    "swing it open": ["arc"],
    "go round with the door": ["arc"],
    "move your hand in a circle": ["arc"],
    "lead the handle around the far edge where the door hangs": ["arc"],
    "it's a door on a hinge": ["arc"],
    "the door swings": ["arc"],
    "don't pull it straight": ["arc"],
    "Do not move in a straight line, but in an arc": ["arc"],
    "swing the handle around in a circle instead of pulling straight": ["arc"],
    "pull it straight out": ["straight"],
    "straight back, no curve": ["straight"],
    "don't follow an arc": ["straight"],
    "it slides": ["straight"],
    "never turn the handle around the hinge": ["straight"],
    "the other way round": ["reverse"],
    "in the opposite direction": ["reverse"],
    "the hinge is on the other edge": ["reverse"],
    "the hinge is on the left": ["pivot=left"],
    "turn the door about the bottom edge": ["arc", "pivot=bottom"],
    "keep the hand level along the way": ["stiff-hand"],
    "turn your hand with the door": ["follow-hand"],
    # approach
    "come from above": ["approach=top"],
    "grab it from the side": ["approach=side approach"],
    "approach from the left": ["approach=left"],
    "take it from the front": ["approach=front"],
    "don't come from above": ["not approach=top"],
    "try it from a different direction": ["approach=different"],
    # where to hold
    "hold it by the rim": ["hold-at=rim"],
    "take hold of the handle": ["hold-at=handle"],
    "grip the cap": ["hold-at=cap"],
    "grasp it at the left end": ["hold-at=left end"],
    "pick it up by the edge": ["hold-at=edge"],
    "hold it at the top": ["hold-at=top"],
    # offsets
    "a bit to the left": ["offset=left"],
    "3 cm higher": ["offset=up 0.03m"],
    "go two centimetres lower": ["offset=down 0.02m"],
    "15 mm to the right": ["offset=right 0.015m"],
    "a little more to the right please": ["offset=right"],
    "half a centimetre up": ["offset=up 0.005m"],
    "move 5 cm back": ["offset=out 0.05m"],
    # amounts
    "open it further": ["farther"],
    "pull 4 cm further": ["farther 0.04m"],
    "not so far": ["less-far"],
    "only half as far": ["less-far"],
    "all the way": ["all-the-way"],
    "until it stands wide open": ["all-the-way"],
    "swing it through 60 degrees": ["arc", "angle 60deg"],
    "that's not wide enough": ["farther"],
    # the hand
    "turn the hand by a quarter turn": ["turn-hand 90deg"],
    "rotate your gripper 45 degrees to the left": ["turn-hand=left 45deg"],
    "twist it by 30 degrees clockwise": ["turn-thing=clockwise 30deg"],
    "tilt the hand down by 20 degrees": ["tilt=down 20deg"],
    "close the fingers vertically": ["fingers=vertically"],
    "the fingers should be horizontal": ["fingers=horizontal"],
    "open your fingers wider": ["finger-width=wider"],
    "open the gripper only halfway": ["finger-width=only halfway"],
    "don't open the gripper so wide": ["finger-width=less"],
    "the bar wasn't between your fingers": ["between"],
    # order, repetition, force
    "open the gripper first": ["open-first"],
    "close your hand before you go there": ["close-first"],
    "back off before turning": ["back-off-before"],
    "let go of it": ["release"],
    "keep hold of the handle": ["hold-on"],
    "move away afterwards": ["back-off"],
    "do it twice": ["repeat=twice x2"],
    "push it three times": ["way=in", "repeat=three times x3"],
    "squeeze it gently": ["force=gently"],
    "grip more firmly": ["force=firmly"],
    "go slower": ["speed=slower"],
    "push it": ["way=in"],
    "lift it up": ["way=up"],
    "pull the handle down": ["way=down"],
    "put it in the middle": ["centre"],
    "look again": ["look"],
}  # fmt: skip


def test_the_table_is_as_large_as_promised():
    assert len(PHRASINGS) >= 60


@pytest.mark.parametrize("text", PHRASINGS)
def test_a_phrasing_means_its_edit(text):
    assert shown(text) == PHRASINGS[text]
    assert read(text).not_understood == ()


SAYINGS = yaml.safe_load(resources.files("memo_core.teachers").joinpath("phrases.yaml").read_text(encoding="utf-8"))
EXPECTED = {
    "untouched-handle": {"hold-at"},
    "missed-grip": {"between"},
    "straight-on-swing": {"arc"},
    "wrong-way-round": {"reverse"},
    "not-far-enough": {"farther", "all-the-way"},
    "arc-on-slide": {"straight"},
    "slide-not-far-enough": {"farther", "all-the-way"},
    "not-closed": {"farther", "all-the-way"},
    "closed-beside": {"offset"},
    "lost-on-lift": {"offset", "between", "force"},
    "still-held": {"release"},
    "dropped-short": {"farther", "all-the-way"},
}


@pytest.mark.parametrize("cause", EXPECTED)
def test_what_the_simulated_participant_says_is_understood(cause):
    for words in SAYINGS[cause]:
        said = words.format(object="crate", place="shelf", side="left", amount="3 cm")
        assert {edit.kind for edit in read(said).edits} & EXPECTED[cause], said


@pytest.mark.parametrize("words", SAYINGS["unclear"])
def test_words_without_a_hint_are_not_understood_rather_than_guessed(words):
    reading = read(words)
    assert reading.edits == () and reading.not_understood


def test_nonsense_has_no_edits_and_is_reported_whole():
    rng = random.Random(3)
    for _ in range(200):
        words = ["".join(rng.choice("bcdfghjklmnpqrstvwxz") for _ in range(rng.randint(4, 9))) for _ in range(8)]
        reading = read(" ".join(words))
        assert reading.edits == ()
        assert reading.not_understood == (" ".join(words),)


def test_words_left_over_beside_an_edit_are_reported_and_names_in_the_scene_are_not():
    assert read("pull the crate handle along a parabolic arc").not_understood == ("parabolic",)
    assert read("pull the crate handle along an arc").not_understood == ()


def test_words_may_be_replaced_by_a_config_and_mistakes_in_them_are_named(tmp_path):
    source = resources.files("memo_llm.offline").joinpath("vocabulary.yaml").read_text(encoding="utf-8")
    own = tmp_path / "own.yaml"
    own.write_text(
        source.replace("words:\n", 'words:\n  zig: "zigzag"\n', 1).replace(
            "phrases:\n", 'phrases:\n  - edit: arc\n    match: ["{zig}"]\n    say: "Zigzag."\n', 1
        )
    )
    assert [e.kind for e in read_sentence("zigzag", Vocabulary.load(str(own))).edits] == ["arc"]
    own.write_text(source.replace("{hinge}", "{hinj}"))
    with pytest.raises(InvalidArgument, match="hinj"):
        Vocabulary.load(str(own))
    own.write_text("words: {}\n")
    with pytest.raises(InvalidArgument, match="no key"):
        Vocabulary.load(str(own))
    with pytest.raises(InvalidArgument, match="cannot be read"):
        Vocabulary.load(str(tmp_path / "none.yaml"))


NAMES = [
    "microwave",
    "oven",
    "fridge",
    "refrigerator",
    "drawer",
    "cupboard",
    "cabinet",
    "cube",
    "cubes",
    "food",
    "apple",
    "chest",
    "toaster",
    "dishwasher",
]


def test_no_name_of_a_task_or_object_occurs_in_the_backend():
    folder = Path(memo_llm.__file__).parent
    # What it was measured to do is listed by tasks' names, in a folder of its own that no code of the backend reads.
    files = [path for path in folder.rglob("*") if path.suffix in (".py", ".yaml") and path.parent.name != "measured"]
    assert len(files) > 10
    for path in files:
        words = set(re.findall(r"[a-z]+", path.read_text(encoding="utf-8").lower()))
        assert not words & set(NAMES), f"{path.name}: {sorted(words & set(NAMES))}"


def test_a_word_that_is_as_long_as_a_page_costs_no_memory():
    tracemalloc.start()
    assert in_full("lower " + "h" * 20_000, {"lower"}).startswith("lower h")
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 1_000_000
