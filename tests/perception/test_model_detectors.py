"""Detectors that ask a language model: what is asked, asked again, made of its answers, and what a run counts."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from memo_perception.cameras.detectors.detector import Request
from memo_perception.cameras.detectors.marks import MarksDetector, marked
from memo_perception.cameras.detectors.points import PointsDetector, cut_out
from memo_perception.cameras.frames import Frame, Intrinsics
from memo_perception.cameras.inventory import Hint, Item
from memo_perception.cameras.regions import Region
from memo_perception.cameras.settings import MarksSettings, PointsSettings
from PIL import Image as Picture

from memo_core.errors import BackendUnavailable
from memo_core.testing.fake_llm import ScriptedModel

WIDE, HIGH = 320, 240
BOXES = {1: (40, 60, 100, 140), 2: (160, 40, 300, 200), 3: (170, 50, 220, 190)}  # left, top, right, bottom
COLOURS = {1: (200, 30, 30), 2: (230, 230, 230), 3: (60, 60, 200)}


def frame(name: str = "front", shift: int = 0) -> Frame:
    rgb = np.full((HIGH, WIDE, 3), 110, dtype=np.uint8)
    for number, (left, top, right, bottom) in BOXES.items():
        rgb[top:bottom, left + shift : right + shift] = COLOURS[number]
    return Frame(name, rgb, np.ones((HIGH, WIDE), dtype=np.float32), Intrinsics(300, 300, 159.5, 119.5), pose())


def pose():
    from memo_core.scene.pose import look_at

    return look_at((0.0, -1.0, 0.5), (0.5, 0.0, 0.0))


def regions(*frames: Frame, shifts: tuple[int, ...] = (0,)) -> tuple[Region, ...]:
    found = []
    for number, (left, top, right, bottom) in BOXES.items():
        masks = {}
        for one, shift in zip(frames, shifts, strict=True):
            mask = np.zeros((HIGH, WIDE), dtype=bool)
            mask[top:bottom, left + shift : right + shift] = True
            if number == 2:
                mask[50:190, 170 + shift : 220 + shift] = False  # the third region is before it
            masks[one.name] = mask
        found.append(Region(number, np.zeros((10, 3)), np.zeros((10, 3), dtype=np.uint8), masks))
    return tuple(found)


def asked(detector, request: Request, *answers):
    model = ScriptedModel({"look": [one if isinstance(one, str) else json.dumps({"things": one}) for one in answers]})
    detector.use_model(model.answer)
    return detector.detect(request), model


CUP = {"label": "cup", "marks": [1], "kind": "object", "part_of": None, "state": None}
FRIDGE = {"label": "fridge", "marks": [2, 3], "kind": "fixture", "part_of": None, "state": None}
DOOR = {"label": "door", "marks": [3], "kind": "part", "part_of": "fridge", "state": "closed"}


def one_look(**more) -> Request:
    one = frame()
    return Request((one,), regions(one), **more)


def test_marks_become_detections_whole_things_first():
    found, model = asked(MarksDetector(), one_look(), [DOOR, CUP, FRIDGE])
    assert [(one.label, one.regions, one.part_of, one.state) for one in found] == [
        ("cup", {1}, None, None),
        ("fridge", {2, 3}, None, None),
        ("door", {3}, "fridge", "closed"),
    ]
    assert all(one.confidence > 0.8 and one.source == "marks" for one in found)
    (request,) = model.asked
    sent = Picture.open(io.BytesIO(request.messages[0].images[0].data))
    assert sent.size == (WIDE, HIGH) and request.response_schema is not None


def test_the_prompt_tells_the_inventory_and_what_people_said():
    hint = Hint("that is not a cup", "cup", instead="salt shaker")
    _, model = asked(MarksDetector(), one_look(inventory=(Item("salt shaker"),), hints=(hint,)), [CUP])
    text = model.prompts("look")[0]
    assert "salt shaker" in text and '"that is not a cup"' in text and "only what is visible" in text.lower()


def test_every_region_is_outlined_and_numbered_on_the_picture():
    one = frame()
    drawn = marked(one, regions(one))
    for left, top, right, bottom in BOXES.values():
        assert (drawn[top : top + 2, left + 5 : right - 5] != one.rgb[top : top + 2, left + 5 : right - 5]).any()
        middle = (slice(top + 5, bottom - 5), slice(left + 5, right - 5))
        assert (drawn[middle] != one.rgb[middle]).any()
    assert (one.rgb[5, 5] == drawn[5, 5]).all()


def test_an_unusable_answer_is_asked_about_again_with_the_reason():
    found, model = asked(MarksDetector(), one_look(), "I see a cup.", [CUP | {"marks": [7]}], [CUP])
    assert [one.label for one in found] == ["cup"] and len(model.asked) == 3
    assert "no JSON" in model.asked[1].messages[-1].text
    assert "there is no mark 7" in model.asked[2].messages[-1].text


def test_asking_again_is_bounded_and_then_nothing_is_invented():
    found, model = asked(MarksDetector(MarksSettings(reasks=1)), one_look(), "nonsense", "still nonsense", [CUP])
    assert len(model.asked) == 2
    assert [one.label for one in found] == ["unknown thing"] * 3
    assert all(one.flag and one.confidence < 0.2 for one in found)
    assert len({one.name for one in found}) == 3


def test_the_best_of_several_doubtful_answers_is_taken_and_flagged():
    bad = [CUP | {"marks": [1, 9]}]
    found, _ = asked(MarksDetector(), one_look(), "nonsense", bad, bad)
    assert [(one.label, bool(one.flag)) for one in found] == [("cup", True)]


def test_without_regions_nothing_is_asked_and_without_a_model_it_is_said():
    found, model = asked(MarksDetector(), Request((frame(),)))
    assert found == () and model.asked == []
    with pytest.raises(BackendUnavailable, match="language model"):
        MarksDetector().detect(one_look())


def box(number: int) -> list[float]:
    left, top, right, bottom = BOXES[number]
    return [1000 * top / HIGH, 1000 * left / WIDE, 1000 * bottom / HIGH, 1000 * right / WIDE]


def test_boxes_find_the_regions_in_them_and_a_part_is_not_its_owner():
    things = [
        {"label": "fridge", "kind": "fixture", "box_2d": box(2)},
        {"label": "door", "kind": "part", "part_of": "fridge", "state": "open", "box_2d": box(3)},
        {"label": "cup", "point": [1000 * 100 / HIGH, 1000 * 70 / WIDE]},
    ]
    found, _ = asked(PointsDetector(), one_look(), things)
    assert [(one.label, one.regions, one.part_of) for one in found] == [
        ("fridge", {2}, None),
        ("cup", {1}, None),
        ("door", {3}, "fridge"),
    ]


def test_a_thing_seen_by_two_cameras_is_one_thing():
    frames = (frame("front"), frame("side", 10))
    request = Request(frames, regions(*frames, shifts=(0, 10)))
    shifted = box(1)
    shifted[1], shifted[3] = shifted[1] + 1000 * 10 / WIDE, shifted[3] + 1000 * 10 / WIDE
    found, model = asked(
        PointsDetector(), request, [{"label": "cup", "box_2d": box(1)}], [{"label": "Cup", "box_2d": shifted}]
    )
    assert len(model.asked) == 2
    assert [(one.label, one.regions, one.flag) for one in found] == [("cup", {1}, "")]


def test_two_names_for_one_region_in_two_pictures_are_one_flagged_thing():
    frames = (frame("front"), frame("side"))
    request = Request(frames, regions(*frames, shifts=(0, 0)))
    found, _ = asked(
        PointsDetector(), request, [{"label": "cup", "box_2d": box(1)}], [{"label": "bowl", "box_2d": box(1)}]
    )
    assert [(one.label, one.regions) for one in found] == [("cup", {1})]
    assert "bowl" in found[0].flag and found[0].confidence < 0.5


def test_a_box_on_the_bare_table_is_flagged_and_a_point_on_it_is_nothing():
    things = [{"label": "spoon", "box_2d": [850, 50, 950, 300]}, {"label": "fork", "point": [900, 700]}]
    found, _ = asked(PointsDetector(), one_look(), things)
    assert [one.label for one in found] == ["spoon"]
    assert "nothing stands out" in found[0].flag and found[0].confidence < 0.5


def test_what_is_in_a_box_is_cut_out_where_geometry_gave_no_regions():
    left, top, right, bottom = BOXES[1]
    mask = cut_out(frame().rgb, (left - 8, top - 8, right + 8, bottom + 8))
    truth = np.zeros((HIGH, WIDE), dtype=bool)
    truth[top:bottom, left:right] = True
    assert (mask & truth).sum() / (mask | truth).sum() > 0.9
    found, _ = asked(PointsDetector(), Request((frame(),)), [{"label": "cup", "box_2d": box(1)}])
    assert found[0].masks["front"].sum() > 1000 and not found[0].flag


def test_the_coordinates_of_a_model_are_a_setting():
    left, top, right, bottom = BOXES[1]
    pixels = PointsDetector(PointsSettings(convention="claude"))
    found, model = asked(pixels, one_look(), [{"label": "cup", "box": [left, top, right, bottom]}])
    assert found[0].regions == {1} and f"{WIDE} wide" in model.prompts("look")[0]
    own = PointsDetector(PointsSettings(convention="qwen3-vl", order="yx", scale=1.0))
    found, _ = asked(
        own, one_look(), [{"label": "cup", "bbox_2d": [top / HIGH, left / WIDE, bottom / HIGH, right / WIDE]}]
    )
    assert found[0].regions == {1}
