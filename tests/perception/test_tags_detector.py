"""Tags stuck to things name them, and nothing else."""

from __future__ import annotations

import numpy as np
from drawn_tags import EYE, TAGS, picture
from memo_perception.cameras.detectors.detector import Request
from memo_perception.cameras.detectors.tags import TagsDetector
from memo_perception.cameras.frames import Frame, Intrinsics
from memo_perception.cameras.regions import Region
from memo_perception.cameras.settings import TaggedThing, TagsSettings


def request(with_region: bool = True) -> Request:
    rgb = picture()
    frame = Frame("front", rgb, np.ones((480, 640), dtype=np.float32), Intrinsics(610, 608, 319.5, 239.5), EYE)
    around = np.zeros((480, 640), dtype=bool)
    u, v = frame.project(np.array(TAGS[3].position))[0]
    around[int(v) - 60 : int(v) + 60, int(u) - 60 : int(u) + 60] = True
    regions = (Region(5, np.zeros((1, 3)), np.zeros((1, 3), dtype=np.uint8), {"front": around}),)
    return Request((frame,), regions if with_region else ())


def test_a_tag_names_the_region_that_it_is_on():
    found = TagsDetector(TagsSettings(things=(TaggedThing(3, "oven", "fixture"),))).detect(request())
    oven = next(one for one in found if one.label == "oven")
    assert oven.regions == {5} and not oven.masks and oven.kind == "fixture" and oven.confidence > 0.9


def test_an_unknown_tag_is_an_unknown_thing_and_flagged():
    found = TagsDetector(TagsSettings(things=(TaggedThing(3, "oven"),))).detect(request())
    other = next(one for one in found if one.key == "tag 7")
    assert other.label == "unknown thing" and "tag 7" in other.flag and other.confidence < 0.2


def test_without_a_region_the_tag_itself_is_where_the_thing_is():
    found = TagsDetector(TagsSettings(things=(TaggedThing(3, "oven"),))).detect(request(with_region=False))
    oven = next(one for one in found if one.label == "oven")
    assert 100 < oven.masks["front"].sum() < 4000


def test_a_part_comes_after_its_owner_and_not_without_it():
    things = (TaggedThing(7, "door", "part", "oven"), TaggedThing(3, "oven", "fixture"))
    assert [one.label for one in TagsDetector(TagsSettings(things=things)).detect(request())] == ["oven", "door"]
    alone = TagsDetector(TagsSettings(things=things[:1])).detect(request())
    assert "door" not in [one.label for one in alone]
