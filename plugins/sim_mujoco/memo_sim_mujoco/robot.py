"""Building a RobotDescription as part of an MjSpec: links, position servos, gravity compensation, the gripper."""

from __future__ import annotations

import logging
import math
from typing import Any

import mujoco
import numpy as np

from memo_core.plugin import (
    FingerLinkage,
    Geom,
    GripperDescription,
    Material,
    RobotDescription,
    UrdfJoint,
    UrdfLink,
    UrdfShape,
    check_fits,
    may_touch,
    read_urdf,
)
from memo_sim_mujoco.scene import LIMIT_SOLREF, MESH_FILES, PREFIX, SOLIMP, add_mesh, add_shape, surface

_log = logging.getLogger("memo.mujoco")
FINGER_TENDON = "robot/fingers"
FINGER_SERVO = "robot/gripper"
# A finger's drive: its reflected inertia (kg) makes the stiff servo below stable at 2 ms.
FINGER_ARMATURE = 0.4
FINGER_LEVER = 0.05  # m, typical length of a hinged finger: its drive's inertia is that of a slide at this distance
FINGER_STIFFNESS = 8000.0  # N/m of opening
FINGER_DAMPING = 90.0  # N s/m of opening, critical for two fingers of 0.5 kg
_LEAST_INERTIA = 1e-9  # kg m2; MuJoCo refuses links of none
_LINK_COLOUR = (0.8, 0.8, 0.82, 1.0)


def add_robot(spec: mujoco.MjSpec, robot: RobotDescription, self_collision: bool) -> None:
    """Add the robot with its base frame at the world's origin.

    Raises ``InvalidArgument`` when the URDF and the description do not fit together.
    """
    urdf = read_urdf(robot.urdf, robot.mesh_folder)
    check_fits(urdf, robot)
    bits = (2, 3 if self_collision else 1)
    children: dict[str, list[UrdfJoint]] = {}
    for joint in urdf.joints:
        children.setdefault(joint.parent, []).append(joint)
    _add_link(spec, spec.worldbody, urdf.links[urdf.root], None, robot, bits)
    stack = [urdf.root]
    while stack:
        name = stack.pop()
        for joint in children.get(name, []):
            parent = spec.body(PREFIX + name)
            _add_link(spec, parent, urdf.links[joint.child], joint, robot, bits)
            stack.append(joint.child)
    if self_collision:
        for first, second in may_touch(urdf, robot):
            spec.add_exclude(bodyname1=PREFIX + first, bodyname2=PREFIX + second)
    for described in robot.joints:
        spec.add_actuator(
            name=PREFIX + described.name,
            target=PREFIX + described.name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            gainprm=[described.kp] + [0.0] * 9,
            biasprm=[0.0, -described.kp, -described.kv] + [0.0] * 7,
            forcelimited=True,
            forcerange=(-described.effort, described.effort),
        )
    if robot.gripper.finger_joints:
        linkage = FingerLinkage(urdf, robot.gripper)
        if linkage.slides:
            _add_gripper(spec, robot.gripper)
        else:
            _add_linkage(spec, robot.gripper, linkage)
    elif robot.gripper.kind == "vacuum":
        _add_suction(spec, robot.gripper)


def _add_link(
    spec: mujoco.MjSpec,
    parent: Any,
    link: UrdfLink,
    joint: UrdfJoint | None,
    robot: RobotDescription,
    bits: tuple[int, int],
) -> None:
    origin = joint.origin if joint is not None else None
    body = parent.add_body(name=PREFIX + link.name, gravcomp=1.0)
    if origin is not None:
        body.pos, body.quat = origin.position, origin.orientation
    if link.mass > 0:
        body.explicitinertial = True
        body.mass = link.mass
        # A rotated inertial frame is turned into the link's axes: MuJoCo takes a full tensor in those only.
        body.ipos = link.centre.position
        body.fullinertia = _turned(link)
    if joint is not None and joint.kind != "fixed":
        _add_joint(body, joint, robot)
    for shape in _seen(link):
        _add_shape(spec, body, shape, _LINK_COLOUR, link.name, contype=0, conaffinity=0, group=2, mass=0.0)
    pad = link.name in robot.gripper.pads
    material = Material(friction=robot.gripper.pad_friction, torsional=0.01) if pad else Material(friction=0.5)
    for shape in link.collisions:
        _add_shape(
            spec,
            body,
            shape,
            (0.2, 0.6, 0.9, 0.4),
            link.name,
            contype=bits[0],
            conaffinity=bits[1],
            group=3,
            mass=0.0,
            **surface(material),
        )


def add_pad_contacts(spec: mujoco.MjSpec, gripper: GripperDescription) -> None:
    """Give each pad and surface of the scene their own friction (``GripperDescription.friction_on``), where it is not
    the larger of the two, which MuJoCo takes by itself."""
    pads = [geom for pad in gripper.pads for geom in spec.body(PREFIX + pad).geoms if geom.contype]
    surfaces = [geom for geom in spec.geoms if geom.contype and not geom.parent.name.startswith(PREFIX)]
    for number, geom in enumerate(surfaces):
        friction = gripper.friction_on(geom.friction[0])
        if math.isclose(friction, max(gripper.pad_friction, geom.friction[0])):
            continue
        geom.name = geom.name or f"surface {number}"
        for side, pad in enumerate(pads):
            pad.name = f"{PREFIX}pad {side}"
            torsional, rolling = np.maximum(pad.friction[1:], geom.friction[1:])
            share = pad.solmix / (pad.solmix + geom.solmix)  # MuJoCo mixes the stiffness of unpaired shapes in this way
            spec.add_pair(
                geomname1=pad.name,
                geomname2=geom.name,
                friction=(friction, friction, torsional, rolling, rolling),
                condim=max(pad.condim, geom.condim),
                solref=share * pad.solref + (1.0 - share) * geom.solref,
                solimp=SOLIMP,
            )


def _add_joint(body: Any, joint: UrdfJoint, robot: RobotDescription) -> None:
    described = {one.name: one for one in robot.joints}.get(joint.name)
    common = {"name": PREFIX + joint.name, "axis": joint.axis, "limited": True, "solref_limit": LIMIT_SOLREF}
    if described is None:
        hinge = joint.kind == "revolute"
        body.add_joint(
            type=mujoco.mjtJoint.mjJNT_HINGE if hinge else mujoco.mjtJoint.mjJNT_SLIDE,
            range=(joint.lower, joint.upper),
            armature=FINGER_ARMATURE * (FINGER_LEVER**2 if hinge else 1.0),
            **common,
        )
        return
    body.add_joint(
        type=mujoco.mjtJoint.mjJNT_HINGE if joint.kind == "revolute" else mujoco.mjtJoint.mjJNT_SLIDE,
        range=(described.lower, described.upper),
        armature=described.armature,
        actgravcomp=True,
        actfrclimited=True,
        actfrcrange=(-described.effort, described.effort),
        **common,
    )


def _add_gripper(spec: mujoco.MjSpec, gripper: GripperDescription) -> None:
    """One tendon along all fingers, whose length is the opening, pulled by a servo of limited force; and a gear that
    keeps the fingers symmetric."""
    tendon = spec.add_tendon(name=FINGER_TENDON)
    for name in gripper.finger_joints:
        tendon.wrap_joint(PREFIX + name, 1.0)
    first, *others = gripper.finger_joints
    for name in others:
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_JOINT,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            name1=PREFIX + first,
            name2=PREFIX + name,
            data=[0.0, 1.0] + [0.0] * 10,
            solref=(0.005, 1.0),
        )
    spec.add_actuator(
        name=FINGER_SERVO,
        target=FINGER_TENDON,
        trntype=mujoco.mjtTrn.mjTRN_TENDON,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        gainprm=[FINGER_STIFFNESS] + [0.0] * 9,
        biasprm=[0.0, -FINGER_STIFFNESS, -FINGER_DAMPING] + [0.0] * 7,
        forcelimited=True,
        forcerange=(-gripper.max_force, gripper.max_force),
    )


def _add_linkage(spec: mujoco.MjSpec, gripper: GripperDescription, linkage: FingerLinkage) -> None:
    """Fingers on hinges: a servo on the driven joint, as stiff and strong at the pads as that of fingers on slides, and
    a gear to each joint that follows it. ``MujocoSimulator`` sets the torque that a force at the pads means."""
    driver, *others = linkage.names
    for name, multiplier, offset in zip(others, linkage.multipliers[1:], linkage.offsets[1:], strict=True):
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_JOINT,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            name1=PREFIX + name,
            name2=PREFIX + driver,
            data=[offset, multiplier] + [0.0] * 10,
            solref=(0.005, 1.0),
        )
    lever = abs(linkage.lever(linkage.driver(0.0)))
    spec.add_actuator(
        name=FINGER_SERVO,
        target=PREFIX + driver,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        gainprm=[FINGER_STIFFNESS * lever**2] + [0.0] * 9,
        biasprm=[0.0, -FINGER_STIFFNESS * lever**2, -FINGER_DAMPING * lever**2] + [0.0] * 7,
        forcelimited=True,
        forcerange=(-gripper.max_force * lever, gripper.max_force * lever),
    )


def _add_suction(spec: mujoco.MjSpec, gripper: GripperDescription) -> None:
    """The cup pulls what it touches: MuJoCo's adhesion, its control the force in N."""
    spec.add_actuator(
        name=FINGER_SERVO,
        target=PREFIX + gripper.pads[0],
        trntype=mujoco.mjtTrn.mjTRN_BODY,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        gainprm=[1.0] + [0.0] * 9,
        biastype=mujoco.mjtBias.mjBIAS_NONE,
        ctrllimited=True,
        ctrlrange=(0.0, gripper.max_force),
    )


def _seen(link: UrdfLink) -> tuple[UrdfShape, ...]:
    """What is drawn of a link: its visual shapes, or its collision shapes where there are none MuJoCo can read (most
    URDFs bring their looks as .dae files)."""
    unreadable = [shape.mesh for shape in link.visuals if shape.mesh and not shape.mesh.lower().endswith(MESH_FILES)]
    if unreadable:
        _log.info("%s looks like its collision shapes: MuJoCo does not read %s", link.name, ", ".join(unreadable))
    return link.collisions if unreadable or not link.visuals else link.visuals


def _add_shape(
    spec: mujoco.MjSpec,
    body: Any,
    shape: UrdfShape,
    colour: tuple[float, float, float, float],
    link: str,
    **more: Any,
) -> None:
    where, pose, colour = f"robot link {link!r}", shape.pose, shape.colour or colour
    if shape.shape != "mesh":
        add_shape(spec, body, Geom(shape.shape, shape.size, pose, colour), where, **more)
        return
    name = add_mesh(spec, shape.mesh, shape.size, where)
    at = {"pos": pose.position, "quat": pose.orientation, "rgba": colour}
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **at, **more)


def _turned(link: UrdfLink) -> tuple[float, ...]:
    xx, yy, zz, xy, xz, yz = link.inertia
    rotation = link.centre.rotation
    tensor = rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ rotation.T
    moments, axes = np.linalg.eigh(tensor)
    possible = np.maximum(moments, _LEAST_INERTIA)
    lacking = possible[2] - possible[0] - possible[1]
    if lacking > 1e-6 * possible[2]:  # no body has a moment beyond the sum of the others
        possible[:2] += 0.501 * lacking
    if not np.array_equal(possible, moments):
        _log.info("%s states the moments of inertia %s, taken as %s", link.name, moments, possible)
        tensor = axes @ np.diag(possible) @ axes.T
    return (tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2])
