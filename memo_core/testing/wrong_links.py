"""Deliberately wrong links, one for each rule of ``memo_core.testing.link``: the suite must reject each of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.interfaces.link import Link
from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Array
from memo_core.testing.ideal_link import IdealLink


class ShortAnswers(IdealLink):
    def joint_velocities(self) -> Array:
        return super().joint_velocities()[:-1]


class SharedArrays(IdealLink):
    def joint_positions(self) -> Array:
        return self._joints


class MeasuredTargets(IdealLink):
    """Tells where the arm is instead of where it was sent."""

    def joint_targets(self) -> Array:
        return self._before.copy()


class SlowClock(IdealLink):
    def time(self) -> float:
        return self._time / 2


class StartsAtHome(IdealLink):
    """Takes its arm to be in its home posture, wherever it stands."""

    def __init__(self, description: RobotDescription) -> None:
        super().__init__(description)
        self._joints = self._joints + 0.3


class FreeRunning(IdealLink):
    """Counts control periods on hardware instead of waiting for them."""

    real_time = True


class LazyArm(IdealLink):
    def _advance(self, targets: Array) -> None:
        super()._advance(targets)
        self._joints = self._before + 0.01 * (self._targets - self._before)


class EagerGrip(IdealLink):
    """Takes closed fingers for a grip."""

    def holding(self) -> bool:
        return self._width < 0.001


class FeelsItsOwnMotion(IdealLink):
    def contact_wrench(self) -> Array:
        wrench = super().contact_wrench()
        wrench[2] += 200.0 * float(np.abs(self.joint_velocities()).max())
        return wrench


class StopForOneCommand(IdealLink):
    """The stop is not latched: the first refusal clears it."""

    def check_stop(self, where: str = "") -> None:
        try:
            super().check_stop(where)
        finally:
            self.release()


class DeafToThreads(IdealLink):
    """Hears only stops from the thread it was made in."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        import threading

        self._owner = threading.get_ident()

    def stop(self) -> None:
        import threading

        if threading.get_ident() == self._owner:
            super().stop()


class HaltReleases(IdealLink):
    def halt(self, targets: Array) -> None:
        super().halt(targets)
        self.release()


class ForgetfulCheckpoint(IdealLink):
    """Restores where the arm was, but not what it was sent to."""

    def restore(self, checkpoint: bytes) -> None:
        targets = self._targets
        super().restore(checkpoint)
        self._targets = targets


class TrustingRestore(IdealLink):
    def restore(self, checkpoint: bytes) -> None:
        try:
            super().restore(checkpoint)
        except InvalidArgument:
            self._joints = np.zeros_like(self._joints)


WRONG_LINKS: dict[str, type[Link]] = {
    "one_value_per_joint": ShortAnswers,
    "answers_are_copies": SharedArrays,
    "the_last_targets_are_told": MeasuredTargets,
    "a_send_takes_one_period": SlowClock,
    "targets_start_where_the_arm_is": StartsAtHome,
    "hardware_takes_real_time": FreeRunning,
    "the_arm_follows": LazyArm,
    "the_fingers_follow": EagerGrip,
    "a_free_hand_feels_nothing": FeelsItsOwnMotion,
    "stop_refuses_every_command": StopForOneCommand,
    "stop_comes_from_any_thread": DeafToThreads,
    "halting_is_allowed_while_stopped": HaltReleases,
    "checkpoints_are_exact": ForgetfulCheckpoint,
    "foreign_checkpoints_are_refused": TrustingRestore,
}
