"""A link to an arm without dynamics that follows every command exactly, for tests of the code above a link."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.interfaces.link import Link
from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Array


class IdealLink(Link):
    """Follows every target exactly. ``thing`` is the width (m) of what is between the fingers, None for nothing;
    ``felt`` gives the contact wrench (6,) at targets (n,); ``blocked`` bounds how far each joint gets (rad), None where
    nothing is in the way; ``sent`` is the record of all targets and ``stop_at`` the number of sends after which the
    stop is pressed."""

    real_time = False
    can_restore = True
    feels_force = True

    def __init__(self, description: RobotDescription, start: Array | None = None) -> None:
        super().__init__(description)
        home = np.array(description.home, dtype=float) if start is None else np.array(start, dtype=float)
        self._joints, self._before, self._targets = home.copy(), home.copy(), home.copy()
        self._width = self._goal = description.gripper.stroke
        self._time = 0.0
        self.thing: float | None = None
        self.felt: Callable[[Array], Array] = lambda joints: np.zeros(6)
        self.blocked: Array | None = None
        self.sent: list[Array] = []
        self.stop_at: int | None = None

    def joint_positions(self) -> Array:
        return self._joints.copy()

    def joint_velocities(self) -> Array:
        return (self._joints - self._before) / self.control_period

    def joint_targets(self) -> Array:
        return self._targets.copy()

    def gripper_width(self) -> float:
        return self._width

    def holding(self) -> bool:
        return self.thing is not None and self._goal < self.thing and self._width <= self.thing + 1e-9

    def contact_wrench(self) -> Array:
        return np.array(self.felt(self._targets), dtype=float)

    def send(self, targets: Array) -> None:
        self.check_stop("moving")
        self._advance(targets)
        if self.stop_at is not None and len(self.sent) >= self.stop_at:
            self.stop_at = None
            self.stop()

    def halt(self, targets: Array) -> None:
        for row in targets:
            self._advance(row)

    def set_gripper(self, width: float, force: float) -> None:
        self.check_stop("moving the fingers")
        self._goal = float(np.clip(width, 0.0, self.description.gripper.stroke))

    def time(self) -> float:
        return self._time

    def checkpoint(self) -> bytes:
        numbers = [self._width, self._goal, self._time]
        return json.dumps([self._joints.tolist(), self._before.tolist(), self._targets.tolist(), numbers]).encode()

    def restore(self, checkpoint: bytes) -> None:
        try:
            joints, before, targets, (width, goal, time) = json.loads(checkpoint)
        except (ValueError, TypeError) as error:
            raise InvalidArgument("checkpoint", f"is not one of this link ({error})", "bytes of checkpoint()") from None
        self._joints, self._before, self._targets = np.array(joints), np.array(before), np.array(targets)
        self._width, self._goal, self._time = width, goal, time

    def _advance(self, targets: Array) -> None:
        self._targets = np.array(targets, dtype=float)
        self.sent.append(self._targets)
        self._before = self._joints
        self._joints = self._targets if self.blocked is None else np.minimum(self._targets, self.blocked)
        step = self.description.gripper.speed * self.control_period
        width = self._width + float(np.clip(self._goal - self._width, -step, step))
        self._width = width if self.thing is None or self._goal >= self.thing else max(width, self.thing)
        self._time += self.control_period
