"""The robot and the scenes of the conformance suite for simulators."""

from __future__ import annotations

import math

import attrs
import numpy as np

from memo_core.robot.description import GripperDescription, JointDescription, RobotDescription
from memo_core.scene.description import Body, Camera, Free, Geom, Hinge, Latch, SceneDescription, Slide
from memo_core.scene.mechanisms import Above, Below, Lasting, Lock, Locked, Pressed, Spring, Times
from memo_core.scene.pose import Pose, look_at

REACH = 0.4  # m from the column to the hand
HEIGHT = 0.5  # m of the shoulder
DROP = 0.47  # m from the elbow down to the tool centre: at home it is 30 mm above the table
CUBE = 0.04  # m


def check_robot() -> RobotDescription:
    """A crane: it turns about a column, shoulder and elbow pitch, and a parallel gripper of 80 mm hangs down."""
    box = '<inertial><mass value="{m}"/><inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>'
    body = box.format(m=1.0, i=0.01)
    shape = '<collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry></collision>'
    slide = '<limit lower="0" upper="0.04" velocity="0.2" effort="80"/>'
    turn = '<limit lower="-2.5" upper="2.5" velocity="2" effort="100"/>'
    urdf = f"""<robot name="crane">
      <link name="base">{shape.format(at="0 0 0.2", size="0.08 0.08 0.38")}</link>
      <link name="column">{body}</link>
      <link name="upper">{body}{shape.format(at="0.2 0 0", size="0.3 0.05 0.05")}</link>
      <link name="hand">{body}{shape.format(at="0 0 -0.4", size="0.06 0.2 0.05")}</link>
      <link name="tool"/>
      <link name="left">{box.format(m=0.1, i=0.0001)}{shape.format(at="0 0.01 0", size="0.02 0.02 0.04")}</link>
      <link name="right">{box.format(m=0.1, i=0.0001)}{shape.format(at="0 -0.01 0", size="0.02 0.02 0.04")}</link>
      <joint name="turn" type="revolute"><parent link="base"/><child link="column"/><origin xyz="0 0 {HEIGHT}"/>
        <axis xyz="0 0 1"/>{turn}</joint>
      <joint name="shoulder" type="revolute"><parent link="column"/><child link="upper"/>
        <axis xyz="0 1 0"/>{turn}</joint>
      <joint name="elbow" type="revolute"><parent link="upper"/><child link="hand"/><origin xyz="{REACH} 0 0"/>
        <axis xyz="0 1 0"/>{turn}</joint>
      <joint name="fixed" type="fixed"><parent link="hand"/><child link="tool"/>
        <origin xyz="0 0 {-DROP}" rpy="{math.pi} 0 0"/></joint>
      <joint name="finger_left" type="prismatic"><parent link="hand"/><child link="left"/>
        <origin xyz="0 0 {-DROP}"/><axis xyz="0 1 0"/>{slide}</joint>
      <joint name="finger_right" type="prismatic"><parent link="hand"/><child link="right"/>
        <origin xyz="0 0 {-DROP}"/><axis xyz="0 -1 0"/>{slide}</joint>
    </robot>"""
    joints = tuple(
        JointDescription(name, -2.5, 2.5, 2.0, 10.0, 1000.0, effort=100.0, kp=4000.0, kv=400.0)
        for name in ("turn", "shoulder", "elbow")
    )
    gripper = GripperDescription(finger_joints=("finger_left", "finger_right"), pads=("left", "right"))
    return RobotDescription(
        "crane", urdf, joints, gripper, "tool", home=(0.0, 0.0, 0.0), allowed_contacts=(("left", "right"),)
    )


def tool_position(joints: np.ndarray) -> np.ndarray:
    """Where the crane's tool centre is, by its geometry (m)."""
    turn, shoulder, elbow = joints
    out = REACH * math.cos(shoulder) - DROP * math.sin(shoulder + elbow)
    up = HEIGHT - REACH * math.sin(shoulder) - DROP * math.cos(shoulder + elbow)
    return np.array([out * math.cos(turn), out * math.sin(turn), up])


def check_scene(**changes: object) -> SceneDescription:
    """A cube between the open fingers, a ball in the air, a door on a spring, a drawer on a spring, two cameras.

    The catch holds the door (spring 1 Nm at the start) unless ``catch`` says less.
    """
    size = float(str(changes.get("cube", CUBE)))
    cube = Body("cube", (Geom("box", (size,) * 3),), Pose((REACH, 0.0, size / 2)), Free(), mass=0.2, label="cube")
    ball = Body("ball", (Geom("sphere", (0.02,)),), Pose((0.0, 0.6, 0.5)), Free(), mass=0.1)
    # A level beam on a vertical hinge, so that gravity does nothing to it.
    knob = Body("knob", (Geom("sphere", (0.01,)),), Pose((0.2, 0.0, 0.0)))
    door = Body(
        "door",
        (Geom("box", (0.2, 0.01, 0.1), Pose((0.1, 0.0, 0.0))),),
        joint=Hinge("hinge", (0, 0, 1), range=(0.0, 1.0), stiffness=1.0, rest=1.0, damping=0.3),
        mass=0.5,
        bodies=(knob,),
    )
    drawer = Body(
        "drawer",
        (Geom("box", (0.1, 0.1, 0.05), Pose((0.0, 0.0, 0.2))),),
        joint=Slide("rail", (0, 0, 1), range=(-0.1, 0.1), stiffness=200.0, rest=0.05, damping=20.0, initial=0.02),
        mass=0.5,
    )
    cabinet = Body("cabinet", (Geom("box", (0.02, 0.02, 0.3)),), Pose((0.7, -0.5, 0.3)), bodies=(door, drawer))
    return SceneDescription(
        bodies=(cube, ball, cabinet),
        cameras=(
            Camera("above", look_at((REACH + 0.6, 0.1, 0.35), (REACH, 0.0, 0.02)), 0.8, (160, 120)),
            Camera("away", look_at((0.0, -1.0, 1.5), (0.4, 0.0, 1.3)), 0.8, (160, 120)),
        ),
        latches=(Latch("hinge", 0.0, float(str(changes.get("catch", 3.0))), 0.1),),
        gravity=float(str(changes.get("gravity", 9.81))),
    )


def mechanism_scene() -> SceneDescription:
    """``check_scene`` without its catch. Its door (spring 1 Nm at the start) is locked until the drawer has been 3.5 mm
    up from its start for half a second; opened to 0.6 rad it is drawn back, and locked again near 0.3 rad. The drawer
    is locked once a finger has pressed on the cube twice."""
    lifted, pressed = Above("rail", 0.0235), Pressed("cube", 10.0)
    return attrs.evolve(
        check_scene(),
        latches=(),
        mechanisms=(
            Lock("bolt", "hinge", (0.0, 0.0), until=Lasting(lifted, 0.5)),
            Spring("hinge", 5.0, 0.25, when=Above("hinge", 0.6, slack=0.5)),
            Lock("stop", "hinge", (0.28, 0.32), again=Times(Below("hinge", 0.4), 1), engaged=False),
            Lock("clamp", "rail", (-0.1, 0.1), again=Times(pressed, 2), engaged=False),
            Spring("rail", 1000.0, 0.0, when=Locked("clamp")),
        ),
    )
