"""Conformance of links: ``check_link(make)`` runs every rule, each can be run alone as a test.

``make()`` returns a link that is ready, with nothing within the arm's or the gripper's reach and the stop released.

@pytest.mark.parametrize("rule", RULES)
def test_my_link(rule):
    RULES[rule](make_my_link)
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np

from memo_core.arm.settling import apart, uncounted
from memo_core.errors import BackendUnavailable, InvalidArgument, Stopped
from memo_core.interfaces.link import Link
from memo_core.scene.pose import Array
from memo_core.testing.rules import Rules

MakeLink = Callable[[], Link]
Rule = Callable[[MakeLink], None]

RULES: Rules[Rule] = Rules()
rule = RULES.rule

_SMALL = 0.05  # rad, a move that every arm can make near its home
_TICKS = 60
_BIAS, _NOISE = 5.0, 3.0  # N


def check_link(make: MakeLink) -> None:
    """Run every rule. Raises ``AssertionError`` naming the first broken promise."""
    for check in RULES.values():
        check(make)


def _towards(link: Link, goal: Array, ticks: int = _TICKS) -> None:
    start = link.joint_targets()
    for i in range(1, ticks + 1):
        link.send(start + (goal - start) * (i / ticks))
    for _ in range(ticks):
        link.send(goal)


def _refused(action: Callable[[], object], what: str) -> None:
    try:
        action()
    except Stopped:
        return
    raise AssertionError(f"{what} was accepted although the stop is latched")


@rule
def one_value_per_joint(make: MakeLink) -> None:
    """Positions, velocities and targets are finite and have one value per joint of the description."""
    problem = uncounted(make())
    assert not problem, problem


@rule
def answers_are_copies(make: MakeLink) -> None:
    """Changing a returned array, or targets after sending them, does not affect the robot."""
    link = make()
    before = link.joint_positions().copy()
    link.joint_positions()[:] = 9.0
    link.joint_targets()[:] = 9.0
    assert np.allclose(link.joint_positions(), before), "joint_positions() hands out the link's own array"
    assert not np.any(link.joint_targets() == 9.0), "joint_targets() hands out the link's own array"
    sent = link.joint_targets()
    link.send(sent)
    sent[:] = 9.0
    assert not np.any(link.joint_targets() == 9.0), "send() keeps the caller's array"


@rule
def the_last_targets_are_told(make: MakeLink) -> None:
    """``joint_targets`` is what was sent last, exactly."""
    link = make()
    goal = link.joint_targets() + 0.001
    link.send(goal)
    assert np.array_equal(link.joint_targets(), goal), f"sent {goal}, told {link.joint_targets()}"


@rule
def a_send_takes_one_period(make: MakeLink) -> None:
    """Every send lets one control period pass, at most 10 ms. On hardware a busy computer may take longer."""
    link = make()
    assert 0 < link.control_period <= 0.0101, f"the control period is {link.control_period} s"
    start, target = link.time(), link.joint_targets()
    for _ in range(20):
        link.send(target)
    passed, late = link.time() - start, 20.0 if link.real_time else 0.5
    assert -0.5 < passed / link.control_period - 20 < late, f"20 sends took {passed} s"


@rule
def targets_start_where_the_arm_is(make: MakeLink) -> None:
    """Before anything is sent, ``joint_targets`` is where the arm is measured: it moves from there to the first
    targets."""
    problem = apart(make())
    assert not problem, f"{problem}, before anything was sent: the first command would make the arm leap"


@rule
def hardware_takes_real_time(make: MakeLink) -> None:
    """A link that is not a simulator's lets each control period pass on the clock on the wall."""
    link = make()
    if link.real_time:
        sends_take_real_time(link)


def sends_take_real_time(link: Link) -> None:
    """Raises ``AssertionError`` if sends return earlier than the clock on the wall allows: an arm would move as many
    times faster."""
    sends, target = 20, link.joint_targets()
    began = time.monotonic()
    for _ in range(sends):
        link.send(target)
    passed, needed = time.monotonic() - began, (sends - 2) * link.control_period
    assert passed >= needed, (
        f"{sends} sends returned within {passed:.3f} s, where each takes {link.control_period:g} s: "
        "send() must wait for a deadline on the clock on the wall"
    )


@rule
def the_arm_follows(make: MakeLink) -> None:
    """The joints go where they are sent."""
    link = make()
    goal = link.joint_positions() + _SMALL
    _towards(link, goal)
    off = float(np.abs(link.joint_positions() - goal).max())
    assert off < 0.01, f"{off:.3f} rad off after a second"
    assert np.abs(link.joint_velocities()).max() < 0.02, "still moving after a second at rest"


@rule
def the_fingers_follow(make: MakeLink) -> None:
    """The gripper opens to a width and closes, and holds nothing where nothing is."""
    link = make()
    gripper = link.description.gripper
    target = link.joint_targets()
    for width in (gripper.stroke, gripper.stroke / 2, 0.0):
        link.set_gripper(width, gripper.max_force)
        for _ in range(int(2 * gripper.stroke / gripper.speed / link.control_period) + 50):
            link.send(target)
        assert abs(link.gripper_width() - width) < 0.003, (
            f"commanded {width:.3f} m, reached {link.gripper_width():.3f} m"
        )
        assert not link.holding(), f"it claims to hold something at {width:.3f} m, with nothing there"


@rule
def a_free_hand_feels_nothing(make: MakeLink) -> None:
    """A link that feels forces tells six finite numbers, near 0 without contact: the arm's own weight and motion are
    not included. A link without force sensing says so."""
    link = make()
    if not link.feels_force:
        try:
            link.contact_wrench()
        except BackendUnavailable:
            return
        raise AssertionError("feels_force is False, and yet contact_wrench() answers")
    felt = [link.contact_wrench()]
    assert np.shape(felt[0]) == (6,), f"contact_wrench() has shape {np.shape(felt[0])}, not (6,)"
    start = link.joint_targets()
    for i in range(1, 61):
        link.send(start + _SMALL * i / 60)
        felt.append(link.contact_wrench())
    for _ in range(_TICKS):
        link.send(start + _SMALL)
    felt.append(link.contact_wrench())
    assert np.all(np.isfinite(felt)), "contact_wrench() is not finite"
    bias = float(np.linalg.norm(felt[0][:3]))
    assert bias < _BIAS, f"at rest {bias:.1f} N are felt"
    change = float(np.linalg.norm(np.array(felt)[:, :3] - felt[0][:3], axis=1).max())
    assert change < _NOISE, f"moving slowly changes what is felt by {change:.1f} N"


@rule
def stop_refuses_every_command(make: MakeLink) -> None:
    """After a stop nothing is commanded, however often it is tried, until the release."""
    link = make()
    target = link.joint_targets()
    link.send(target)
    link.stop()
    assert link.stopped, "stop() does not show in stopped"
    moved = target + _SMALL
    for _ in range(3):
        _refused(lambda: link.send(moved), "send()")
        _refused(lambda: link.set_gripper(0.0, link.description.gripper.min_force), "set_gripper()")
    assert np.array_equal(link.joint_targets(), target), "refused targets were taken all the same"
    link.release()
    assert not link.stopped, "release() does not show in stopped"
    link.send(target)


@rule
def stop_comes_from_any_thread(make: MakeLink) -> None:
    """A stop from another thread refuses the very next send."""
    link = make()
    other = threading.Thread(target=link.stop)
    other.start()
    other.join()
    target = link.joint_targets()
    _refused(lambda: link.send(target), "send() after another thread's stop")


@rule
def halting_is_allowed_while_stopped(make: MakeLink) -> None:
    """A commanded deceleration is accepted after a stop, leaves the arm at rest and does not release the stop."""
    link = make()
    start = link.joint_targets()
    for i in range(20):
        link.send(start + 0.002 * i)
    link.stop()
    speeds = 0.002 * np.linspace(1.0, 0.0, 15)
    link.halt(start[None, :] + 0.038 + np.cumsum(speeds)[:, None])
    assert link.stopped, "halt() released the stop"
    target = link.joint_targets()
    _refused(lambda: link.send(target), "send() after halt()")
    link.release()
    for _ in range(_TICKS):
        link.send(target)
    assert np.abs(link.joint_positions() - target).max() < 0.01, "the arm is not where it was halted"


@rule
def checkpoints_are_exact(make: MakeLink) -> None:
    """Where the world can be restored: state, targets and time are those of the checkpoint, and what follows is the
    same again."""
    link = make()
    if not link.can_restore:
        return
    _towards(link, link.joint_positions() + _SMALL, 20)
    saved = link.checkpoint()
    state = (link.joint_positions(), link.joint_velocities(), link.joint_targets(), np.array([link.time()]))
    goal = link.joint_positions() - _SMALL
    _towards(link, goal, 20)
    first = link.joint_positions()
    link.restore(saved)
    again = (link.joint_positions(), link.joint_velocities(), link.joint_targets(), np.array([link.time()]))
    assert all(np.array_equal(a, b) for a, b in zip(state, again, strict=True)), "the state restored is another one"
    _towards(link, goal, 20)
    assert np.array_equal(link.joint_positions(), first), "the same commands lead elsewhere after a restore"


@rule
def foreign_checkpoints_are_refused(make: MakeLink) -> None:
    """Bytes that are no checkpoint are an ``InvalidArgument``, and the robot stays as it is."""
    link = make()
    if not link.can_restore:
        return
    before = link.joint_positions()
    for wrong in (b"", b"not a checkpoint", b"{}"):
        try:
            link.restore(wrong)
        except InvalidArgument:
            continue
        raise AssertionError(f"{wrong!r} was taken for a checkpoint")
    assert np.array_equal(link.joint_positions(), before), "a refused checkpoint changed the state"
