"""Without a model, things are told apart by colour and size, and nothing is guessed."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from memo_perception.cameras.backend import Cameras
from memo_perception.cameras.inventory import Hint, Item
from memo_perception.cameras.settings import CamerasSettings, SimulatedSettings

from memo_core.scene.description import Body, Free, Geom
from memo_core.scene.name_corrections import read_name_corrections
from memo_core.scene.pose import Pose
from tests.perception.small_scene import looking_at, scene

PLAIN = CamerasSettings(detector="inventory", simulated=SimulatedSettings(width=320))


def seen(context, items=(), hints=()):
    eyes = Cameras(attrs.evolve(PLAIN, items=tuple(items)))
    eyes.start(context)
    eyes.hints = tuple(hints)
    return eyes.look()


@pytest.fixture(scope="module")
def world():
    with looking_at(scene()) as context:
        yield context


BLOCK = Item("red block", colours=("red",), size=(0.05, 0.09, 0.04))
CAN = Item("can", colours=("blue",), size=(0.06, 0.06, 0.11))
CUPBOARD = Item("cupboard", "fixture", colours=("white",), size=(0.24, 0.3, 0.26))


@pytest.mark.sim
def test_the_things_of_a_list_are_found_with_their_parts(world):
    graph = seen(world)
    labels = {node.label for node in graph.nodes}
    assert {"red block", "can", "cupboard", "cupboard door"} <= labels
    assert np.linalg.norm(np.subtract(graph.node("red block").pose.position, (0.42, -0.22, 0.02))) < 0.006
    assert graph.node("cupboard door").part_of == graph.node("cupboard").id


def test_what_no_line_describes_is_unknown_and_not_guessed(world):
    labels = {node.label for node in seen(world, [CAN, CUPBOARD]).nodes}
    assert "red block" not in labels
    assert any(label.startswith("unknown thing") for label in labels)


def test_what_is_not_there_is_not_seen(world):
    banana = Item("banana", colours=("yellow",), size=(0.16, 0.05, 0.03))
    assert "banana" not in {node.label for node in seen(world, [banana, BLOCK, CAN, CUPBOARD]).nodes}


def test_of_two_lines_that_fit_equally_neither_is_claimed(world):
    other = attrs.evolve(BLOCK, label="red sponge")
    labels = {node.label for node in seen(world, [BLOCK, other, CAN, CUPBOARD]).nodes}
    assert not {"red block", "red sponge"} & labels


def test_a_person_may_say_that_it_is_something_else(world):
    hint = Hint("that is not the red block", "red block", (0.42, -0.22, 0.02))
    assert "red block" not in {node.label for node in seen(world, [BLOCK, CAN, CUPBOARD], [hint]).nodes}


def grey(described):
    """The scene with its cupboard, the door and its handle all of one grey."""

    def painted(body):
        geoms = tuple(attrs.evolve(geom, colour=(0.5, 0.5, 0.52, 1)) for geom in body.geoms)
        return attrs.evolve(body, geoms=geoms, bodies=tuple(painted(child) for child in body.bodies))

    bodies = tuple(painted(body) if body.name == "cupboard" else body for body in described.bodies)
    return attrs.evolve(described, bodies=bodies)


@pytest.mark.sim
@pytest.mark.parametrize("noise", ["none", "d435"])
def test_a_door_and_its_handle_are_told_apart_by_form_where_all_is_of_one_colour(noise):
    with looking_at(grey(scene())) as context:
        eyes = Cameras(attrs.evolve(PLAIN, simulated=SimulatedSettings(noise=noise)))
        eyes.start(context)
        graph = eyes.look()
    owners = {node.label: node.part_of for node in graph.nodes}
    assert owners["cupboard door"] == "cupboard" and owners["cupboard handle"] == "cupboard door"
    assert "the cupboard door is closed" in graph.sentences()
    handle = graph.node("cupboard handle")
    assert np.linalg.norm(np.subtract(handle.pose.position, (0.56, -0.06, 0.13))) < 0.03
    assert handle.size[2] == pytest.approx(0.14, abs=0.03)


def test_what_a_person_says_of_a_name_holds_for_later_looks_and_for_other_runs(world):
    eyes = Cameras(PLAIN)
    eyes.start(world)
    before = eyes.look()
    said = read_name_corrections("that is not a can, it is a candle", before, "ann")
    eyes.correct_names(said)
    for after in (eyes.look(), eyes.glance()):
        assert after.node("candle").id == before.node("can").id
        assert "can" not in {node.label for node in after.nodes}
    later = Cameras(PLAIN)
    later.correct_names(tuple(one.elsewhere() for one in said))
    later.start(world)
    labels = {node.label for node in later.look().nodes}
    assert "candle" in labels and "can" not in labels and "red block" in labels


@pytest.mark.sim
@pytest.mark.parametrize("noise", ["none", "d435"])
def test_two_things_of_one_colour_are_two_though_one_stands_before_the_other_in_a_picture(noise):
    blue = Geom("box", (0.05, 0.05, 0.05), colour=(0.1, 0.2, 0.8, 1))
    toy = Body("toy", (blue,), Pose((0.437, 0.365, 0.025)), Free(), label="toy block")
    described = scene()
    with looking_at(attrs.evolve(described, bodies=(*described.bodies, toy))) as context:
        eyes = Cameras(attrs.evolve(PLAIN, simulated=SimulatedSettings(noise=noise)))
        eyes.start(context)
        graph = eyes.look()
    assert np.linalg.norm(np.subtract(graph.node("can").pose.position, (0.40, 0.30, 0.055))) < 0.015
    assert np.linalg.norm(np.subtract(graph.node("toy block").pose.position, (0.437, 0.365, 0.025))) < 0.015
