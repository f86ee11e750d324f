"""Conditions that must be observed over time: how long an object was held up, how far it was moved, what mishaps
occurred. Monitors sample fifty times a second, since nothing relevant happens and is undone in less time. Their state
is plain JSON and part of every checkpoint, so that a retry inherits nothing from a failed attempt.
"""

from __future__ import annotations

import copy
import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from memo_core.plugin import Monitor, WorldState
from memo_tabletop import success_checks as checks

SAMPLE_S = 0.02
FALLING_M_S = 1.4  # after 10 cm; nobody sets anything down from higher
OVER_RAD = 1.0  # what leans further lies on its side
BELOW_TABLE_M = -0.1
STILL_M = 0.0003  # between two samples; what moves less was not moved by anybody


class Sampled(Monitor):
    """Calls ``sample`` every ``SAMPLE_S``; its whole state is in ``seen`` (JSON values)."""

    def __init__(self) -> None:
        self.seen: dict[str, Any] = {}
        self._next = 0.0

    @abstractmethod
    def start(self, world: WorldState) -> dict[str, Any]:
        """What is known at the beginning."""

    @abstractmethod
    def sample(self, world: WorldState) -> None: ...

    def reset(self, world: WorldState) -> None:
        self.seen, self._next = self.start(world), 0.0

    def update(self, world: WorldState) -> None:
        if world.time >= self._next - 1e-9:
            self._next = world.time + SAMPLE_S
            self.sample(world)

    def memory(self) -> dict[str, Any]:
        return {"next": self._next, "seen": copy.deepcopy(self.seen)}

    def recall(self, memory: dict[str, Any]) -> None:
        self._next, self.seen = memory["next"], copy.deepcopy(memory["seen"])


class Since(Sampled):
    """The time since which ``holds`` has been true without interruption."""

    def start(self, world: WorldState) -> dict[str, Any]:
        return {"since": None}

    @abstractmethod
    def holds(self, world: WorldState) -> bool: ...

    def sample(self, world: WorldState) -> None:
        if not self.holds(world):
            self.seen["since"] = None
        elif self.seen["since"] is None:
            self.seen["since"] = world.time

    def seconds(self, world: WorldState) -> float:
        """For how long the condition has held until now."""
        since = self.seen["since"]
        return 0.0 if since is None else world.time - since


class HeldUp(Since):
    """The time since which an object has been held by the robot alone, ``height`` (m) above where it started."""

    def __init__(self, thing: str, height: float, name: str = "held up") -> None:
        super().__init__()
        self.thing, self.height, self.name = thing, height, name

    def start(self, world: WorldState) -> dict[str, Any]:
        return super().start(world) | {"from": world.body_pose(self.thing).position[2]}

    def holds(self, world: WorldState) -> bool:
        return self.lifted(world) >= self.height and checks.held(world, self.thing)

    def lifted(self, world: WorldState) -> float:
        """How far above its start it is now (m)."""
        return world.body_pose(self.thing).position[2] - self.seen["from"]


class Moved(Sampled):
    """The largest distance of each object from where it started (m)."""

    def __init__(self, things: Sequence[str], name: str = "moved") -> None:
        super().__init__()
        self.things, self.name = tuple(things), name

    def start(self, world: WorldState) -> dict[str, Any]:
        return {
            "from": {t: list(world.body_pose(t).position) for t in self.things},
            "farthest": dict.fromkeys(self.things, 0.0),
        }

    def sample(self, world: WorldState) -> None:
        farthest = self.seen["farthest"]
        for thing, place in self.seen["from"].items():
            farthest[thing] = max(farthest[thing], math.dist(place, world.body_pose(thing).position))

    def farthest(self, thing: str) -> float:
        return self.seen["farthest"][thing]


class Standing(Since):
    """Since when ``things`` have rested on one another in one tower, in any order, untouched by the robot: a chain of
    contacts in which each thing's frame is at least ``rise`` (m) above the one below it."""

    def __init__(self, things: Sequence[str], rise: float, name: str = "standing") -> None:
        super().__init__()
        self.things, self.rise, self.name = tuple(things), rise, name

    def holds(self, world: WorldState) -> bool:
        height = {thing: world.body_pose(thing).position[2] for thing in self.things}
        order = sorted(self.things, key=lambda thing: height[thing])
        pairs = list(pairwise(order))
        # Heights first: contacts are dear to ask for.
        if any(height[upper] - height[lower] < self.rise for lower, upper in pairs):
            return False
        return all(checks.touches(world, upper, lower) for lower, upper in pairs) and all(
            checks.released(world, thing) for thing in order
        )


class Mishaps(Sampled):
    """Mishaps of each object, for reports: ``dropped`` (it fell after the robot had held it), ``pushed over`` (it
    stood, and lies now), ``off the table``. ``upright`` names those for which lying is a mishap."""

    name = "mishaps"

    def __init__(self, things: Sequence[str], upright: Sequence[str] = ()) -> None:
        super().__init__()
        self.things, self.upright = tuple(things), frozenset(upright)

    def start(self, world: WorldState) -> dict[str, Any]:
        return {
            thing: {"at": list(world.body_pose(thing).position), "carried": False, "befell": []}
            for thing in self.things
        }

    def sample(self, world: WorldState) -> None:
        for thing, known in self.seen.items():
            pose = world.body_pose(thing)
            before, now = known["at"], pose.position
            if math.dist(before, now) < STILL_M:
                if known["carried"] and checks.at_rest(world, thing):
                    known["carried"] = checks.held(world, thing)
                continue
            known["at"] = list(now)
            held = checks.held(world, thing)
            if known["carried"] and not held and (before[2] - now[2]) / SAMPLE_S > FALLING_M_S:
                self._note(known, "dropped")
            known["carried"] = held or (known["carried"] and not checks.at_rest(world, thing))
            if thing in self.upright and not held and checks.tilt(pose) > OVER_RAD:
                self._note(known, "dropped" if known["carried"] else "pushed over")
            if now[2] < BELOW_TABLE_M:
                self._note(known, "off the table")

    def _note(self, known: dict[str, Any], what: str) -> None:
        if what not in known["befell"]:
            known["befell"].append(what)

    def befell(self, thing: str) -> tuple[str, ...]:
        return tuple(self.seen[thing]["befell"])

    def story(self, world: WorldState) -> str:
        """The mishaps of the objects, and objects that the hand still holds or presses against something; empty when
        all went well."""
        words = {"dropped": "was dropped", "pushed over": "was pushed over", "off the table": "fell off the table"}
        told = [
            f"the {thing} {' and '.join(words[w] for w in self.befell(thing))}"
            for thing in self.things
            if self.befell(thing)
        ]
        for thing in self.things:
            touching = {name for c in world.contacts(thing) for name in (c.first, c.second)} - world.family(thing)
            robot = {name for name in touching if name.startswith("robot/")}
            against = touching - robot - set(self.things)
            if robot and against:
                told.append(f"the {thing} is jammed between the hand and the {sorted(against)[0].split('/')[0]}")
            elif robot:
                told.append(f"the hand still holds the {thing}" if len(robot) > 1 else f"the hand touches the {thing}")
        return ", ".join(told)


def story_of(monitors: Mapping[str, Any], world: WorldState) -> str:
    """The mishaps of the objects, for ``checks.judge``; empty without a ``Mishaps`` monitor."""
    mishaps = monitors.get("mishaps")
    return mishaps.story(world) if isinstance(mishaps, Mishaps) else ""
