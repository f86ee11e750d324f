"""Malformed and mistaken answers of models that see: read, or told what is wrong, never a crash, and never a thing
without a place, or with a doubtful one, that is not flagged."""

from __future__ import annotations

import json

import pytest
from hypothesis import given, strategies as st
from memo_perception.cameras.detectors.conventions import CONVENTIONS, Convention
from memo_perception.cameras.detectors.marks import read_marks
from memo_perception.cameras.detectors.model_answers import Reading
from memo_perception.cameras.detectors.points import read_points

MARKS = {1, 2, 3, 4, 5}
SIZE = (640, 480)
CUP = {"label": "cup", "marks": [1], "kind": "object", "part_of": None, "state": None}
FRIDGE = {"label": "fridge", "marks": [2, 3], "kind": "fixture", "part_of": None, "state": None}
DOOR = {"label": "door", "marks": [3], "kind": "part", "part_of": "fridge", "state": "closed"}
INSIDE = {"label": "inside", "marks": [], "kind": "space", "part_of": "fridge", "state": None}


def said(*things, **key) -> str:
    return json.dumps({key.get("key", "things"): things})


def without(thing: dict, *keys: str, **changed) -> dict:
    return {key: value for key, value in (thing | changed).items() if key not in keys}


# answer, things that are read (a "?" before what is flagged), words of the problem (None: the answer is all right)
MARKED = {
    "as asked": (said(CUP, FRIDGE, DOOR, INSIDE), "cup fridge door inside", None),
    "nothing there": (said(), "", None),
    "an empty list": ("[]", "", None),
    "fenced": (f"```json\n{said(CUP)}\n```", "cup", None),
    "prose around": (f"Sure! Here is what I see:\n{said(CUP)}\nLet me know.", "cup", None),
    "thoughts before": (f"<think>there are {{things}}</think>{said(CUP)}", "cup", None),
    "a bare list": (json.dumps([CUP, FRIDGE]), "cup fridge", None),
    "one bare object": (json.dumps(CUP), "cup", None),
    "another list's name": (said(CUP, key="objects"), "cup", None),
    "single quotes": (str({"things": [CUP]}), "cup", None),
    "trailing comma": (said(CUP)[:-2] + ",]}", "cup", None),
    "a comment in it": (said(CUP).replace("[1],", "[1], // the red one\n"), "cup", None),
    "curly quotes": (said(CUP).replace('"', "\u201c"), "cup", None),
    "marks as a number": (said(without(CUP, marks=1)), "cup", None),
    "marks as text": (said(without(CUP, marks="1")), "cup", None),
    "marks as texts": (said(without(CUP, marks=["1", "4"])), "cup", None),
    "marks as floats": (said(without(CUP, marks=[1.0])), "cup", None),
    "mark, not marks": (said(without(CUP, "marks", mark=1)), "cup", None),
    "name, not label": (said(without(CUP, "label", name="cup")), "cup", None),
    "a number in the label": (said(without(CUP, label="cup 1")), "cup", None),
    "an underscore": (said(without(CUP, label="red_cup")), "red cup", None),
    "said twice": (said(CUP, CUP), "cup", None),
    "owner in capitals": (said(FRIDGE, without(DOOR, part_of="Fridge")), "fridge door", None),
    "keys are missing": (said({"label": "cup", "marks": [1]}), "cup", None),
    "a strange state": (said(FRIDGE, without(DOOR, state="wobbly")), "fridge door", None),
    "two cups apart": (said(CUP, without(CUP, marks=[4])), "cup cup", None),
    "empty": ("", "", "no JSON"),
    "white space": (" \n\t", "", "no JSON"),
    "only prose": ("I see a cup and a fridge.", "", "no JSON"),
    "a refusal": ("I'm sorry, I can't help with that.", "", "no JSON"),
    "an apology in JSON": ('{"error": "no image provided"}', "", "no JSON"),
    "cut off in a thing": (said(CUP, FRIDGE)[:-30], "cup", "breaks off"),
    "cut off in the list": (said(CUP)[:-2], "cup", "breaks off"),
    "cut off at once": ('{"things": [{"label": "cu', "", "no JSON"),
    "no label": (said(without(CUP, "label")), "", "no label"),
    "an empty label": (said(without(CUP, label="  ")), "", "no label"),
    "a label that is no text": (said(without(CUP, label=7)), "", "no label"),
    "a label that says nothing": (said(without(CUP, label="unknown")), "", "no label"),
    "a label as long as a story": (said(without(CUP, label="cup " * 40)), "", "no label"),
    "no marks": (said(without(CUP, "marks")), "", "no marks"),
    "empty marks": (said(without(CUP, marks=[])), "", "no marks"),
    "marks in words": (said(without(CUP, marks="the left one")), "", "not a list of numbers"),
    "marks that are null": (said(without(CUP, marks=[None])), "", "not a list of numbers"),
    "NaN": (said(CUP).replace("[1]", "[NaN]"), "", "not a list of numbers"),
    "infinity": (said(CUP).replace("[1]", "[Infinity]"), "", "not a list of numbers"),
    "true": (said(CUP).replace("[1]", "[true]"), "", "not a list of numbers"),
    "a mark that is not there": (said(without(CUP, marks=[9])), "", "there is no mark 9"),
    "one of two is not there": (said(without(CUP, marks=[1, 9])), "?cup", "there is no mark 9"),
    "half a mark": (said(without(CUP, marks=[1.5])), "", "there is no mark 1.5"),
    "a huge mark": (said(without(CUP, marks=[10**400])), "", "not a list of numbers"),
    "two things, one mark": (said(CUP, without(CUP, label="bowl")), "?cup", "both said to be at mark 1"),
    "two things share a mark": (said(CUP, without(CUP, label="bowl", marks=[1, 4])), "?cup bowl", "at mark 1"),
    "three names for one": (said(*(without(CUP, label=one) for one in ("cup", "mug", "jar"))), "?cup", "both said"),
    "part of what is not there": (said(without(DOOR, part_of="oven")), "?door", "'oven', which is not named"),
    "part of nothing": (said(without(DOOR, part_of=None)), "?door", "not said what it is part of"),
    "part of itself": (said(without(DOOR, part_of="door")), "?door", "part of itself"),
    "parts of each other": (
        said(without(DOOR, part_of="lid"), without(DOOR, label="lid", part_of="door", marks=[4])),
        "?door ?lid",
        "part of itself",
    ),
    "inside of nothing": (said(without(INSIDE, part_of=None)), "", "not said what it is part of"),
    "inside of what is not there": (said(without(INSIDE, part_of="oven")), "", "which is not named"),
    "which of two": (
        said(FRIDGE, without(FRIDGE, marks=[4]), without(DOOR, marks=[5])),
        "fridge fridge ?door",
        "there are several",
    ),
    "an unknown kind": (said(without(CUP, kind="kitchenware")), "?cup", "is no kind"),
    "a kind that is no text": (said(without(CUP, kind=["object"])), "cup", None),
    "things that are texts": ('{"things": ["cup", "fridge"]}', "", "no JSON"),
    "deeply nested": ('{"a":' * 200 + said(CUP) + "}" * 200, "cup", None),
    "endlessly nested": ('{"a":' * 9000, "", "no JSON"),
    "a draft and the answer": (f"{said(without(CUP, label='mug'))} No, rather: {said(CUP)}", "cup", None),
    "things are no list": ('{"things": {"cup": 1}}', "", "no JSON"),
    "marks as a table": (said(without(CUP, marks={"a": 1})), "", "not a list of numbers"),
    "a label in a list": (said(without(CUP, label=["cup"])), "", "no label"),
    "more than anybody has": (
        json.dumps({"things": [without(CUP, label=f"cup {chr(97 + n % 26)}{n // 26}x") for n in range(70)]}),
        None,
        "at most 60",
    ),
}

BOX = {"label": "cup", "box_2d": [100, 200, 300, 400]}  # ymin, xmin, ymax, xmax
BOWL = {"label": "bowl", "box_2d": [500, 500, 700, 800]}
BOXED = {
    "as asked": (said(BOX, BOWL), "cup bowl", None),
    "a bare list": (json.dumps([BOX, BOWL]), "cup bowl", None),
    "box, not box_2d": (said(without(BOX, "box_2d", box=[100, 200, 300, 400])), "cup", None),
    "corners exchanged": (said(without(BOX, box_2d=[300, 400, 100, 200])), "cup", None),
    "numbers as texts": (said(without(BOX, box_2d=["100", "200", "300", "400"])), "cup", None),
    "a text": (said(without(BOX, box_2d="[100, 200, 300, 400]")), "cup", None),
    "a list in a list": (said(without(BOX, box_2d=[[100, 200, 300, 400]])), "cup", None),
    "a little outside": (said(without(BOX, box_2d=[-5, 200, 300, 1010])), "cup", None),
    "a point": (said({"label": "cup", "point": [150, 300]}), "cup", None),
    "the same twice": (said(BOX, without(BOX, box_2d=[101, 200, 300, 401])), "cup", None),
    "a part in its owner's box": (
        said(BOX, {"label": "handle", "kind": "part", "part_of": "cup", "box_2d": [100, 200, 300, 400]}),
        "cup handle",
        None,
    ),
    "booleans": (said(without(BOX, box_2d=[True, False, True, False])), "", "not four finite numbers"),
    "a table": (said(without(BOX, box_2d={"top": 1})), "", "not four finite numbers"),
    "enormous": (said(without(BOX, box_2d=[1e30, 1e30, 1e31, 1e31])), "", "outside of the picture"),
    "three numbers": (said(without(BOX, box_2d=[100, 200, 300])), "", "not four finite numbers"),
    "five numbers": (said(without(BOX, box_2d=[1, 2, 3, 4, 5])), "", "not four finite numbers"),
    "NaN in it": (said(BOX).replace("100", "NaN"), "", "not four finite numbers"),
    "infinite": (said(BOX).replace("100", "-Infinity"), "", "not four finite numbers"),
    "1e999": (said(BOX).replace("100", "1e999"), "", "not four finite numbers"),
    "null": (said(without(BOX, box_2d=[100, None, 300, 400])), "", "not four finite numbers"),
    "no place": (said({"label": "cup"}), "", "neither"),
    "far outside": (said(without(BOX, box_2d=[100, 200, 300, 4000])), "", "outside of the picture"),
    "beside the picture": (said(without(BOX, box_2d=[1500, 1500, 1700, 1700])), "", "outside of the picture"),
    "negative": (said(without(BOX, box_2d=[-500, -400, -300, -200])), "", "outside of the picture"),
    "no area": (said(without(BOX, box_2d=[100, 200, 100, 400])), "", "no area"),
    "the whole picture": (said(without(BOX, box_2d=[0, 0, 1000, 1000])), "?cup", "the whole picture"),
    "two things, one box": (said(BOX, without(BOX, label="bowl")), "?cup", "both said to be at one place"),
    "two things, nearly one box": (
        said(BOX, {"label": "bowl", "box_2d": [102, 203, 299, 398]}),
        "?cup",
        "both said to be at one place",
    ),
    "two things at one point": (
        said({"label": "cup", "point": [100, 100]}, {"label": "bowl", "point": [100, 100]}),
        "?cup",
        "one place",
    ),
    "a point with three numbers": (said({"label": "cup", "point": [1, 2, 3]}), "", "not two finite numbers"),
    "a point outside": (said({"label": "cup", "point": [1, 2000]}), "", "outside of the picture"),
    "cut off": (json.dumps([BOX, BOWL])[:-25], "cup", "breaks off"),
    "a name that is a place": (said({"label": None, "box_2d": [1, 2, 300, 400]}), "", "no label"),
}


def check(reading: Reading, things: str | None, problem: str | None) -> None:
    if things is not None:
        assert " ".join(("?" if one.flag else "") + one.label for one in reading.things) == things
    if problem is None:
        assert reading.problems == ()
    else:
        assert any(problem in one for one in reading.problems), reading.problems
    for one in reading.things:
        assert one.marks <= MARKS
        assert one.marks or one.box or one.point or (one.kind == "space" and one.part_of)
        assert one.part_of is None or one.part_of in {other.label for other in reading.things}
        assert one.confidence < 0.5 or not one.flag
        if one.box:
            assert 0 <= one.box[0] < one.box[2] <= SIZE[0] and 0 <= one.box[1] < one.box[3] <= SIZE[1]
        if one.point:
            assert 0 <= one.point[0] < SIZE[0] and 0 <= one.point[1] < SIZE[1]


@pytest.mark.parametrize("case", MARKED)
def test_answers_with_marks(case):
    text, things, problem = MARKED[case]
    check(read_marks(text, MARKS), things, problem)


@pytest.mark.parametrize("case", BOXED)
def test_answers_with_boxes(case):
    text, things, problem = BOXED[case]
    check(read_points(text, CONVENTIONS["gemini-robotics-er"], SIZE, SIZE), things, problem)


def test_at_least_sixty_of_them_are_wrong():
    assert sum(problem is not None for _, _, problem in [*MARKED.values(), *BOXED.values()]) >= 60


_VALUES = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["label", "marks", "box_2d", "point", "kind", "part_of", "state", "things", "x"]), inner
        )
    ),
    max_leaves=25,
)


@given(_VALUES)
def test_no_json_is_a_crash_or_a_phantom(value):
    text = json.dumps(value)
    check(read_marks(text, MARKS), None, None if not read_marks(text, MARKS).problems else "")
    reading = read_points(text, CONVENTIONS["gemini-robotics-er"], SIZE, SIZE)
    check(reading, None, None if not reading.problems else "")


@given(st.text(max_size=200))
def test_no_text_is_a_crash(text):
    read_marks(text, MARKS)
    read_points(text, CONVENTIONS["molmo"], SIZE, SIZE)


@pytest.mark.parametrize(
    ("convention", "sent", "value"),
    [
        ("gemini-robotics-er", (640, 480), [250, 100, 750, 300]),
        ("qwen3-vl", (640, 480), [100, 250, 300, 750]),
        ("qwen2.5-vl", (644, 476), [64.4, 119, 193.2, 357]),
        ("claude", (640, 480), [64, 120, 192, 360]),
        ("molmo", (640, 480), [10, 25, 30, 75]),
        ("molmo2", (640, 480), [100, 250, 300, 750]),
    ],
)
def test_one_box_in_the_coordinates_of_each_model(convention, sent, value):
    own = CONVENTIONS[convention]
    (thing,) = read_points(said({"label": "cup", own.key: value}), own, sent, SIZE).things
    assert thing.box == pytest.approx((64, 120, 192, 360))


def test_pixels_are_those_of_the_picture_that_was_sent():
    import numpy as np

    large = np.zeros((2160, 3840, 3), dtype=np.uint8)
    own = CONVENTIONS["claude"]
    picture = own.sent(large)
    assert max(picture.shape) == 1568
    (thing,) = read_points(said({"label": "cup", "box": [0, 0, 784, 441]}), own, (1568, 882), (3840, 2160)).things
    assert thing.box == pytest.approx((0, 0, 1920, 1080))
    assert CONVENTIONS["qwen2.5-vl"].sent(np.zeros((480, 640, 3), dtype=np.uint8)).shape[:2] == (476, 644)


def test_coordinates_in_the_wrong_order_are_flagged_where_that_can_be_told():
    pixels = Convention("xy", 0, "box")
    reading = read_points(said({"label": "cup", "box": [100, 500, 200, 600]}), pixels, SIZE, SIZE)
    assert "exchanged" in reading.problems[0]
    assert reading.things[0].box == (500, 100, 600, 200) and reading.things[0].flag


def test_molmo_points_in_its_own_way():
    text = (
        ' <points x1="10.0" y1="20.0" x2="50.0" y2="60.0" alt="cups">cups</points> <point x="75" y="50">fridge</point>'
    )
    reading = read_points(text, CONVENTIONS["molmo"], SIZE, SIZE)
    assert [(one.label, one.point) for one in reading.things] == [
        ("cups", (64.0, 96.0)),
        ("cups", (320.0, 288.0)),
        ("fridge", (480.0, 240.0)),
    ]
