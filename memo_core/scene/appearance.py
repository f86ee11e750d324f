"""The appearance of objects in words: names of the colours in a scene description, and materials. Only what a person
can see is described, so masses, frictions and joints are not.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np

from memo_core.scene.description import Body, Colour, Geom, Part
from memo_core.scene.pose import Array, Pose

SECOND_COLOUR = 0.15  # share of a thing's surface from which on its second colour is named too
TRANSPARENT_BELOW = 0.5  # opacity
LIGHTNESS_WEIGHT = 0.4  # a pale and a dark green are both green: hue and saturation tell more than lightness
_INSIDE_PART_M = 0.001

# sRGB samples of each name, pale, saturated and dark, where one word covers a wide range.
_NAMED = {
    "black": ("#000000", "#1c1c20", "#2e3036"),
    "grey": ("#55585c", "#808080", "#9ea3ab", "#b8b8b8"),
    "white": ("#ffffff", "#e8e8e4"),
    "red": ("#cc2020", "#ff0000", "#801818"),
    "orange": ("#ff8000", "#cc7020"),
    "yellow": ("#ffff00", "#e8c830"),
    "green": ("#008000", "#30e030", "#66a066", "#204830"),
    "turquoise": ("#20b0a8", "#80d8d0"),
    "blue": ("#0000ff", "#3060c0", "#80b0f0", "#102050"),
    "purple": ("#802090", "#a060d0"),
    "pink": ("#ff60b0", "#ffb8c8"),
    "brown": ("#402010", "#5c3821", "#805030", "#9e734a", "#cd853f"),
    "beige": ("#d8c098", "#f0e0c0"),
}


def appearance(body: Body, part: Part | None = None) -> tuple[str, ...]:
    """Colours and material of a body without its parts, or of one of its parts: ``("white", "porcelain")``.

    Args:
        body: the body, together with the attached bodies that have neither a label nor parts.
        part: one of ``body.parts``, made of the geoms whose centre lies in its box; a part without such geoms takes the
            body's colours. None: the body without its parts.

    Returns:
        The colour of most of the surface, a second colour if it covers at least the share ``SECOND_COLOUR``, and the
        material if it is stated.
    """
    geoms = [(geom, pose) for geom, pose in _geoms(body, Pose())]
    inside = [[_within(one, pose.position) for _, pose in geoms] for one in body.parts]
    own = [geom for i, (geom, _) in enumerate(geoms) if not any(of_part[i] for of_part in inside)]
    if part is not None:
        own = [geom for geom, pose in geoms if _within(part, pose.position)] or own
    made_of = body.made_of if part is None else part.made_of
    return (*colours(own or [geom for geom, _ in geoms]), *((made_of,) if made_of else ()))


def colours(geoms: Iterable[Geom]) -> tuple[str, ...]:
    """Names of the colours that make up most of the surface of these geoms, the largest first; none for none."""
    surfaces: dict[str, float] = defaultdict(float)
    for geom in geoms:
        surfaces["transparent" if geom.colour[3] < TRANSPARENT_BELOW else colour_name(geom.colour)] += _surface(geom)
    total = sum(surfaces.values())
    ranked = sorted(surfaces, key=lambda name: -surfaces[name])[:2]
    return tuple(name for i, name in enumerate(ranked) if i == 0 or surfaces[name] >= SECOND_COLOUR * total)


def colour_name(colour: Colour | tuple[float, float, float]) -> str:
    """Everyday word for a colour: the name of the nearest sample in OKLab.

    Hue and saturation count more than lightness, which is weighted by ``LIGHTNESS_WEIGHT``.

    Args:
        colour: sRGB components from 0 to 1, values beyond are clipped; a fourth component (opacity) is ignored.

    Returns:
        A word such as ``"white"`` or ``"turquoise"``.
    """
    seen = _perceived(colour[:3])
    return min(_SAMPLES, key=lambda sample: math.dist(seen, sample[1]))[0]


def _perceived(rgb: tuple[float, ...]) -> tuple[float, ...]:
    """In OKLab, Björn Ottosson's colour space in which equal distances look about equally different; lightness is
    weighted."""
    shown = np.clip(np.asarray(rgb), 0.0, 1.0)
    linear = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    lightness, *chroma = (float(v) for v in _LMS_TO_LAB @ np.cbrt(_RGB_TO_LMS @ linear))
    return LIGHTNESS_WEIGHT * lightness, *chroma


_RGB_TO_LMS = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_LMS_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
_SAMPLES = tuple(
    (name, _perceived(tuple(byte / 255 for byte in bytes.fromhex(code[1:]))))
    for name, codes in _NAMED.items()
    for code in codes
)


def _geoms(body: Body, pose: Pose) -> Iterator[tuple[Geom, Pose]]:
    """The geoms of a body and of unlabelled bodies attached to it, posed in the body's frame (joints at 0)."""
    for geom in body.geoms:
        yield geom, pose * geom.pose
    for child in body.bodies:
        if not child.label and not child.parts:
            yield from _geoms(child, pose * child.pose)


def _within(part: Part, point: tuple[float, float, float]) -> bool:
    local: Array = np.abs(part.pose.inverse().apply(np.asarray(point)))
    return bool(np.all(local <= np.asarray(part.size) / 2 + _INSIDE_PART_M))


def _surface(geom: Geom) -> float:
    """Surface area (m2). A mesh counts as 1 m2, more than the primitives beside it, because its area is only in its
    file."""
    if geom.shape == "mesh":
        return 1.0
    if geom.shape == "box":
        x, y, z = geom.size
        return 2 * (x * y + y * z + z * x)
    radius = geom.size[0]
    if geom.shape == "sphere":
        return 4 * math.pi * radius**2
    ends = 2 * radius if geom.shape == "capsule" else radius
    return 2 * math.pi * radius * (geom.size[1] + ends)
