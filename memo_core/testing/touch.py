"""Conformance of controls with force sensing: ``check_touch(make)`` runs every rule on a ``Control``, each can be run
alone as a test.

``make()`` returns a control whose hand is free and points down, 4 to 15 cm above something hard and level that reaches
10 cm around, with room for 5 cm of motion upwards.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from memo_core.errors import MotionError
from memo_core.skills.control import Control, Waypoints
from memo_core.testing.fake_control import FakeControl
from memo_core.testing.rules import Rules

MakeControl = Callable[[], Control]
Rule = Callable[[MakeControl], None]

RULES: Rules[Rule] = Rules()
rule = RULES.rule
DOWN, UP = [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]


def check_touch(make: MakeControl) -> None:
    """Run every rule. Raises ``AssertionError`` naming the first broken promise."""
    for name, check in RULES.items():
        try:
            check(make)
        except AssertionError as error:
            raise AssertionError(f"{name}: {check.__doc__} Broken: {error}") from error


def _height(control: Control) -> float:
    return control.tool_pose().position[2]


@rule
def a_free_hand_feels_nothing(make: MakeControl) -> None:
    """Before anything is touched, less than 1 N is felt."""
    felt = math.hypot(*make().contact_force())
    assert felt < 1.0, f"{felt:.1f} N"


@rule
def contact_ends_a_motion(make: MakeControl) -> None:
    """``move_until_contact`` stops at what it meets, returns the way it moved, and then feels about the force asked
    for, against its direction."""
    for force in (4.0, 8.0):
        control = make()
        before = _height(control)
        moved = control.move_until_contact(DOWN, 0.2, force, 0.02)
        went = before - _height(control)
        assert abs(moved - went) < 0.002, f"it says {100 * moved:.1f} cm and moved {100 * went:.1f} cm"
        assert moved > 0.02, f"it moved {100 * moved:.1f} cm only"
        felt = control.contact_force()[2]
        assert 0.5 * force < felt < 1.5 * force, f"asked for {force} N, {felt:.1f} N are felt"


@rule
def no_contact_is_an_error(make: MakeControl) -> None:
    """Where nothing is met, ``move_until_contact`` goes all the way and says so (``no-contact``)."""
    control = make()
    before = _height(control)
    try:
        control.move_until_contact(UP, 0.05, 5.0, 0.05)
    except MotionError as error:
        assert error.cause == "no-contact", f"the cause is {error.cause!r}"
        assert abs(_height(control) - before - 0.05) < 0.005, f"it moved by {_height(control) - before:.3f} m of 0.05"
        return
    raise AssertionError("moving up into the air raised nothing")


@rule
def pressing_on_air_is_an_error(make: MakeControl) -> None:
    """``press`` with nothing within 3 cm is a ``MotionError`` (``no-contact``)."""
    try:
        make().press(UP, 5.0, 0.2)
    except MotionError as error:
        assert error.cause == "no-contact", f"the cause is {error.cause!r}"
        return
    raise AssertionError("pressing upwards into the air raised nothing")


@rule
def pressing_keeps_its_force(make: MakeControl) -> None:
    """``press`` presses with the given force and returns the measured one."""
    for force in (4.0, 12.0):
        control = make()
        control.move_until_contact(DOWN, 0.2, 3.0, 0.02)
        mean = control.press(DOWN, force, 1.0)
        assert abs(mean - force) < 0.2 * force, f"asked for {force} N, it says {mean:.1f} N"
        felt = control.contact_force()[2]
        assert abs(felt - force) < 0.3 * force, f"asked for {force} N, {felt:.1f} N are felt at the end"


@rule
def pressing_along_keeps_to_the_path(make: MakeControl) -> None:
    """``press_along`` comes to the path's end across its direction, whatever the path says along it, and stays in
    contact."""
    control = make()
    control.move_until_contact(DOWN, 0.2, 3.0, 0.02)
    x, y, z = control.tool_pose().position
    turn = list(control.tool_pose().orientation)
    control.press_along("press_along", [([x, y + 0.05, z + 0.004], turn)], DOWN, 5.0, 0.03)
    end = control.tool_pose().position
    across = math.hypot(end[0] - x, end[1] - y - 0.05)
    assert across < 0.004, f"it ended {1000 * across:.0f} mm beside the path"
    assert abs(end[2] - z) < 0.003, f"it left the surface by {1000 * (end[2] - z):.0f} mm"
    assert control.contact_force()[2] > 1.0, f"{control.contact_force()[2]:.1f} N are felt at the end"


@rule
def a_search_that_finds_nothing_says_so(make: MakeControl) -> None:
    """``spiral_search`` on a plain surface is a ``MotionError`` (``no-contact``), the hand back in the middle."""
    control = make()
    control.move_until_contact(DOWN, 0.2, 3.0, 0.02)
    before = np.array(control.tool_pose().position)
    try:
        control.spiral_search(DOWN, 0.002, 4.0, 0.003, 0.001)
    except MotionError as error:
        assert error.cause == "no-contact", f"the cause is {error.cause!r}"
        away = float(np.linalg.norm((np.array(control.tool_pose().position) - before)[:2]))
        assert away < 0.002, f"the hand stays {1000 * away:.1f} mm from where it began"
        return
    raise AssertionError("a plain surface was taken for a hole")


class _FeelsItsWeight(FakeControl):
    def contact_force(self) -> list[float]:
        return [0.0, 0.0, -7.0]


class _RunsThrough(FakeControl):
    def move_until_contact(self, direction: list[float], distance: float, force: float, speed: float) -> float:
        super().move_until_contact(direction, distance, force, speed)
        return distance


class _IsNeverDisappointed(FakeControl):
    def move_until_contact(self, direction: list[float], distance: float, force: float, speed: float) -> float:
        try:
            return super().move_until_contact(direction, distance, force, speed)
        except MotionError:
            return distance


class _PressesOnAir(FakeControl):
    def press(self, direction: list[float], force: float, seconds: float) -> float:
        return force


class _PressesAtWill(FakeControl):
    def press(self, direction: list[float], force: float, seconds: float) -> float:
        return super().press(direction, 9.0, seconds)


class _LiftsOff(FakeControl):
    def press_along(self, skill: str, path: Waypoints, direction: list[float], force: float, speed: float) -> float:
        mean = super().press_along(skill, path, direction, force, speed)
        x, y, z = self.pose.position
        self._go([x, y, z + 0.02], None, 1.0)
        return mean


class _FindsAlways(FakeControl):
    def spiral_search(
        self, direction: list[float], radius: float, force: float, depth: float, pitch: float
    ) -> list[float]:
        return list(self.pose.position)


WRONG_CONTROLS: dict[str, type[FakeControl]] = {
    "a_free_hand_feels_nothing": _FeelsItsWeight,
    "contact_ends_a_motion": _RunsThrough,
    "no_contact_is_an_error": _IsNeverDisappointed,
    "pressing_on_air_is_an_error": _PressesOnAir,
    "pressing_keeps_its_force": _PressesAtWill,
    "pressing_along_keeps_to_the_path": _LiftsOff,
    "a_search_that_finds_nothing_says_so": _FindsAlways,
}
