"""Open the bottle, close the bottle: a cap on a bayonet that only turning frees.

Nothing but contact holds the cap: two lugs inside it pass between two lugs of the neck, and a quarter turn clockwise
takes them below those, up to a stop. Seen from above, cap and bottle carry a mark each; the marks lie over one another
where the cap goes on and comes off.
"""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from memo_core.plugin import (
    Body,
    Camera,
    Colour,
    Free,
    Geom,
    Material,
    Monitor,
    Outcome,
    Pose,
    SceneDescription,
    Task,
    Vector,
    WorldState,
    cup,
    look_at,
)
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import Mishaps, Sampled
from memo_tabletop.objects import METAL, RED, cameras
from memo_tabletop.reference import solution

SEAT = 0.11  # m, height of the shoulder that a closed cap's rim sits on
NECK_TOP = 0.016  # m above the seat
CAP_HEIGHT = 0.020  # m
CAP_INSIDE, CAP_WALL = 0.0145, 0.003  # m, apothem and wall: 35 mm across the flats
CLOSED = math.radians(-90)  # of the cap about the bottle's axis, from where the marks meet
_LUG = 0.008  # m, width of each lug: 22 degrees to either side
_NECK_LUG = (0.009, 0.012)  # m above the seat
_CAP_LUG = (0.0022, 0.008)  # m above the cap's rim
_NECK_RADIUS, _NECK_REACH, _CAP_REACH = 0.008, 0.012, 0.0092  # m from the axis
_COLLAR = (0.0137, 0.0018)  # m, radius and height of what centres the rim
_RELIEF = 0.0006  # m
_STOP = math.radians(-33)

AXIS_M, AXIS_RAD = 0.002, math.radians(5)  # how far a closed cap may be from the bottle's axis
SEATED_M = 0.0015
TURNED_RAD = math.radians(80)
ENGAGED_RAD = math.radians(33)  # lugs that lie over one another by at least a quarter of their width
CLEAR_M = 0.03  # m level distance from which a cap is beside the bottle and not on it
GREEN_GLASS: Colour = (0.16, 0.42, 0.30, 1.0)


def _ring_box(near: float, far: float, low: float, high: float, angle: float, width: float, **more: Any) -> Geom:
    """A box that reaches from ``near`` to ``far`` (m) from the axis at this angle, between two heights (m)."""
    middle = (near + far) / 2
    at = (middle * math.cos(angle), middle * math.sin(angle), (low + high) / 2)
    return Geom("box", (far - near, width, high - low), Pose.from_yaw(at, angle), **more)


def bottle(place: Vector, yaw: float, friction: float = 0.3) -> Body:
    """Clamped to the table; its frame is on its axis at the height of the seat, x towards its mark."""
    smooth = Material(friction=friction)
    x, y, z = place
    body = SEAT - 0.02
    geoms = [
        Geom("cylinder", (0.030, body), Pose((0, 0, body / 2 - SEAT)), GREEN_GLASS),
        Geom("cylinder", (0.0185, 0.02), Pose((0, 0, -0.01)), GREEN_GLASS, material=smooth),
        Geom("capsule", (_NECK_RADIUS, NECK_TOP - _NECK_RADIUS), Pose((0, 0, 0.004)), GREEN_GLASS, material=smooth),
        Geom("cylinder", _COLLAR, Pose((0, 0, _COLLAR[1] / 2)), GREEN_GLASS, material=smooth),
        Geom("box", (0.012, 0.003, 0.001), Pose((0.0245, 0, body - SEAT)), RED, collides=False),
    ]
    for side in (0.0, math.pi):
        geoms.append(_ring_box(0.005, _NECK_REACH, *_NECK_LUG, side, _LUG, colour=GREEN_GLASS, material=smooth))
        geoms.append(
            _ring_box(0.005, _NECK_REACH, 0.0, _NECK_LUG[0], side + _STOP, 0.0025, colour=GREEN_GLASS, material=smooth)
        )
    geoms.append(Geom("box", (0.09, 0.11, 0.012), Pose((0, 0, 0.006 - SEAT)), METAL))
    for side in (-1.0, 1.0):  # the clamp's jaws
        geoms.append(Geom("box", (0.06, 0.02, 0.045), Pose((0, side * 0.039, 0.0225 - SEAT)), METAL))
    pose = Pose.from_yaw((x, y, z + SEAT), yaw)
    return Body("bottle", tuple(geoms), pose, label="bottle", fixture=True, made_of="glass")


def _shorter(wall: Geom) -> Geom:
    """A wall of the cap that ends just above the rim."""
    x, y, z = wall.size
    rx, ry, rz = wall.pose.position
    pose = attrs.evolve(wall.pose, position=(rx, ry, rz + _RELIEF / 2))
    return attrs.evolve(wall, size=(x, y, z - _RELIEF), pose=pose)


def cap(pose: Pose, friction: float = 0.3) -> Body:
    """Its frame is on its axis in the plane of its rim, x towards its mark."""
    smooth = Material(friction=friction)
    over = Pose((0.0, 0.0, CAP_HEIGHT), (0.0, 1.0, 0.0, 0.0))
    wall = cup(CAP_INSIDE, CAP_HEIGHT, CAP_WALL, colour=(0.85, 0.85, 0.83, 1.0), material=smooth)
    geoms = [attrs.evolve(geom, pose=over * geom.pose) for geom in wall]
    # It stands on three of its twelve sides: fewer contacts, and no wobble either.
    geoms[1:] = [geom if number % 4 == 0 else _shorter(geom) for number, geom in enumerate(geoms[1:])]
    for side in (math.pi / 2, -math.pi / 2):
        geoms.append(_ring_box(_CAP_REACH, CAP_INSIDE + 0.001, *_CAP_LUG, side, _LUG, material=smooth))
    geoms.append(Geom("box", (0.012, 0.003, 0.001), Pose((0.010, 0, CAP_HEIGHT)), RED, mass=0.0, collides=False))
    return Body("cap", tuple(geoms), pose, Free(), mass=0.03, label="cap")


def cap_on_bottle(world: WorldState) -> tuple[float, float, float, float]:
    """Of the cap in the bottle's frame: distance from its axis (m), tilt (rad), height of the rim over the seat (m),
    turn about the axis from where the marks meet (rad)."""
    relative = world.body_pose("bottle").inverse() * world.body_pose("cap")
    x, y, z = relative.position
    rotation = relative.rotation
    return math.hypot(x, y), checks.tilt(relative), z, math.atan2(rotation[1, 0], rotation[0, 0])


def screwed_on(away: float, tilt: float, height: float, turn: float) -> bool:
    """Whether the lugs hold the cap: on its axis, seated, and each of its lugs below one of the neck's."""
    engaged = abs(math.remainder(turn - CLOSED, math.pi)) < ENGAGED_RAD
    return away < AXIS_M and tilt < AXIS_RAD and abs(height) < SEATED_M and engaged


class CapTurned(Sampled):
    """How far the cap has been turned about the bottle's axis (rad, clockwise from above is positive) since it has last
    come to sit on it."""

    name = "cap turned"

    def start(self, world: WorldState) -> dict[str, Any]:
        return {"turned": 0.0, "at": None, "most": 0.0, "least": 0.0}

    def sample(self, world: WorldState) -> None:
        away, tilt, height, turn = cap_on_bottle(world)
        seen = self.seen
        if away > 2 * AXIS_M or tilt > 2 * AXIS_RAD or not -SEATED_M < height < 2 * SEATED_M:
            seen["at"] = None
            return
        if seen["at"] is None:
            seen["turned"] = 0.0
        else:
            seen["turned"] -= math.remainder(turn - seen["at"], 2 * math.pi)
            seen["most"], seen["least"] = max(seen["most"], seen["turned"]), min(seen["least"], seen["turned"])
        seen["at"] = turn

    def clockwise(self) -> float:
        """rad, since it came to sit."""
        return self.seen["turned"]

    def loosened(self) -> float:
        """The farthest it was ever turned the other way while it sat (rad)."""
        return -self.seen["least"]


def close_up(place: Vector) -> tuple[Camera, ...]:
    """The usual cameras, and ``near`` for what is too small for them."""
    x, y, z = place
    near = Camera("near", look_at((x - 0.26, y - 0.28, z + 0.36), (x, y, z + SEAT - 0.01)), 0.5)
    return (*cameras((0.5, 0.0, 0.1)), near)


def _places(rng: np.random.Generator) -> tuple[Vector, float, Vector, float]:
    """The bottle's place and yaw, a free place beside it and a yaw."""
    x, y = np.array([0.50, 0.08]) + rng.uniform(-0.03, 0.03, 2)
    beside = np.array([0.45, -0.20]) + rng.uniform(-0.03, 0.03, 2)
    return (x, y, 0.0), rng.uniform(-0.5, 0.5), (beside[0], beside[1], 0.001), rng.uniform(-0.5, 0.5)


class OpenTheBottle(Task):
    """Success: the cap is off the neck, having been turned, not torn; in the hand or on the table."""

    name = "open-the-bottle"
    instruction = "open the bottle"
    goal = ("the cap is off the bottle", "the cap was turned on the bottle")
    kind = "TR"
    lesson = "turn the cap a quarter turn to the left before you lift it off"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        place, yaw, _, _ = _places(rng)
        stands = bottle(place, yaw)
        on = stands.pose * Pose.from_yaw((0.0, 0.0, 0.0002), CLOSED)
        return SceneDescription((stands, cap(on)), close_up(place))

    def monitors(self) -> tuple[Monitor, ...]:
        return (CapTurned(), Mishaps(("cap",)))

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        turned, mishaps = monitors["cap turned"], monitors["mishaps"]
        assert isinstance(turned, CapTurned) and isinstance(mishaps, Mishaps)
        away, _, height, _ = cap_on_bottle(world)
        loosened = turned.loosened()
        return checks.judge(
            "the bottle is open",
            [
                (away > CLEAR_M or height > NECK_TOP, "the cap is still on the bottle"),
                (not checks.touches(world, "cap", "bottle"), "the cap still touches the bottle"),
                (
                    loosened > TURNED_RAD / 2,
                    f"the cap was torn off, turned by only {math.degrees(loosened):.0f} degrees",
                ),
                (
                    checks.on_table(world, "cap") or checks.held(world, "cap"),
                    "the cap is neither in the hand nor on the table",
                ),
            ],
            {"from_axis_m": away, "height_m": height, "loosened_rad": loosened},
            "" if checks.held(world, "cap") else mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        return checks.picked(world, ("cap",), names) if action in (*checks.PICKING, "REMOVE", "TAKE_OFF") else None

    @property
    def reference_solution(self) -> str:
        return solution("handling", "bottle", calls="open_bottle()\n")


class CloseTheBottle(Task):
    """Success: the cap sits straight on its seat, turned until its lugs hold it, and has been let go. That a cap for
    which this is so holds a pull of 8 N, and one for which it is not comes off, is tested by pulling."""

    name = "close-the-bottle"
    instruction = "close the bottle"
    goal = ("the cap is on the bottle", "the cap was turned on the bottle", "the hand has let go of the cap")
    kind = "TR"
    split = "held-out"
    lesson = "put the cap on with the marks over one another, then turn it a quarter turn to the right"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        place, yaw, beside, cap_yaw = _places(rng)
        return SceneDescription((bottle(place, yaw), cap(Pose.from_yaw(beside, cap_yaw))), close_up(place))

    def monitors(self) -> tuple[Monitor, ...]:
        return (CapTurned(), Mishaps(("cap",)))

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        turned, mishaps = monitors["cap turned"], monitors["mishaps"]
        assert isinstance(turned, CapTurned) and isinstance(mishaps, Mishaps)
        away, tilt, height, turn = cap_on_bottle(world)
        clockwise = turned.clockwise()
        return checks.judge(
            "the bottle is closed",
            [
                (away < CLEAR_M, "the cap is not on the bottle"),
                (
                    away < AXIS_M and tilt < AXIS_RAD,
                    f"the cap sits crooked, {1000 * away:.0f} mm and {math.degrees(tilt):.0f} degrees off",
                ),
                (abs(height) < SEATED_M, f"the cap sits {1000 * height:.1f} mm too high"),
                (
                    clockwise >= TURNED_RAD and screwed_on(away, tilt, height, turn),
                    f"the cap was turned by only {math.degrees(clockwise):.0f} degrees",
                ),
                *checks.let_go(world, "cap"),
            ],
            {"from_axis_m": away, "tilt_rad": tilt, "height_m": height, "clockwise_rad": clockwise},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        return checks.picked(world, ("cap",), names) if action in checks.PICKING else None

    @property
    def reference_solution(self) -> str:
        return solution("handling", "bottle", calls="close_bottle()\n")
