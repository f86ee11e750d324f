"""What a person established about a real robot before its first task; later runs are checked against its file.

The steps move the arm slowly, within ``hardware.safety`` and after a person has agreed to each motion. They are no
safety function: the person keeps everybody outside the workspace and a hand on the emergency stop.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import attrs
import cattrs
import numpy as np

from memo_core.errors import BackendUnavailable, InvalidArgument, MotionError
from memo_core.interfaces.link import Link
from memo_core.robot.description import RobotDescription
from memo_core.robot.safety import SafetyLimits
from memo_core.scene.pose import Array, Pose

DOWN = (0.0, 0.0, 1.0, 0.0)  # quaternion of a hand that points down
_TARE_S = 2.0
_PUSH_S = 15.0  # of the robot's clock, in which somebody pushes
_PUSHED_S = 0.5  # of pushing that is measured
_PUSHED_N = 5.0  # above which the hand counts as pushed
_ALONG = 0.7  # share of a push that must be along the direction that was asked for
_INSET = 0.08  # m between a corner of the workspace and where the tool is taken
_LOWEST = 0.15  # m above the base frame's origin, to stay clear of a table
_SHARES = (1.0, 0.85, 0.7, 0.55, 0.4)  # of the way from the workspace's middle to a corner that are tried
_LIFT = 0.05  # m
_GRIP = 20.0  # N
_CORNERS = 8  # of the workspace


class Operator(Protocol):
    """Who commissions the robot."""

    def tell(self, text: str) -> None: ...

    def ready(self, what: str) -> bool:
        """Whether to do this next; False leaves it out."""

    def answer(self, question: str) -> str: ...


@attrs.frozen
class Commissioning:
    """What was established. ``differences`` compares it with the robot of a later run."""

    robot: str  # name of the description
    address: str
    arm: str  # serial number, as a person read it
    by: str
    at: str  # ISO 8601
    tool: list[float]  # tool frame in its link: position (m), quaternion wxyz
    stroke: float  # m, of the gripper
    particulars: dict[str, str]  # of the link
    bias: float  # N felt at rest
    push: list[float]  # N felt while somebody pushed along the base's x
    corners: list[list[float]]  # m, places that were reached
    lifted: bool  # whether the gripper held and lifted a cube

    def differences(self, robot: RobotDescription, address: str, link: Link) -> str:
        """In what the robot of an open link differs from the one that was commissioned; empty if in nothing."""
        now = {"robot": robot.name, "address": address, "tool": tool_of(robot), "stroke": robot.gripper.stroke}
        then = {"robot": self.robot, "address": self.address, "tool": self.tool, "stroke": self.stroke}
        now, then = now | link.particulars(), then | self.particulars
        changed = [name for name in {**then, **now} if then.get(name) != now.get(name)]
        return "; ".join(f"{name} was {then.get(name)}, is {now.get(name)}" for name in changed)

    @property
    def left_out(self) -> str:
        """The steps that were left out or did not succeed; empty if there are none."""
        steps = [f"{len(self.corners)} of {_CORNERS} corners reached"] if len(self.corners) < _CORNERS else []
        return ", ".join([*steps, *(() if self.lifted else ("the gripper did not hold a cube",))])

    def write(self, file: Path) -> None:
        file.write_text(json.dumps(attrs.asdict(self), indent=1) + "\n", encoding="utf-8")


def read_commissioning(file: Path) -> Commissioning:
    """Raises ``InvalidArgument`` for a file that is missing or was not written by ``memo robot commission``."""
    try:
        return cattrs.structure(json.loads(file.read_text(encoding="utf-8")), Commissioning)
    except OSError as error:
        problem = f"{file} cannot be read: {error.strerror}"
    except (ValueError, TypeError, KeyError, cattrs.BaseValidationError):
        problem = f"{file} is no such file"
    raise InvalidArgument("hardware.commissioning", problem, "the file that memo robot commission wrote")


def check_commissioning(file: Path, robot: RobotDescription, address: str, link: Link) -> Commissioning:
    """Read the file and compare it with the robot. Raises ``BackendUnavailable`` where the robot is not the one that
    was commissioned."""
    commissioned = read_commissioning(file)
    if changed := commissioned.differences(robot, address, link):
        problem = f"it is not as it was commissioned ({file}): {changed}"
        raise BackendUnavailable("robot", address, problem, "memo robot commission")
    return commissioned


def tool_of(robot: RobotDescription) -> list[float]:
    return [*robot.tool_offset.position, *robot.tool_offset.orientation]


def bias_of(link: Link) -> Array:
    """Mean force (N) that the resting arm feels, base axes, shape (3,)."""
    mean: Array = np.mean(list(_felt(link, _TARE_S)), axis=0)
    return mean


def pushed(link: Link, bias: Array) -> Array:
    """Mean force (N), shape (3,), felt while somebody pushes the hand away from the base along x. Raises
    ``InvalidArgument`` if nobody did, or in another direction."""
    felt: list[Array] = []
    for force in _felt(link, _PUSH_S):
        if np.linalg.norm(force - bias) > _PUSHED_N:
            felt.append(force - bias)
        if len(felt) * link.control_period >= _PUSHED_S:
            break
    else:
        raise InvalidArgument("the push", f"less than {_PUSHED_N:g} N were felt for {_PUSHED_S:g} s", "a steady push")
    mean: Array = np.mean(felt, axis=0)
    if abs(mean[0]) < _ALONG * np.linalg.norm(mean):
        shown = ", ".join(f"{one:.1f}" for one in mean)
        raise InvalidArgument("the push", f"was felt as {shown} N", "a push along the base's x")
    return mean


def _felt(link: Link, seconds: float) -> Iterator[Array]:
    target = link.joint_targets()
    for _ in range(round(seconds / link.control_period)):
        link.send(target)
        yield link.contact_wrench()[:3]


def corners_of(limits: SafetyLimits) -> list[tuple[float, float, float]]:
    """Places (m, base frame) a little within the workspace's corners, the lower ones above a table."""
    low, high = np.array(limits.workspace[:3]) + _INSET, np.array(limits.workspace[3:]) - _INSET
    low[2] = max(low[2], _LOWEST)
    spans = [(float(a), float(b)) if a < b else (float(a + b) / 2,) * 2 for a, b in zip(low, high, strict=True)]
    return [(x, y, z) for z, x, y in itertools.product(spans[2], spans[0], spans[1])]


def visit_corners(link: Link, limits: SafetyLimits, person: Operator) -> list[list[float]]:
    """Take the tool towards each corner that the person agrees to, as far as the arm reaches; where it was."""
    middle = np.mean(corners_of(limits), axis=0)
    visited = []
    for corner in corners_of(limits):
        shown = ", ".join(f"{one:.2f}" for one in corner)
        if not person.ready(f"The tool moves slowly to ({shown}) m, or as far towards it as it reaches."):
            continue
        places = [middle + share * (np.array(corner) - middle) for share in _SHARES]
        place = next((one for one in places if _moved(link, one)), None)
        if place is None:
            person.tell("left out: the arm reaches nothing on the way there")
            continue
        visited.append([round(float(one), 3) for one in place])
    return visited


def _moved(link: Link, place: Array) -> bool:
    """Whether the tool could be taken there; False before anything has moved."""
    from memo_core.arm.settling import check_arrived
    from memo_core.arm.slow_motion import move_tool

    before = link.joint_targets()
    try:
        move_tool(link, Pose((float(place[0]), float(place[1]), float(place[2])), DOWN))
    except MotionError:
        if not np.array_equal(link.joint_targets(), before):
            raise
        return False
    check_arrived(link)
    return True


def lift_cube(link: Link, person: Operator) -> bool:
    """Whether the gripper held a cube that the person put between its fingers, and lifted it."""
    from memo_core.arm.inverse_kinematics import Kinematics
    from memo_core.arm.settling import check_arrived
    from memo_core.arm.slow_motion import move_joints, move_tool

    gripper = link.description.gripper
    if not person.ready("The arm moves slowly to its home posture, and its fingers open."):
        return False
    move_joints(link, np.array(link.description.home))
    check_arrived(link)
    _fingers(link, gripper.stroke, gripper.max_force)
    if not person.ready("Put a cube between the fingers; they close on it."):
        return False
    _fingers(link, 0.0, float(np.clip(_GRIP, gripper.min_force, gripper.max_force)))
    if not link.holding():
        person.tell("the gripper says that it holds nothing")
        return False
    here = Kinematics(link.description).pose(link.joint_targets())
    x, y, z = here.position
    move_tool(link, Pose((x, y, z + _LIFT), here.orientation))
    check_arrived(link)
    held = link.holding() and person.ready("It should hold the cube now. Does it?")
    move_tool(link, here)
    if person.ready("Take the cube; the fingers open."):
        _fingers(link, gripper.stroke, gripper.max_force)
    return held


def _fingers(link: Link, width: float, force: float) -> None:
    gripper = link.description.gripper
    target = link.joint_targets()
    link.set_gripper(width, force)
    for _ in range(round((1.5 * gripper.stroke / gripper.speed + 0.5) / link.control_period)):
        link.send(target)
