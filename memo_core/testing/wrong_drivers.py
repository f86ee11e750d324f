"""Deliberately wrong drivers, one for each rule of the driver suites: the suites must reject each of them."""

from __future__ import annotations

import time

import numpy as np

from memo_core.interfaces.driver import GripperDriver, RobotDriver
from memo_core.interfaces.link import Health, Link
from memo_core.interfaces.simulator import Simulator
from memo_core.robot.description import GripperDescription, RobotDescription
from memo_core.scene.pose import Array
from memo_core.testing.fake_drivers import FakeDriverLink, FakeGripper
from memo_core.testing.ideal_link import IdealLink


def _driver(link_class: type[FakeDriverLink]) -> type[RobotDriver]:
    class Driver(RobotDriver):
        def link(self, robot: RobotDescription, gripper: GripperDriver, simulator: Simulator | None = None) -> Link:
            return link_class(robot, gripper)

    Driver.__name__ = link_class.__name__
    return Driver


class ConnectsAtOnce(FakeDriverLink):
    def __init__(self, description: RobotDescription, gripper: GripperDriver) -> None:
        super().__init__(description, gripper)
        self.open()


class HasOneJointMore(FakeDriverLink):
    def joint_positions(self) -> Array:
        return np.append(super().joint_positions(), 0.0)


class ClosesOnlyWhenOpen(FakeDriverLink):
    def close(self) -> None:
        assert self._connected, "not open"
        super().close()


class ReadyForEver(FakeDriverLink):
    _was_open = False

    def open(self) -> None:
        super().open()
        self._was_open = True

    def health(self) -> Health:
        return Health(self._was_open, "" if self._was_open else "the link is not open")


class DeafToTheStop(FakeDriverLink):
    def health(self) -> Health:
        return Health(self._connected, "" if self._connected else "the link is not open")


class OpensTheFingers(FakeDriverLink):
    def open(self) -> None:
        super().open()
        self._gripper.move(0.0, 10.0)


class LeavesTheGripper(FakeDriverLink):
    def stop(self) -> None:
        Link.stop(self)


class StartsAtHome(FakeDriverLink):
    """Takes its arm to be in the home posture of the description, wherever it stands."""

    def __init__(self, description: RobotDescription, gripper: GripperDriver) -> None:
        super().__init__(description, gripper, np.full(len(description.joints), 0.1))

    def open(self) -> None:
        super().open()
        self._targets = np.array(self.description.home)


class FreeRunning(FakeDriverLink):
    """Counts control periods instead of waiting for them."""

    def _advance(self, targets: Array) -> None:
        IdealLink._advance(self, targets)


class CountedClock(FakeDriverLink):
    """Its clock goes on only with commands."""

    def time(self) -> float:
        return self._time


class AsksTheIncludedGripper(FakeDriverLink):
    """Does not branch on ``gripper.included``."""

    def set_gripper(self, width: float, force: float) -> None:
        self._gripper.move(width, force)


WRONG_DRIVERS: dict[str, type[RobotDriver]] = {
    "making_a_link_connects_nothing": _driver(ConnectsAtOnce),
    "each_joint_has_one_finite_value": _driver(HasOneJointMore),
    "closing_is_allowed_at_any_time": _driver(ClosesOnlyWhenOpen),
    "an_open_link_is_ready_and_a_closed_one_is_not": _driver(ReadyForEver),
    "a_latched_stop_is_no_health": _driver(DeafToTheStop),
    "opening_moves_nothing": _driver(OpensTheFingers),
    "a_stop_reaches_the_gripper": _driver(LeavesTheGripper),
    "targets_start_where_the_arm_is": _driver(StartsAtHome),
    "sends_take_a_control_period_of_real_time": _driver(FreeRunning),
    "the_clock_goes_by_itself": _driver(CountedClock),
    "the_gripper_that_is_configured_moves": _driver(AsksTheIncludedGripper),
}


class CannotCloseTwice(FakeGripper):
    def close(self) -> None:
        assert self._open, "not open"
        super().close()


class ReadyUnopened(FakeGripper):
    def health(self) -> Health:
        return Health(True)


class HomesWhenOpened(FakeGripper):
    def open(self, gripper: GripperDescription) -> None:
        super().open(gripper)
        self.move(0.0, 10.0)


class WaitsForArrival(FakeGripper):
    def move(self, width: float, force: float) -> None:
        super().move(width, force)
        if 0.0 < width < self._gripper.stroke:
            time.sleep(0.6)


class ClipsSilently(FakeGripper):
    def move(self, width: float, force: float) -> None:
        super().move(min(max(width, 0.0), self._gripper.stroke), min(force, self._gripper.max_force))


class KeepsMoving(FakeGripper):
    def stop(self) -> None:
        self.calls.append("stop")


WRONG_GRIPPERS: dict[str, type[GripperDriver]] = {
    "closing_is_allowed_at_any_time": CannotCloseTwice,
    "health_follows_open_and_close": ReadyUnopened,
    "opening_moves_nothing": HomesWhenOpened,
    "the_fingers_go_where_they_are_sent": WaitsForArrival,
    "impossible_commands_are_refused": ClipsSilently,
    "a_stop_ends_the_motion": KeepsMoving,
}
