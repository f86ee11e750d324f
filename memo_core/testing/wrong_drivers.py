"""Deliberately wrong drivers, one for each rule of the driver suites: the suites must reject each of them."""

from __future__ import annotations

import time

from memo_core.interfaces.driver import GripperDriver, RobotDriver
from memo_core.interfaces.link import Health, Link
from memo_core.interfaces.simulator import Simulator
from memo_core.robot.description import GripperDescription, RobotDescription
from memo_core.testing.fake_drivers import FakeDriverLink, FakeGripper


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


WRONG_DRIVERS: dict[str, type[RobotDriver]] = {
    "making_a_link_connects_nothing": _driver(ConnectsAtOnce),
    "closing_is_allowed_at_any_time": _driver(ClosesOnlyWhenOpen),
    "an_open_link_is_ready_and_a_closed_one_is_not": _driver(ReadyForEver),
    "a_latched_stop_is_no_health": _driver(DeafToTheStop),
    "opening_moves_nothing": _driver(OpensTheFingers),
    "a_stop_reaches_the_gripper": _driver(LeavesTheGripper),
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
