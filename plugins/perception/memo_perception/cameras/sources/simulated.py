"""Frames of a simulated scene's cameras, as perfect as rendered or with a depth camera's noise and a wrong
calibration."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from memo_core.plugin import Camera, InvalidArgument, PerceptionContext, Pose, quaternion_from_axis_angle
from memo_perception.cameras.frames import Frame, Intrinsics
from memo_perception.cameras.settings import SimulatedSettings
from memo_perception.cameras.sources.depth_noise import NOISE, noisy
from memo_perception.cameras.sources.source import Source


class SimulatedSource(Source):
    """Renders RGB and depth through the simulator's own renderer. The noise is drawn from a generator of its own,
    seeded by the environment; its state belongs to a checkpoint, so that after a restore the same pictures come again.
    The errors of calibration are drawn once, at ``start``."""

    def __init__(self, settings: SimulatedSettings | None = None) -> None:
        self.settings = settings or SimulatedSettings()
        self._context: PerceptionContext | None = None
        self._errors: dict[str, Pose] = {}
        self._rng = np.random.default_rng(0)

    def start(self, context: PerceptionContext | None) -> None:
        if context is None or context.simulator is None or context.scene is None:
            problem = "'simulated' renders a simulator's cameras, and there is none"
            raise InvalidArgument("perception.source", problem, "a source for real cameras, or 'folder'")
        if not context.scene.cameras:
            raise InvalidArgument("perception.source", "the scene has no camera", "a scene with cameras")
        there = [camera.name for camera in context.scene.cameras]
        if missing := [name for name in self.settings.cameras if name not in there]:
            key, problem = "perception.simulated.cameras", f"the scene has no camera {missing[0]!r}"
            raise InvalidArgument(key, problem, f"some of: {', '.join(there)}")
        self._context = context
        self._rng = np.random.default_rng(context.rng.integers(2**63))
        self._errors = {camera.name: self._calibration_error() for camera in context.scene.cameras}

    def capture(self) -> tuple[Frame, ...]:
        context = self._context
        if context is None or context.scene is None:
            raise InvalidArgument("perception.source", "captured before start()", "start(context) first")
        own = self.settings.cameras
        return tuple(self._frame(camera) for camera in context.scene.cameras if not own or camera.name in own)

    def state(self) -> bytes:
        return json.dumps(self._rng.bit_generator.state).encode()

    def restore(self, state: bytes) -> None:
        self._rng.bit_generator.state = json.loads(state)

    def _frame(self, camera: Camera) -> Frame:
        simulator = self._context.simulator  # type: ignore[union-attr]
        assert simulator is not None
        width, height = camera.resolution
        scale = self.settings.width / width
        width, height = self.settings.width, round(height * scale)
        intrinsics = Intrinsics.from_field_of_view(camera.field_of_view, width, height)
        rgb = simulator.render(camera.name, width, height)
        depth = simulator.render_depth(camera.name, width, height)
        depth = np.where(np.isfinite(depth), depth, 0.0).astype(np.float32)
        if self.settings.noise != "none":
            depth = noisy(depth, intrinsics, NOISE[self.settings.noise], self._rng)
        pose = camera.pose if not camera.link else simulator.body_pose(f"robot/{camera.link}") * camera.pose
        return Frame(camera.name, rgb, depth, intrinsics, pose * self._errors[camera.name], simulator.time)

    def _calibration_error(self) -> Pose:
        """Believed camera pose in the true one: of the set distance and angle, in a random direction."""
        shift, axis = _direction(self._rng) * self.settings.calibration_error, _direction(self._rng)
        return Pose(tuple(shift), quaternion_from_axis_angle(axis.tolist(), self.settings.calibration_rotation))


def _direction(rng: np.random.Generator) -> Any:
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)
