"""The tabletop scenes: any simulator can build them, they depend on the seed alone, and they are what they claim."""

from __future__ import annotations

import math

import numpy as np
import pytest
from memo_tabletop.furniture import STEEL, DoorHinge, Handle, cabinet
from memo_tabletop.plugin import TabletopSettings, tasks
from memo_tabletop.tasks.fridge import OpenTheFridge
from memo_tabletop.tasks.microwave import PutTheFoodInTheMicrowave

from memo_core.cli.options import load
from memo_core.errors import InvalidArgument
from memo_core.runs.factories import environment_of
from memo_core.scene.description import Free, Geom, SceneDescription
from memo_core.scene.hollow import bar, cup, inside, shelf, shell
from memo_core.scene.pose import Pose, quaternion_from_axis_angle
from memo_core.testing.suite import check_suite

TASKS = tasks(TabletopSettings())
# The paper's tasks in its order: instruction, type; the last five are held out.
PAPER = (
    ("pick the left can", "SR"),
    ("put the banana on the plate", "SR"),
    ("put the cube away", "LH"),
    ("put the food in the microwave", "TR"),
    ("put the food in the pan and place it in the microwave", "SR"),
    ("put the trash away", "SR"),
    ("stack the cubes", "LH"),
    ("turn on the faucet", "TR"),
    ("set the table", "LH"),
    ("clean up the table", "LH"),
    ("heat the food", "SR"),
    ("cook the food", "SR"),
    ("empty the fridge", "LH"),
    ("make toast", "SR"),
    ("move the lonely object to the others", "SR"),
    ("move the right can to the left can", "SR"),
    ("open the fridge", "TR"),
    ("open the bottle", "TR"),
    ("wipe the plate", "CR"),
    ("season the food", "SR"),
    ("place the apple on the table", "LH"),
    ("pour the can", "TR"),
    ("close the bottle", "TR"),
    ("empty the cabinet", "SR"),
    ("put the food in the oven", "CR"),
)
HELD_OUT = 5
each_task = pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)


def scene_of(task, seed: int) -> SceneDescription:
    return task.scene(np.random.default_rng(seed))


def test_the_suite_keeps_the_rules_for_suites():
    check_suite(lambda: tasks(TabletopSettings()))


def test_the_papers_tasks_are_there_in_its_order():
    assert [(task.instruction, task.kind) for task in TASKS] == list(PAPER)
    assert [task.name for task in TASKS] == [instruction.replace(" ", "-") for instruction, _ in PAPER]
    held_out = [task.split == "held-out" for task in TASKS]
    assert held_out == [False] * (len(PAPER) - HELD_OUT) + [True] * HELD_OUT


@each_task
def test_twenty_seeds_give_twenty_scenes_with_unique_names(task):
    scenes = [scene_of(task, seed) for seed in range(20)]
    assert len({repr(scene) for scene in scenes}) == 20
    for scene in scenes:
        bodies = [body for body, _ in scene.walk()]
        names = [b.name for b in bodies]
        names += [b.joint.name for b in bodies if b.joint is not None and not isinstance(b.joint, Free)]
        names += [part.id for b in bodies for part in (*b.parts, *b.cavities)]
        assert len(set(names)) == len(names)
        labels = [b.label for b in bodies if b.label] + [part.label for b in bodies for part in (*b.parts, *b.cavities)]
        assert len(set(labels)) == len(labels)


FURNISHED = [t for t in TASKS if scene_of(t, 0).bodies[0].fixture and "bottle" not in t.name]  # a bottle is round


@pytest.mark.parametrize("task", FURNISHED, ids=lambda task: task.name)
def test_furniture_scatters_by_two_centimetres_and_five_degrees(task):
    fixtures = [scene_of(task, seed).bodies[0] for seed in range(40)]
    places = np.array([body.pose.position[:2] for body in fixtures])
    yaws = np.array([2 * math.atan2(body.pose.orientation[3], body.pose.orientation[0]) for body in fixtures])
    assert np.all(np.ptp(places, axis=0) <= 0.04) and np.all(np.ptp(places, axis=0) > 0.025)
    assert np.all(np.abs(yaws) <= math.radians(5)) and np.ptp(yaws) > math.radians(6)


@pytest.fixture(scope="module")
def experiment():
    return load(None, [])[1]


@pytest.mark.sim
@each_task
def test_nothing_falls_jumps_or_rolls_when_the_scene_begins(experiment, task):
    for seed in (0, 1):
        with environment_of(experiment, task, seed) as world:
            things = [b for b in world.description.bodies if isinstance(b.joint, Free) and b.label]
            before = {body.name: world.simulator.body_pose(body.name) for body in things}
            world.settle(0.6)
            for name, pose in before.items():
                moved, turned = pose.distance(world.simulator.body_pose(name))
                assert moved < 0.006, f"{name}, seed {seed}, moved by {1000 * moved:.0f} mm"
                assert turned < 0.1, f"{name}, seed {seed}, turned by {math.degrees(turned):.0f} degrees"


def test_a_shell_leaves_the_inside_it_names_free():
    size, wall = (0.3, 0.36, 0.34), 0.012
    for side in ("front", "top"):
        centre, extents, opening = inside(size, wall, side)
        for geom in shell(size, wall, side):
            apart = np.abs(np.array(geom.pose.position) - centre) - (np.array(geom.size) + extents) / 2
            assert apart.max() >= -1e-9, f"a wall of the {side} shell reaches into its inside"
        # the open side has no wall: the inside reaches to the outer face there
        axis = int(np.argmax(np.abs(opening)))
        face = centre[axis] + opening[axis] * extents[axis] / 2
        assert face == pytest.approx(0.0 if side == "front" else size[2])


def test_walls_of_a_shell_do_not_overlap():
    geoms = shell((0.3, 0.36, 0.34), 0.012) + shell((0.3, 0.36, 0.34), 0.012, "top")
    for group in (geoms[:5], geoms[5:]):
        for i, one in enumerate(group):
            for other in group[i + 1 :]:
                apart = np.abs(np.subtract(one.pose.position, other.pose.position)) - np.add(one.size, other.size) / 2
                assert apart.max() >= -1e-9


def test_a_shelf_lies_between_the_walls_at_the_height_it_says():
    size, wall = (0.3, 0.36, 0.5), 0.012
    board = shelf(size, wall, 0.22, 0.09)
    centre, extents, _ = inside(size, wall)
    low, high = (np.array(board.pose.position) + s * np.array(board.size) / 2 for s in (-1, 1))
    assert high[2] == pytest.approx(0.22)
    assert np.all(low >= np.array(centre) - np.array(extents) / 2 - 1e-9)
    assert np.all(high <= np.array(centre) + np.array(extents) / 2 + 1e-9)


@pytest.mark.parametrize("sides", [3, 8, 12])
def test_a_cup_holds_what_fits_its_apothem_and_has_no_gaps(sides):
    apothem, wall = 0.03, 0.004
    floor, *walls = cup(apothem, 0.1, wall, sides)
    assert len(walls) == sides and floor.pose.position[2] + floor.size[1] / 2 == pytest.approx(wall)
    for one, other in zip(walls, walls[1:] + walls[:1], strict=True):
        face = one.pose.inverse().apply([0.0, 0.0, 0.05])
        assert -face[0] - wall / 2 == pytest.approx(apothem)  # the inner face
        ends = one.pose.apply([0.0, one.size[1] / 2, 0.0]), other.pose.apply([0.0, -other.size[1] / 2, 0.0])
        corner = np.abs(other.pose.inverse().apply(ends[0])) - np.array(other.size) / 2
        assert corner[:2].max() <= wall  # neighbours reach one another
    with pytest.raises(InvalidArgument):
        cup(0.03, 0.002)


@pytest.mark.parametrize("along", ["y", "z"])
def test_a_bar_is_round_and_its_posts_reach_the_face(along):
    rod, *posts = bar((-0.05, 0.1, 0.2), 0.14, along, 0.05)
    assert rod.shape == "cylinder" and rod.size == (0.009, 0.14)
    assert abs(rod.pose.rotation[1 if along == "y" else 2, 2]) == pytest.approx(1.0)
    for post in posts:
        assert post.pose.position[0] + post.size[0] / 2 == pytest.approx(0.0)


@pytest.mark.parametrize("edge", ["left", "right", "bottom"])
def test_a_door_swings_outwards_about_its_edge_and_touches_nothing_on_the_way(edge):
    size = (0.30, 0.36, 0.34)
    body = cabinet("box", (0.7, 0, 0.4), 0.0, size, DoorHinge(edge, 1.6), Handle(0.14, 0.05), STEEL, STEEL)
    door = body.bodies[0]
    panel: Geom = door.geoms[0]
    signs = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
    for angle in np.linspace(0.0, 1.6, 9):
        turn = Pose(orientation=quaternion_from_axis_angle(door.joint.axis, float(angle)))
        corners = (door.pose * turn * panel.pose).apply(signs * np.asarray(panel.size))
        assert corners[:, 0].max() < 0.02, "the panel swings into the shell"
        inside_front = (corners[:, 0] > 0) & (np.abs(corners[:, 1]) < size[1] / 2) & (corners[:, 2] > 0)
        assert not inside_front.any()
    assert corners[:, 0].min() < -0.3


def test_lesions_change_what_they_name_and_nothing_else():
    plain, mirrored = PutTheFoodInTheMicrowave(), PutTheFoodInTheMicrowave(mirrored=True)
    one, other = (scene_of(task, 3).body("microwave/door") for task in (plain, mirrored))
    assert one.joint.axis[2] == -other.joint.axis[2]
    assert one.parts[0].pose.position[1] == pytest.approx(-other.parts[0].pose.position[1])
    low = scene_of(PutTheFoodInTheMicrowave(handle_height=0.15), 3).body("microwave/door")
    assert low.parts[0].pose.position[2] == pytest.approx(0.15)
    stiff = scene_of(OpenTheFridge(hinge_friction=2.5, bar_friction=0.4), 3).body("fridge/door")
    assert stiff.joint.friction == 2.5
    assert {g.material.friction for g in stiff.geoms[1:4]} == {0.4}
