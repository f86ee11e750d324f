"""The simulator's own masks and names, to measure the geometry alone. For tests and benchmarks only: it sees through
nothing, but it is never wrong about what a pixel belongs to.

Of a body's pixels, those whose true point lies in a part's box belong to the part. States (open, closed) and everything
metric are left to the geometry. In a chain it takes the place of a segmenter: it masks what earlier stages point at,
and names nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from memo_core.plugin import Array, Camera, InvalidArgument, PerceptionContext, Pose, SceneDescription, Simulator
from memo_perception.cameras.detectors.detector import Detection, Detector, Prompt, Request
from memo_perception.cameras.detectors.local import cut_out_found
from memo_perception.cameras.detectors.model_answers import Box, overlap
from memo_perception.cameras.frames import Frame, Intrinsics
from memo_perception.labelled_things import Thing, labelled_things

LEAST_PIXELS = 12  # of a thing in all pictures together, to be detected
_PART_MARGIN = 0.004  # m by which a part's box may miss its own surface
_AT_POINT = 4  # px beside a point within which a thing may be meant
_FITS = 0.4  # intersection over union of a box with that around a mask, from which the mask may be meant
_BEFORE = 0.015  # m before a wall, seen from the camera, that must lie in the cavity for the wall to be its lining


class OracleDetector(Detector):
    """See the module."""

    needs_regions = False
    cuts_out = True

    def __init__(self) -> None:
        self._context: PerceptionContext | None = None
        self._things: tuple[Thing, ...] = ()
        self._owner: dict[str, str] = {}
        self._heap: dict[str, str] = {}

    def start(self, context: PerceptionContext | None) -> None:
        if context is None or context.simulator is None or context.scene is None:
            raise InvalidArgument("perception.detector", "'oracle' reads a simulator, and there is none", "another one")
        self._context = context
        self._things = tuple(labelled_things(context.scene))
        self._owner = _owners(context.scene)
        self._heap = {body.name: body.heap for body, _ in context.scene.walk() if body.heap}

    def detect(self, request: Request) -> tuple[Detection, ...]:
        seen = self._seen(request)
        if not self.refines:
            return seen
        frames = {id(frame.rgb): frame.name for frame in request.frames}

        def cut(rgb: np.ndarray, prompts: list[Prompt]) -> list[np.ndarray]:
            shapes = _with_parts(seen, frames[id(rgb)])
            return [_prompted(prompt, shapes, rgb.shape[:2]) for prompt in prompts]

        return cut_out_found(request, cut, "oracle")

    def _seen(self, request: Request) -> tuple[Detection, ...]:
        assert self._context is not None and self._context.scene is not None, "detect() before start()"
        cameras = {camera.name: camera for camera in self._context.scene.cameras}
        masks: dict[str, dict[str, np.ndarray]] = {}
        for frame in request.frames:
            if frame.name not in cameras:
                raise InvalidArgument("frames", f"{frame.name!r} is no camera of the scene", ", ".join(cameras))
            for id, mask in self._masks(frame, cameras[frame.name]):
                masks.setdefault(id, {})[frame.name] = mask
        enough = {id: seen for id, seen in masks.items() if sum(map(np.count_nonzero, seen.values())) >= LEAST_PIXELS}
        named = [
            Detection(thing.label, thing.kind, thing.id, thing.part_of, None, enough[thing.id], source="oracle")  # type: ignore[arg-type]
            for thing in self._things
            if thing.id in enough
        ]
        heaps = [
            Detection(label, "heap", f"heap/{label}", None, None, enough[f"heap/{label}"], source="oracle")
            for label in dict.fromkeys(self._heap.values())
            if f"heap/{label}" in enough
        ]
        return (*named, *heaps)

    def _masks(self, frame: Frame, camera: Camera) -> Iterator[tuple[str, np.ndarray]]:
        """Pairs of a thing's id and its pixels."""
        simulator = self._context.simulator  # type: ignore[union-attr]
        assert simulator is not None
        width, height = frame.size
        index, names = simulator.render_segmentation(camera.name, width, height)
        points = _true_points(simulator, camera, width, height)
        present = {names[i]: i for i in np.unique(index) if i >= 0}
        heaps: dict[str, np.ndarray] = {}
        bodies: dict[str, np.ndarray] = {}
        for name, number in present.items():
            mask = index == number
            if name in self._heap:
                id = f"heap/{self._heap[name]}"
                heaps[id] = heaps.get(id, False) | mask
            elif name in self._owner:
                owner = self._owner[name]
                bodies[owner] = bodies.get(owner, False) | mask
        yield from heaps.items()
        for thing in self._things:
            mask = bodies.get(thing.body.name)
            if mask is None or thing.kind == "space" or thing.id == thing.body.name:
                continue
            own = _in_box(points, mask, simulator.body_pose(thing.body.name) * thing.pose, thing.size, _PART_MARGIN)
            bodies[thing.body.name] = mask & ~own
            if own.any():
                yield thing.id, own
        for thing in self._things:
            mask = bodies.get(thing.body.name)
            if mask is None:
                continue
            if thing.kind == "space":
                rays = points - np.asarray(_camera_pose(simulator, camera).position)
                before = points - _BEFORE * rays / np.linalg.norm(rays, axis=-1, keepdims=True)
                lining = _in_box(before, mask, simulator.body_pose(thing.body.name) * thing.pose, thing.size, 0.0)
                if lining.any():
                    yield thing.id, lining
            elif thing.id == thing.body.name and mask.any():
                yield thing.id, mask


def _with_parts(seen: Sequence[Detection], frame: str) -> list[np.ndarray]:
    """Masks of a frame: of each thing alone, and with its parts, as a segmenter sees furniture with its doors."""
    own = {one.name: one.masks[frame] for one in seen if frame in one.masks}
    whole = dict(own)
    for one in reversed(seen):  # parts come after what they are part of
        if one.kind == "part" and one.part_of in whole and one.name in whole:
            whole[one.part_of] = whole[one.part_of] | whole[one.name]
    return [*own.values(), *whole.values()]


def _prompted(prompt: Prompt, shapes: Sequence[np.ndarray], size: tuple[int, ...]) -> np.ndarray:
    """The mask whose outline fits a box best, or the smallest one at a point; empty where there is none."""
    nothing = np.zeros(size, dtype=bool)
    if len(prompt) == 2:
        x, y = round(prompt[0]), round(prompt[1])
        near = (slice(max(0, y - _AT_POINT), y + _AT_POINT + 1), slice(max(0, x - _AT_POINT), x + _AT_POINT + 1))
        here = [mask for mask in shapes if mask[y, x]] or [mask for mask in shapes if mask[near].any()]
        return min(here, key=np.count_nonzero, default=nothing)
    fits = [overlap(_around(mask), (prompt[0], prompt[1], prompt[2], prompt[3])) for mask in shapes]
    best = int(np.argmax(fits)) if fits else -1
    return shapes[best] if best >= 0 and fits[best] > _FITS else nothing


def _around(mask: np.ndarray) -> Box:
    rows, columns = np.nonzero(mask)
    return float(columns.min()), float(rows.min()), float(columns.max() + 1), float(rows.max() + 1)


def _owners(scene: SceneDescription) -> dict[str, str]:
    """Every body's nearest body with a label or parts, itself or above it."""
    found: dict[str, str] = {}
    for body, parent in scene.walk():
        if body.label or body.parts:
            found[body.name] = body.name
        elif parent is not None and parent.name in found:
            found[body.name] = found[parent.name]
    return found


def _true_points(simulator: Simulator, camera: Camera, width: int, height: int) -> Array:
    """What each pixel truly shows, in the base frame (m), shape (H, W, 3)."""
    depth = simulator.render_depth(camera.name, width, height)
    pose = _camera_pose(simulator, camera)
    intrinsics = Intrinsics.from_field_of_view(camera.field_of_view, width, height)
    depth = np.where(np.isfinite(depth), depth, 0.0).astype(np.float32)
    return Frame(camera.name, np.zeros((height, width, 3), np.uint8), depth, intrinsics, pose).points()


def _camera_pose(simulator: Simulator, camera: Camera) -> Pose:
    return camera.pose if not camera.link else simulator.body_pose(f"robot/{camera.link}") * camera.pose


def _in_box(points: Array, mask: np.ndarray, pose: Pose, size: tuple[float, ...], margin: float) -> np.ndarray:
    """Those pixels of ``mask`` whose points lie in a box grown by ``margin``, shape (H, W)."""
    inside = np.zeros_like(mask)
    local = np.abs(pose.inverse().apply(points[mask]))
    inside[mask] = np.all(local <= np.asarray(size) / 2 + margin, axis=1)
    return inside
