"""The friction of a pair is the larger of the two (``Material``), whereas Bullet multiplies one coefficient per link.
No choice of coefficients gives every pair its larger value. With b the friction of most bodies, sqrt(b) for bodies up
to b and f / sqrt(b) for rougher ones is correct if one of the two has the common friction, and for a rough with a
smooth one. A gripper's pads need the product instead (``GripperDescription.friction_on``), that is f / sqrt(b) for any
surface. A body smoother than b therefore has every shape once more for the pads alone, and if there are other smooth
bodies that it may touch (*apart*), a third time, with sqrt(f), for these. Remaining errors: two bodies both rougher
than b have f1 f2 / b, two different smooth ones the root of their product.

For torsion and rolling Bullet uses t1 f2 + t2 f1, which is again correct if one of the two has the common friction. But
in Bullet torsional friction is a motor that resists any spin, and balls of 7 mm that cannot spin form a stable arch in
a can that is turned over. Therefore rolling bodies have no torsional friction of their own, and a pair with one of them
has at most half.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import Literal

import attrs

from memo_core.plugin import Material, SceneDescription, default_table

# A common or rough surface, a pad, or the copy of a smooth surface that meets smooth ones, pads, or all others.
Surface = Literal["plain", "pad", "for smooth", "for others", "for pads"]
_COLLIDING: set[tuple[Surface, Surface]] = {
    ("plain", "plain"),
    ("plain", "pad"),
    ("pad", "pad"),
    ("for smooth", "for smooth"),
    ("for others", "plain"),
    ("for pads", "pad"),
}


def collide(first: Surface, second: Surface) -> bool:
    """Whether two surfaces are meant for each other."""
    return (first, second) in _COLLIDING or (second, first) in _COLLIDING


@attrs.frozen
class Frictions:
    """``common``: the friction of most bodies; ``apart``: whether smooth bodies may meet each other."""

    common: float
    apart: bool
    common_torsion: float = Material().torsional  # m

    def copies(self, material: Material) -> tuple[Surface, ...]:
        """List the copies that a surface of this material consists of."""
        if material.friction >= self.common:
            return ("plain",)
        return ("for smooth", "for others", "for pads") if self.apart else ("for others", "for pads")

    def coefficient(self, material: Material, surface: Surface) -> float:
        """Bullet's coefficient."""
        if surface == "for smooth":
            return math.sqrt(material.friction)
        paired = surface in ("pad", "for pads")
        return (material.friction if paired else max(material.friction, self.common)) / math.sqrt(self.common)

    def torsion(self, material: Material) -> float:
        """m, what Bullet multiplies and adds."""
        own = material.torsional if material.contact_dimensions == 4 else 0.0
        return max(own - self.common_torsion / 2, 0.0) / math.sqrt(self.common)

    def rolling(self, material: Material) -> float:
        """m; most things do not resist rolling."""
        return material.rolling / math.sqrt(self.common) if material.contact_dimensions == 6 else 0.0


def frictions_of(scene: SceneDescription) -> Frictions:
    """For a scene with its table and floor."""
    bodies = [body for body, _ in scene.walk()] + [default_table(scene.table_height)]
    found = [{geom.material.friction for geom in body.geoms if geom.collides} for body in bodies]
    counts = Counter(friction for each in found for friction in each)
    common = max(counts, key=lambda friction: (counts[friction], friction))
    return Frictions(common, sum(min(each, default=common) < common for each in found) > 1)
