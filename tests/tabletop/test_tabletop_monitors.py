"""What monitors remember, on hand-made motion, and the geometry that checks rest on."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, strategies as st
from memo_tabletop import success_checks as checks
from memo_tabletop.house.monitors import Shaken
from memo_tabletop.monitors import SAMPLE_S, HeldUp, Mishaps, Moved, Standing
from memo_tabletop.objects import apple, banana, can, cup, cutlery, open_box, pan, plate

from memo_core.interfaces.simulator import Contact
from memo_core.scene.description import SceneDescription
from memo_core.scene.pose import Pose, quaternion_from_axis_angle
from memo_core.testing.perception import StillWorld

FINGERS = ("robot/left", "robot/right")
NAMES = ("red", "green")


class Puppets(StillWorld):
    """Two cans that a test moves about."""

    def __init__(self) -> None:
        super().__init__(
            SceneDescription((can("red", (0.5, 0.2, 0.0), (1, 0, 0, 1)), can("green", (0.5, -0.2, 0.0), (0, 1, 0, 1))))
        )
        self.touching: list[tuple[str, str]] = [("red", "table"), ("green", "table")]
        self.monitors: list = []
        self.speed = {name: np.zeros(3) for name in NAMES}

    def body_velocity(self, body):
        return self.speed[body], np.zeros(3)

    def contacts(self, body=None):
        pairs = [pair for pair in self.touching if body is None or body in pair]
        return tuple(Contact(a, b, (0.0, 0.0, 0.0), 1.0) for a, b in pairs)

    def watch(self, monitor):
        monitor.reset(self)
        self.monitors.append(monitor)
        return monitor

    def go(self, seconds: float, name: str | None = None, velocity=(0.0, 0.0, 0.0), tilted: float = 0.0) -> None:
        for _ in range(round(seconds / 0.01)):
            self.seconds += 0.01
            if name is not None:
                self.speed[name] = np.array(velocity)
                pose = self.body_pose(name)
                there = tuple(p + 0.01 * v for p, v in zip(pose.position, velocity, strict=True))
                turned = quaternion_from_axis_angle((1, 0, 0), tilted) if tilted else pose.orientation
                self.moved[name] = Pose(there, turned)
            for monitor in self.monitors:
                monitor.update(self)

    def grasp(self, name: str, lifted: bool = True) -> None:
        self.touching = [(FINGERS[0], name), (name, FINGERS[1])] + [
            pair for pair in self.touching if name not in pair or not lifted
        ]

    def let_go(self) -> None:
        self.touching = [pair for pair in self.touching if not any(n.startswith("robot/") for n in pair)]


def test_held_up_counts_only_while_it_is_high_and_held_by_the_robot_alone():
    world = Puppets()
    monitor = world.watch(HeldUp("red", 0.10))
    world.grasp("red")
    world.go(0.5, "red", (0, 0, 0.3))
    world.go(0.4)
    assert monitor.seconds(world) == pytest.approx(0.4 + 0.05 / 0.3 * 1.0, abs=0.05)
    world.touching.append(("red", "green"))
    world.go(0.1)
    assert monitor.seconds(world) == 0.0
    world.touching.remove(("red", "green"))
    world.go(0.3)
    assert 0.2 < monitor.seconds(world) < 0.4
    world.go(1.0, "red", (0, 0, -0.1))
    assert monitor.seconds(world) == 0.0 and monitor.lifted(world) == pytest.approx(0.05)


def test_moved_remembers_the_farthest_even_when_it_was_put_back():
    world = Puppets()
    monitor = world.watch(Moved(NAMES))
    world.go(1.0, "green", (0.05, 0, 0))
    world.go(1.0, "green", (-0.05, 0, 0))
    assert monitor.farthest("green") == pytest.approx(0.05, abs=0.002)
    assert monitor.farthest("red") == 0.0


def test_standing_starts_again_when_the_chain_breaks():
    world = Puppets()
    monitor = world.watch(Standing(("green", "red"), rise=0.08))  # the lower one need not be named first
    world.go(0.5)
    assert monitor.seconds(world) == 0.0
    world.moved["green"] = Pose((0.5, 0.2, 0.1))  # beside it and a little higher, as on uneven ground
    world.touching = [("red", "table"), ("green", "table"), ("green", "red")]
    world.go(0.5)
    assert monitor.seconds(world) == 0.0
    world.moved["green"] = Pose((0.5, 0.2, 0.165))
    world.touching = [("red", "table"), ("green", "red")]
    world.go(1.0)
    assert monitor.seconds(world) == pytest.approx(1.0, abs=2 * SAMPLE_S)
    world.touching.append(("robot/left", "green"))
    world.go(0.05)
    assert monitor.seconds(world) == 0.0


def test_a_can_that_topples_by_itself_or_by_a_push_was_pushed_over():
    world = Puppets()
    monitor = world.watch(Mishaps(NAMES, upright=NAMES))
    world.go(0.2, "red", (0.1, 0, 0), tilted=1.5)
    assert monitor.befell("red") == ("pushed over",) and monitor.befell("green") == ()
    assert "the red was pushed over" in monitor.story(world)


def test_a_thing_that_may_lie_was_not_pushed_over():
    world = Puppets()
    monitor = world.watch(Mishaps(NAMES))
    world.go(0.2, "red", (0.1, 0, 0), tilted=1.5)
    assert monitor.befell("red") == ()


def test_what_slips_from_the_hand_was_dropped_and_what_is_set_down_was_not():
    world = Puppets()
    monitor = world.watch(Mishaps(NAMES, upright=NAMES))
    world.grasp("red")
    world.go(1.0, "red", (0, 0, 0.3))
    world.go(0.9, "red", (0, 0, -0.3))
    world.let_go()
    world.go(0.1, "red", (0, 0, -0.3))
    assert monitor.befell("red") == ()
    world.grasp("green")
    world.go(1.0, "green", (0, 0, 0.3))
    world.let_go()
    world.go(0.1, "green", (0, 0, -1.5))
    assert monitor.befell("green") == ("dropped",)


def test_what_was_set_down_and_is_pushed_over_later_was_not_dropped():
    world = Puppets()
    monitor = world.watch(Mishaps(NAMES, upright=NAMES))
    world.grasp("red")
    world.go(0.5, "red", (0, 0, 0.1))
    world.go(0.5, "red", (0, 0, -0.1))
    world.go(0.2, "red", (0, 0, 0))
    world.let_go()
    world.go(0.5, "red", (0, 0, 0))
    world.go(0.2, "red", (0.1, 0, 0), tilted=1.5)
    assert monitor.befell("red") == ("pushed over",)


def test_what_falls_off_the_table_is_told():
    world = Puppets()
    monitor = world.watch(Mishaps(NAMES))
    world.go(0.3, "red", (1.0, 0, -1.0))
    assert "off the table" in monitor.befell("red")


def test_what_the_hand_still_has_hold_of_or_presses_against_something_is_told():
    world = Puppets()
    monitor = world.watch(Mishaps(NAMES))
    world.grasp("red")
    assert "still holds the red" in monitor.story(world)
    world.touching.append(("red", "microwave/door"))
    assert "jammed between the hand and the microwave" in monitor.story(world)


@pytest.mark.parametrize("make", [lambda: HeldUp("red", 0.1), lambda: Moved(NAMES), lambda: Mishaps(NAMES, NAMES)])
def test_a_retry_inherits_nothing_of_what_came_after_the_checkpoint(make):
    world = Puppets()
    monitor = world.watch(make())
    world.grasp("red")
    world.go(0.5, "red", (0, 0, 0.3))
    kept = json.dumps(monitor.memory())
    world.let_go()
    world.go(0.3, "red", (0.2, 0, -2.0), tilted=1.5)
    assert json.dumps(monitor.memory()) != kept
    monitor.recall(json.loads(kept))
    assert json.dumps(monitor.memory()) == kept
    other = make()
    other.recall(json.loads(kept))
    assert json.dumps(other.memory()) == kept


THINGS = [
    apple("apple", (0, 0, 0)),
    banana("banana", (0, 0, 0), 0.0),
    can("can", (0, 0, 0), (1, 0, 0, 1)),
    cup("cup", (0, 0, 0)),
    cutlery("spoon", (0, 0, 0), 0.0),
    pan("pan", (0, 0, 0), 0.0),
    plate("plate", (0, 0, 0)),
]


def surface(geom, count: int, rng) -> np.ndarray:
    """Points on or in a geom, its own frame."""
    if geom.shape == "box":
        return (rng.random((count, 3)).round() - 0.5) * geom.size
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    if geom.shape == "sphere":
        return directions * geom.size[0]
    ends = np.array([[0, 0, s * geom.size[1] / 2] for s in rng.choice([-1, 1], count)])
    if geom.shape == "capsule":
        return directions * geom.size[0] + ends
    level = directions * [1, 1, 0]
    return level / np.linalg.norm(level, axis=1, keepdims=True) * geom.size[0] + ends


@given(st.sampled_from(THINGS), st.integers(0, 10**6))
def test_the_spread_of_a_thing_holds_all_of_it_and_no_more(thing, seed):
    rng = np.random.default_rng(seed)
    turn = rng.normal(size=4)
    frame = Pose(tuple(rng.uniform(-1, 1, 3)), tuple(turn / np.linalg.norm(turn)))
    low, high = checks.spread(thing, frame)
    points = np.vstack([(frame * g.pose).apply(surface(g, 3000, rng)) for g in thing.geoms if g.collides])
    assert np.all(points >= low - 1e-9) and np.all(points <= high + 1e-9)
    assert np.all(points.min(axis=0) <= low + 0.006) and np.all(points.max(axis=0) >= high - 0.006)


@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.05, 0.2), st.floats(-3, 3))
def test_inside_means_that_no_part_sticks_out(x, y, z, yaw):
    box = open_box("box", (0.4, 0.0, 0.0), 0.0, (0.2, 0.26, 0.13), (0, 0, 0, 1))
    fork = cutlery("fork", (0, 0, 0), 0.0)
    world = StillWorld(SceneDescription((box, fork)))
    world.moved["fork"] = Pose.from_yaw((0.5 + x, y, z), yaw)
    said = checks.inside(world, "box", box.cavities[0], fork, tolerance=0.0)
    space = world.body_pose("box") * box.cavities[0].pose
    corners = [
        (space.inverse() * world.body_pose("fork") * geom.pose).apply(np.array(corner) * geom.size)
        for geom in fork.geoms
        for corner in np.ndindex(2, 2, 2)
        for corner in [np.array(corner) - 0.5]
    ]
    assert said == bool(np.all(np.abs(corners) <= np.array(box.cavities[0].size) / 2))


UP_FIRST, DOWN_FIRST, SIDEWAYS = (
    ((0, 0, 0.25), (0, 0, -0.25)),
    ((0, 0, -0.25), (0, 0, 0.25)),
    ((0, 0.25, 0), (0, -0.25, 0)),
)


@pytest.mark.parametrize("strokes", [UP_FIRST, DOWN_FIRST, SIDEWAYS])
@pytest.mark.parametrize("shakes", [1, 3, 10])
def test_shakes_are_counted_however_they_are_made(strokes, shakes):
    world = Puppets()
    shaken = world.watch(Shaken("red", 0.11, "green", 0.07, "green", (0.02, 0.02)))
    world.go(1.0, "red", (0, 0, 0.2))
    world.go(1.0, "red", (0, -0.36, 0))  # 4 cm beside the middle of what is seasoned
    world.go(0.5, "red", (0, 0, -0.2))
    for _ in range(shakes):
        for velocity in strokes:
            world.go(0.12, "red", velocity)
    world.go(1.0, "red", (0, 0, 0.2))
    assert abs(shaken.shakes - shakes) <= 1
    assert not shaken.passed_over


def test_shakes_beside_the_target_do_not_count_and_a_way_across_is_remembered():
    world = Puppets()
    shaken = world.watch(Shaken("red", 0.11, "green", 0.07, "green", (0.06, 0.06)))
    for _ in range(10):
        for velocity in UP_FIRST:
            world.go(0.12, "red", velocity)
    assert shaken.shakes == 0 and not shaken.passed_over
    world.go(1.0, "red", (0, -0.4, 0))
    world.go(1.0, "red", (0, -0.4, 0))
    assert shaken.passed_over
    other = Shaken("red", 0.11, "green", 0.07, "green", (0.06, 0.06))
    other.recall(json.loads(json.dumps(shaken.memory())))
    assert other.passed_over
