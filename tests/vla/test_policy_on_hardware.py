"""The method on a link that cannot wait: commanded while the server computes, and by a person's leave only."""

from __future__ import annotations

import time

import attrs
import numpy as np
import pytest
from memo_franka.description import fr3
from memo_vla.double.server import PolicyServer
from memo_vla.method import Vla
from memo_vla.settings import VlaSettings

from memo_core.interfaces.teacher import Verdict
from memo_core.policy.person import Person
from memo_core.policy.run_context import Session
from memo_core.policy.settings import RunSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.sandbox import Sandbox
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from memo_core.testing.fake_environment import FakeEnvironment
from memo_core.testing.fake_llm import ScriptedModel
from tests.support.arms import FixedPerception, control_of, limits_used

pytestmark = pytest.mark.wire


class Beside(Person):
    """A person beside the robot, who releases what may move it and judges the task."""

    permits = watches = True

    def __init__(self, releases: bool) -> None:
        self.releases, self.asked = releases, []

    def permit(self, program):
        self.asked.append(program.code)
        return Verdict("approve" if self.releases else "correct", "not today")

    def judge_task(self, episode):
        self.asked.append(episode.task)
        return Verdict("approve")


class Slow:
    """A policy that takes its time and asks for a swing, then for rest."""

    def __init__(self, link) -> None:
        self.link, self.meanwhile = link, []
        self.goal = np.array([*link.description.home, 0.08])
        self.goal[0] += 0.4

    def begin(self):
        return self

    def infer(self, observation):
        before = len(self.link.sent)
        time.sleep(0.1)
        self.meanwhile.append(len(self.link.sent) - before)
        return {"actions": np.array([self.goal] * 5)}


@pytest.fixture
def cell():
    """A session with an arm that can only be commanded, and that person; the link keeps a real arm's pace."""
    robot = fr3()
    control, link, _ = control_of(robot)
    link.can_restore, send = False, link.send

    def paced(targets):
        time.sleep(0.001)
        send(targets)

    link.send = paced
    world = FakeEnvironment("wave")
    world.robot, world.link, world.control = robot, link, control
    world.time = link.time
    library = skill_library(BUILTIN_SKILLS)
    session = Session(
        run="test",
        environment=world,
        llm=ScriptedModel({}),
        skills=library,
        sandbox=Sandbox(library),
        settings=RunSettings(video="off"),
        stop=StopSwitch(),
        emit=lambda event: None,
        person=Beside(True),
    )
    return robot, link, session


def test_the_arm_is_commanded_while_the_server_computes(cell):
    robot, link, session = cell
    policy = Slow(link)
    with PolicyServer(policy) as server:
        result = Vla(VlaSettings(url=server.url, preset="joints", still_s=1.5)).run(session)
    assert result.finished and result.verdict == "approved"
    assert len(policy.meanwhile) >= 3 and min(policy.meanwhile) > 0
    assert max(limits_used(robot, link.sent, link.control_period)) <= 1.001
    assert link.joint_targets()[0] == pytest.approx(robot.home[0] + 0.4, abs=1e-6)


def test_nothing_moves_until_the_person_has_released_the_policy(cell):
    _, link, session = cell
    session = attrs.evolve(session, person=Beside(False))
    with PolicyServer(Slow(link)) as server:
        result = Vla(VlaSettings(url=server.url, preset="joints")).run(session)
        assert server.url in session.person.asked[0]
    assert not result.finished and "did not release" in result.reason and not link.sent


def test_pictures_of_a_perception_without_a_way_of_its_own_are_those_of_a_look():
    class Eyes(FixedPerception):
        def pictures(self):
            return {"front": np.full((2, 2, 3), self.looks, np.uint8)}

        def look(self):
            self.looks += 1
            return super().look()

        looks = 0

    eyes = Eyes()
    assert eyes.photograph()["front"][0, 0, 0] == 1 and eyes.photograph()["front"][0, 0, 0] == 2
