"""Detectors in a chain refine each other by one rule, and markers tell poses."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from boards import LENS
from drawn_tags import EYE, SIZE, TAGS, picture
from memo_perception.cameras.backend import Cameras
from memo_perception.cameras.detectors.chain import Chain
from memo_perception.cameras.detectors.detector import Detection, Detector, Request
from memo_perception.cameras.detectors.local import LocalDetector
from memo_perception.cameras.detectors.oracle import OracleDetector
from memo_perception.cameras.detectors.tags import TagsDetector
from memo_perception.cameras.frames import Frame, Intrinsics
from memo_perception.cameras.settings import (
    CamerasSettings,
    LocalSettings,
    SimulatedSettings,
    TaggedThing,
    TagsSettings,
)
from memo_perception.cameras.sources.simulated import SimulatedSource

from memo_core.errors import InvalidArgument
from memo_core.scene.pose import Pose, look_at
from tests.perception.small_scene import looking_at, scene
from tests.perception.tiny_models import sam2

OTHER_EYE = look_at((0.8, 0.4, 0.6), (0.45, 0.0, 0.0))


class Says(Detector):
    """A stage that says what it is given, and remembers what it was asked."""

    needs_regions = False

    def __init__(self, *said: Detection, cuts_out: bool = False) -> None:
        self.said, self.cuts_out, self.asked = said, cuts_out, []

    def detect(self, request: Request) -> tuple[Detection, ...]:
        self.asked.append(request)
        return self.said


def square(left, size=10):
    mask = np.zeros((40, 60), dtype=bool)
    mask[10 : 10 + size, left : left + size] = True
    return {"front": mask}


def frame():
    return Frame(
        "front", np.zeros((40, 60, 3), np.uint8), np.ones((40, 60), np.float32), Intrinsics(50, 50, 30, 20), Pose()
    )


def chained(*stages):
    return Chain(stages).detect(Request((frame(),)))


def test_what_a_later_stage_says_holds_and_what_it_leaves_open_stays():
    first = Says(Detection("oven", "fixture", state="open", masks=square(5), confidence=0.4, flag="doubtful"))
    second = Says(Detection("Oven", "fixture", confidence=0.99, pose=Pose((1, 0, 0)), size=(0.1, 0.1, 0.1)))
    [oven] = chained(first, second)
    assert (oven.label, oven.confidence, oven.flag) == ("Oven", 0.99, "")
    assert oven.state == "open" and oven.masks["front"].sum() == 100 and oven.pose == Pose((1, 0, 0))
    assert second.asked[0].found[0].label == "oven"


def test_two_names_for_the_same_pixels_are_one_thing_and_two_places_are_two():
    first = Says(Detection("bottle", masks=square(5)), Detection("cap", "part", part_of="bottle", masks=square(5, 4)))
    second = Says(Detection("salt shaker", masks=square(6)), Detection("cup", masks=square(40)))
    found = {one.label: one for one in chained(first, second)}
    assert set(found) == {"salt shaker", "cup", "cap"}
    assert found["cap"].part_of == found["salt shaker"].name


def test_of_several_of_one_name_the_one_with_the_most_pixels_in_common_is_refined():
    first = Says(Detection("cup", key="cup", masks=square(5)), Detection("cup", key="cup 2", masks=square(30)))
    found = chained(first, Says(Detection("cup", masks=square(31), confidence=0.5)))
    assert [(one.name, one.confidence) for one in found] == [("cup", 1.0), ("cup 2", 0.5)]


def test_what_is_only_pointed_at_is_left_out_unless_a_later_stage_cuts_it_out():
    pointed = Detection("cup", prompts={"front": (10.0, 12.0)})
    handle = Detection("cup handle", "part", part_of="cup", masks=square(30))
    [alone] = chained(Says(pointed, handle), Says())
    assert (alone.label, alone.kind) == ("cup handle", "object") and "seen nowhere" in alone.flag
    first = Says(pointed)
    masked = attrs.evolve(pointed, masks=square(8), refines="cup")
    assert [one.label for one in chained(first, Says(masked, cuts_out=True))] == ["cup"]
    assert first.asked[0].cut_out_later


@pytest.mark.process
def test_sam_cuts_out_boxes_and_points_of_an_earlier_stage(tmp_path):
    local = LocalDetector(LocalSettings(masks=str(sam2(tmp_path / "sam2"))))
    boxed, pointed = Detection("box", prompts={"front": (5, 5, 30, 30)}), Detection("cup", prompts={"front": (40, 20)})
    chain = Chain([Says(boxed, pointed), local])
    chain.open()
    sizes: list[list[int]] = []
    real = local._segmenter.masks

    def planted(rgb, prompts):
        masks = real(rgb, prompts)
        sizes.append([len(one) for one in prompts])
        assert [mask.shape for mask in masks] == [(40, 60)] * 2  # random weights: only that it can be run
        return [square(5)["front"], square(38)["front"]]

    local._segmenter.masks = planted
    found = chain.detect(Request((frame(),)))
    assert sizes == [[4, 2]]
    assert [(one.label, int(np.nonzero(one.masks["front"])[1].min())) for one in found] == [("box", 5), ("cup", 38)]


def test_without_weights_local_says_what_it_needs_alone_and_in_a_chain():
    with pytest.raises(InvalidArgument, match=r"perception.local.weights"):
        LocalDetector(LocalSettings(masks="somewhere")).open()
    with pytest.raises(InvalidArgument, match=r"perception.local.masks"):
        Chain([Says(), LocalDetector()]).open()


# -- markers -----------------------------------------------------------------------------------------------------------


def tag_frame(name, eye, seed=0, noise=0.0):
    k = Intrinsics(LENS.matrix[0, 0], LENS.matrix[1, 1], LENS.matrix[0, 2], LENS.matrix[1, 2])
    rgb = picture(eye, TAGS, seed)
    rays = Frame(name, rgb, np.ones((480, 640), np.float32), k, eye).points() - np.asarray(eye.position)
    depth = -eye.position[2] / rays[..., 2]  # down to the table
    depth = depth + np.random.default_rng(seed).normal(0, noise, depth.shape) if noise else depth
    return Frame(name, rgb, np.where(depth > 0, depth, 0).astype(np.float32), k, eye)


HANDLE = TaggedThing(3, "handle", side=SIZE, extents=(0.02, 0.03, 0.1), offset=(0.0, 0.06, 0.01))


def test_a_marker_tells_the_pose_of_the_box_beside_it():
    frames = (tag_frame("front", EYE, 1, 0.002), tag_frame("side", OTHER_EYE, 2, 0.002))
    [handle] = TagsDetector(TagsSettings(things=(HANDLE,))).detect(Request(frames, noise=0.002))[:1]
    assert handle.label == "handle" and handle.size == HANDLE.extents and not handle.flag
    assert np.linalg.norm(np.subtract(handle.pose.position, TAGS[3].apply((0.0, 0.06, 0.01)))) < 0.002
    into, left, up = handle.pose.rotation.T  # the tag lies on its back: into it is down, its top points along y
    assert into @ (0, 0, -1) > 0.999 and left @ (-1, 0, 0) > 0.999 and up @ (0, 1, 0) > 0.999


def test_depth_settles_what_one_picture_of_a_marker_leaves_open():
    from_depth = TagsDetector(TagsSettings(things=(HANDLE,)))
    errors = {True: [], False: []}
    for seed in range(4):
        one = tag_frame("front", EYE, seed, 0.001)
        for measured in errors:
            seen = one if measured else attrs.evolve(one, depth=np.zeros_like(one.depth))
            [handle] = from_depth.detect(Request((seen,), noise=0.001))[:1]
            errors[measured].append(np.linalg.norm(np.subtract(handle.pose.position, TAGS[3].apply((0.0, 0.06, 0.01)))))
    assert max(errors[True]) < 0.002
    assert np.median(errors[True]) <= np.median(errors[False])


def test_a_marker_that_two_pictures_show_in_two_places_is_flagged():
    moved = tag_frame("side", OTHER_EYE, 2)
    moved = attrs.evolve(moved, pose=Pose((0.05, 0, 0)) * moved.pose)
    frames = (tag_frame("front", EYE, 1), moved)
    [handle] = TagsDetector(TagsSettings(things=(HANDLE,))).detect(Request(frames))[:1]
    assert "not in one place" in handle.flag and handle.confidence < 0.5


def test_a_pose_needs_the_extents_of_the_box():
    with pytest.raises(InvalidArgument, match=r"extents.*'handle' takes its pose from tag 3"):
        TaggedThing(3, "handle", side=0.05)


def test_a_marker_renames_what_carries_it_and_one_that_is_not_listed_renames_nothing():
    seen = tag_frame("front", EYE, 1)
    masks = {}
    for number, label in ((3, "bottle"), (7, "box")):
        u, v = seen.project(np.array(TAGS[number].position))[0]
        masks[label] = np.zeros((480, 640), dtype=bool)
        masks[label][int(v) - 60 : int(v) + 60, int(u) - 60 : int(u) + 60] = True
    first = Says(*(Detection(label, masks={"front": mask}) for label, mask in masks.items()))
    chain = Chain([first, TagsDetector(TagsSettings(things=(TaggedThing(3, "salt shaker"),)))])
    found = {one.label: one for one in chain.detect(Request((seen,)))}
    assert set(found) == {"salt shaker", "box"}
    assert found["salt shaker"].masks["front"].sum() == 120 * 120


# -- two sources -------------------------------------------------------------------------------------------------------

ONE, OTHER = SimulatedSettings(cameras=("right",), noise="d435"), SimulatedSettings(cameras=("left",), noise="femto")


@pytest.mark.sim
def test_the_cameras_of_two_sources_are_one_set_of_views_and_come_again_after_a_restore():
    with looking_at(scene()) as context:
        eyes = Cameras(CamerasSettings(detector="oracle", simulated=(ONE, OTHER)))
        eyes.open()
        eyes.start(context)
        state = eyes.source.state()
        frames = eyes.source.capture()
        eyes.source.restore(state)
        assert [one.name for one in frames] == ["right", "left"]
        assert [one.digest() for one in eyes.source.capture()] == [one.digest() for one in frames]
        assert {"red block", "can", "cupboard"} <= {node.label for node in eyes.look().nodes}
        eyes.close()


@pytest.mark.sim
def test_cameras_of_one_name_and_cameras_that_are_not_there_are_named():
    with looking_at(scene()) as context:
        twice = Cameras(CamerasSettings(detector="oracle", simulated=(ONE, SimulatedSettings())))
        twice.start(context)
        with pytest.raises(InvalidArgument, match=r"two cameras are called 'right'"):
            twice.look()
        with pytest.raises(InvalidArgument, match=r"no camera 'behind'.*right, left"):
            SimulatedSource(SimulatedSettings(cameras=("behind",))).start(context)


@pytest.mark.sim
def test_a_chain_with_masks_in_place_of_a_segmenter_sees_what_it_is_pointed_at():
    with looking_at(scene()) as context:
        oracle = OracleDetector()
        oracle.start(context)
        source = SimulatedSource()
        source.start(context)
        frames = source.capture()
        seen = {one.label: one for one in oracle.detect(Request(frames))}
        prompts = {}
        for name, mask in seen["can"].masks.items():
            rows, columns = np.nonzero(mask)
            prompts[name] = (float(np.median(columns)), float(np.median(rows)))
        eyes = Cameras(CamerasSettings(), detector=Chain([Says(Detection("tin", prompts=prompts)), OracleDetector()]))
        eyes.open()
        eyes.start(context)
        [tin] = eyes.look().nodes
        assert tin.label == "tin" and np.linalg.norm(np.subtract(tin.pose.position, (0.40, 0.30, 0.055))) < 0.005
