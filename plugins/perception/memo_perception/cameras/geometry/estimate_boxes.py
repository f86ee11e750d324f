"""From detections to measured things: whole things first, from the table up, then their parts, then their insides."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import attrs
import numpy as np
from scipy.spatial import cKDTree

from memo_core.plugin import Array, Pose, colour_name
from memo_perception.cameras.detectors.detector import Detection, State
from memo_perception.cameras.geometry.cavities import LEAST_POINTS, fit_inside, is_lining
from memo_perception.cameras.geometry.fitting import Fit, Seen, extents, fit_thing, trimmed_extents
from memo_perception.cameras.geometry.panels import (
    fit_panel,
    fit_part,
    in_frame,
    is_closer,
    is_open,
    owner_frame,
    slides,
)
from memo_perception.cameras.geometry.silhouettes import main_pieces, silhouette
from memo_perception.cameras.geometry.table import View
from memo_perception.cameras.inventory import Kind
from memo_perception.cameras.regions import Region

_STANDS = 0.02  # m between a thing's underside and what it stands on
_FEW_PIXELS = 150.0  # at which confidence in a box is halved
_ROUGH = 0.01  # m of outline residual at which confidence in a box is halved
_PANEL = 0.06  # m: what is thicker is no door or drawer front
_BAR = 1.6  # length, and height over what it is fixed to, against its width, from which on a handle is a bar on posts
_SHAPED = (0.0025, 0.2)  # deviation of an extent that outlines tell: m, and share of the deviation of depth
_UNSHAPED = (0.004, 0.8)  # the same of one that only points tell
_LONE = 0.1  # of the neighbours that most points have, up to which one is a flying pixel
_SECOND_COLOUR = 0.2  # share of the pixels from which on a second colour is named


@attrs.frozen(eq=False)
class Measured:
    """One thing with its box, before it has an id that stays. ``key`` and ``part_of`` are those of detections."""

    key: str
    label: str
    kind: Kind
    part_of: str | None
    pose: Pose
    size: tuple[float, float, float]
    opening: tuple[float, float, float] | None = None
    state: State | None = None
    confidence: float = 1.0
    attributes: tuple[str, ...] = ()
    flag: str = ""
    outlines: int = 0


@attrs.frozen(eq=False)
class _Found:
    detection: Detection
    seen: Seen
    pixels: int
    colours: np.ndarray  # (N, 3) uint8


def measure(
    views: Sequence[View],
    blocked: dict[str, np.ndarray],
    detections: Sequence[Detection],
    regions: Sequence[Region],
    table_height: float,
) -> tuple[Measured, ...]:
    """The boxes and states of what was detected. ``blocked``: frame name -> pixels that the arm covers. What shows no
    depth anywhere is left out."""
    by_id = {region.id: region for region in regions}
    found = {
        detection.name: one for detection in detections if (one := _found(views, blocked, detection, by_id)) is not None
    }
    marked = {one.name: one for one in detections if one.pose is not None}
    left = {name: one for name, one in found.items() if name not in marked}
    wholes = [one for one in left.values() if one.detection.part_of is None and one.detection.kind != "heap"]
    fits = _wholes(wholes, table_height)
    for name, fit in list(fits.items()):
        if found[name].detection.kind == "fixture":
            fits[name] = in_frame(fit, owner_frame(fit, _front(found[name], found.values())))
    states: dict[str, State] = {}
    fits |= {name: _fit_of_marker(one) for name, one in marked.items()}
    for one in _parts_in_order(left, fits):
        detection = one.detection
        owner = fits[detection.part_of or ""]
        if is_closer(detection.label):
            fits[detection.name] = fit_panel(one.seen, detection.label, owner)
            states[detection.name] = "open" if is_open(fits[detection.name], owner) else "closed"
        else:
            bar = _bar(one, owner, views, blocked, by_id)
            fits[detection.name] = fit_part((bar or one).seen, owner)
    for name, closer in marked.items():
        if closer.part_of in fits and is_closer(closer.label):
            states[name] = "open" if is_open(fits[name], fits[closer.part_of]) else "closed"
    measured = [_measured(found[name], fit, states.get(name)) for name, fit in fits.items() if name not in marked]
    measured += [
        _marked(thing, fits[name], states.get(name), found.get(name))
        for name, thing in marked.items()
        if thing.part_of is None or thing.part_of in fits
    ]
    measured += [_heap(one, table_height) for one in found.values() if one.detection.kind == "heap"]
    return (*measured, *_insides(found, fits, states, detections))


def sized(
    regions: Sequence[Region], views: Sequence[View], blocked: dict[str, np.ndarray], table_height: float
) -> tuple[Region, ...]:
    """The regions with their sizes, each measured as if it were one thing."""
    alone = [Detection(str(region.id), regions=frozenset({region.id})) for region in regions]
    by_id = {region.id: region for region in regions}
    found = {one.name: seen for one in alone if (seen := _found(views, blocked, one, by_id)) is not None}
    fits = _wholes(found.values(), table_height)

    def change(region: Region) -> Region:
        fit = fits.get(str(region.id))
        if fit is None:
            return region
        seen = found[str(region.id)].seen
        noise, uncovered = seen.noise, max(float(one.valid.mean()) for one in seen.silhouettes)
        deviation = _SHAPED[0] + _SHAPED[1] * noise if fit.explained else _UNSHAPED[0] + _UNSHAPED[1] * noise
        return attrs.evolve(region, size=fit.size, deviation=deviation, uncovered=uncovered)

    return tuple(change(region) for region in regions)


def _wholes(wholes: Iterable[_Found], table_height: float) -> dict[str, Fit]:
    """Whole things by name, from the table up, since what a thing stands on tells where it begins."""
    fits: dict[str, Fit] = {}
    for one in sorted(wholes, key=lambda whole: float(np.percentile(whole.seen.points[:, 2], 3))):
        seen = attrs.evolve(one.seen, support=_support(one.seen, table_height, fits.values()))
        fits[one.detection.name] = fit_thing(seen)
    return fits


def _found(
    views: Sequence[View], blocked: dict[str, np.ndarray], detection: Detection, regions: dict[int, Region]
) -> _Found | None:
    points: list[Array] = []
    colours, outlines, noises, cameras, pixels = [], [], [], [], 0
    whole = detection.kind in ("object", "fixture")
    for view in views:
        mask = _mask(view, detection, regions)
        if mask is None:
            continue
        cover = blocked.get(view.frame.name)
        if cover is not None:
            mask = mask & ~cover
        if not mask.any():
            continue
        if whole:
            mask = main_pieces(mask)
        outline = silhouette(view, mask, cover)
        if outline is None:
            continue
        own = view.points[mask]
        measured = np.isfinite(own[:, 0])
        cameras.append(np.full(np.count_nonzero(measured), len(points)))
        points.append(own[measured])
        colours.append(view.frame.rgb[mask][measured])
        outlines.append(outline)
        noises.append(view.noise)
        pixels += int(np.count_nonzero(mask))
    if not points or sum(map(len, points)) < 5:
        return None
    seen = Seen(np.concatenate(points), np.concatenate(cameras), tuple(outlines), float(np.mean(noises)))
    seen = seen if whole else _without_lone_points(seen)
    return _Found(detection, _without_strays(seen), pixels, np.concatenate(colours))


def _bar(
    handle: _Found, panel: Fit, views: Sequence[View], blocked: dict[str, np.ndarray], regions: dict[int, Region]
) -> _Found | None:
    """A handle without the posts that fix it to a door or drawer front: a bar stands out as far as any of it, and is as
    deep as it is wide. None for what is no bar on posts."""
    thin = int(np.argmin(panel.size))
    out = panel.pose.rotation[:, thin]
    points = handle.seen.points - np.asarray(panel.pose.position)
    out = out if np.median(points @ out) > 0 else -out
    low, high = trimmed_extents(np.delete(points @ panel.pose.rotation, thin, axis=1), handle.seen.noise)
    short, long = sorted(float(extent) for extent in high - low)
    near, far = np.percentile(points @ out, [3, 97])
    if panel.size[thin] > _PANEL or long < _BAR * short or far - near < _BAR * short:
        return None
    cut = far - 1.2 * short - handle.seen.noise
    masks = {}
    for view in views:
        mask = _mask(view, handle.detection, regions)
        if mask is not None:
            with np.errstate(invalid="ignore"):
                masks[view.frame.name] = mask & ((view.points - np.asarray(panel.pose.position)) @ out > cut)
    return _found(views, blocked, attrs.evolve(handle.detection, masks=masks, regions=frozenset()), {})


def _mask(view: View, detection: Detection, regions: dict[int, Region]) -> np.ndarray | None:
    name = view.frame.name
    masks = [detection.masks[name]] if name in detection.masks else []
    masks += [regions[id].masks[name] for id in detection.regions if id in regions and name in regions[id].masks]
    return np.logical_or.reduce(masks) if masks else None


def _without_lone_points(seen: Seen) -> Seen:
    """Without points that have few others near them. Along the edges of a thin part in front of something far, flying
    pixels are so many that its percentiles are theirs, but they are spread over the way to what is behind."""
    near = cKDTree(seen.points).query_ball_point(seen.points, 0.01 + 2 * seen.noise, return_length=True)
    return seen_at(seen, near > _LONE * np.median(near))


def _without_strays(seen: Seen) -> Seen:
    """Without points far from the others, such as the flying pixels along an edge."""
    low, high = np.percentile(seen.points, [2, 98], axis=0)
    reach = 0.35 * (high - low) + 0.01 + 2 * seen.noise
    near = np.all((seen.points > low - reach) & (seen.points < high + reach), axis=1)
    return seen_at(seen, near) if np.count_nonzero(near) >= 5 else seen


def seen_at(seen: Seen, chosen: np.ndarray) -> Seen:
    """With only the points (N,) that are chosen."""
    return attrs.evolve(seen, points=seen.points[chosen], cameras=seen.cameras[chosen])


def _support(seen: Seen, table_height: float, fits: Iterable[Fit]) -> float | None:
    """Height of what a thing stands on, the table or the top of something measured before; None if that is unclear."""
    low, high = extents(seen, np.eye(3))
    middle = (low + high) / 2
    tops = [table_height]
    for fit in fits:
        local = np.abs(fit.pose.rotation.T @ (middle - np.asarray(fit.pose.position))) - np.asarray(fit.size) / 2
        if np.all(local[:2] <= 0.0):
            if local[2] <= 0.0:
                return None  # it is in there, and where the floor is has not been measured
            tops.append(fit.pose.position[2] + fit.size[2] / 2)
    nearest = min(tops, key=lambda top: abs(top - float(low[2])))
    return nearest if abs(nearest - low[2]) <= _STANDS + seen.noise else None


def _front(whole: _Found, found: Iterable[_Found]) -> Array | None:
    """Direction out of the front of a piece of furniture: where its doors and handles are; None without any."""
    middle = np.median(whole.seen.points, axis=0)
    for one in found:
        if one.detection.part_of == whole.detection.name and is_closer(one.detection.label):
            away = np.median(one.seen.points, axis=0) - middle
            if np.hypot(away[0], away[1]) > 0.5 * abs(away[2]):
                return away
    return None


def _parts_in_order(found: dict[str, _Found], fits: dict[str, Fit]) -> Iterable[_Found]:
    """Parts whose owner is measured, owners first; ``fits`` grows meanwhile."""
    waiting = [one for one in found.values() if one.detection.part_of is not None and one.detection.kind == "part"]
    while waiting:
        ready = [one for one in waiting if one.detection.part_of in fits]
        if not ready:
            return
        yield from ready
        waiting = [one for one in waiting if one not in ready]


def _measured(one: _Found, fit: Fit, state: State | None) -> Measured:
    detection = one.detection
    sure = detection.confidence * one.pixels / (one.pixels + _FEW_PIXELS) * _ROUGH / (_ROUGH + fit.residual)
    said = detection.state if detection.state in ("open", "closed") else None
    return Measured(
        detection.name,
        detection.label,
        detection.kind,
        detection.part_of,
        fit.pose,
        fit.size,
        state=state or said,
        confidence=round(float(min(1.0, sure)), 3),
        attributes=colour_words(one.colours),
        flag=detection.flag,
        outlines=fit.outlines,
    )


def _fit_of_marker(detection: Detection) -> Fit:
    assert detection.pose is not None and detection.size is not None
    return Fit(detection.pose, detection.size, "marker", 0.0, 0)


def _marked(detection: Detection, fit: Fit, state: State | None, found: _Found | None) -> Measured:
    """Measurement of a thing that has its box from a marker; ``found``: its pixels, if any are known."""
    return Measured(
        detection.name,
        detection.label,
        detection.kind,
        detection.part_of,
        fit.pose,
        fit.size,
        state=state,
        confidence=detection.confidence,
        attributes=() if found is None else colour_words(found.colours),
        flag=detection.flag,
    )


def _heap(one: _Found, table_height: float) -> Measured:
    """An upright box around where most of it is seen, down to the table or what it lies on."""
    points = one.seen.points
    near = np.linalg.norm(points[:, :2] - np.median(points[:, :2], axis=0), axis=1) < 0.08
    low, high = extents(seen_at(one.seen, near), np.eye(3))
    if low[2] - table_height < 0.01:
        low[2] = table_height
    size = tuple(np.maximum(high - low, 0.004).tolist())
    box = Fit(Pose(tuple((low + high) / 2)), size, "rectangle", 0.0, one.seen.outlines)
    return _measured(one, box, None)


def _insides(
    found: dict[str, _Found], fits: dict[str, Fit], states: dict[str, State], detections: Sequence[Detection]
) -> Iterable[Measured]:
    """The rooms that are seen: those that were detected, and those of containers whose door is found open."""
    named = {one.part_of: one for one in detections if one.kind == "space" and one.part_of is not None}
    closers = {one.name: one for one in detections if one.name in states}
    opened = {_room_owner(one) for name, one in closers.items() if states[name] == "open"}
    shut = {_room_owner(one) for name, one in closers.items() if states[name] == "closed"} - opened
    for name in [*named, *(owner for owner in opened if owner is not None and owner not in named)]:
        if name not in fits or name not in found or name in shut:
            continue
        detection = named.get(name)
        lining = found.get(detection.name) if detection is not None else None
        if lining is None:
            deep = is_lining(found[name].seen, fits[name])
            lining = attrs.evolve(found[name], seen=seen_at(found[name].seen, deep))
        if len(lining.seen.points) < LEAST_POINTS:
            continue
        room = fit_inside(lining.seen, fits[name])
        if room is None:
            continue
        label = detection.label if detection is not None else f"{found[name].detection.label} inside"
        key = detection.name if detection is not None else f"{name}/inside"
        sure = found[name].detection.confidence * len(lining.seen.points) / (len(lining.seen.points) + _FEW_PIXELS)
        yield Measured(key, label, "space", name, room.pose, room.size, room.opening, None, round(float(sure), 3))


def _room_owner(closer: Detection) -> str | None:
    """Key of what has the room that a closer closes: what a door is part of, but the drawer itself."""
    return closer.name if slides(closer.label) else closer.part_of


def colour_words(
    colours: np.ndarray, name: Callable[[tuple[float, float, float]], str] = colour_name
) -> tuple[str, ...]:
    """Everyday words for the colours of pixels (N, 3) uint8, the most frequent first, at most two."""
    if len(colours) == 0:
        return ()
    some = colours[np.linspace(0, len(colours) - 1, min(len(colours), 60)).astype(int)] / 255.0
    words, counts = np.unique([name(tuple(pixel)) for pixel in some.tolist()], return_counts=True)
    ranked = sorted(zip(counts.tolist(), words.tolist(), strict=True), reverse=True)[:2]
    return tuple(word for i, (count, word) in enumerate(ranked) if i == 0 or count >= _SECOND_COLOUR * len(some))
