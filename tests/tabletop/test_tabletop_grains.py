"""Pouring and seasoning by physics, and grains: they fit their vessel, come to rest, and are counted where they lie.

All twenty seeds: ``memo tasks verify``.
"""

from __future__ import annotations

import math

import attrs
import mujoco
import numpy as np
import pytest
from memo_perception.ground_truth import GroundTruth
from memo_sim_mujoco.settings import MujocoSettings
from memo_sim_mujoco.simulator import MujocoSimulator
from memo_tabletop.grains import CEREAL, contained, grains, vessel
from memo_tabletop.objects import block
from memo_tabletop.tasks import pouring, seasoning
from memo_tabletop.tasks.pouring import PourTheCan
from memo_tabletop.tasks.seasoning import SeasonTheFood

from memo_core.arm.attached_objects import Attachment, grasped
from memo_core.arm.collision import obstacles_of
from memo_core.cli.options import load
from memo_core.robot.description import GripperDescription
from memo_core.scene.description import SceneDescription
from memo_core.scene.pose import Pose
from memo_core.testing.perception import StillWorld, cupboard_scene, still_context
from tests.support.wrong_behaviours import Wrong, judged, rehearsal_fixture

pytestmark = pytest.mark.sim

POUR = ("pour",)
OVER_BOWL = 'tilt, back, before = lift_over("can", "bowl", 0.02, get_size("can")[2] + 0.015)\n'
OVER_FOOD = 'tilt, back, before = lift_over("salt shaker", "food", 0.055, 0.12, False, math.radians(150))\n'
SET_DOWN = """
place, height = get_position(TARGET), get_bounds(TARGET)[1][2]
grip = get_gripper_position()
low = grip[2] - 0.62 * get_size(THING)[2]
hand = get_gripper_orientation()
move_straight([place[0], place[1], grip[2]], hand, slack=0.0)
move_straight([place[0], place[1], grip[2] - low + FLOOR], hand, slack=0.0, speed=0.2)
open_gripper()
"""

WRONG = {
    PourTheCan: (
        Wrong(
            "nearly right",
            "tilts the can too little",
            f"{OVER_BOWL}follow_path(tilt[:9], slack=0.0)",
            "still in the can",
            using=POUR,
        ),
        Wrong(
            "sloppy",
            "pours before the bowl",
            OVER_BOWL.replace("0.02", "0.14") + "follow_path(tilt, slack=0.0, speed=0.5)",
            "beside",
            using=POUR,
        ),
        Wrong(
            "cheating",
            "sets the can down in the bowl",
            SET_DOWN.replace("TARGET", '"bowl"').replace("THING", '"can"').replace("FLOOR", "0.008"),
            "0 of 25 balls are in the bowl, 25 still in the can",
            before=OVER_BOWL,
            using=POUR,
        ),
    ),
    SeasonTheFood: (
        Wrong(
            "nearly right",
            "tilts the shaker too little",
            f"{OVER_FOOD}follow_path(tilt[:7])\nput_back(list(reversed(tilt[:7]))[1:] + back[-3:], before)",
            "0 of 5 grains are on the food, 5 in the shaker",
            using=POUR,
        ),
        Wrong(
            "sloppy",
            "salts the plate",
            'season("salt shaker", "food", short=0.13)',
            "beside",
            using=POUR,
        ),
        Wrong(
            "sloppy",
            "drops the shaker afterwards",
            f"{OVER_FOOD}follow_path(tilt, slack=0.0, speed=0.3)\nwait(0.5)\nopen_gripper()",
            "does not stand upright on the table",
            using=POUR,
        ),
        Wrong(
            "cheating",
            "stands the shaker on the food",
            SET_DOWN.replace("TARGET", '"food"').replace("THING", '"salt shaker"').replace("FLOOR", "height + 0.002"),
            "0 of 5 grains are on the food, 5 in the shaker",
            before=OVER_FOOD,
            using=POUR,
        ),
    ),
}

rehearsal = rehearsal_fixture()
test_a_wrong_behaviour_is_not_success, test_the_reference_is_success_and_doing_nothing_is_not = judged(WRONG)


# -- where grains are --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("count", "radius", "room"), [(25, 0.007, 0.0275), (5, 0.003, 0.019), (9, 0.007, 0.012), (3, 0.007, 0.008)]
)
def test_grains_start_apart_from_each_other_and_within_their_room(count, radius, room):
    bodies = grains("beans", count, radius, 0.001, CEREAL, (1, 1, 1, 1), (0.1, 0.2, 0.3), room)
    places = np.array([body.pose.position for body in bodies])
    assert len(bodies) == count and {body.heap for body in bodies} == {"beans"}
    apart = np.linalg.norm(places[:, None] - places[None], axis=2) + np.eye(count)
    assert apart.min() > 2 * radius
    assert np.hypot(*(places[:, :2] - [0.1, 0.2]).T).max() + radius < room
    assert places[:, 2].min() - radius > 0.3


class Placed(StillWorld):
    """Grains laid out by hand."""

    def put(self, names, places) -> None:
        for name, place in zip(names, places, strict=True):
            self.moved[name] = Pose(place)

    def body_velocity(self, body):
        return np.zeros(3), np.zeros(3)


def test_what_lies_in_a_leaning_vessel_is_counted_in_its_frame():
    cup = vessel("cup", (0.5, 0.0, 0.3), 0.0, 0.03, 0.1, 0.004, 0.1, (1, 1, 1, 1))
    balls = grains("beans", 2, 0.005, 0.001, CEREAL, (1, 1, 1, 1), (0.0, 0.0, 0.0), 0.03)
    world = Placed(SceneDescription((cup, *balls)))
    lying = Pose((0.5, 0.0, 0.3), (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0))  # its mouth points along +x
    world.moved["cup"] = lying
    world.put(["beans/0", "beans/1"], [(0.55, 0.0, 0.3), (0.5, 0.0, 0.35)])
    assert contained(world, "cup", 0.03, 0.1, ["beans/0", "beans/1"]) == ("beans/0",)


def test_a_can_is_at_most_66_mm_wide_from_corner_to_corner():
    apothem, _, wall = pouring.CAN
    assert 2 * (apothem + wall) / math.cos(math.pi / 12) <= 0.066


def food_frame(task: SeasonTheFood) -> tuple[Placed, np.ndarray]:
    world = Placed(task.scene(np.random.default_rng(0)))
    return world, np.asarray(world.body_pose("food").position)


@pytest.mark.parametrize(
    ("at", "counts"),
    [
        ((0.0, 0.0, 0.018), True),
        ((0.03, 0.02, 0.0185), True),
        ((0.0, 0.0, 0.030), False),  # in the air, or in a shaker that stands there
        ((0.09, 0.0, -0.009), False),  # on the plate
        ((0.0, 0.0, 0.0), False),  # inside
    ],
)
def test_a_grain_is_on_the_food_when_it_lies_on_top_of_it(at, counts):
    task = SeasonTheFood()
    world, middle = food_frame(task)
    world.put(["salt/0"], [tuple(middle + np.asarray(at))])
    assert ("salt/0" in task._on_food(world)) is counts
    assert seasoning.RADIUS < 0.004


@pytest.mark.sim
def test_the_sparse_solver_that_many_bodies_get_finds_what_the_dense_one_finds():
    """MuJoCo 4.0.0 is known for a wrong Hessian in its sparse Newton solver; where it mattered this would show."""
    scene = PourTheCan().scene(np.random.default_rng(0))
    robot = load(None, [])[1].create("robot")
    found = []
    with (
        MujocoSimulator(MujocoSettings(tolerance=1e-12)) as sparse,
        MujocoSimulator(MujocoSettings(tolerance=1e-12, jacobian="dense")) as dense,
    ):
        for simulator in (sparse, dense):
            simulator.build(scene, robot)
        assert sparse.model.nv > 60
        for _ in range(20):
            sparse.tick()
        can = sparse.model.body("can").dofadr[0]
        sparse.data.qvel[can + 4] = 6.0  # knocked over
        for _ in range(3):
            for _ in range(12):
                sparse.tick()
            dense.data.qpos[:], dense.data.qvel[:] = sparse.data.qpos, sparse.data.qvel
            dense.data.ctrl[:], dense.data.qacc_warmstart[:] = sparse.data.ctrl, sparse.data.qacc_warmstart
            mujoco.mj_forward(dense.model, dense.data)
            mujoco.mj_forward(sparse.model, sparse.data)
            size = np.linalg.norm(dense.data.qacc)
            found.append((dense.data.nefc, np.linalg.norm(sparse.data.qacc - dense.data.qacc) / size))
    assert all(rows > 200 for rows, _ in found)
    assert max(error for _, error in found) < 1e-6


# -- what is seen of them ----------------------------------------------------------------------------------------------


def seen(scene: SceneDescription, moved: dict[str, tuple[float, float, float]]):
    context = still_context(scene)
    for name, place in moved.items():
        context.simulator.moved[name] = Pose(place)
    perception = GroundTruth()
    perception.start(context)
    return perception.look()


def bowl_and_beans(count: int) -> SceneDescription:
    bowl = vessel("bowl", (0.5, 0.0, 0.0), 0.0, 0.06, 0.05, 0.004, 0.4, (1, 1, 1, 1))
    beans = grains("rice", count, 0.005, 0.001, CEREAL, (1, 1, 1, 1), (0.5, 0.0, 0.004), 0.05)
    return SceneDescription((bowl, *beans))


def test_many_grains_are_one_thing_that_is_in_something():
    graph = seen(bowl_and_beans(12), {})
    heap = graph.node("rice")
    assert heap.kind == "heap" and [node.label for node in graph.nodes].count("rice") == 1
    assert not any(node.id.startswith("rice/") for node in graph.nodes)
    assert "the rice is in the bowl" in graph.sentences()
    assert "the rice is on the table" not in graph.sentences()


def test_a_heap_is_where_most_of_its_grains_are():
    away = {f"rice/{number}": (0.3 + 0.012 * number, 0.3, 0.005) for number in range(8)}
    heap = seen(bowl_and_beans(12), away).node("rice")
    assert heap.pose.position[:2] == pytest.approx((0.342, 0.3))
    assert heap.size == pytest.approx((7 * 0.012 + 0.01, 0.01, 0.01))
    graph = seen(bowl_and_beans(12), dict(list(away.items())[:3]))
    assert "the rice is in the bowl" in graph.sentences()


def test_grains_behind_a_closed_door_are_not_seen():
    scene = cupboard_scene()
    cavity = next(cavity for body in scene.bodies for cavity in body.cavities)
    holder = next(body for body in scene.bodies if cavity in body.cavities)
    rice = grains("rice", 3, 0.005, 0.001, CEREAL, (1, 1, 1, 1), (holder.pose * cavity.pose).position, 0.02)
    scene = attrs.evolve(scene, bodies=(*scene.bodies, *rice))
    assert not any(node.kind == "heap" for node in seen(scene, {}).nodes)
    graph = seen(scene, {"rice/0": (0.4, 0.2, 0.005)})  # one lies outside
    assert graph.node("rice").size == pytest.approx((0.01, 0.01, 0.01))


def test_a_heap_is_no_obstacle_and_is_not_what_a_hand_grasps():
    graph = seen(bowl_and_beans(12), {})
    assert not any(obstacle.node == "heap/rice" for obstacle in obstacles_of(graph))
    held = grasped(graph, Attachment(), Pose(graph.node("rice").pose.position), GripperDescription())
    assert held.held is not None and held.held.label == "bowl"


def test_what_is_in_something_is_not_said_to_be_on_the_table():
    # a low tray: what lies in it is as near to the table as what lies on it
    tray = vessel("tray", (0.5, 0.0, 0.0), 0.0, 0.10, 0.03, 0.004, 0.4, (1, 1, 1, 1))
    lying = [block(name, name, (x, 0.0, z), 0.0, (0.03, 0.03, 0.02), 0.1, (1, 1, 1, 1)) for name, x, z in
             (("bread", 0.5, 0.004), ("cheese", 0.5, 0.024), ("knife", 0.3, 0.0))]  # fmt: skip
    sentences = set(seen(SceneDescription((tray, *lying)), {}).sentences())
    assert {"the bread is in the tray", "the knife is on the table", "the cheese is on the bread"} <= sentences
    assert not {"the bread is on the table", "the bread is on the tray"} & sentences
