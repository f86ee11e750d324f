"""Detectors in a chain: a model names and points, a segmenter masks, markers give poses.

One rule settles what two stages say of one thing: what the later one says holds, and what it leaves open (pixels,
state, owner) stays as the earlier one said. Two stages speak of one thing if the later one says which it refines, if
the labels are the same (of several, the one with which it shares most pixels), or if they share most of their pixels.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import attrs
import numpy as np

from memo_core.plugin import Ask, PerceptionContext
from memo_perception.cameras.detectors.detector import Detection, Detector, Request
from memo_perception.cameras.detectors.points import with_owners
from memo_perception.cameras.frames import Frame
from memo_perception.cameras.regions import Region

_SAME = 0.5  # intersection over union from which on two outlines are of one thing


class Chain(Detector):
    """Stages in order, each of which adds to what the earlier ones found, or refines it."""

    def __init__(self, stages: Sequence[Detector]) -> None:
        self.stages = tuple(stages)
        self.asks_model = any(stage.asks_model for stage in stages)
        self.needs_regions = any(stage.needs_regions for stage in stages)
        self.needs_sizes = any(stage.needs_sizes for stage in stages)
        for stage in stages[1:]:
            stage.refines = True

    def open(self) -> None:
        for number, stage in enumerate(self.stages):
            try:
                stage.open()
            except BaseException:
                for opened in self.stages[:number]:
                    opened.close()
                raise

    def start(self, context: PerceptionContext | None) -> None:
        for stage in self.stages:
            stage.start(context)

    def use_model(self, ask: Ask) -> None:
        for stage in self.stages:
            stage.use_model(ask)

    def detect(self, request: Request) -> tuple[Detection, ...]:
        found: tuple[Detection, ...] = ()
        for number, stage in enumerate(self.stages):
            later = any(other.cuts_out for other in self.stages[number + 1 :])
            said = stage.detect(attrs.evolve(request, found=found, cut_out_later=later))
            found = joined(found, said, request)
        return settled(found)

    def close(self) -> None:
        for stage in self.stages:
            stage.close()


def joined(found: Sequence[Detection], said: Sequence[Detection], request: Request) -> tuple[Detection, ...]:
    """Combine what earlier stages found with what a later one says, by the rule of this module."""
    result = list(found)
    left = {one.name for one in found}
    keys: dict[str, str] = {}
    for one in said:
        same = _same(one, [other for other in found if other.name in left], request)
        if same is None:
            keys[one.name] = _free(one.name, [other.name for other in result])
            result.append(attrs.evolve(one, key=keys[one.name]))
        else:
            keys[one.name] = same.name
            left.discard(same.name)
            result[[other.name for other in result].index(same.name)] = _refined(same, one)
    own = set(keys.values())
    told = [
        attrs.evolve(one, part_of=keys.get(one.part_of, one.part_of)) if one.part_of and one.name in own else one
        for one in result
    ]
    return tuple(sorted(told, key=lambda one: one.part_of is not None))


def settled(found: Iterable[Detection]) -> tuple[Detection, ...]:
    """Detections that have a place; owners of parts as in ``with_owners``."""
    return tuple(with_owners([one for one in found if one.placed]))


def overlap(one: Detection, other: Detection, frames: Iterable[Frame], regions: Sequence[Region]) -> float:
    """Intersection over union of two detections' pixels in all frames that show both; 0 if none does."""
    common = either = 0
    for frame in frames:
        a, b = one.pixels(frame, regions), other.pixels(frame, regions)
        if a is not None and b is not None:
            common += int(np.count_nonzero(a & b))
            either += int(np.count_nonzero(a | b))
    return common / either if either else 0.0


def _same(one: Detection, found: Sequence[Detection], request: Request) -> Detection | None:
    named = [other for other in found if other.name == one.refines]
    named = named or [other for other in found if other.label.lower() == one.label.lower()]
    if len(named) == 1:
        return named[0]
    alike = [other for other in named or found if (other.part_of is None) == (one.part_of is None)]
    shared = {other.name: overlap(one, other, request.frames, request.regions) for other in alike}
    best = max(alike, key=lambda other: shared[other.name], default=None)
    least = 0.0 if named else _SAME
    return best if best is not None and shared[best.name] > least else None


def _refined(earlier: Detection, later: Detection) -> Detection:
    pixels = later if later.masks or later.regions else earlier
    boxed = later if later.pose else earlier
    return attrs.evolve(
        later,
        key=earlier.name,
        part_of=later.part_of or earlier.part_of,
        state=later.state or earlier.state,
        masks=pixels.masks,
        regions=pixels.regions,
        prompts=earlier.prompts | later.prompts,
        pose=boxed.pose,
        size=boxed.size,
    )


def _free(key: str, taken: Sequence[str]) -> str:
    free, number = key, 2
    while free in taken:
        free, number = f"{key} {number}", number + 1
    return free
