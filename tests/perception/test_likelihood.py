"""Which lines of an inventory regions are likely to be: only as sure as the next best explanation of all lets."""

from __future__ import annotations

import numpy as np
import pytest
from memo_perception.cameras.detectors.likelihood import Piece, most_likely
from memo_perception.cameras.inventory import Item
from memo_perception.cameras.regions import Region

DEVIATION = 0.004  # m, at the noise of a depth camera 1.4 m away


def piece(number: int, *extents: float, colour: str = "grey", bare: bool = True) -> Piece:
    nothing = np.zeros((1, 3))
    region = Region(number, nothing, nothing.astype(np.uint8))
    middle = np.array([0.4, 0.2 * number, 0.02])
    return Piece((region,), middle - 0.02, middle + 0.02, np.array(extents), DEVIATION, {colour: 1.0}, bare)


def named(items, pieces, together=lambda item, piece, other: False):
    """Number of each piece -> its name and how sure it is."""
    found = most_likely(items, pieces, (), together)
    return {one.regions[0].id: (item.label, sure) for item, one, sure in found}


FORK, KNIFE, SPOON = (Item(name, colours=("grey",), size=(0.15, wide, 0.014)) for name, wide in
                      (("fork", 0.026), ("knife", 0.018), ("spoon", 0.036)))  # fmt: skip


def test_what_differs_by_millimetres_is_told_apart_by_what_the_others_are():
    found = named([FORK, KNIFE, SPOON], [piece(1, 0.15, 0.038, 0.015), piece(2, 0.15, 0.029, 0.014),
                                         piece(3, 0.15, 0.020, 0.014)])  # fmt: skip
    assert [found[i][0] for i in (1, 2, 3)] == ["spoon", "fork", "knife"]


def test_two_lines_that_fit_equally_are_a_toss_up():
    other = Item("tin", colours=("grey",), size=(0.15, 0.026, 0.014))
    ((_, sure),) = named([FORK, other], [piece(1, 0.15, 0.026, 0.014)]).values()
    assert sure == pytest.approx(0.5)


def test_two_pieces_that_fit_equally_are_a_toss_up_unless_they_are_of_one_thing():
    pieces = [piece(1, 0.15, 0.026, 0.014), piece(2, 0.15, 0.026, 0.014)]
    ((_, sure),) = named([FORK], pieces).values()
    assert sure == pytest.approx(0.5)
    ((_, sure),) = named([FORK], pieces, lambda *those: True).values()
    assert sure > 0.95


def test_two_of_a_kind_are_no_rivals():
    found = named([FORK, FORK], [piece(1, 0.15, 0.026, 0.014), piece(2, 0.15, 0.026, 0.014)])
    assert {label for label, _ in found.values()} == {"fork"} and min(sure for _, sure in found.values()) > 0.95


def test_what_is_too_large_or_of_another_colour_is_not_named():
    assert named([FORK], [piece(1, 0.25, 0.12, 0.05)]) == {}
    assert named([FORK], [piece(1, 0.15, 0.026, 0.014, colour="red")]) == {}


def test_of_what_is_covered_a_part_may_be_missing():
    box = Item("box", colours=("red",), size=(0.15, 0.10, 0.08))
    half = {"colour": "red"}
    assert named([box], [piece(1, 0.10, 0.08, 0.06, bare=False, **half)])[1][0] == "box"
    assert named([box], [piece(1, 0.10, 0.08, 0.06, **half)]) == {}


def test_the_last_line_and_the_last_region_go_together():
    """Nothing but elimination tells what a badly seen region is."""
    bad = piece(2, 0.14, 0.031, 0.016)
    alone = named([FORK, SPOON], [bad])[2][1]
    assert alone < 0.75
    left = named([FORK, SPOON], [piece(1, 0.15, 0.037, 0.014), bad])
    assert left[1][0] == "spoon" and left[2][0] == "fork" and left[2][1] > alone
