"""Imagining code: executing it in the robot-code sandbox with a recorder in place of the robot."""

from __future__ import annotations

import threading

from memo_core.plugin import BUILTIN_SKILLS, Command, Pose, RecordingControl, SceneGraph, skill_library
from memo_core.sandbox import Limits, Sandbox

# These limits are by the clock on the wall: what is read out of a template must not depend on the machine's load.
PATIENCE = Limits(seconds_between_calls=60.0, seconds_in_all=120.0)


def hand_over(scene: SceneGraph) -> RecordingControl:
    """A recorded hand above the scene that points down; no robot moves."""
    return RecordingControl(scene, Pose(scene.observation.end_effector.position, (0.0, 1.0, 0.0, 0.0)))


class Imagination:
    """Starts processes at the first use; ``close`` ends them, and with them what is still being imagined."""

    def __init__(self) -> None:
        self._sandbox = Sandbox(skill_library(BUILTIN_SKILLS), PATIENCE)
        self._closed = threading.Event()

    def open(self) -> None:
        self._closed.clear()

    def close(self) -> None:
        self._closed.set()
        self._sandbox.close()

    def __enter__(self) -> Imagination:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def commands(self, code: str, scene: SceneGraph) -> list[Command]:
        """The recorded motion of the hand when the code runs on the scene; up to where it failed, if it did, since what
        fails half-way was still going somewhere."""
        hand = hand_over(scene)
        self._sandbox.run(code, hand, stopped=self._closed.is_set)
        return hand.commands
