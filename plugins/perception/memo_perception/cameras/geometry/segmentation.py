"""Regions: what stands on the table, told apart by colour and by steps in depth, and put together over the pictures.

No model and no names. A thing of several colours is several regions; two things of one colour that touch are one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import attrs
import cv2
import numpy as np
from scipy import ndimage

from memo_core.plugin import Array
from memo_perception.cameras.geometry.protrusions import split
from memo_perception.cameras.geometry.table import View
from memo_perception.cameras.regions import Region

_WORKSPACE = ((-0.1, 1.3), (-0.9, 0.9))  # m: x and y in which things are looked for
_ABOVE = 0.004  # m above the table from which a pixel is not the table's, without noise
_TOP = 1.2  # m above the table
_CHROMA = (
    0.06  # distance in chromaticity (shares of red, green and blue, which shading keeps) from which colours differ
)
_SHADE = 0.45  # of two faces of one colour the darker is at least this bright, against the other
_DARK = 60.0  # sum of the channels (of 765) below which chromaticity says little
_LIGHTNESS = 0.25  # weight of Lab's L, which shading changes, against a and b
_EDGE = 9.0  # step of the weighted colour between neighbours that parts two segments
_EDGE_WIDTH = 4  # px
_BETWEEN = 3.0  # steps in depth by which a pixel at an edge may lie between near and far
_AROUND = 12  # pixels around a segment in which something may stand out of it
_DEPTH_STEP = 0.012  # m between neighbours that parts two segments, without noise
_LEAST_PIXELS = 25
_VOXEL = 0.008  # m
_OVERLAP = 0.3  # share of the smaller segment's cells that must coincide to be the same thing
_TOUCH = 0.08  # the same share for two of one picture, but at least
_SIDE = 1.5  # times as many cells as the side of a square has
_TABLE_COLOUR = 12.0  # weighted distance in Lab from the table's colour from which a flat thing is not the table


Cell = tuple[int, int, int]


@attrs.frozen(eq=False)
class _Segment:
    """A piece of one picture."""

    frame: int
    mask: np.ndarray  # (H, W) bool
    points: Array  # (N, 3)
    colours: np.ndarray  # (N, 3) uint8
    chroma: Array  # (3,) of the median colour
    brightness: float  # 0 to 1
    cells: frozenset[Cell]
    apart: bool  # whether it was parted from what it touches in the picture by form, not by colour


def regions_of(views: Sequence[View], blocked: Mapping[str, np.ndarray], table_height: float) -> tuple[Region, ...]:
    """The regions of a look, the largest first; their numbers count from 1. ``blocked``: frame name -> pixels (H, W)
    that show the robot."""
    segments = [
        segment
        for number, view in enumerate(views)
        for segment in _segments(number, view, blocked.get(view.frame.name), table_height)
    ]
    groups = sorted(_joined(segments), key=lambda group: -sum(len(one.points) for one in group))
    return tuple(_region(id, group, views) for id, group in enumerate(groups, 1))


def _segments(number: int, view: View, blocked: np.ndarray | None, table_height: float) -> list[_Segment]:
    frame = view.frame
    lab = cv2.cvtColor(frame.rgb.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    weighted = lab * np.array([_LIGHTNESS, 1.0, 1.0], dtype=np.float32)
    there = _foreground(view, weighted, blocked, table_height)
    step = _DEPTH_STEP + 3 * view.noise
    smooth = cv2.medianBlur(frame.depth, 5) if view.noise > 0.001 else frame.depth
    edges = np.zeros(there.shape, dtype=bool)
    for axis in (0, 1):
        ahead = np.linalg.norm(np.diff(weighted, axis=axis), axis=2) > _EDGE
        ahead |= np.abs(np.diff(smooth, axis=axis)) > step
        low, high = (np.s_[:-1], np.s_[1:]) if axis == 0 else (np.s_[:, :-1], np.s_[:, 1:])
        edges[low] |= ahead
        edges[high] |= ahead
        # A camera blurs an edge over a pixel, so that neither step alone may be large.
        before, at, after = (
            (np.s_[:-2], np.s_[1:-1], np.s_[2:]) if axis == 0 else (np.s_[:, :-2], np.s_[:, 1:-1], np.s_[:, 2:])
        )
        edges[at] |= np.linalg.norm(weighted[after] - weighted[before], axis=2) > _EDGE
    count, labels = cv2.connectedComponents((there & ~edges).astype(np.uint8), connectivity=4)
    sizes = np.bincount(labels.ravel(), minlength=count)
    keep = sizes >= _LEAST_PIXELS
    keep[0] = False
    labels[~keep[labels]] = 0
    _spread(labels, there, weighted / _EDGE, smooth / step)
    found = []
    eye = np.asarray(frame.pose.position)
    for label, where in enumerate(ndimage.find_objects(labels), 1):
        if where is None:
            continue
        wide = (
            slice(max(0, where[0].start - _AROUND), where[0].stop + _AROUND),
            slice(max(0, where[1].start - _AROUND), where[1].stop + _AROUND),
        )
        pieces = split(
            view.points[wide], labels[wide] == label, (labels[wide] > 0) & (labels[wide] != label), view.noise, eye
        )
        parted = [*((part, True) for part in (*pieces.out, *pieces.faces)), (pieces.rest, False)]
        for part, apart in parted:
            mask = np.zeros(there.shape, dtype=bool)
            mask[wide] = part
            one = _segment(number, view, mask, apart)
            if one is not None:
                found.append(one)
    return found


def _spread(labels: np.ndarray, there: np.ndarray, colour: np.ndarray, depth: np.ndarray) -> None:
    """Give pixels of an edge (0 in ``labels``, of those ``there``) to the segment beside them that they resemble most,
    in colour (H, W, 3) and depth (H, W), both over the step that makes an edge; in place."""
    height, width = labels.shape
    for largest in [1.0] * _EDGE_WIDTH + [_BETWEEN] * _EDGE_WIDTH:  # first without a step in depth, then what is left
        rows, columns = np.nonzero(there & (labels == 0))
        best, chosen = np.full(len(rows), np.inf), np.zeros(len(rows), dtype=labels.dtype)
        for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            beside = np.clip(rows + down, 0, height - 1), np.clip(columns + right, 0, width - 1)
            step = np.abs(depth[rows, columns] - depth[beside])
            step[(depth[rows, columns] == 0) | (depth[beside] == 0)] = 0.99 * _BETWEEN  # not measured
            apart = np.linalg.norm(colour[rows, columns] - colour[beside], axis=1) + np.minimum(step, _BETWEEN)
            better = (labels[beside] > 0) & (apart < best) & (step < largest)
            best[better], chosen[better] = apart[better], labels[beside][better]
        labels[rows, columns] = chosen


def _segment(number: int, view: View, mask: np.ndarray, apart: bool) -> _Segment | None:
    """None where too little was measured."""
    points = view.points[mask]
    good = np.isfinite(points[:, 0])
    if np.count_nonzero(good) < _LEAST_PIXELS // 2:
        return None
    points, colours = points[good], view.frame.rgb[mask][good]
    cells = frozenset(map(tuple, np.unique(np.floor(points / _VOXEL).astype(int), axis=0).tolist()))
    middle = np.median(colours, axis=0)
    chroma, brightness = middle / max(float(middle.sum()), _DARK), float(middle.mean()) / 255
    return _Segment(number, mask, points, colours, chroma, brightness, cells, apart)


def _foreground(view: View, weighted: np.ndarray, blocked: np.ndarray | None, table_height: float) -> np.ndarray:
    """Pixels of what stands or lies on the table, by height, or by colour where it is flat."""
    (x0, x1), (y0, y1) = _WORKSPACE
    with np.errstate(invalid="ignore"):
        x, y, z = np.moveaxis(view.points, -1, 0)
        inside = (x > x0) & (x < x1) & (y > y0) & (y < y1) & (z < table_height + _TOP)
        height = z - table_height
        raised = inside & (height > _ABOVE + 3 * view.noise)
        on_table = inside & (np.abs(height) <= _ABOVE + 3 * view.noise)
    if blocked is not None:
        raised &= ~blocked
        on_table &= ~blocked
    if np.count_nonzero(on_table) < 500:
        return raised
    table = np.median(weighted[on_table], axis=0)
    odd = on_table & (np.linalg.norm(weighted - table, axis=2) > _TABLE_COLOUR)
    unmeasured = ~np.isfinite(view.points[..., 0])
    odd |= (
        unmeasured
        & ndimage.binary_dilation(raised | odd, iterations=2)
        & (np.linalg.norm(weighted - table, axis=2) > _TABLE_COLOUR)
    )
    # Together, since the lowest rows of what is raised are thin by themselves.
    return raised | ndimage.binary_opening(raised | odd, iterations=1)


def _joined(segments: list[_Segment]) -> list[list[_Segment]]:
    """Segments that show the same thing, by common cells and colours."""
    grown = [_grown(one.cells) for one in segments]
    groups = [[i] for i in range(len(segments))]  # of each segment, shared by those in it

    def join(i: int, j: int) -> None:
        if groups[i] is not groups[j]:
            groups[i] += groups[j]
            for k in groups[j]:
                groups[k] = groups[i]

    def apart(i: int, j: int) -> bool:
        """Whether another picture shows what is joined with each, and a gap between them."""
        for frame in {segments[k].frame for k in groups[i]} - {segments[i].frame}:
            here = [k for k in groups[i] if segments[k].frame == frame]
            there = [k for k in groups[j] if segments[k].frame == frame]
            if there and not any(segments[k].cells & grown[other] for k in here for other in there):
                return True
        return False

    # Pieces of one picture touch where one stands before the other, too: what other pictures say goes first.
    pairs = [(i, j) for i in range(len(segments)) for j in range(i)]
    for i, j in pairs:
        if segments[i].frame != segments[j].frame and _alike(segments[i], segments[j]):
            common, size = _common(segments, grown, i, j)
            if common >= _OVERLAP * size:
                join(i, j)
    for i, j in pairs:
        one, other = segments[i], segments[j]
        if one.frame == other.frame and not (one.apart or other.apart) and _alike(one, other):
            common, size = _common(segments, grown, i, j)
            # They touch along an edge only, but along more than a corner.
            if common >= max(_TOUCH * size, _SIDE * np.sqrt(size)) and not apart(i, j):
                join(i, j)
    unique = {id(group): group for group in groups}
    return [[segments[k] for k in sorted(group)] for group in unique.values()]


def _alike(one: _Segment, other: _Segment) -> bool:
    """Whether they are of one colour, lit or shaded."""
    dark, light = sorted((one.brightness + 0.02, other.brightness + 0.02))
    return bool(np.linalg.norm(one.chroma - other.chroma) <= _CHROMA and dark >= _SHADE * light)


def _common(segments: list[_Segment], grown: list[frozenset[Cell]], i: int, j: int) -> tuple[int, int]:
    """How many cells two segments have in common, and how many the smaller one has."""
    small, large = (i, j) if len(segments[i].cells) <= len(segments[j].cells) else (j, i)
    return len(segments[small].cells & grown[large]), len(segments[small].cells)


def _grown(cells: frozenset[Cell]) -> frozenset[Cell]:
    steps = (-1, 0, 1)
    return frozenset((x + i, y + j, z + k) for x, y, z in cells for i in steps for j in steps for k in steps)


def _region(id: int, group: list[_Segment], views: Sequence[View]) -> Region:
    masks: dict[str, np.ndarray] = {}
    for one in group:
        name = views[one.frame].frame.name
        masks[name] = masks[name] | one.mask if name in masks else one.mask
    points = np.concatenate([one.points for one in group])
    return Region(id, points, np.concatenate([one.colours for one in group]), masks)
