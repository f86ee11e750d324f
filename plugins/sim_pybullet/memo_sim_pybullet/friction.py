"""The friction of a pair is the larger of the two (``Material``), whereas Bullet multiplies one coefficient per link.
No choice of coefficients gives every pair its larger value. With b the friction of most bodies, sqrt(b) for bodies up
to b and f / sqrt(b) for rougher ones is correct if one of the two has the common friction, and for a rough with a
smooth one. A body smoother than b (*smooth*) that may touch another smooth one has every shape twice: one copy collides
only with smooth bodies and has sqrt(f), the other with everything else. Remaining errors: two bodies both rougher than
b have f1 f2 / b, two different smooth ones the root of their product.

For torsion and rolling Bullet uses t1 f2 + t2 f1, which is again correct if one of the two has the common friction. But
in Bullet torsional friction is a motor that resists any spin, and balls of 7 mm that cannot spin form a stable arch in
a can that is turned over. Therefore rolling bodies have no torsional friction of their own, and a pair with one of them
has at most half.
"""

from __future__ import annotations

import math
from collections import Counter

import attrs

from memo_core.scene.building import default_table
from memo_core.scene.description import Material, SceneDescription


@attrs.frozen
class Frictions:
    """``common``: the friction of most bodies; ``apart``: whether smooth surfaces are duplicated."""

    common: float
    apart: bool
    common_torsion: float = Material().torsional  # m

    def smooth(self, material: Material) -> bool:
        """Whether a surface of it has a second copy."""
        return self.apart and material.friction < self.common

    def coefficient(self, material: Material, among_smooth: bool = False) -> float:
        """Bullet's coefficient, for a copy that touches only smooth bodies or for any other surface."""
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
