"""Furniture of the tabletop suite with modifications: additional movable parts, springs, stops. Each function takes a
piece made by ``memo_tabletop.furniture`` and returns a modified copy; nothing visible is added.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs

from memo_core.plugin import Body, Hinge, Pose, Slide


def with_mover(fixture: Body, change: Callable[[Body], Body]) -> Body:
    """The fixture with its door or drawer (its first child) changed."""
    mover, *rest = fixture.bodies
    return attrs.evolve(fixture, bodies=(change(mover), *rest))


def with_joint(fixture: Body, **changes: Any) -> Body:
    """The fixture with its door's or drawer's joint changed (fields of ``Hinge`` or ``Slide``)."""

    def change(mover: Body) -> Body:
        assert isinstance(mover.joint, (Hinge, Slide))
        joint: Hinge | Slide = attrs.evolve(mover.joint, **changes)
        return attrs.evolve(mover, joint=joint)

    return with_mover(fixture, change)


def with_lifting_handle(fixture: Body, travel: float) -> Body:
    """The bar on the door or drawer front becomes a body of its own that can be lifted by ``travel`` (m); a spring
    draws it back down when let go. Its joint is ``NAME/lift``."""
    name = fixture.name

    def change(mover: Body) -> Body:
        part = mover.parts[0]
        on_bar = [g for g in mover.geoms if _at_bar(g.pose, part.pose, max(part.size))]
        rest = tuple(g for g in mover.geoms if g not in on_bar)
        handle = Body(
            name=f"{name}/bar",
            geoms=tuple(on_bar),
            joint=Slide(
                f"{name}/lift",
                (0.0, 0.0, 1.0),
                range=(0.0, travel),
                friction=0.3,
                damping=3.0,
                stiffness=80.0,
                rest=-0.05,
            ),
            mass=0.15,
            parts=(part,),
        )
        return attrs.evolve(mover, geoms=rest, parts=(), bodies=(*mover.bodies, handle))

    return with_mover(fixture, change)


def _at_bar(pose: Pose, bar: Pose, length: float) -> bool:
    """Whether a geom is the bar or one of its posts: before the face, no farther out than the bar's end."""
    near = sum((a - b) ** 2 for a, b in zip(pose.position, bar.position, strict=True)) ** 0.5 <= length / 2 + 0.02
    return near and pose.position[0] < -0.02
