"""Perception says what a camera could say: visible things, their boxes and relations, and nothing hidden."""

from __future__ import annotations

import math

import attrs
import numpy as np
import pytest
from memo_perception.ground_truth import GroundTruth
from memo_perception.ground_truth_boxes import geom_bounds
from memo_perception.settings import GroundTruthSettings

from memo_core.errors import InvalidArgument
from memo_core.scene import relations
from memo_core.scene.description import Body, Cavity, Free, Geom, Part, SceneDescription, Slide
from memo_core.scene.graph import Node
from memo_core.scene.pose import Pose, quaternion_from_axis_angle
from memo_core.testing.perception import StillWorld, box, check_perception, cupboard_scene, still_context


def looking(scene=None, **settings):
    context = still_context(scene)
    perception = GroundTruth(GroundTruthSettings(**settings))
    perception.start(context)
    return perception, context


def sentences(graph):
    return set(graph.sentences())


@pytest.mark.parametrize(
    "settings",
    [{}, {"position_noise": 0.01, "rotation_noise": 0.05}, {"dropout": 0.3}],
    ids=["plain", "noise", "dropout"],
)
def test_ground_truth_conforms(settings):
    check_perception(lambda: GroundTruth(GroundTruthSettings(**settings)))


class _Wrong(GroundTruth):
    """A backend that keeps every promise but the one its ``spoil`` breaks."""

    def __init__(self, spoil):
        super().__init__()
        self.spoil = spoil
        self.looks = 0

    def look(self):
        self.looks += 1
        graph = super().look()
        return attrs.evolve(graph, nodes=tuple(self.spoil(self, node) for node in graph.nodes))


WRONG = {
    "ids persist": lambda self, n: attrs.evolve(
        n, id=f"{n.id}{self.looks}", part_of=n.part_of and f"{n.part_of}{self.looks}"
    ),
    "labels are unique": lambda self, n: attrs.evolve(n, label="thing"),
    "ids are unique": lambda self, n: attrs.evolve(n, id="x", part_of=None),
    "labels persist": lambda self, n: attrs.evolve(n, label=f"{n.label} {self.looks}"),
    "part of": lambda self, n: attrs.evolve(n, part_of="nobody"),
    "extents": lambda self, n: attrs.evolve(n, size=(0.0, 1.0, 1.0)),
    "an inside, and only that": lambda self, n: attrs.evolve(n, opening=(0.0, 0.0, 1.0)),
    "kind": lambda self, n: attrs.evolve(n, kind="thing"),
    "looks are words": lambda self, n: attrs.evolve(n, attributes=("0.4 kg",)),
    "restore": lambda self, n: attrs.evolve(n, confidence=1.0 / self.looks),
    "deterministic": lambda self, n: attrs.evolve(n, confidence=0.5 + 0.4 * (id(self) % 997) / 997),
}


@pytest.mark.parametrize("rule", [r for r in WRONG if r not in ("ids persist",)])
def test_the_suite_rejects_a_backend_that_breaks(rule):
    with pytest.raises(AssertionError, match=rule):
        kept = []  # keeps instances alive so that their ids differ

        def make():
            kept.append(_Wrong(WRONG[rule]))
            return kept[-1]

        check_perception(make)


def test_the_suite_rejects_ids_that_change():
    class Forgetful(_Wrong):
        def look(self):
            graph = super().look()
            return attrs.evolve(graph, relations=())

    with pytest.raises(AssertionError, match="ids persist"):
        check_perception(lambda: Forgetful(WRONG["ids persist"]))


def test_the_suite_rejects_a_backend_that_sees_through_doors():
    class Seer(GroundTruth):
        def _hidden(self, thing, shut, poses):
            return False

    with pytest.raises(AssertionError, match="hidden"):
        check_perception(Seer)


def test_every_visible_thing_is_a_node_with_its_kind_and_owner():
    perception, _ = looking()
    graph = perception.look()
    assert {(n.id, n.label, n.kind, n.part_of) for n in graph.nodes} == {
        ("cupboard", "cupboard", "fixture", None),
        ("cupboard_door", "cupboard door", "part", "cupboard"),
        ("cupboard/handle", "cupboard handle", "part", "cupboard_door"),
        ("tin_a", "tin", "object", None),
        ("tin_b", "tin 2", "object", None),
    }


def test_a_box_is_of_the_body_alone_without_door_handle_and_handle_posts():
    perception, _ = looking()
    graph = perception.look()
    assert graph.node("cupboard").size == pytest.approx((0.3, 0.3, 0.3))
    assert graph.node("cupboard").pose.position == pytest.approx((0.7, 0.0, 0.15))
    assert graph.node("cupboard door").size == pytest.approx((0.02, 0.3, 0.3))
    assert graph.node("cupboard handle").pose.position == pytest.approx((0.48, -0.12, 0.15))


def test_opening_the_door_shows_inside_and_content_and_says_so():
    perception, context = looking()
    assert "the cupboard door is closed" in sentences(perception.look())
    context.simulator.joints["cupboard_hinge"] = math.pi / 2
    graph = perception.look()
    assert {"the cupboard door is open", "the cup is in the cupboard"} <= sentences(graph)
    inside = graph.node("cupboard inside")
    assert inside.kind == "space" and inside.part_of == "cupboard" and inside.opening == pytest.approx((-1, 0, 0))
    assert graph.node("cupboard door").pose.position == pytest.approx((0.39, 0.15, 0.15), abs=1e-6)


def test_a_drawer_carries_its_inside_along():
    drawer = Body(
        "drawer",
        (box(0.25, 0.2, 0.01, (0, 0, -0.04)), box(0.01, 0.2, 0.1, (-0.125, 0, 0))),
        Pose((0, 0, 0.08)),
        Slide("drawer_slide", (-1, 0, 0), (0, 0.15)),
        label="drawer",
        cavities=(
            Cavity("drawer/inside", "drawer inside", Pose(), (0.23, 0.18, 0.08), (0, 0, 1), "drawer_slide", 0.0, 0.03),
        ),
    )
    chest = Body(
        "chest",
        (box(0.28, 0.22, 0.16, (0, 0, 0.08)),),
        Pose((0.7, 0.1, 0)),
        label="chest",
        fixture=True,
        bodies=(drawer,),
    )
    pea = Body("pea", (Geom("sphere", (0.01,)),), Pose((0.7, 0.1, 0.055)), Free(), label="pea")
    perception, context = looking(SceneDescription((chest, pea)))
    assert {n.id for n in perception.look().nodes} == {"chest", "drawer"}
    context.simulator.joints["drawer_slide"] = 0.12
    context.simulator.moved["pea"] = Pose((0.58, 0.1, 0.055))
    graph = perception.look()
    assert {"the drawer is open", "the pea is in the drawer"} <= sentences(graph)
    assert graph.node("drawer inside").pose.position == pytest.approx((0.58, 0.1, 0.08))


def test_numbers_are_given_at_first_sight_so_that_hidden_things_do_not_betray_themselves():
    scene = cupboard_scene()
    hidden_tin = Body("tin_0", (box(0.05, 0.05, 0.1),), Pose((0.75, 0.05, 0.06)), Free(), label="tin")
    scene = attrs.evolve(scene, bodies=(hidden_tin, *scene.bodies))
    perception, context = looking(scene)
    assert {n.label for n in perception.look().nodes if n.kind == "object"} == {"tin", "tin 2"}
    context.simulator.joints["cupboard_hinge"] = 1.5
    assert {n.id: n.label for n in perception.look().nodes if n.kind == "object"} == {
        "tin_a": "tin", "tin_b": "tin 2", "tin_0": "tin 3", "cup": "cup",
    }  # fmt: skip


def test_on_stacked_held_and_sides():
    perception, context = looking()
    assert {"the tin is on the table", "the tin 2 is on the table", "the tin is left of the tin 2"} <= sentences(
        perception.look()
    )
    context.simulator.moved["tin_b"] = Pose((0.4, 0.2, 0.15))
    graph = perception.look()
    assert "the tin 2 is on the tin" in sentences(graph)
    assert not any("left of" in s for s in sentences(graph))
    context.simulator.moved["tin_b"] = Pose((0.4, 0.0, 0.4))
    context.link.grips = True
    context.simulator.tool = Pose((0.4, 0.0, 0.42), (0, 1, 0, 0))
    graph = perception.look()
    assert "the gripper holds the tin 2" in sentences(graph) and graph.observation.holding
    assert not any(r.subject == "tin_b" and r.predicate == "on" for r in graph.relations)


RIM = Node("plate", "plate", Pose((0.5, 0.1, 0.012)), (0.18, 0.18, 0.024))


@pytest.mark.parametrize(
    ("what", "at", "size", "where"),
    [
        ("a banana on the plate's floor, its middle below the rim", (0.5, 0.1, 0.022), (0.16, 0.05, 0.032), "plate"),
        ("an apple on the plate's floor", (0.5, 0.1, 0.036), (0.06, 0.06, 0.06), "plate"),
        ("a box on the rim", (0.5, 0.1, 0.044), (0.2, 0.2, 0.04), "plate"),
        ("a banana that leans on the rim, most of it beside", (0.5, 0.21, 0.022), (0.16, 0.05, 0.042), "table"),
        ("a banana beside the plate", (0.5, 0.30, 0.016), (0.16, 0.05, 0.032), "table"),
    ],
)
def test_what_lies_within_a_plates_rim_is_on_the_plate(what, at, size, where):
    thing = Node("thing", "thing", Pose(at), size)
    found = [r.object for r in relations.support((RIM, thing), 0.0) if r.subject == "thing"]
    assert found == [where], what


@pytest.mark.parametrize(
    ("slope", "at", "where"),
    [(15, (0.518, 0.1, 0.028), "plate"), (25, (0.54, 0.12, 0.035), "plate"), (20, (0.5, 0.215, 0.03), "table")],
)
def test_a_banana_that_leans_on_the_rim_is_on_the_plate_while_its_middle_is_over_it(slope, at, where):
    """As it settles in simulation: a corner of its tilted box is below the plate, and even below the table."""
    tilted = quaternion_from_axis_angle((0, 1, 0), math.radians(slope))
    thing = Node("thing", "thing", Pose(at, tilted), (0.16, 0.06, 0.032))
    assert thing.bounds()[0][2] < RIM.bounds()[0][2]
    assert [r.object for r in relations.support((RIM, thing), 0.0) if r.subject == "thing"] == [where]


def test_a_bowl_turned_over_on_a_plate_lies_on_the_table():
    bowl = Node("bowl", "bowl", Pose((0.5, 0.1, 0.05)), (0.24, 0.24, 0.1))
    assert [r.object for r in relations.support((RIM, bowl), 0.0) if r.subject == "bowl"] == ["table"]


def test_what_stands_under_a_low_table_is_not_on_it():
    shelf = Node("shelf", "shelf", Pose((0.5, 0.1, 0.15)), (0.3, 0.3, 0.3), kind="fixture")
    thing = Node("thing", "thing", Pose((0.5, 0.1, 0.05)), (0.05, 0.05, 0.1))
    assert [r.object for r in relations.support((shelf, thing), 0.0)] == ["table"]


@pytest.mark.parametrize(
    ("offset", "said"),
    [((0, 0.2), "left of"), ((0, -0.2), "right of"), ((-0.2, 0.05), "in front of"), ((0.2, 0.05), "behind")],
)
def test_sides_are_as_the_robot_sees_them(offset, said):
    b = Node("b", "b", Pose((0.5, 0, 0.02)), (0.04, 0.04, 0.04))
    a = Node("a", "a", Pose((0.5 + offset[0], offset[1], 0.02)), (0.04, 0.04, 0.04))
    assert relations.side(a, b) == said
    assert [r.predicate for r in relations.arrangement([a, b])] == [said]


def test_far_things_are_not_compared_and_close_ones_are_next_to_each_other():
    a, b, c = (Node(n, n, Pose((x, 0, 0.02)), (0.04, 0.04, 0.04)) for n, x in (("a", 0.3), ("b", 0.37), ("c", 0.9)))
    assert {(r.subject, r.predicate, r.object) for r in relations.arrangement([a, b, c])} == {
        ("a", "in front of", "b"), ("a", "next to", "b"),
    }  # fmt: skip


def test_noise_is_what_the_setting_says_and_parts_move_with_their_body():
    perception, _ = looking(position_noise=0.01, rotation_noise=0.02)
    truth = looking()[0].look().node("tin").pose
    offsets, angles, rigid = [], [], []
    for _ in range(300):
        graph = perception.look()
        seen = graph.node("tin").pose
        offsets.append(np.subtract(seen.position, truth.position))
        angles.append(seen.distance(truth)[1])
        door, handle = graph.node("cupboard door").pose, graph.node("cupboard handle").pose
        rigid.append((door.inverse() * handle).position)
    assert np.std(offsets, axis=0) == pytest.approx([0.01] * 3, rel=0.15)
    assert np.sqrt(np.mean(np.square(angles))) == pytest.approx(0.02 * math.sqrt(3), rel=0.15)
    assert np.ptp(rigid, axis=0) == pytest.approx([0, 0, 0], abs=1e-9)


def test_dropout_misses_objects_and_never_furniture():
    perception, _ = looking(dropout=0.5)
    graphs = [perception.look() for _ in range(200)]
    share = np.mean([any(n.id == "tin_a" for n in g.nodes) for g in graphs])
    assert 0.4 < share < 0.6
    assert all({"cupboard", "cupboard_door", "cupboard/handle"} <= {n.id for n in g.nodes} for g in graphs)


def test_a_restored_state_gives_the_same_look_again():
    perception, _ = looking(position_noise=0.01, dropout=0.5)
    perception.look()
    state = perception.state()
    later = [perception.look().nodes for _ in range(5)]
    perception.restore(state)
    assert [perception.look().nodes for _ in range(5)] == later
    with pytest.raises(InvalidArgument, match="perception state"):
        perception.restore(b"rubbish")


def test_mistakes_are_named():
    perception = GroundTruth()
    with pytest.raises(InvalidArgument, match="before start"):
        perception.look()
    with pytest.raises(InvalidArgument, match="there is none"):
        perception.start(attrs.evolve(still_context(), simulator=None))
    with pytest.raises(InvalidArgument, match="no camera 'front'"):
        GroundTruth(GroundTruthSettings(images=("front",))).start(still_context())
    with pytest.raises(InvalidArgument, match="no geoms"):
        GroundTruth().start(still_context(SceneDescription((Body("ghost", (), label="ghost"),))))


def test_a_fixed_unlabelled_piece_belongs_to_its_body_and_a_part_of_an_unlabelled_body_to_the_next_labelled():
    post = Body("post", (box(0.02, 0.02, 0.2, (0, 0, 0.1)),), Pose((0.1, 0, 0)))
    arm = Body(
        "arm",
        (box(0.02, 0.02, 0.02),),
        Pose((0, 0, 0.3)),
        Slide("s", (1, 0, 0)),
        parts=(Part("knob", "knob", Pose(), (0.02, 0.02, 0.02)),),
    )
    lamp = Body(
        "lamp", (box(0.1, 0.1, 0.02, (0, 0, 0.01)),), Pose((0.5, 0, 0)), label="lamp", fixture=True, bodies=(post, arm)
    )
    graph = looking(SceneDescription((lamp,)))[0].look()
    assert graph.node("lamp").size == pytest.approx((0.16, 0.1, 0.2))
    assert graph.node("knob").part_of == "lamp"


@pytest.mark.parametrize(
    ("shape", "size", "extents"),
    [
        ("cylinder", (0.1, 0.4), (0.4, 0.2, 0.2)),
        ("capsule", (0.1, 0.4), (0.6, 0.2, 0.2)),
        ("sphere", (0.1,), (0.2, 0.2, 0.2)),
        ("box", (0.1, 0.2, 0.3), (0.3, 0.2, 0.1)),
    ],
)
def test_a_geom_lying_along_x_is_measured_along_the_bodys_axes(shape, size, extents):
    lying = Pose(orientation=(math.cos(math.pi / 4), 0, math.sin(math.pi / 4), 0))
    low, high = geom_bounds(Geom(shape, size, lying))
    assert high - low == pytest.approx(extents, abs=1e-9)


def test_meshes_are_measured(tmp_path):
    path = tmp_path / "wedge.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 2 3\n")
    low, high = geom_bounds(Geom("mesh", (0.1,), mesh=str(path)))
    assert (low.tolist(), high.tolist()) == ([0, 0, 0], pytest.approx([0.1, 0.2, 0.3]))
    with pytest.raises(InvalidArgument, match="mesh"):
        geom_bounds(Geom("mesh", (1.0,), mesh=str(tmp_path / "none.obj")))


def test_the_still_world_turns_its_door_about_the_hinge():
    world = StillWorld(cupboard_scene())
    world.joints["cupboard_hinge"] = math.pi / 2
    hinge_edge = world.body_pose("cupboard_door").apply([0.0, 0.15, 0.0])
    assert hinge_edge == pytest.approx([0.54, 0.15, 0.15])


def test_a_glance_sees_the_truth_and_changes_nothing():
    perception, _context = looking(position_noise=0.05, dropout=0.9)
    before = perception.state()
    truth = looking()[0].look()
    assert perception.glance().nodes == truth.nodes
    assert perception.state() == before


def test_visible_extents_are_what_sticks_out_of_a_chest():
    drawer = Body(
        "drawer",
        (box(0.25, 0.2, 0.1), box(0.01, 0.2, 0.1, (-0.13, 0, 0))),
        Pose((0, 0, 0.08)),
        Slide("drawer_slide", (-1, 0, 0), (0, 0.15)),
        label="drawer",
    )
    walls = (box(0.25, 0.24, 0.02, (0, 0, 0.01)), box(0.25, 0.24, 0.02, (0, 0, 0.15)))
    chest = Body("chest", walls, Pose((0.7, 0.1, 0)), label="chest", fixture=True, bodies=(drawer,))
    for visible, closed, opened in ((False, 0.26, 0.26), (True, 0.01, 0.11)):
        perception, context = looking(SceneDescription((chest,)), visible_extents=visible)
        assert perception.look().node("drawer").size[0] == pytest.approx(closed)
        context.simulator.joints["drawer_slide"] = 0.1
        seen = perception.look().node("drawer")
        assert seen.size == pytest.approx((opened, 0.2, 0.1))
        assert seen.pose.position[0] - opened / 2 == pytest.approx(0.7 - 0.135 - 0.1)
