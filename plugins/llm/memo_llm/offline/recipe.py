"""A subtask as steps with parameters, before any code is written: taken from habits, shaped by templates and edited by
corrections."""

from __future__ import annotations

from typing import Any

import attrs

from memo_core.errors import InvalidArgument
from memo_llm.offline.vocabulary import read_yaml

STEPS = ("open-hand", "close-hand", "approach", "path", "turn", "back-off", "look")
_NO_KINDS = frozenset(["verbs", "rough", "tools", "ways"])  # keys of habits.yaml beside the kinds
Vector = tuple[float, float, float]


@attrs.frozen
class Recipe:
    """How one subtask is done. Lengths in metres, angles in degrees. Directions are words whose meaning the code works
    out when it runs: ``out`` and ``in`` belong to the thing; ``up``, ``left``, ``towards`` (the robot) to the base."""

    kind: str  # open, close, pick, place, push, pull, turn, pour, wipe, stir; press: a part of it, whatever the subtask
    thing: str
    place: str | None = None
    steps: tuple[str, ...] = ()
    hold_at: str = "middle"
    approach: str = "top"
    opening: float | None = None  # of the fingers before the approach; None: fully
    clearance: float = 0.10
    side_tilt: float = 0.0  # pitch where a side approach is needed
    tilt: float = 0.0  # pitch asked for
    hand_turn: float = 0.0  # about the approach, before gripping
    fingers: str = "across"  # across what is held, horizontal, vertical
    offset: Vector = (0.0, 0.0, 0.0)
    deeper: float = 0.0  # along the approach
    centred: bool = False
    shape: str = "straight"  # straight, arc
    way: str = "up"
    distance: float = 0.15
    angle: float = 90.0
    pivot: str = "far"  # edge of the door: far (from the handle), near, left, right, top, bottom
    sense: int = 1  # -1: the other way round
    hand_follows: bool = True
    turn: float = 0.0  # of the held thing, about the approach
    way_named: bool = False  # whether somebody said which way it is turned
    clear_first: bool = False  # the arm goes home before anything else
    repeat: int = 1
    force: float | None = None
    speed: float | None = None
    push: float = 0.025  # between two looks, where something is pushed until it is shut
    first: tuple[tuple[str, float], ...] = ()  # (way, metres) of what is held, before its path
    eased: bool = False  # after the path: back a little and once more
    press: float = 0.0  # newtons along the approach while turning
    hold: float = 0.0  # seconds that the hand stays before it lets go or leaves
    grip_wait: float = 0.0  # seconds that the hand stays once it has closed on something to be lifted
    shakes: int = 0  # up and down, of what is held; of the open hand, where something is put down
    beside: tuple[str, str, float] | None = None  # (which side, of what, metres between them), where it is put down
    gap: float = 0.008  # that a thing is let fall
    travel: float = 0.0  # above the stop before the last stretch, on the way there
    last_speed: float | None = None  # of the last, straight stretch
    opens_slowly: bool = False  # to let go
    retreat: str = ""  # after letting go: up, slowly; "": the way it came
    pose: str = ""  # of what is put down: upright, flat, upside down; "": as it was taken
    over: float = 0.04  # above its place on the way into something that opens to the side
    strokes: str = "rows"  # rows, circles, inwards: how it is wiped
    edges: bool = False  # whether it is wiped once round its edge as well
    spread: bool = False  # whether the hand goes round over the place while it tips or shakes
    lined_up: bool = False  # whether its sides are turned to be parallel to those of what it is put on
    felt: bool = False  # whether the last stretch down ends where it is felt to touch
    from_edge: float = 0.0  # metres towards the middle of the things on the table

    @property
    def leads_tool(self) -> bool:
        """Whether something that is held is led over, or in, the thing."""
        return self.kind in ("wipe", "stir")

    @property
    def read_as(self) -> str:
        """The kind of subtask as which sentences about it are read: none where a tool is led over something."""
        return "" if self.leads_tool else self.kind

    @property
    def changes_nothing_held(self) -> bool:
        return "path" not in self.steps and "turn" not in self.steps


@attrs.frozen(eq=False)
class Habits:
    """The data of ``habits.yaml``."""

    verbs: dict[str, str]  # verb -> kind
    kinds: dict[str, dict[str, Any]]
    rough: dict[str, float]
    tools: dict[str, list[str]]  # kind -> what one does it with
    ways: dict[str, int]  # verbs that say which way round it is turned: 1 as the habit says, -1 the other way

    @classmethod
    def load(cls, path: str = "") -> Habits:
        """From a YAML file, or the one that comes with MEMO. Raises ``InvalidArgument`` naming the key."""
        data = read_yaml(path, "habits.yaml", "llm.habits")
        for key in ("verbs", "rough"):
            if not isinstance(data.get(key), dict):
                raise InvalidArgument("llm.habits", f"no mapping {key!r}", "the keys of habits.yaml")
        fields = {field.name for field in attrs.fields(Recipe)}
        kinds = {key: value for key, value in data.items() if key not in _NO_KINDS}
        for kind, habit in kinds.items():
            for key in [*habit, *(key for other in habit.get("instead", ()) for key in other)]:
                if key not in fields | {"instead"}:
                    raise InvalidArgument(f"llm.habits: {kind}.{key}", "unknown key", ", ".join(sorted(fields)))
            for step in habit.get("steps", ()):
                if step not in STEPS:
                    raise InvalidArgument(f"llm.habits: {kind}.steps", f"unknown step {step!r}", ", ".join(STEPS))
        verbs = {verb: kind for kind, words in data["verbs"].items() for verb in words}
        for verb, kind in verbs.items():
            if kind not in kinds:
                raise InvalidArgument(f"llm.habits: verbs.{kind}", f"no habit for {verb!r}", ", ".join(kinds))
        tools = dict(data.get("tools") or {})
        for kind in tools:
            if kind not in kinds:
                raise InvalidArgument(f"llm.habits: tools.{kind}", "no habit of this kind", ", ".join(kinds))
        rough = {key: float(value) for key, value in data["rough"].items()}
        return cls(verbs, kinds, rough, tools, dict(data.get("ways") or {}))

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
        habit["steps"] = tuple(habit.get("steps", ()))
        if way := self.ways.get(action.split(" ")[0]):
            habit |= {"turn": way * habit.get("turn", 0.0), "way_named": True}
        return Recipe(kind, objects[0] if objects else "", objects[1] if len(objects) > 1 else None, **habit)
