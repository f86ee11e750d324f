"""A hand without a robot that records the motions commanded by code, and the properties of these motions that people
talk about."""

from __future__ import annotations

import itertools
import math

import attrs
import numpy as np

from memo_core.scene.pose import Array, Pose, quaternion_angle
from memo_core.skills.control import Waypoints
from memo_core.skills.recording_control import STROKE, Command, RecordingControl

_REVERSAL = math.radians(75)  # a sharper change of direction begins a new leg


class RecordedHand(RecordingControl):
    """Also records pressing and waiting; every requested force is reached immediately."""

    def go_home(self) -> None:
        self._record("home", None)

    def wait(self, seconds: float) -> None:
        self._record("wait", seconds)

    def contact_force(self) -> list[float]:
        return [0.0, 0.0, 0.0]

    def move_until_contact(self, direction: list[float], distance: float, force: float, speed: float) -> float:
        self._record("press", force)
        return 0.0

    def press_along(self, skill: str, path: Waypoints, direction: list[float], force: float, speed: float) -> float:
        self._record("press", force)
        self.follow_path(path, None, 0.0, speed)
        return force

    def press(self, direction: list[float], force: float, seconds: float) -> float:
        self._record("press", force)
        self._record("wait", seconds)
        return force

    def spiral_search(
        self, direction: list[float], radius: float, force: float, depth: float, pitch: float
    ) -> list[float]:
        self._record("press", force)
        return list(self._pose.position)


@attrs.frozen(eq=False)
class Leg:
    """A stretch of the way without a sharp turn. ``bend``: largest sideways deviation over length."""

    start: Array
    end: Array
    length: float
    bend: float


@attrs.frozen(eq=False)
class Motion:
    """What people talk about: where the hand touches, how it points, the way it goes then. Metres, degrees, newtons."""

    contact: Array
    pointing: Array  # the hand's approach direction there
    closing: Array  # the direction in which its fingers close there
    legs: tuple[Leg, ...]  # after the contact
    turned: float  # degrees about the approach, after the contact, before letting go
    tipped: float  # largest change of the approach direction, degrees
    force: float | None
    opening: float | None  # of the fingers before the contact
    closed_first: bool
    speed: float  # the slowest that was asked for
    fastest: float
    waits: float
    released: bool  # the fingers open after the contact
    end: Array
    highest: float = 0.0  # of the way to the contact, metres above the base
    cleared: bool = False  # whether the arm goes home before the contact
    rounds: int = 1  # how often the fingers open after a contact
    leaving: Array | None = None  # the way the hand goes right after it has let go

    @property
    def main(self) -> Leg | None:
        return max(self.legs, key=lambda leg: leg.length, default=None)

    @property
    def extent(self) -> float:
        return self.main.length if self.main is not None else 0.0


def motion_of(acts: list[Command]) -> Motion | None:
    """The motion in a recording; None where the hand touched nothing."""
    at = _contact(acts)
    if at is None:
        return None
    touch = acts[at]
    gripping = touch.kind in ("open", "close")
    held, released = [touch.pose], False
    for act in acts[at + 1 :]:
        if act.kind == "open":
            released = True
            break
        if act.kind == "go":
            held.append(act.pose)
    if touch.kind == "open":
        released, held = True, held[:1]
    before = acts[:at]
    opened = [STROKE if act.amount is None else act.amount for act in before if act.kind == "open"]
    closed_before = any(act.kind == "close" for act in before)
    legs = _legs(held)
    if not gripping and len(legs) > 1:
        legs = legs[:-1]  # the last leg of a push is the way back
    rotation = touch.pose.rotation
    contacts = [act for act in acts if act.kind == "go" and not act.free]
    forces = [act.amount for act in acts[at:] if act.kind in ("close", "press") and act.amount is not None]
    return Motion(
        contact=np.asarray(touch.pose.position),
        pointing=rotation[:, 2],
        closing=rotation[:, 1],
        legs=tuple(legs),
        turned=_turned_about_approach(held),
        tipped=max((angle(rotation[:, 2], pose.rotation[:, 2]) for pose in held), default=0.0),
        force=max(forces, default=None),
        opening=opened[-1] if opened else None,
        closed_first=closed_before,
        speed=min((act.speed for act in contacts), default=0.5),
        fastest=max((act.speed for act in contacts), default=0.5),
        waits=sum(act.amount or 0.0 for act in acts if act.kind == "wait"),
        released=released,
        end=np.asarray(held[-1].position),
        highest=max((act.pose.position[2] for act in before if act.kind == "go"), default=0.0),
        cleared=any(act.kind == "home" for act in before),
        rounds=sum(act.kind == "open" for act in acts[at:]),
        leaving=_leaving(acts, at),
    )


def _leaving(acts: list[Command], contact: int) -> Array | None:
    """From where the fingers open after the contact to the goal that follows."""
    for i in range(contact, len(acts) - 1):
        if acts[i].kind == "open" and acts[i + 1].kind == "go":
            return np.asarray(acts[i + 1].pose.position) - np.asarray(acts[i].pose.position)
    return None


def _contact(acts: list[Command]) -> int | None:
    """Index of the first opening or closing after a motion in contact; else of the first such motion."""
    touched = False
    first = None
    for i, act in enumerate(acts):
        if act.kind == "go" and not act.free:
            first = i if first is None else first
            touched = True
        elif act.kind in ("open", "close") and touched:
            later = [a for a in acts[first + 1 : i] if a.kind == "go"]  # type: ignore[operator]
            pushed = any(a.kind == "close" for a in acts[:first]) and act.kind == "open" and bool(later)
            return first if pushed else i
    return first


def _legs(poses: list[Pose]) -> list[Leg]:
    points = [np.asarray(pose.position) for pose in poses]
    runs: list[list[Array]] = []
    last: Array | None = None
    for a, b in itertools.pairwise(points):
        step = b - a
        if np.linalg.norm(step) < 1e-5:
            continue
        if last is not None and math.radians(angle(last, step)) < _REVERSAL:
            runs[-1].append(b)
        else:
            runs.append([a, b])
        last = step
    return [_leg(run) for run in runs]


def _leg(points: list[Array]) -> Leg:
    chord = points[-1] - points[0]
    span = float(np.linalg.norm(chord))
    length = float(sum(np.linalg.norm(b - a) for a, b in itertools.pairwise(points)))
    if span < 1e-6 or len(points) < 3:
        return Leg(points[0], points[-1], length, 0.0)
    offsets = np.array(points) - points[0]
    sideways = offsets - np.outer(offsets @ chord / span**2, chord)
    return Leg(points[0], points[-1], length, float(np.linalg.norm(sideways, axis=1).max()) / span)


def _turned_about_approach(poses: list[Pose]) -> float:
    total = 0.0
    for a, b in itertools.pairwise(poses):
        if quaternion_angle(a.orientation, b.orientation) < 1e-6:
            continue
        axis, y0, y1 = a.rotation[:, 2], a.rotation[:, 1], b.rotation[:, 1]
        total += math.degrees(math.atan2(float(np.cross(y0, y1) @ axis), float(y0 @ y1)))
    return total


def angle(a: Array, b: Array) -> float:
    """Degrees between two directions."""
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return math.degrees(math.acos(max(-1.0, min(1.0, float(a @ b) / size)))) if size > 1e-12 else 0.0
