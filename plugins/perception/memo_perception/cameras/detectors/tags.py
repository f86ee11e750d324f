"""ArUco and AprilTag markers stuck to things: exact names without a model, and poses where a marker's size is known.

What carries a marker that only names is the thing of an earlier stage under it, or the region; where there is none, the
square of the marker itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from memo_core.plugin import Pose, quaternion_from_rotation
from memo_perception.calibration.tags import found_corners
from memo_perception.cameras.detectors.detector import Detection, Detector, Request
from memo_perception.cameras.geometry.marker_pose import MarkerPose, Sighting, marker_pose
from memo_perception.cameras.regions import Region
from memo_perception.cameras.settings import TaggedThing, TagsSettings

_UNKNOWN = 0.1
_SURE = 0.99  # a wrong number is possible: dictionaries differ in how well they are told apart
_INTO = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])  # a box's axes in its tag's frame, as columns


class TagsDetector(Detector):
    """See the module. A tag whose number the settings do not name is on an unknown thing, unless it is in a chain; one
    number may tell the poses of several things, such as a door and its handle."""

    def __init__(self, settings: TagsSettings | None = None) -> None:
        self.settings = settings or TagsSettings()
        self._named: dict[int, list[TaggedThing]] = {}
        for one in self.settings.things:
            self._named.setdefault(one.number, []).append(one)

    def detect(self, request: Request) -> tuple[Detection, ...]:
        seen: dict[int, list[Sighting]] = {}
        for frame in request.frames:
            corners, numbers = found_corners(cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY), self.settings.dictionary)
            for square, number in zip(corners, numbers, strict=True):
                seen.setdefault(number, []).append(Sighting(frame, square))
        unlisted: list[TaggedThing | None] = [] if self.refines else [None]  # in a chain another stage names it
        found = [
            _detection(number, thing, seen[number], request)
            for number in sorted(seen)
            for thing in self._named.get(number, unlisted)
        ]
        whole = [one for one in found if one is not None]
        if not self.refines:  # else the chain knows what owners there are
            labels = {one.label for one in whole}
            whole = [one for one in whole if one.part_of is None or one.part_of in labels]
        return tuple(sorted(whole, key=lambda one: one.part_of is not None))


def _detection(number: int, known: TaggedThing | None, seen: Sequence[Sighting], request: Request) -> Detection | None:
    if known is not None and known.side:
        return _posed(known, seen, request)
    carrier = _carrier(known, seen, request.found) if known is not None else None
    regions = {under for one in seen if (under := _under(one, request.regions)) is not None}
    alone = [one for one in seen if _single(one, seen) and _under(one, request.regions) is None]
    masks = {one.frame.name: _filled(one) for one in alone} if not regions else {}
    if carrier is not None:
        regions, masks = set(), {}  # it is known better than by its tag
    elif not regions and not masks:
        return None
    flag = "" if len(regions) < 2 else f"tag {number} is on several things"
    if known is None:
        return Detection(
            "unknown thing",
            key=f"tag {number}",
            masks=masks,
            regions=frozenset(regions),
            confidence=_UNKNOWN,
            source="tags",
            flag=f"tag {number} is not among perception.tags.things",
        )
    return Detection(
        known.label,
        known.kind,
        known.label,
        _owner(known, request.found),
        masks=masks,
        regions=frozenset(regions),
        confidence=0.4 if flag else _SURE,
        source="tags",
        flag=flag,
        refines="" if carrier is None else carrier.name,
    )


def _posed(known: TaggedThing, seen: Sequence[Sighting], request: Request) -> Detection | None:
    """Detection of a thing that takes its pose from its tag, or None if the tag tells none."""
    single = [one for one in seen if _single(one, seen)]
    found = marker_pose(single, known.side, request.noise) if single else None
    if found is None:
        return None
    return Detection(
        known.label,
        known.kind,
        known.label,
        _owner(known, request.found),
        confidence=0.4 if found.flag else _SURE,
        source="tags",
        flag=found.flag,
        pose=box_pose(found, known),
        size=known.extents,
    )


def box_pose(marker: MarkerPose, thing: TaggedThing) -> Pose:
    """The pose of the middle of a thing's box, from its marker's."""
    to_box = Pose(thing.offset, quaternion_from_rotation(_INTO @ _turned(*thing.turn)))
    return marker.pose * to_box


def _turned(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Rotation about x, then y, then z, all fixed, as in a URDF."""
    about = [np.eye(3)[axis] * angle for axis, angle in enumerate((roll, pitch, yaw))]
    x, y, z = (cv2.Rodrigues(turn)[0] for turn in about)
    return z @ y @ x


def _owner(known: TaggedThing, found: Sequence[Detection]) -> str | None:
    """Name of what it is part of: of an earlier stage's thing with that label, else the label itself."""
    if not known.part_of:
        return None
    return next((one.name for one in found if one.label.lower() == known.part_of.lower()), known.part_of)


def _carrier(known: TaggedThing, seen: Sequence[Sighting], found: Sequence[Detection]) -> Detection | None:
    """The thing of an earlier stage that carries a tag: the one with its label, else the smallest whose pixels hold
    most of the tag, and which is a part if the tagged thing is one."""
    labelled = [one for one in found if one.label.lower() == known.label.lower()]
    if len(labelled) == 1:
        return labelled[0]
    alike = [one for one in labelled or found if (one.kind == "part") == (known.kind == "part") and one.masks]
    under = [one for one in alike if any(_covers(one, sighting) for sighting in seen)]
    return min(under, key=lambda one: sum(map(np.count_nonzero, one.masks.values())), default=None)


def _covers(one: Detection, sighting: Sighting) -> bool:
    mask, inside = one.masks.get(sighting.frame.name), _filled(sighting)
    return mask is not None and bool(np.count_nonzero(mask & inside) > np.count_nonzero(inside) / 2)


def _single(one: Sighting, seen: Sequence[Sighting]) -> bool:
    """Whether its picture shows the number once: twice it says nothing about which is which."""
    return sum(other.frame is one.frame for other in seen) == 1


def _under(sighting: Sighting, regions: tuple[Region, ...]) -> int | None:
    """The region that most of the tag lies on."""
    inside = _filled(sighting)
    best = max(
        (
            (int((mask & inside).sum()), region.id)
            for region in regions
            if (mask := region.masks.get(sighting.frame.name)) is not None
        ),
        default=(0, 0),
    )
    return best[1] if best[0] > inside.sum() / 2 else None


def _filled(sighting: Sighting) -> np.ndarray:
    filled = np.zeros(sighting.frame.rgb.shape[:2], dtype=np.uint8)
    cv2.fillConvexPoly(filled, np.round(sighting.corners).astype(np.int32), 1)
    return filled.astype(bool)
