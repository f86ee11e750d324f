"""The bounding box of a body's geoms along the body's own axes."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from memo_core.plugin import Array, Body, Geom, InvalidArgument, Part, Pose

INSIDE_PART_M = 0.005
MOUNTING_SHARE = 0.05  # a geom below this share of the body's volume that touches a part is the part's mounting


def body_box(body: Body, moved: Mapping[str, Pose] | None = None) -> tuple[Pose, tuple[float, float, float]] | None:
    """(pose of the box's centre in the body's frame, full extents), without the body's parts; including unlabelled
    pieces that are fixed to it, and movable ones at their poses in ``moved`` (name -> pose in the body's frame). None
    when the body has no geoms."""
    pieces = list(_pieces(body, Pose(), body.parts, moved or {}))
    if not pieces:
        return None
    total = sum(float(np.prod(high - low)) for low, high in pieces)
    own = [piece for piece in pieces if not _belongs_to_part(piece, body.parts, total)] or pieces
    low = np.min([piece[0] for piece in own], axis=0)
    high = np.max([piece[1] for piece in own], axis=0)
    return Pose(tuple((low + high) / 2)), tuple(float(v) for v in high - low)  # type: ignore[return-value]


def loose_pieces(body: Body) -> tuple[str, ...]:
    """Names of the movable unlabelled bodies attached to this one, such as the collapsible walls of a can."""
    return tuple(c.name for c in body.bodies if c.joint is not None and not c.label and not c.parts and not c.bodies)


def _pieces(body: Body, pose: Pose, parts: Sequence[Part], moved: Mapping[str, Pose]):
    # What nothing can touch is decoration, unless there is nothing else to see.
    solid = [geom for geom in body.geoms if geom.collides] or body.geoms
    for geom in solid:
        yield geom_bounds(geom, pose)
    for child in body.bodies:
        if child.joint is None and not child.label and not child.parts:
            yield from _pieces(child, pose * child.pose, parts, {})
        elif child.name in moved:
            yield from _pieces(child, moved[child.name], parts, {})


def _belongs_to_part(piece: tuple[Array, Array], parts: Sequence[Part], total: float) -> bool:
    low, high = piece
    for part in parts:
        part_low, part_high = _upright(part.pose, np.asarray(part.size) / 2)
        centre = (low + high) / 2
        if np.all(centre >= part_low - INSIDE_PART_M) and np.all(centre <= part_high + INSIDE_PART_M):
            return True
        touches = np.all(low <= part_high + INSIDE_PART_M) and np.all(high >= part_low - INSIDE_PART_M)
        if touches and float(np.prod(high - low)) < MOUNTING_SHARE * total:
            return True
    return False


def geom_bounds(geom: Geom, frame: Pose = Pose()) -> tuple[Array, Array]:
    """Lowest and highest corner (m) of a geom along the axes of the frame that ``frame`` poses its body in."""
    pose = frame * geom.pose
    if geom.shape == "mesh":
        points = pose.apply(mesh_vertices(geom) * geom.size[0])
        return points.min(axis=0), points.max(axis=0)
    if geom.shape == "box":
        return _upright(pose, np.asarray(geom.size) / 2)
    centre = np.asarray(pose.position)
    if geom.shape == "sphere":
        reach = np.full(3, geom.size[0])
    else:
        radius, length = geom.size[:2]
        axis = pose.rotation[:, 2]
        along = np.abs(axis) * length / 2
        across = np.ones(3) if geom.shape == "capsule" else np.sqrt(np.maximum(1 - axis**2, 0.0))
        reach = along + radius * across
    return centre - reach, centre + reach


def _upright(pose: Pose, half: Array) -> tuple[Array, Array]:
    reach = np.abs(pose.rotation) @ half
    return np.asarray(pose.position) - reach, np.asarray(pose.position) + reach


def mesh_vertices(geom: Geom) -> Array:
    """Vertices of a geom's .obj or .stl file, unscaled, shape (n, 3). Raises ``InvalidArgument``."""
    path = Path(geom.mesh or "")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InvalidArgument(
            "mesh", f"{geom.mesh!r} cannot be read ({error.strerror})", "an .obj or .stl file"
        ) from None
    if path.suffix.lower() == ".obj":
        rows = [line.split()[1:4] for line in data.decode(errors="replace").splitlines() if line.startswith("v ")]
    elif data[:5] == b"solid" and b"facet" in data[:500]:
        rows = [line.split()[1:4] for line in data.decode(errors="replace").splitlines() if "vertex" in line]
    else:
        count = struct.unpack_from("<I", data, 80)[0]
        records = np.frombuffer(
            data, dtype=np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")]), count=count, offset=84
        )
        return records["v"].reshape(-1, 3).astype(float)
    points = np.asarray(rows, dtype=float)
    if points.ndim != 2 or len(points) == 0:
        raise InvalidArgument("mesh", f"{geom.mesh!r} has no vertices", "an .obj or .stl file")
    return points
