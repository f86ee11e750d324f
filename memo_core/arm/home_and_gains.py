"""Reach, home, gains and contact force of an arm whose URDF states none of them.

Starting values for ``memo_core.arm.description_from_urdf``, each with the reason why it was guessed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import attrs
import numpy as np

from memo_core.arm.collision import RobotShape
from memo_core.arm.facing import SIDES, facing
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.robot.description import RobotDescription
from memo_core.robot.urdf.reading import link_poses, read_urdf
from memo_core.scene.pose import Array, Pose

_STIFFEST = 4500.0  # Nm/rad
_RADII, _HEIGHTS = (0.5, 0.42, 0.6, 0.35, 0.7), (0.45, 0.35, 0.55, 0.25, 0.65)  # shares of the reach, of home's tool


@attrs.frozen
class Guess:
    """One value that the URDF does not state."""

    what: str  # field of the description
    value: str
    why: str


def with_reach(robot: RobotDescription, guesses: list[Guess]) -> RobotDescription:
    """Reach in m from the first joint."""
    kinematics = Kinematics(robot)
    _, position = kinematics.forward(kinematics.samples(4096))
    far = float(np.linalg.norm(position - kinematics.shoulder[:, None], axis=0).max())
    urdf = read_urdf(robot.urdf, robot.mesh_folder)
    lengths = [float(np.linalg.norm(urdf.joint(name).origin.position)) for name in robot.joint_names[1:]]
    poses = link_poses(urdf, {})
    wrist = urdf.joint(robot.joint_names[-1]).child
    lengths.append(
        float(np.linalg.norm((poses[wrist].inverse() * poses[robot.tool_link] * robot.tool_offset).position))
    )
    reach = math.floor(1000 * min(0.97 * far, sum(lengths))) / 1000
    guesses.append(
        Guess("reach", f"{reach:.3f} m", "how far 4096 sampled postures bring the tool from the first joint")
    )
    return attrs.evolve(robot, reach=reach)


def with_home(robot: RobotDescription, guesses: list[Guess]) -> tuple[RobotDescription, float]:
    """A posture with the hand pointing down in front of the base, far from joint limits, clear of itself; where there
    is none, one to another side, and by what the base is to be turned then (rad about z)."""
    kinematics = Kinematics(robot)
    checker = RobotShape(robot, kinematics).checker([], robot.gripper.stroke)
    faces = facing(kinematics, robot.reach)
    for side in dict.fromkeys((faces.side, *SIDES)):
        turned = SIDES[side]
        for height in _HEIGHTS:
            for radius in _RADII:
                for yaw in (0.0, math.pi / 2, -math.pi / 2):
                    away = radius * robot.reach * np.array([math.cos(turned), -math.sin(turned)])
                    pose = Pose((*away.tolist(), height * robot.reach), _down(yaw - turned))
                    found = kinematics.inverse(pose, kinematics.home[:, None], samples=200)
                    free = [one for one in found.T if not checker.collides(one, "free")]
                    if not free:
                        continue
                    rounded = np.round(_comfortable(robot, kinematics, free), 4) + 0.0  # no -0.0
                    home = tuple(rounded.tolist())
                    front = f"{radius * robot.reach:.2f} m in front of the base"
                    why = f"the hand points down {front}, {height * robot.reach:.2f} m up"
                    if turned:
                        why += f", turned: by the URDF it is to the base's {side}"
                        ahead = str(faces) if side == faces.side else "ahead (+x) is no posture with the hand down"
                        guesses.append(Guess("base_rpy", f"[0, 0, {turned:.4f}]", ahead))
                    guesses.append(Guess("home", f"{home}", why))
                    return attrs.evolve(robot, home=home), turned
    guesses.append(Guess("home", f"{robot.home}", "the middle of the limits: no posture with the hand down was found"))
    return robot, 0.0


def _down(yaw: float) -> tuple[float, float, float, float]:
    return (0.0, math.cos(yaw / 2), math.sin(yaw / 2), 0.0)


def _comfortable(robot: RobotDescription, kinematics: Kinematics, postures: Sequence[Array]) -> Array:
    """Of postures (n,) one far from joint limits and singularities; of those alike in that, with the highest elbow."""
    middle, half = (kinematics.lower + kinematics.upper) / 2, (kinematics.upper - kinematics.lower) / 2
    urdf = read_urdf(robot.urdf, robot.mesh_folder)
    jacobians = [kinematics.jacobian(one) for one in postures]
    dexterity = np.array([np.linalg.svd(one, compute_uv=False)[min(6, len(one[0])) - 1] for one in jacobians])

    def rank(number: int) -> tuple[float, float, float]:
        joints = postures[number]
        poses = link_poses(urdf, dict(zip(robot.joint_names, joints.tolist(), strict=True)))
        low = -sum(poses[urdf.joint(name).child].position[2] for name in robot.joint_names)
        return (
            round(float((np.abs(joints - middle) / half).max()), 1),
            -round(float(dexterity[number] / dexterity.max()), 1),
            low,
        )

    return postures[min(range(len(postures)), key=rank)]


def with_gains(robot: RobotDescription, guesses: list[Guess]) -> RobotDescription:
    """Servo gains and accelerations from torques and from the inertia that each joint moves at home."""
    import pinocchio as pin

    kinematics = Kinematics(robot)
    shape = RobotShape(robot, kinematics)
    q = shape.configuration(kinematics.home, 0.0)
    data = kinematics.model.createData()
    mass = np.asarray(pin.crba(kinematics.model, data, q))
    joints = []
    for joint, number in zip(robot.joints, kinematics.joint_ids, strict=True):
        place = kinematics.model.joints[number].idx_v
        armature = min(0.1, joint.effort / 100)
        inertia = float(mass[place, place]) + armature
        kp = round(min(_STIFFEST, 160 * joint.effort))
        acceleration = round(min(max(0.3 * joint.effort / inertia, 1.0), 4 * joint.velocity), 2)
        joints.append(
            attrs.evolve(
                joint, kp=float(kp), kv=kp / 10, armature=armature, acceleration=acceleration, jerk=100 * acceleration
            )
        )
    urdf = read_urdf(robot.urdf, robot.mesh_folder)
    units = [urdf.joint(joint.name).units for joint in joints]
    gains = in_units([f"{joint.kp:.0f}" for joint in joints], [one.stiffness for one in units])
    why = "160 Nm/rad for each Nm of torque (a slide: N/m for each N), 4500 at most"
    guesses.append(Guess("kp, kv", f"kp {gains}, kv = kp / 10", why))
    quick = in_units([f"{joint.acceleration:g}" for joint in joints], [f"{one.position}/s2" for one in units])
    guesses.append(Guess("acceleration, jerk", quick, "0.3 of the torque on the inertia moved at home"))
    return attrs.evolve(robot, joints=tuple(joints))


def in_units(values: Sequence[str], units: Sequence[str]) -> str:
    """Values with the unit behind the last of those that share it: ``4500 N/m, 800, 800 Nm/rad``."""
    following = [*units[1:], ""]
    return ", ".join(
        value if unit == then else f"{value} {unit}" for value, unit, then in zip(values, units, following, strict=True)
    )


def with_contact_force(robot: RobotDescription, guesses: list[Guess]) -> RobotDescription:
    """N that the weakest joint can press down with at home, with a margin."""
    kinematics = Kinematics(robot)
    down = np.abs(kinematics.jacobian(kinematics.home)[2])
    efforts = np.array([joint.effort for joint in robot.joints])
    most = float(np.min(efforts / np.maximum(down, 1e-3)))
    force = float(max(1, math.floor(min(50.0, 0.6 * most))))
    guesses.append(Guess("max_contact_force", f"{force:g} N", "0.6 of what the weakest joint can press with at home"))
    return attrs.evolve(robot, max_contact_force=force)
