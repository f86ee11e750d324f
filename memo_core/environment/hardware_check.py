"""What is looked at before a real robot moves for the first time. Nothing here moves it."""

from __future__ import annotations

import platform
import resource
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import attrs
import numpy as np

from memo_core.environment.commissioning import check_commissioning
from memo_core.environment.hardware import HardwareSettings
from memo_core.environment.lease import Lease
from memo_core.errors import BackendUnavailable, InvalidArgument, MemoError, RobotFault
from memo_core.interfaces.driver import GripperDriver, RobotDriver
from memo_core.interfaces.link import Link
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.robot.description import RobotDescription
from memo_core.robot.safety import SafetyLimits

LISTENING_S = 5.0
_SLOWEST_S = 0.02  # between two states, by the clock on the wall
_STANDS = 0.05  # share of the clock on the wall below which the robot's counts as standing still
_BIAS_N = 10.0


@attrs.frozen
class Check:
    """One line: what was looked at, how it is, and what to do where it is not as it should be."""

    what: str
    state: Literal["ok", "warning", "failed"]
    detail: str
    remedy: str = ""


def examine_host() -> Iterator[Check]:
    """Whether this computer can answer a robot a thousand times a second (Linux)."""
    kernel = platform.version()
    flag = Path("/sys/kernel/realtime")
    realtime = "PREEMPT_RT" in kernel or (flag.is_file() and flag.read_text().strip() == "1")
    remedy = "" if realtime else "install a PREEMPT_RT kernel: without one motions may end in lost packets"
    yield Check("kernel", "ok" if realtime else "warning", f"{platform.release()} {kernel}", remedy)
    priority = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    allowed = priority == resource.RLIM_INFINITY or priority >= 80
    remedy = "" if allowed else "give your user `rtprio 99` in /etc/security/limits.conf and log in again"
    yield Check("real-time priority", "ok" if allowed else "warning", f"up to {priority}", remedy)
    files = sorted(Path("/sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor"))
    governors = sorted({file.read_text().strip() for file in files})
    if governors:
        fast = governors == ["performance"]
        remedy = "" if fast else "cpupower frequency-set -g performance"
        yield Check("processor's governor", "ok" if fast else "warning", ", ".join(governors), remedy)


def examine_robot(
    driver: RobotDriver,
    gripper: GripperDriver,
    robot: RobotDescription,
    settings: HardwareSettings,
    perception: Callable[[], Perception] | None = None,
    listening_s: float = LISTENING_S,
) -> Iterator[Check]:
    """Connect, listen for a while, look once, and tell how the robot is. It ends with the first thing that prevents the
    rest. ``perception`` makes it, unopened; an error that it raises is what the row of the cameras says."""
    from memo_core.arm.guarded_link import COUNTED
    from memo_core.arm.settling import uncounted

    lease = Lease(driver.address)
    try:
        lease.take()
    except BackendUnavailable as error:
        yield Check("lease", "failed", error.reason, error.remedy)
        return
    link = driver.link(robot, gripper)
    try:
        link.open()
        yield Check("connection", "ok", f"{robot.name} at {driver.address}")
        health = link.health()
        yield Check("health", "ok" if health.ready else "failed", health.problem or "ready")
        if problem := uncounted(link):
            yield Check("positions", "failed", problem, COUNTED)
            return
        yield _listened(link, listening_s)
        for name, value in link.particulars().items():
            yield Check(name, "ok", value)
        yield _started(link)
        yield _standing(link, robot, settings.safety)
        holding = ", holding something" if link.holding() else ""
        yield Check("gripper", "ok", f"{1000 * link.gripper_width():.0f} mm open{holding}")
        if link.feels_force:
            yield _bias(link)
        yield _commissioned(link, robot, driver.address, settings.commissioning)
        if perception is not None:
            yield _seen(link, robot, perception)
    except RobotFault as fault:
        yield Check("connection", "failed", fault.problem, fault.remedy)
    except BackendUnavailable as error:
        yield Check("connection", "failed", error.reason, error.remedy)
    except MemoError as error:
        yield Check("connection", "failed", str(error))
    finally:
        link.close()
        lease.give_back()


def _listened(link: Link, seconds: float) -> Check:
    """How evenly states come, while nothing is commanded."""
    began = last = time.monotonic()
    robot_began, slowest, states = link.time(), 0.0, 0
    while last - began < seconds:
        link.joint_positions()
        now = time.monotonic()
        slowest, last, states = max(slowest, now - last), now, states + 1
        time.sleep(0.0005)
    passed = link.time() - robot_began
    if wrong := _clock_problem(passed, seconds):
        remedy = "Link.time() of its driver must be a clock that goes by itself, such as time.monotonic()"
        return Check("states", "failed", wrong, remedy)
    rate = states / passed if passed > 0 else 0.0
    detail = (
        f"{states} read in {seconds:g} s ({rate:.0f} in a second of the robot's clock, which went {passed:.2f} s), "
        f"longest wait {1000 * slowest:.0f} ms"
    )
    good = slowest <= _SLOWEST_S and abs(passed - seconds) < 0.05 * seconds + 0.02
    remedy = "" if good else "no other load on this computer, a network port of its own, no switch in between"
    return Check("states", "ok" if good else "warning", detail, remedy)


def _clock_problem(passed: float, seconds: float) -> str:
    """Why the robot's clock, which went on by ``passed`` (s) in ``seconds``, cannot time a motion; empty if it can. A
    slow one may be a busy computer's."""
    if passed <= _STANDS * seconds:
        return f"the robot's clock stands still: it went {passed:.2f} s in {seconds:g} s"
    if passed > 1.05 * seconds + 0.02:
        return f"the robot's clock is too fast: it went {passed:.2f} s in {seconds:g} s"
    return ""


def _started(link: Link) -> Check:
    """Whether the driver's targets are where the arm is: the first command starts from there."""
    from memo_core.arm.guarded_link import STARTS
    from memo_core.arm.settling import APART, apart

    if problem := apart(link):
        return Check("targets", "failed", f"the first command would make it leap: {problem}", STARTS)
    units = " or ".join(dict.fromkeys(link.description.position_units))
    return Check("targets", "ok", f"within {APART:g} {units} of where the arm is measured")


def _standing(link: Link, robot: RobotDescription, limits: SafetyLimits) -> Check:
    from memo_core.arm.guarded_link import GuardedLink

    outside = GuardedLink(link, robot, limits).outside()
    remedy = "guide it by hand until it is within hardware.safety" if outside else ""
    return Check("limits", "failed" if outside else "ok", outside or "it is within hardware.safety", remedy)


def _bias(link: Link) -> Check:
    felt = float(np.linalg.norm(link.contact_wrench()[:3]))
    heavy = felt > _BIAS_N
    remedy = "set the load of what is mounted on the flange, and keep clear of the hand" if heavy else ""
    return Check("force at rest", "warning" if heavy else "ok", f"{felt:.1f} N", remedy)


def _commissioned(link: Link, robot: RobotDescription, address: str, file: str | None) -> Check:
    if file is None:
        remedy = "memo robot commission, and hardware.commissioning: the file that it writes"
        return Check("commissioning", "warning", "not commissioned, or no file of it is named", remedy)
    try:
        left_out = check_commissioning(Path(file).expanduser(), robot, address, link).left_out
    except BackendUnavailable as error:
        return Check("commissioning", "failed", error.reason, error.remedy)
    except InvalidArgument as error:
        return Check("commissioning", "failed", error.problem, error.expected)
    if left_out:
        remedy = "memo robot commission, with these steps, before a program needs them"
        return Check("commissioning", "warning", f"as in {file}, but {left_out}", remedy)
    return Check("commissioning", "ok", f"as in {file}")


def _seen(link: Link, robot: RobotDescription, make: Callable[[], Perception]) -> Check:
    """One look with the cameras."""
    from memo_core.arm.inverse_kinematics import Kinematics

    kinematics = Kinematics(robot)
    try:
        perception = make()
        perception.open()
        try:
            rng = np.random.default_rng(0)
            context = PerceptionContext(rng, robot, link, lambda: kinematics.pose(link.joint_positions()))
            perception.start(context)
            scene = perception.look()
        finally:
            perception.close()
    except RobotFault:
        raise
    except MemoError as error:
        return Check("camera images", "failed", str(error), "perception: a backend that uses cameras")
    labels = ", ".join(sorted(node.label for node in scene.nodes)) or "nothing"
    return Check("camera images", "ok", f"one look sees {labels}")
