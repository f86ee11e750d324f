"""The detector without a model: regions are matched to a list of what may be on the table, by colour and size.

Whole things first, then their parts near them. What fits no line of the list well, or two lines equally well, is called
"unknown thing 1" rather than guessed.
"""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import numpy as np

from memo_core.plugin import Array, colour_name
from memo_perception.cameras.detectors.detector import Detection, Detector, Request
from memo_perception.cameras.detectors.likelihood import Piece, most_likely
from memo_perception.cameras.geometry.fitting import trimmed_extents
from memo_perception.cameras.inventory import Item
from memo_perception.cameras.regions import Region
from memo_perception.cameras.settings import InventorySettings

NAME = "inventory"
_SAMPLES = 80  # pixels of a region whose colours are named
_NEAR = 0.03  # m around a thing in which regions may be parts or pieces of it
_BESIDE = 0.01  # m between pieces up to which they may be one thing
_UNCOVERED = 0.9  # of a piece's outline, from which on it is taken to be seen whole
_SMALL = 0.012  # m: pieces smaller than this in all directions are not reported
_LEAST_POINTS = 40  # of an unknown thing
_SLACK, _SLACK_NOISE = 0.006, 2.0  # m, and times the deviation of depth, by which pieces together may exceed a line
_POINTS_DEVIATION = (0.005, 1.5)  # m, and share of the deviation of depth: of extents that only points tell


class InventoryDetector(Detector):
    """See the module."""

    needs_sizes = True

    def __init__(self, settings: InventorySettings | None = None) -> None:
        self.settings = settings or InventorySettings()

    def detect(self, request: Request) -> tuple[Detection, ...]:
        pieces = _alone([_piece((region,), request) for region in request.regions])
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
        self, items: Sequence[Item], pieces: Sequence[Piece], request: Request
    ) -> list[tuple[Item, Piece, float]]:
        """The likeliest lines of pieces, without those that are not sure enough."""

        def together(item: Item, piece: Piece, other: Piece) -> bool:
            return _together(item, piece, other, request) is not None

        found = most_likely(items, pieces, request.hints, together)
        return [(item, piece, round(sure, 3)) for item, piece, sure in found if sure >= self.settings.accept]


def _alone(pieces: list[Piece]) -> list[Piece]:
    """The same, with those marked that show all of a thing: nothing covers them in one picture, and nothing touches
    them that may be another piece of the same thing."""

    def bare(piece: Piece) -> bool:
        near = (other for other in pieces if other is not piece and _touches(piece, other, _BESIDE))
        return piece.regions[0].uncovered >= _UNCOVERED and not any(near)

    return [attrs.evolve(piece, bare=bare(piece)) for piece in pieces]


def _lines(items: object) -> list[Item]:
    """One for each thing: a line that counts three is three lines."""
    return [item for item in items for _ in range(max(1, item.count))]  # type: ignore[attr-defined]


def _piece(regions: tuple[Region, ...], request: Request) -> Piece:
    points = np.concatenate([region.points for region in regions])
    colours = np.concatenate([region.colours for region in regions])
    low, high = trimmed_extents(points, request.noise)
    size, deviation = regions[0].size, regions[0].deviation
    if size is None or len(regions) > 1:
        size = (*_flat_extents(points[:, :2]), float(high[2] - low[2]))
        deviation = _POINTS_DEVIATION[0] + _POINTS_DEVIATION[1] * request.noise
    some = colours[np.linspace(0, len(colours) - 1, min(len(colours), _SAMPLES)).astype(int)] / 255.0
    words, counts = np.unique([colour_name(tuple(pixel)) for pixel in some.tolist()], return_counts=True)
    shares = dict(zip(words.tolist(), (counts / len(some)).tolist(), strict=True))
    return Piece(regions, low, high, np.sort(np.asarray(size))[::-1], deviation, shares)


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


def _touches(one: Piece, other: Piece, reach: float = 2 * _NEAR) -> bool:
    return bool(np.all(one.low <= other.high + reach) and np.all(one.high >= other.low - reach))


def _within(one: Piece, found: Sequence[tuple[Item, Piece, float]]) -> bool:
    """Whether a left-over piece lies within something named, such as a shadow in a box."""
    middle = (one.low + one.high) / 2
    return any(np.all(middle >= piece.low - 0.005) and np.all(middle <= piece.high + 0.005) for _, piece, _ in found)


def _completed(
    found: list[tuple[Item, Piece, float]], left: list[Piece], request: Request
) -> list[tuple[Item, Piece, float]]:
    """Left-over pieces are added to the thing that they may be of."""
    done = []
    for item, piece, sure in found:
        for one in list(left):
            if (grown := _together(item, piece, one, request)) is not None:
                piece = grown
                left.remove(one)
        done.append((item, piece, sure))
    return done


def _together(item: Item, piece: Piece, one: Piece, request: Request) -> Piece | None:
    """Both pieces as one, if they touch, are together no larger than the line says, and ``one`` has one of its colours
    or is small against it; None if they cannot be the same thing."""
    if not item.size or one is piece or not _touches(one, piece):
        return None
    colours = set(item.colours) & {word for word, share in one.colours.items() if share > 0.3}
    if not colours and one.count > 0.1 * piece.count:
        return None
    grown = _piece((*piece.regions, *one.regions), request)
    wanted = np.sort(np.asarray(item.size, dtype=float))[::-1]
    slack = _SLACK + _SLACK_NOISE * max(0.0, request.noise - 0.0005)
    return grown if np.all(grown.extents <= 1.1 * wanted + slack) else None
