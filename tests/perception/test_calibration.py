"""Hand-eye calibration: how near it comes to the truth, and every reason for which it refuses."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from boards import CAMERA, HELD, LENS, ON_HAND, example, shots, tools, turned
from memo_perception.calibration.board import Board
from memo_perception.calibration.drawn_board import draw_board
from memo_perception.calibration.file import load, save
from memo_perception.calibration.hand_eye import BadCalibration, Shot, calibrate

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.scene.pose import Pose


def cause(*args, **kwargs) -> str:
    with pytest.raises(BadCalibration) as refused:
        calibrate(shots(*args, **kwargs), Board(), LENS, "world")
    return refused.value.cause


@pytest.mark.parametrize("seed", range(3))
def test_a_fixed_camera_is_found_within_a_millimetre_and_a_tenth_of_a_degree(seed):
    found = calibrate(shots(tools(25, seed), seed=seed), Board(), LENS, "world")
    far, angle = found.camera.distance(CAMERA)
    assert far < 0.001 and angle < np.radians(0.1)
    assert found.board.distance(HELD)[0] < 0.001
    assert found.shots == 25 and found.pixels < 0.5


def test_a_camera_on_the_hand_is_found_as_exactly():
    """The same pictures, seen the other way round: the board lies still and the camera moves."""
    down = (0.0, 1.0, 0.0, 0.0)
    lying = Pose((0.5, 0.1, 0.0), down)
    rng = np.random.default_rng(5)
    taken = []
    for number in range(25):
        around = turned(lying, rng.uniform(-0.4, 0.4, 3))  # the camera circles the middle of the board
        far = rng.uniform(0.4, 0.5)
        tool = around * Pose((*rng.uniform(-0.03, 0.03, 2), -far)) * ON_HAND.inverse()
        taken += [
            attrs.evolve(one, tool=tool) for one in shots([lying], camera=tool * ON_HAND, in_hand=Pose(), seed=number)
        ]
    found = calibrate(taken, Board(), LENS, "hand")
    far, angle = found.camera.distance(ON_HAND)
    assert far < 0.001 and angle < np.radians(0.1)
    assert found.board.distance(lying)[0] < 0.001


def test_the_held_out_error_tells_a_noisy_arm_from_an_exact_one():
    exact = calibrate(shots(tools(25), arm=0.0), Board(), LENS, "world")
    noisy = calibrate(shots(tools(25), arm=0.0005), Board(), LENS, "world")
    assert exact.position_error < 0.0015 < noisy.position_error < 0.005
    assert exact.position_deviation < noisy.position_deviation


def test_few_pictures_are_refused():
    assert cause(tools(9)) == "few-poses"


def test_poses_that_hardly_turn_are_refused():
    assert cause(tools(25, spread=0.02)) == "alike-poses"


def test_turning_about_one_axis_only_is_refused():
    middle = tools(1, spread=0.0)[0]
    assert cause([turned(middle, (0.0, 0.0, angle)) for angle in np.linspace(-0.5, 0.5, 25)]) == "alike-poses"


@pytest.mark.parametrize("square", [0.029, 0.0303, 0.025])
def test_a_board_of_another_size_is_refused_and_its_size_told(square):
    real = Board(square=square, marker=0.02)
    with pytest.raises(BadCalibration) as refused:
        calibrate(shots(tools(25), true_board=real), Board(), LENS, "world")
    assert refused.value.cause == "wrong-size"
    assert f"{1000 * square:.2f} mm" in str(refused.value) or f"{1000 * square:.1f}" in str(refused.value)


def test_a_bent_board_is_refused():
    assert cause(tools(25), bent=0.01) == "not-flat"


def test_a_board_that_is_loose_in_the_hand_is_refused():
    rng = np.random.default_rng(1)
    loose = [
        Pose(
            tuple(np.asarray(HELD.position) + rng.normal(0, 0.004, 3)), turned(HELD, rng.normal(0, 0.02, 3)).orientation
        )
        for _ in range(25)
    ]
    assert cause(tools(25), in_hand=loose) == "inaccurate"


@pytest.mark.parametrize("shift, turn", [((0.004, 0.0, 0.003), 0.0), ((0.0, 0.0, 0.0), 0.01)])
def test_a_camera_that_moved_between_two_poses_is_refused_and_the_picture_named(shift, turn):
    moved = turned(Pose(tuple(np.asarray(CAMERA.position) + shift), CAMERA.orientation), (0.0, turn, 0.0))
    with pytest.raises(BadCalibration) as refused:
        calibrate(shots(tools(25), camera=[CAMERA] * 12 + [moved] * 13), Board(), LENS, "world")
    assert refused.value.cause == "camera-moved"
    assert "before picture 13" in str(refused.value)


def test_a_board_that_slipped_in_the_hand_is_refused():
    slipped = turned(HELD, (0.0, 0.0, 0.04))
    assert cause(tools(25), in_hand=[HELD] * 15 + [slipped] * 10) == "board-moved"


def test_an_unsteady_but_unmoved_setup_is_not_called_moved():
    for seed in range(3):
        try:
            calibrate(shots(tools(15, seed), arm=0.002, seed=seed), Board(), LENS, "world")
        except BadCalibration as refused:
            assert refused.cause in ("inaccurate", "alike-poses")


def test_pictures_of_a_board_are_calibrated_from_end_to_end():
    """Drawn boards, the real detector, the whole fit."""
    rng = np.random.default_rng(0)
    board, taken = Board(), []
    for number, tool in enumerate(tools(14, 3)):
        picture = rng.normal(120, 12, (480, 640, 3)).clip(0, 255).astype(np.uint8)
        picture = draw_board(picture, board, CAMERA.inverse() * tool * HELD, LENS)
        sighting = board.seen_in(picture)
        assert sighting is not None and len(sighting.corners) >= 20
        taken.append(Shot(f"picture {number + 1}", tool, sighting))
    found = calibrate(taken, board, LENS, "world")
    far, angle = found.camera.distance(CAMERA)
    assert far < 0.001 and angle < np.radians(0.05)


def test_a_picture_without_the_board_or_with_a_corner_of_it_shows_none():
    grey = np.full((480, 640), 128, dtype=np.uint8)
    assert Board().seen_in(grey) is None
    aside = Pose((0.19, 0.12, 0.4), (1.0, 0.0, 0.0, 0.0))
    assert Board().seen_in(draw_board(np.repeat(grey[..., None], 3, axis=2), Board(), aside, LENS)) is None


def test_a_board_that_cannot_be_is_refused():
    with pytest.raises(InvalidArgument, match="30 mm do not fit squares of 30 mm"):
        Board(marker=0.03)
    with pytest.raises(UnknownName, match="4x4_50"):
        Board(dictionary="4x4")


def test_a_calibration_is_read_as_it_was_written(tmp_path):
    save(example(), tmp_path / "front.json")
    assert load(tmp_path / "front.json") == example()


@pytest.mark.parametrize(
    "text, told",
    [
        ("", "is no JSON"),
        ("[]", "no calibration"),
        ('{"memo_calibration": 2}', "no calibration of this version"),
        ('{"memo_calibration": 1, "camera": "front"}', "robot"),
    ],
)
def test_a_file_that_is_no_calibration_is_named(tmp_path, text, told):
    file = tmp_path / "front.json"
    file.write_text(text)
    with pytest.raises(InvalidArgument, match=told) as refused:
        load(file)
    assert "front.json" in str(refused.value)
    with pytest.raises(InvalidArgument, match="No such file"):
        load(tmp_path / "none.json")
