"""Friction of a pair is the larger of the two (``Material``); Bullet multiplies one coefficient a link.

No coefficients give every pair its larger value. With b the friction of most bodies, sqrt(b) for everything up to b and
f / sqrt(b) for what is rougher are right wherever one of the two is of the common kind, and for rough with smooth. What
is smoother than b (*smooth*) and can meet its like has every shape twice: one copy collides with smooth things only and
has sqrt(f), the other with everything else. What remains: two that are both rougher than b have f1 f2 / b, two smooth
ones that differ the root of their product.

Of torsion and rolling Bullet takes t1 f2 + t2 f1. Right again where one of the two is of the common kind. But torsion
is a motor that holds still in Bullet, and balls of 7 mm that cannot spin stand as an arch in a can that is turned over:
what rolls has none of its own, so half of it at most.
"""

from __future__ import annotations

import math
from collections import Counter

import attrs

from memo_core.scene.building import default_table
from memo_core.scene.description import Material, SceneDescription


@attrs.frozen
class Frictions:
    """``common``: the friction of most bodies; ``apart``: whether smooth surfaces are there twice."""

    common: float
    apart: bool
    common_torsion: float = Material().torsional  # m

    def smooth(self, material: Material) -> bool:
        """Whether a surface of it has a second copy."""
        return self.apart and material.friction < self.common

    def coefficient(self, material: Material, among_smooth: bool = False) -> float:
        """What Bullet multiplies, for a copy that meets smooth things only or for any other surface."""
        if among_smooth:
            return math.sqrt(material.friction)
        return max(material.friction, self.common) / math.sqrt(self.common)

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
