"""A subtask as steps with parameters, before any code is written: taken from habits, shaped by templates and edited by
corrections."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Any

import attrs
import yaml

Vector = tuple[float, float, float]


@attrs.frozen
class Recipe:
    """The way in which one subtask is done. Lengths in metres, angles in degrees. Directions are words whose meaning
    the code works out when it runs: ``out`` and ``in`` belong to the thing; ``up``, ``left``, ``towards`` (the robot)
    to the base."""

    kind: str  # open, close, pick, place, push, pull, turn; press: a part of it, whatever the subtask
    thing: str
    place: str | None = None
    steps: tuple[str, ...] = ()  # open-hand, close-hand, approach, path, turn, back-off, look
    hold_at: str = "middle"
    approach: str = "top"
    opening: float | None = None  # of the fingers before the approach; None: fully
    clearance: float = 0.10  # from where the last stretch goes straight
    side_tilt: float = 0.0  # pitch where a side approach is needed
    tilt: float = 0.0  # pitch asked for
    hand_turn: float = 0.0  # about the approach, before gripping
    fingers: str = "across"  # across what is held, horizontal, vertical
    offset: Vector = (0.0, 0.0, 0.0)
    deeper: float = 0.0  # along the approach
    shape: str = "straight"  # straight, arc
    way: str = "up"
    distance: float = 0.15
    angle: float = 90.0
    pivot: str = "far"  # edge of the door: far (from the handle), near, left, right, top, bottom
    sense: int = 1  # -1: the other way round
    hand_follows: bool = True
    turn: float = 0.0  # of the held thing, about the approach
    repeat: int = 1
    force: float | None = None  # newtons
    speed: float | None = None
    push: float = 0.025  # between two looks, where something is pushed until it is shut
    first: tuple[str, float] | None = None  # (way, metres) of what is held, before its path
    eased: bool = False  # after the path: back a little and once more
    press: float = 0.0  # newtons along the approach while turning
    hold: float = 0.0  # seconds that the hand stays before it lets go or leaves
    gap: float = 0.008  # that a thing is let fall
    over: float = 0.04  # above its place on the way into something that opens to the side

    @property
    def gripped_at(self) -> int:
        """The index in the steps at which the thing is held: after closing the hand on it, or after the approach."""
        approach = self.steps.index("approach") if "approach" in self.steps else -1
        if "close-hand" in self.steps[approach + 1 :]:
            return self.steps.index("close-hand", approach + 1) + 1
        return approach + 1


@attrs.frozen(eq=False)
class Habits:
    """The data of ``habits.yaml``."""

    verbs: dict[str, str]  # verb -> kind
    kinds: dict[str, dict[str, Any]]

    def kind(self, action: str) -> str:
        """The kind of subtask that a verb names; "" for a verb that is not known."""
        return self.verbs.get(action) or self.verbs.get(action.split(" ")[0], "")

    def recipe(self, action: str, objects: tuple[str, ...], failed: int = 0) -> Recipe | None:
        """The naive way to do ACTION(objects), or None for a verb that is not known. ``failed``: how many attempts did
        not end well; the habit's ``instead`` says what is then tried, one after the other."""
        kind = self.kind(action)
        if not kind:
            return None
        habit = dict(self.kinds[kind])
        others = habit.pop("instead", ())
        if failed and others:
            habit |= others[(failed - 1) % len(others)]
        habit["steps"] = tuple(habit["steps"])
        if action.startswith("unscrew"):
            habit["turn"] = -habit["turn"]
        return Recipe(kind, objects[0] if objects else "", objects[1] if len(objects) > 1 else None, **habit)


@cache
def habits() -> Habits:
    """The built-in habits."""
    data = yaml.safe_load(resources.files(__package__).joinpath("habits.yaml").read_text("utf-8"))
    verbs = {verb: kind for kind, words in data.pop("verbs").items() for verb in words}
    return Habits(verbs, data)
