"""Masses of a body's geoms: what is stated holds, and decoration weighs nothing beside what collides."""

from __future__ import annotations

import pytest

from memo_core.errors import InvalidArgument
from memo_core.scene.building import masses
from memo_core.scene.description import Body, Geom


def geom(mass: float | None = None, collides: bool = True) -> Geom:
    return Geom("box", (0.1, 0.1, 0.1), mass=mass, collides=collides)


@pytest.mark.parametrize(
    ("geoms", "mass", "expected"),
    [
        ([geom(), geom()], 3.0, (1.5, 1.5)),
        ([geom(1.0), geom()], 3.0, (1.0, 2.0)),
        ([geom(), geom(collides=False)], None, (0.5, 0.0)),
        ([geom(1.0), geom(collides=False)], None, (1.0, 0.0)),
        ([geom(1.0), geom(collides=False)], 3.0, (3.0, 0.0)),
        ([geom(0.2, collides=False), geom()], None, (0.2, 0.5)),
        ([geom(collides=False)], None, (0.5,)),
        ([geom(1.0), geom(1.0)], 3.0, (1.5, 1.5)),
    ],
)
def test_masses_are_shared(geoms, mass, expected):
    assert masses(Body("thing", tuple(geoms), mass=mass), lambda file: 0.0) == pytest.approx(expected)


def test_a_body_weighs_more_than_its_geoms_state():
    with pytest.raises(InvalidArgument, match="'thing': weighs"):
        masses(Body("thing", (geom(2.0), geom()), mass=1.0), lambda file: 0.0)
