"""The success checks say no to what a person would not call done, and yes to what they would. Hand-made states."""

from __future__ import annotations

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from memo_tabletop import success_checks as checks
from memo_tabletop.tasks.cubes import SIDE, StackTheCubes
from memo_tabletop.tasks.drawer import PutTheCubeAway
from memo_tabletop.tasks.fridge import OpenTheFridge
from memo_tabletop.tasks.microwave import PutTheFoodInTheMicrowave
from memo_tabletop.tasks.oven import PutTheFoodInTheOven

from memo_core.interfaces.simulator import Contact
from memo_core.scene.pose import Pose
from memo_core.testing.perception import StillWorld

FINGERS = ("robot/panda_leftfinger", "robot/panda_rightfinger")


class Posed(StillWorld):
    """A scene put into a state by hand."""

    def __init__(self, task, seed: int = 0) -> None:
        super().__init__(task.scene(np.random.default_rng(seed)))
        self.touching: list[tuple[str, str]] = []
        self.speed: dict[str, float] = {}

    def contacts(self, body=None):
        pairs = [pair for pair in self.touching if body is None or body in pair]
        return tuple(Contact(a, b, (0.0, 0.0, 0.0), 1.0) for a, b in pairs)

    def body_velocity(self, body):
        return np.array([self.speed.get(body, 0.0), 0.0, 0.0]), np.zeros(3)

    def put(self, thing: str, holder: str, at: tuple[float, float, float], yaw: float = 0.0) -> None:
        """Put a thing at a place given in a body's frame."""
        self.moved[thing] = self.body_pose(holder) * Pose.from_yaw(at, yaw)


FOOD_TASKS = {"microwave": PutTheFoodInTheMicrowave, "oven": PutTheFoodInTheOven}
HEIGHT = 0.012 + 0.0225  # the food's middle above the shell's outer bottom


def food_world(name: str, door_deg: float = 85, at=(0.10, 0.0, HEIGHT)) -> tuple:
    task = FOOD_TASKS[name]()
    world = Posed(task)
    world.joints[f"{name}/hinge"] = math.radians(door_deg)
    world.put("food", name, at)
    return task, world


@pytest.mark.parametrize("name", FOOD_TASKS)
def test_food_that_lies_inside_behind_an_open_door_is_done(name):
    task, world = food_world(name)
    assert task.check(world, {}).success
    assert task.check_subtask(f"PLACE(food, {name})", world).success
    assert task.check_subtask(f"OPEN({name})", world).success


@pytest.mark.parametrize("name", FOOD_TASKS)
@pytest.mark.parametrize(
    "at",
    [
        (0.15, 0.0, 0.40),  # on top
        (0.15, 0.0, -0.05),  # below
        (-0.10, 0.0, 0.03),  # before it
        (0.005, 0.0, HEIGHT),  # half of it sticks out
        (0.15, 0.30, HEIGHT),  # beside it
        (0.45, 0.0, HEIGHT),  # behind it
    ],
)
def test_food_anywhere_else_is_not_done(name, at):
    task, world = food_world(name, at=at)
    outcome = task.check(world, {})
    assert not outcome.success and "inside" in outcome.reason


@pytest.mark.parametrize("name", FOOD_TASKS)
@pytest.mark.parametrize("degrees", [0, 25, 45])
def test_a_door_through_which_no_hand_fits_is_not_open(name, degrees):
    task, world = food_world(name, door_deg=degrees)
    assert not task.check(world, {}).success
    assert not task.check_subtask(f"OPEN({name})", world).success


@pytest.mark.parametrize("name", FOOD_TASKS)
def test_food_that_is_held_or_moves_is_not_done(name):
    task, world = food_world(name)
    world.touching = [(FINGERS[0], "food"), ("food", FINGERS[1])]
    assert "touches" in task.check(world, {}).reason
    assert task.check_subtask("Pick up(the food)", world).success
    world.touching = []
    world.speed["food"] = 0.2
    assert "moving" in task.check(world, {}).reason


def test_an_opening_is_as_wide_as_what_one_can_reach_straight_into():
    assert checks.passage(0.0, 0.336, 0.36) < 0
    assert checks.passage(math.radians(60), 0.336, 0.36) == pytest.approx(0.336 - 0.18)
    assert checks.passage(math.radians(90), 0.336, 0.36) == pytest.approx(0.336)
    assert checks.passage(math.radians(110), 0.336, 0.36) == pytest.approx(0.336)


@pytest.mark.parametrize(("degrees", "done"), [(0, False), (30, False), (60, False), (85, True), (110, True)])
def test_a_fridge_is_open_when_a_hand_with_the_milk_fits_through(degrees, done):
    task = OpenTheFridge()
    world = Posed(task)
    world.joints["fridge/hinge"] = math.radians(degrees)
    assert task.check(world, {}).success is done
    world.touching = [(FINGERS[0], "fridge/door")]
    assert not task.check(world, {}).success


def drawer_world(out: float, at=(0.12, 0.0, 0.04)) -> tuple:
    task = PutTheCubeAway()
    world = Posed(task)
    world.joints["chest/slide"] = out
    world.put("cube", "chest/drawer", at)
    return task, world


def test_a_cube_in_the_shut_drawer_is_away():
    task, world = drawer_world(0.002)
    assert task.check(world, {}).success
    assert task.check_subtask("CLOSE(drawer)", world).success
    assert not task.check_subtask("OPEN(drawer)", world).success


@pytest.mark.parametrize("out", [0.03, 0.15])
def test_a_drawer_left_open_is_not_shut(out):
    task, world = drawer_world(out)
    outcome = task.check(world, {})
    assert not outcome.success and "open" in outcome.reason
    assert task.check_subtask("PLACE(cube, drawer)", world).success


@pytest.mark.parametrize("at", [(0.15, 0.0, 0.20), (0.30, 0.0, 0.04), (-0.10, 0.0, 0.02), (0.12, 0.20, 0.04)])
def test_a_cube_on_behind_before_or_beside_the_drawer_is_not_in_it(at):
    task, world = drawer_world(0.0, at)
    assert "not in the drawer" in task.check(world, {}).reason


def test_a_held_cube_is_not_away():
    task, world = drawer_world(0.0)
    world.touching = [(FINGERS[0], "cube")]
    assert not task.check(world, {}).success


CUBES = ("red cube", "green cube", "blue cube")


def tower(order=CUBES, offset: float = 0.0) -> tuple:
    task = StackTheCubes()
    world = Posed(task)
    for i, name in enumerate(order):
        world.moved[name] = Pose((0.5 + offset * i, 0.0, SIDE / 2 + i * SIDE))
    world.touching = list(pairwise(order))
    monitors = {monitor.name: monitor for monitor in task.monitors()}
    for monitor in monitors.values():
        monitor.reset(world)
    return task, world, monitors


def watch(world, monitors, seconds: float) -> None:
    for _ in range(round(seconds / 0.01)):
        world.seconds += 0.01
        for monitor in monitors.values():
            monitor.update(world)


@pytest.mark.parametrize("order", [CUBES, CUBES[::-1], (CUBES[1], CUBES[0], CUBES[2])])
def test_a_tower_in_any_order_is_done_once_it_has_stood_for_two_seconds(order):
    task, world, monitors = tower(order)
    watch(world, monitors, 1.5)
    assert not task.check(world, monitors).success
    watch(world, monitors, 0.6)
    assert task.check(world, monitors).success


def test_two_cubes_on_one_are_no_tower():
    task, world, monitors = tower()
    world.moved["blue cube"] = Pose((0.52, 0.0, 1.5 * SIDE))
    watch(world, monitors, 3.0)
    assert not task.check(world, monitors).success


def test_a_cube_held_above_the_others_is_no_tower():
    task, world, monitors = tower()
    world.touching = [("red cube", "green cube"), (FINGERS[0], "blue cube"), (FINGERS[1], "blue cube")]
    watch(world, monitors, 3.0)
    assert not task.check(world, monitors).success


def test_the_clock_starts_again_when_the_tower_fell():
    task, world, monitors = tower()
    watch(world, monitors, 1.9)
    top = world.moved["blue cube"]
    world.moved["blue cube"] = Pose((0.6, 0.0, SIDE / 2))
    watch(world, monitors, 0.02)
    assert not task.check(world, monitors).success
    world.moved["blue cube"] = top
    watch(world, monitors, 1.5)
    assert not task.check(world, monitors).success


def test_the_clock_starts_again_when_the_tower_was_touched():
    task, world, monitors = tower()
    watch(world, monitors, 1.9)
    standing = world.touching
    world.touching = [*standing, (FINGERS[0], "blue cube")]
    watch(world, monitors, 0.1)
    world.touching = standing
    watch(world, monitors, 1.5)
    assert not task.check(world, monitors).success
    watch(world, monitors, 0.7)
    assert task.check(world, monitors).success


def test_what_the_monitor_remembers_survives_a_checkpoint():
    task, world, monitors = tower()
    watch(world, monitors, 2.5)
    others = {monitor.name: monitor for monitor in task.monitors()}
    for name, other in others.items():
        other.recall(json.loads(json.dumps(monitors[name].memory())))
    assert task.check(world, others).success


def test_subtasks_that_a_task_cannot_judge_are_left_open():
    task, world = food_world("oven")
    assert task.check_subtask("SING(food)", world) is None
    assert StackTheCubes().check_subtask("PLACE(red cube, shelf)", tower()[1]) is None
