"""The conformance suite passes for every simulator here, and rejects one deliberately wrong simulator a rule."""

from __future__ import annotations

import attrs
import pytest
from memo_sim_mujoco.simulator import MujocoSimulator
from memo_sim_pybullet.simulator import PybulletSimulator

from memo_core.errors import InvalidArgument
from memo_core.scene.description import Camera
from memo_core.scene.pose import Pose
from memo_core.testing.own_scenes import RULES as OWN_RULES
from memo_core.testing.simulator import RULES, check_simulator
from memo_core.testing.simulator_scenes import check_robot, check_scene
from memo_core.testing.wrong_simulators import wrong_simulators

pytestmark = pytest.mark.sim

SIMULATORS = {"mujoco": MujocoSimulator, "pybullet": PybulletSimulator}
WRONG = wrong_simulators(MujocoSimulator)


@pytest.mark.parametrize("simulator", SIMULATORS)
@pytest.mark.parametrize("name", RULES)
def test_the_simulator_keeps_the_rule(name, simulator):
    RULES[name](SIMULATORS[simulator])


def test_every_rule_has_a_wrong_simulator():
    assert set(WRONG) == set(RULES)


@pytest.mark.parametrize("name", RULES)
def test_the_rule_rejects_a_simulator_that_breaks_it(name):
    with pytest.raises(AssertionError):
        RULES[name](WRONG[name])


def test_the_suite_names_the_broken_promise():
    with pytest.raises(AssertionError, match=r"starts_at_home: After build"):
        check_simulator(WRONG["starts_at_home"])


class OwnScenes(MujocoSimulator):
    """MuJoCo as a simulator that builds only one scene of its own."""

    any_scene = False

    def sample(self):
        return check_scene(), check_robot()

    def build(self, scene, robot):
        if scene != check_scene():
            raise InvalidArgument("scene", "is not mine", "the one of sample()")
        super().build(scene, robot)


class OnAWrist(OwnScenes):
    """One whose sample has a camera that the hand carries."""

    def sample(self):
        scene, robot = super().sample()
        return attrs.evolve(scene, cameras=(*scene.cameras, Camera("wrist", Pose(), link="hand"))), robot

    def build(self, scene, robot):
        MujocoSimulator.build(self, scene, robot)


class KnowsOnlyBodies(OnAWrist):
    def body_pose(self, body):
        return super().body_pose(body.removeprefix("robot/") if body.startswith("robot/") else body)


class BuildsAnything(OwnScenes):
    def build(self, scene, robot):
        MujocoSimulator.build(self, scene, robot)


class NamesGeoms(OwnScenes):
    def contacts(self, body=None):
        return tuple(attrs.evolve(contact, first="geom 7") for contact in super().contacts(body))


WRONG_OWN = wrong_simulators(OwnScenes) | {
    "other_scenes_are_refused": BuildsAnything,
    "links_with_cameras_have_poses": KnowsOnlyBodies,
    "contacts_name_bodies_and_links": NamesGeoms,
}


@pytest.mark.parametrize("name", OWN_RULES)
def test_a_simulator_with_scenes_of_its_own_keeps_the_rule(name):
    OWN_RULES[name](OwnScenes)


@pytest.mark.parametrize("name", OWN_RULES)
def test_the_rule_rejects_a_simulator_with_scenes_of_its_own_that_breaks_it(name):
    with pytest.raises(AssertionError):
        OWN_RULES[name](WRONG_OWN[name])


def test_a_camera_on_the_hand_is_on_a_link_that_is_known():
    OWN_RULES["links_with_cameras_have_poses"](OnAWrist)


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_a_scene_that_another_simulator_alone_builds_names_the_settings(simulator):
    with SIMULATORS[simulator]() as engine, pytest.raises(InvalidArgument, match="expected simulator=moonbase"):
        engine.build(attrs.evolve(check_scene(), only_in="simulator=moonbase"), check_robot())
