"""A small scene with two cameras in a simulator, for tests of the eyes: quick to build and to render."""

from __future__ import annotations

from contextlib import contextmanager

import attrs
import numpy as np

import memo_core as memo
from memo_core.interfaces.perception import PerceptionContext
from memo_core.scene.description import Body, Camera, Cavity, Free, Geom, Hinge, Part, SceneDescription
from memo_core.scene.hollow import bar, inside, shell
from memo_core.scene.pose import Pose, look_at
from memo_core.testing.perception import StillLink

CUPBOARD = (0.24, 0.30, 0.26)  # m: depth, width, height


def cameras(width=320, height=240):
    middle = (0.55, 0.0, 0.08)
    return (
        Camera("right", look_at((-0.2, -0.75, 0.75), middle), 0.8, (width, height)),
        Camera("left", look_at((-0.1, 0.8, 0.8), middle), 0.8, (width, height)),
    )


def scene(door_angle=0.0):
    """A red block, a blue can and a cupboard with a door, hinged on its left side, open by ``door_angle`` (rad)."""
    _, width, height = CUPBOARD
    centre, room, opening = inside(CUPBOARD, 0.012)
    door = Body(
        "cupboard/door",
        (
            Geom("box", (0.018, width, height), Pose((-0.009, -width / 2, height / 2)), (0.3, 0.2, 0.1, 1)),
            *bar((-0.06, -width + 0.04, height / 2), 0.14, "z", 0.042),
        ),
        Pose((0.0, width / 2, 0.0)),
        Hinge("cupboard/hinge", (0, 0, -1), range=(0.0, 2.0), initial=door_angle, friction=0.5),
        mass=0.5,
        label="cupboard door",
        parts=(
            Part("cupboard/handle", "cupboard handle", Pose((-0.06, -width + 0.04, height / 2)), (0.018, 0.018, 0.14)),
        ),
    )
    cupboard = Body(
        "cupboard",
        shell(CUPBOARD, 0.012, "front", (0.8, 0.8, 0.75, 1)),
        Pose((0.62, 0.05, 0.0)),
        label="cupboard",
        fixture=True,
        cavities=(Cavity("cupboard/inside", "cupboard inside", Pose(centre), room, opening, "cupboard/hinge"),),
        bodies=(door,),
    )
    block = Body(
        "block", (Geom("box", (0.05, 0.09, 0.04), colour=(0.8, 0.1, 0.1, 1)),),
        Pose.from_yaw((0.42, -0.22, 0.02), 0.5), Free(), label="red block",
    )  # fmt: skip
    can = Body(
        "can",
        (Geom("cylinder", (0.03, 0.11), colour=(0.1, 0.2, 0.8, 1)),),
        Pose((0.40, 0.30, 0.055)),
        Free(),
        label="can",
    )
    return SceneDescription((cupboard, block, can), cameras=cameras())


@contextmanager
def looking_at(described, seed=0, simulator="mujoco"):
    """A context over a simulator with this scene; the robot stands at its home position."""
    experiment = memo.load(None, f"simulator.backend={simulator}")
    robot, world = experiment.create("robot"), experiment.create("simulator")
    with world:
        world.build(described, robot)
        link = _Link(robot, world)
        yield PerceptionContext(np.random.default_rng(seed), robot, link, world.tool_pose, world, described)


class _Link(StillLink):
    """Reads the simulated arm; ``grips`` says whether the hand holds something."""

    def __init__(self, robot, world):
        super().__init__()
        self.description, self._world = robot, world

    def joint_positions(self):
        return self._world.joint_positions()

    def gripper_width(self):
        return self._world.gripper_width()


def without(described, name):
    """The scene without this body."""
    return attrs.evolve(described, bodies=tuple(body for body in described.bodies if body.name != name))
