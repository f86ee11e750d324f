"""Tags that do not move tell whether a camera is still where it was calibrated."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from boards import LENS, example
from drawn_tags import EYE, SIZE, TAGS, picture
from memo_perception.calibration.tags import find_tags

from memo_core.errors import InvalidArgument
from memo_core.scene.pose import Pose, look_at


def at(eye: Pose):
    one = example()
    return attrs.evolve(one, found=attrs.evolve(one.found, camera=eye))


def test_tags_are_found_where_they_are():
    found = {tag.number: tag for tag in find_tags(picture(), "apriltag_36h11", SIZE, LENS)}
    assert set(found) == set(TAGS)
    for number, tag in found.items():
        far, angle = (EYE * tag.pose).distance(TAGS[number])
        assert far < 0.006 and (angle < np.radians(4) or not tag.certain)


def test_an_unmoved_camera_has_not_drifted_and_a_moved_one_has():
    known = at(EYE).remember([picture(seed=seed) for seed in range(3)], Pose(), "apriltag_36h11", SIZE)
    assert {tag.number for tag in known.tags} == set(TAGS)
    still = known.drifts([picture(seed=seed) for seed in range(3, 6)], Pose())
    assert len(still) == 2 and max(one.distance for one in still) < 0.004
    bumped = Pose(tuple(np.asarray(EYE.position) + [0.0, 0.02, 0.0]), EYE.orientation)
    moved = known.drifts([picture(bumped, seed=seed) for seed in range(3)], Pose())
    assert all(0.015 < one.distance < 0.025 for one in moved)


def test_a_tag_that_was_taken_away_is_not_reported_as_seen():
    known = at(EYE).remember([picture()], Pose(), "apriltag_36h11", SIZE)
    assert [one.tag.number for one in known.drifts([picture(tags={7: TAGS[7]})], Pose())] == [7]


def test_a_camera_on_the_hand_is_checked_wherever_the_hand_is():
    on_hand = Pose((0.05, 0.0, -0.03), (0.99, 0.1, 0.0, 0.1))
    other = look_at((0.7, 0.4, 0.6), (0.45, 0.0, 0.0))
    one = example()
    one = attrs.evolve(one, found=attrs.evolve(one.found, mount="hand", camera=on_hand))
    known = one.remember([picture(EYE)], EYE * on_hand.inverse(), "apriltag_36h11", SIZE)
    seen = known.drifts([picture(other)], other * on_hand.inverse())
    assert len(seen) == 2 and max(drift.distance for drift in seen) < 0.01


def test_a_number_that_is_seen_twice_is_left_out():
    one = picture(tags={3: TAGS[3], 7: TAGS[7]})
    twice = one.copy()
    seen = next(tag for tag in find_tags(one, "apriltag_36h11", SIZE, LENS) if tag.number == 3)
    left, top = seen.corners.min(axis=0).astype(int) - 12
    right, bottom = seen.corners.max(axis=0).astype(int) + 12
    twice[5 : 5 + bottom - top, 5 : 5 + right - left] = one[top:bottom, left:right]
    assert [tag.number for tag in find_tags(twice, "apriltag_36h11", SIZE, LENS)] == [7]


def test_pictures_of_another_size_are_refused():
    with pytest.raises(InvalidArgument, match="640x480"):
        at(EYE).remember([np.zeros((240, 320, 3), dtype=np.uint8)], Pose(), "apriltag_36h11", SIZE)
