"""Units and shapes that policies want: presets, actions and their reverse, states, pictures."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from memo_franka.description import panda
from memo_vla.actions import arm_actions, gripper_value, opening
from memo_vla.pictures import shaped
from memo_vla.robot_state import RobotState, rotation_vector
from memo_vla.settings import DROID, JOINTS, LIBERO, VlaSettings

import memo_core
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.config import ConfigErrors
from memo_core.scene.pose import Pose, quaternion_from_axis_angle

PANDA = panda()
KINEMATICS = Kinematics(PANDA)
small = st.lists(st.floats(-0.03, 0.03), min_size=7, max_size=7)


@pytest.mark.parametrize("layout", [DROID, LIBERO, JOINTS], ids=["droid", "libero", "joints"])
@settings(max_examples=20)
@given(steps=st.lists(small, min_size=1, max_size=4))
def test_a_demonstrated_action_leads_where_the_demonstration_went(layout, steps):
    actions = arm_actions(layout, KINEMATICS)
    shown = played = np.array(PANDA.home)
    for step in steps:
        before, shown = shown, shown + step
        played = actions.goal(actions.part(before, shown), played)
    far, turned = KINEMATICS.pose(played).distance(KINEMATICS.pose(shown))
    assert far < 0.003 and turned < 0.01
    if layout.actions != "delta-pose":
        assert np.allclose(played, shown, atol=1e-9)


def test_an_action_of_one_means_the_scale_and_more_is_cut():
    home = np.array(PANDA.home)
    droid = arm_actions(DROID, KINEMATICS)
    assert np.allclose(
        droid.goal(np.array([9.0, -9.0, 1.0, 0.5, 0, 0, 0]), home) - home, [0.2, -0.2, 0.2, 0.1, 0, 0, 0]
    )
    libero = arm_actions(LIBERO, KINEMATICS)
    moved = KINEMATICS.pose(libero.goal(np.array([0, 0, -1.0, 0, 0, 0]), home)).position
    assert np.allclose(np.subtract(moved, KINEMATICS.pose(home).position), [0, 0, -0.05], atol=1e-3)


@pytest.mark.parametrize(("kind", "closes", "opens"), [("closed", 0.9, 0.1), ("sign", 0.1, -0.1), ("width", 0.0, 0.08)])
def test_the_last_value_opens_and_closes(kind, closes, opens):
    assert opening(closes, kind, PANDA.gripper) == 0.0 and opening(opens, kind, PANDA.gripper) == 0.08
    for width in (0.0, 0.08):
        assert opening(gripper_value(width, kind, PANDA.gripper), kind, PANDA.gripper) == width


def test_a_wrong_number_of_scales_is_named():
    with pytest.raises(memo_core.MemoError, match=r"action_scale.*1 or 7"):
        arm_actions(attrs.evolve(DROID, action_scale=(0.1, 0.2)), KINEMATICS)


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_the_rotation_vector_of_a_hand_that_points_down_does_not_jump(tilt, yaw):
    down = Pose(orientation=quaternion_from_axis_angle((1.0, 0.0, 0.0), np.pi))
    turned = Pose(orientation=quaternion_from_axis_angle((0.0, 1.0, 0.0), tilt)) * down
    turned = Pose(orientation=quaternion_from_axis_angle((0.0, 0.0, 1.0), yaw)) * turned
    vector = rotation_vector(turned)
    assert np.abs(vector - [np.pi, 0.0, 0.0]).max() < 0.9
    again = Pose(orientation=quaternion_from_axis_angle(tuple(vector / np.linalg.norm(vector)), np.linalg.norm(vector)))
    assert again.distance(Pose(orientation=turned.orientation))[1] < 1e-6


def test_states_have_the_shapes_and_units_of_their_examples():
    state = RobotState(np.array(PANDA.home), KINEMATICS.pose(np.array(PANDA.home)), 0.02, PANDA.gripper)
    assert state.vector(LIBERO.state["observation/state"]).shape == (8,)
    assert state.vector(DROID.state["observation/joint_position"]).shape == (7,)
    assert np.allclose(state.vector(("gripper-closed", "fingers")), [0.75, 0.01, -0.01])


def test_pictures_are_fitted_turned_and_ordered():
    picture = np.zeros((60, 80, 3), np.uint8)
    picture[:30, :, 0] = 200  # the upper half is red
    layout = attrs.evolve(LIBERO, image_size=(40, 40))
    padded, cropped = shaped(picture, layout), shaped(picture, attrs.evolve(layout, fit="crop"))
    assert padded.shape == cropped.shape == (40, 40, 3) and padded.dtype == np.uint8
    assert padded[2].max() == 0 and padded[10, 20, 0] == 200 and padded[30, 20, 0] == 0  # black above the picture
    assert cropped[2, 20, 0] == 200 and cropped[37, 20, 0] == 0
    turned = shaped(picture, attrs.evolve(layout, fit="crop", rotate_180=True))
    assert turned[37, 20, 0] == 200 and turned[2, 20, 0] == 0
    unit = shaped(picture, attrs.evolve(layout, image_values="unit", image_order="chw"))
    assert unit.shape == (3, 40, 40) and unit.dtype == np.float32 and unit.max() == pytest.approx(200 / 255)


def test_settings_replace_single_values_of_a_preset():
    layout = VlaSettings(preset="droid", horizon=3, prompt="task").layout
    assert (layout.horizon, layout.prompt, layout.actions) == (3, "task", "joint-velocity")
    assert VlaSettings(preset="droid").layout == DROID


@pytest.mark.parametrize(
    ("value", "said"),
    [("url=http://127.0.0.1:8000", "websocket"), ("state={s: [joint]}", "did you mean 'joints'"), ("horizon=0", "1")],
)
def test_wrong_settings_are_named(value, said):
    with pytest.raises(ConfigErrors, match=said):
        memo_core.load(None, "method.backend=vla", f"method.{value}")
