"""The numbers of a recording as columns of a dataset: the policy's state and actions, and what they were made of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from memo_core.plugin import Kinematics, RobotDescription
from memo_vla.actions import arm_actions, gripper_value
from memo_vla.dataset.recorder import Recording
from memo_vla.settings import Layout

# How a column is called in v3.0, by LeRobot's conventions, and in v2.1, by those of openpi's LIBERO recipe.
STATE, ACTION, PICTURE = "observation.state", "action", "observation.images."


@attrs.frozen
class Names:
    """Names of columns in one version of the format."""

    state: str
    action: str
    pictures: dict[str, str]  # camera -> column


def names_of(version: str, cameras: Sequence[str]) -> Names:
    """Names of columns: LeRobot's in v3.0; in v2.1 those that openpi's LIBERO recipe repacks (``image``,
    ``wrist_image``, ``state``, ``actions``)."""
    if version == "v3.0":
        return Names(STATE, ACTION, {camera: f"{PICTURE}{camera}" for camera in cameras})
    called = ["image", *(f"{camera}_image" for camera in cameras[1:])]
    return Names("state", "actions", dict(zip(cameras, called, strict=True)))


def part_names(parts: Sequence[str], robot: RobotDescription) -> list[str]:
    """A name for each value of a state vector made of these parts."""
    named = {
        "joints": list(robot.joint_names),
        "position": ["x", "y", "z"],
        "rotation-vector": ["rx", "ry", "rz"],
        "fingers": ["finger_left", "finger_right"],
        "gripper-closed": ["gripper_closed"],
        "gripper-width": ["gripper_width"],
    }
    return [name for part in parts for name in named[part]]


def action_names(layout: Layout, robot: RobotDescription) -> list[str]:
    """A name for each value of an action."""
    steps = ["dx", "dy", "dz", "drx", "dry", "drz"]
    return [*(steps if layout.actions == "delta-pose" else robot.joint_names), "gripper"]


def columns_of(recording: Recording, layout: Layout, robot: RobotDescription, names: Names) -> dict[str, np.ndarray]:
    """Numbers of every frame that has a next one: an action is what leads there.

    Returns:
        By name, float32, shape (T, D): the policy's state and action; ``observation.joints`` (rad),
        ``observation.hand`` (m and quaternion wxyz), ``observation.gripper`` (m), ``sent.joints`` (rad) and
        ``sent.gripper`` (m), to which the arm and the fingers were sent by the next frame.
    """
    frames, after = recording.frames[:-1], recording.frames[1:]
    arm, gripper = arm_actions(layout, Kinematics(robot)), robot.gripper
    parts = tuple(part for some in layout.state.values() for part in some)
    steps = [
        [*arm.part(one.sent, two.sent), gripper_value(two.opening, layout.gripper, gripper)]
        for one, two in zip(frames, after, strict=True)
    ]
    columns: dict[str, list[Any]] = {
        names.state: [one.state.vector(parts) for one in frames],
        names.action: steps,
        "observation.joints": [one.state.joints for one in frames],
        "observation.hand": [[*one.state.hand.position, *one.state.hand.orientation] for one in frames],
        "observation.gripper": [[one.state.width] for one in frames],
        "sent.joints": [one.sent for one in after],
        "sent.gripper": [[one.opening] for one in after],
    }
    return {name: np.asarray(rows, np.float32) for name, rows in columns.items()}


def features_of(layout: Layout, robot: RobotDescription, names: Names) -> dict[str, dict[str, Any]]:
    """Entries of ``info.json`` for the columns of ``columns_of``."""
    parts = tuple(part for some in layout.state.values() for part in some)
    named = {
        names.state: part_names(parts, robot),
        names.action: action_names(layout, robot),
        "observation.joints": list(robot.joint_names),
        "observation.hand": ["x", "y", "z", "qw", "qx", "qy", "qz"],
        "observation.gripper": ["width"],
        "sent.joints": list(robot.joint_names),
        "sent.gripper": ["width"],
    }
    return {name: {"dtype": "float32", "shape": [len(names)], "names": names} for name, names in named.items()}
