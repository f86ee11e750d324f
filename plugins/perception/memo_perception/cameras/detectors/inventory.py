"""The detector without a model: regions are matched to a list of what may be on the table, by colour and size.

Whole things first, then their parts near them. What fits no line of the list well, or two lines equally well, is called
"unknown thing 1" rather than guessed.
"""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import numpy as np
from scipy.optimize import linear_sum_assignment

from memo_core.scene.appearance import colour_name
from memo_core.scene.pose import Array
from memo_perception.cameras.detectors.detector import Detection, Detector, Request
from memo_perception.cameras.geometry.fitting import trimmed_extents
from memo_perception.cameras.geometry.panels import slides
from memo_perception.cameras.inventory import Hint, Item
from memo_perception.cameras.regions import Region
from memo_perception.cameras.settings import InventorySettings

NAME = "inventory"
_SAMPLES = 80  # pixels of a region whose colours are named
_SIZE_SCALE = 0.03  # m of difference in extents, summed, at which likeness of size is 1/e
_HIDDEN_WEIGHT = 0.5  # of what is missing of a size, against what is too much: things cover each other
_SHADED = 0.6
_NEXT = {
    frozenset(pair)
    for pair in (
        ("white", "grey"),
        ("grey", "black"),
        ("white", "beige"),
        ("brown", "orange"),
        ("brown", "beige"),
        ("brown", "black"),
    )
}  # colours that shade or glare turns into each other
_NEAR = 0.03  # m around a thing in which regions may be parts or pieces of it
_MARGIN = 0.06  # by which the best line must fit better than the next, for full confidence
_MARGIN_NOISE = 20.0  # more margin for each metre of depth noise
_SMALL = 0.012  # m: pieces smaller than this in all directions are not reported
_LEAST_POINTS = 40  # of an unknown thing


@attrs.frozen(eq=False)
class _Piece:
    """What is compared of a region, or of several together."""

    regions: tuple[Region, ...]
    low: Array  # (3,)
    high: Array  # (3,)
    extents: Array  # (3,) of the smallest upright box, descending
    colours: dict[str, float]  # word -> share of the pixels

    @property
    def ids(self) -> frozenset[int]:
        return frozenset(region.id for region in self.regions)

    @property
    def count(self) -> int:
        return sum(len(region.points) for region in self.regions)


class InventoryDetector(Detector):
    """See the module."""

    def __init__(self, settings: InventorySettings | None = None) -> None:
        self.settings = settings or InventorySettings()

    def detect(self, request: Request) -> tuple[Detection, ...]:
        pieces = [_piece((region,), request) for region in request.regions]
        wholes = _lines(item for item in request.inventory if not item.part_of and item.kind != "space")
        found = self._matched(wholes, pieces, request)
        taken = {id for _, piece, _ in found for id in piece.ids}
        parts = [item for item in request.inventory if item.part_of and item.kind == "part"]
        owners = {item.label: piece for item, piece, _ in found}
        for _ in range(3):  # a door's handle is a part of a part
            ready = [item for item in parts if item.part_of in owners and item.label not in owners]
            for owner in dict.fromkeys(item.part_of for item in ready):
                near = [one for one in pieces if not one.ids & taken and _touches(one, owners[owner])]
                own = self._matched([item for item in ready if item.part_of == owner], near, request)
                found += own
                taken |= {id for _, piece, _ in own for id in piece.ids}
                owners |= {item.label: piece for item, piece, _ in own}
        found = _completed(found, [one for one in pieces if not one.ids & taken], request)
        taken = {id for _, piece, _ in found for id in piece.ids}
        detections = [
            Detection(
                item.label, item.kind, part_of=item.part_of or None, regions=piece.ids, confidence=sure, source=NAME
            )
            for item, piece, sure in found
        ]
        named = {item.label for item, _, _ in found}
        detections += [
            Detection(item.label, "space", part_of=item.part_of, source=NAME)
            for item in request.inventory
            if item.kind == "space" and item.part_of in named
        ]
        unknown = [one for one in pieces if not one.ids & taken and one.count >= _LEAST_POINTS]
        unknown = [one for one in unknown if one.extents.max() > _SMALL and not _within(one, found)]
        detections += [
            Detection(
                f"unknown thing {i}", regions=one.ids, confidence=0.3, source=NAME, flag="fits no line of the list"
            )
            for i, one in enumerate(unknown, 1)
        ]
        return tuple(detections)

    def _matched(
        self, items: Sequence[Item], pieces: Sequence[_Piece], request: Request
    ) -> list[tuple[Item, _Piece, float]]:
        """The assignment of lines to pieces that fits best in all, without those that fit badly."""
        if not items or not pieces:
            return []
        needed = _MARGIN + _MARGIN_NOISE * max(0.0, request.noise - 0.001)
        fits = np.array([[_fit(item, piece, request.hints) for piece in pieces] for item in items])
        found = []
        for i, j in zip(*linear_sum_assignment(-fits), strict=True):
            rivals = [fits[k, j] for k in range(len(items)) if k != i and items[k].label != items[i].label]
            margin = fits[i, j] - max(rivals, default=0.0)
            sure = float(fits[i, j] * np.clip(0.5 + 0.5 * margin / needed, 0.0, 1.0))
            if sure >= self.settings.accept:
                found.append((items[i], pieces[j], round(sure, 3)))
        return found


def _lines(items: object) -> list[Item]:
    """One for each thing: a line that counts three is three lines."""
    return [item for item in items for _ in range(max(1, item.count))]  # type: ignore[attr-defined]


def _piece(regions: tuple[Region, ...], request: Request) -> _Piece:
    points = np.concatenate([region.points for region in regions])
    colours = np.concatenate([region.colours for region in regions])
    low, high = trimmed_extents(points, request.noise)
    extents = np.array([*_flat_extents(points[:, :2]), high[2] - low[2]])
    some = colours[np.linspace(0, len(colours) - 1, min(len(colours), _SAMPLES)).astype(int)] / 255.0
    words, counts = np.unique([colour_name(tuple(pixel)) for pixel in some.tolist()], return_counts=True)
    shares = dict(zip(words.tolist(), (counts / len(some)).tolist(), strict=True))
    return _Piece(regions, low, high, np.sort(extents)[::-1], shares)


def _flat_extents(flat: Array) -> tuple[float, float]:
    """Sides of the smallest rectangle around points seen from above, without the outermost."""
    best = (np.inf, 0.0, 0.0)
    some = flat[:: max(1, len(flat) // 800)]
    for yaw in np.radians(np.arange(0, 90, 7.5)):
        turned = some @ np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        low, high = np.percentile(turned, [2, 98], axis=0)
        a, b = (high - low).tolist()
        best = min(best, (a * b, a, b))
    return best[1], best[2]


def _fit(item: Item, piece: _Piece, hints: Sequence[Hint]) -> float:
    """How well a line describes a piece, 0 to 1."""
    middle = (piece.low + piece.high) / 2
    for hint in hints:
        place = hint.position
        if hint.label == item.label and place is not None and np.linalg.norm(middle - np.asarray(place)) < 0.05:
            return 0.0  # a person said that this is not it
    colour = 0.5
    if item.colours:
        colour = min(1.0, sum(share * _alike(word, item.colours) for word, share in piece.colours.items()) / 0.7)
    size = 0.5
    if item.size:
        wanted = np.sort(np.asarray(item.size, dtype=float))[::-1]
        size = _likeness(piece.extents, wanted)
        if slides(item.label):  # of a drawer that is pushed in the front is seen, and not how deep it is
            size = max(size, *(_likeness(piece.extents[:2], np.delete(wanted, axis)) for axis in range(3)))
        if item.kind == "part" and item.label.endswith("handle"):  # it stands on posts, as far out as they reach
            size = max(size, _likeness(piece.extents[[0, 2]], wanted[[0, 2]]))
    return float(np.sqrt(colour * size))


def _likeness(extents: Array, wanted: Array) -> float:
    """Of two lists of extents (m), descending: 1 for the same, 0 for very different."""
    excess = extents - wanted
    apart = np.maximum(excess, 0.0) + _HIDDEN_WEIGHT * np.maximum(-excess, 0.0)
    return float(np.exp(-apart.sum() / (_SIZE_SCALE + 0.15 * wanted.max())))


def _alike(word: str, wanted: Sequence[str]) -> float:
    """1 for a colour that is wanted, less for one that shade or glare makes of it."""
    return 1.0 if word in wanted else _SHADED if any(frozenset((word, one)) in _NEXT for one in wanted) else 0.0


def _touches(one: _Piece, other: _Piece) -> bool:
    return bool(np.all(one.low <= other.high + 2 * _NEAR) and np.all(one.high >= other.low - 2 * _NEAR))


def _within(one: _Piece, found: Sequence[tuple[Item, _Piece, float]]) -> bool:
    """Whether a left-over piece lies within something named, such as a shadow in a box."""
    middle = (one.low + one.high) / 2
    return any(np.all(middle >= piece.low - 0.005) and np.all(middle <= piece.high + 0.005) for _, piece, _ in found)


def _completed(
    found: list[tuple[Item, _Piece, float]], left: list[_Piece], request: Request
) -> list[tuple[Item, _Piece, float]]:
    """Left-over pieces are added to the thing they touch if that is then no larger than its line says, and they have
    one of its colours or are small against it."""
    done = []
    for item, piece, sure in found:
        for one in list(left):
            if not item.size or not _touches(one, piece):
                continue
            colours = set(item.colours) & {word for word, share in one.colours.items() if share > 0.3}
            if not colours and one.count > 0.1 * piece.count:
                continue
            grown = _piece((*piece.regions, *one.regions), request)
            wanted = np.sort(np.asarray(item.size, dtype=float))[::-1]
            if np.all(grown.extents <= 1.1 * wanted + 0.006):
                piece = grown
                left.remove(one)
        done.append((item, piece, sure))
    return done
