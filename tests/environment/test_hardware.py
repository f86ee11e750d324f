"""A real robot, with a fake driver in its place: the same loop, a person who releases and judges, limits below it."""

from __future__ import annotations

import importlib.metadata
import io
import json
import subprocess
import sys
from collections import deque
from pathlib import Path

import attrs
import numpy as np
import pytest
from memo_franka.description import panda

from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.cli import robot_link
from memo_core.config import ConfigErrors, load_experiment
from memo_core.environment.commissioning import Commissioning, tool_of
from memo_core.environment.hardware import HardwareEnvironment, HardwareSettings
from memo_core.environment.lease import Lease
from memo_core.errors import BackendUnavailable, InvalidArgument, MotionError
from memo_core.interfaces.backend import Backend
from memo_core.interfaces.perception import Perception
from memo_core.interfaces.teacher import Episode, Program, TaskEpisode, Teacher, Verdict
from memo_core.plugins.hooks import hookimpl
from memo_core.plugins.registry import Registry
from memo_core.robot.safety import SafetyLimits
from memo_core.runs.factories import task_of, world_of
from memo_core.runs.run import resume_experiment, run_experiment
from memo_core.runs.sections import SECTIONS
from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.testing.fake_drivers import FakeDriver, FakeDriverLink, FakeGripper
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_entry_point import FakeEntryPoint
from memo_core.testing.fake_environment import fake_robot
from memo_core.testing.fake_llm import ScriptedModel
from memo_core.testing.fake_store import FakeStore

UP = "```python\nmove_to([0.45, 0.1, 0.35], top_orientation())\nprint('there')\n```"
NOTES = '{"corrections": ["Keep away from the lamp."], "general": []}'
TEMPLATE = "```python\ndef up(name):\n    '''Above what is named.'''\n    wait(1.0)\n```"


class Arm(FakeDriverLink):
    """Runs as fast as it can. ``dies_at``: the send in which the process is gone."""

    real_time = False
    dies_at = 0

    def send(self, targets):
        super().send(targets)
        if self.dies_at and len(self.sent) >= self.dies_at:
            raise SystemExit("the power failed")


@attrs.frozen
class WireSettings:
    address: str = "127.0.0.9"
    dies_at: int = 0


class WireDriver(FakeDriver):
    links: list[Arm] = []

    def __init__(self, settings: WireSettings) -> None:
        self._settings = settings

    @property
    def address(self) -> str:
        return self._settings.address

    def link(self, robot, gripper, simulator=None):
        assert simulator is None
        link = Arm(robot, FakeGripper() if gripper.included else gripper)
        link.dies_at = self._settings.dies_at
        self.links.append(link)
        return link


class OneCube(Perception):
    """A camera that sees one cube."""

    def start(self, context):
        self._context = context

    def look(self):
        cube = Node("cube", "cube", Pose((0.45, 0.1, 0.02)), (0.04, 0.04, 0.04))
        picture = np.zeros((8, 8, 3), np.uint8)
        seen = Observation(self._context.tool_pose(), 0.08, False, {"front": picture})
        return SceneGraph((cube,), (), seen, 0.0, "a table", self._context.link.time())


class Person(Teacher):
    """Answers from lists, and remembers what was asked."""

    who = "ann"
    permits = True

    def __init__(self) -> None:
        self.asked: list[object] = []
        self.releases = deque[Verdict]()
        self.verdicts = deque[Verdict]()
        self.whole = Verdict("approve")
        self.pictures: list[tuple[str, ...]] = []

    def permit(self, program: Program) -> Verdict:
        self.asked.append(program)
        return self.releases.popleft() if self.releases else Verdict("approve")

    def judge(self, episode: Episode) -> Verdict:
        self.asked.append(episode)
        return self.verdicts.popleft() if self.verdicts else Verdict("approve")

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        self.asked.append(episode)
        return self.whole

    def put_back(self, episode: Episode) -> bool:
        self.asked.append("put back")
        self.pictures.append(episode.recordings)
        return True

    def confirm(self, episode: Episode) -> bool:
        self.asked.append("confirm")
        return True


@pytest.fixture
def person():
    WireDriver.links = []
    return Person()


def registry_with(person: Teacher, model: ScriptedModel) -> Registry:
    @hookimpl
    def memo_robot_drivers():
        return [Backend("robot_driver", "wire", "for tests", WireDriver, WireSettings)]

    @hookimpl
    def memo_perceptions():
        return [Backend("perception", "one-cube", "for tests", lambda settings: OneCube())]

    @hookimpl
    def memo_language_models():
        return [Backend("llm", "scripted", "for tests", lambda settings: model)]

    @hookimpl
    def memo_teachers():
        return [Backend("teacher", "ann", "for tests", lambda settings: person)]

    @hookimpl
    def memo_embedders():
        return [Backend("embedder", "fake", "for tests", lambda settings: FakeEmbedder())]

    @hookimpl
    def memo_vector_stores():
        return [Backend("vectorstore", "fake", "for tests", lambda settings: FakeStore())]

    hooks = {name: hook for name, hook in locals().items() if name.startswith("memo_")}
    return Registry([*importlib.metadata.entry_points(group="memo"), FakeEntryPoint("p", "d", **hooks)])


def experiment(registry: Registry, folder: Path, *overrides: str, teacher: str = "ann"):
    parts = {"perception": "one-cube", "llm": "scripted", "teacher": teacher, "embedder": "fake", "vectorstore": "fake"}
    given = [f"{kind}.backend={name}" for kind, name in parts.items()]
    driver = ['robot={"driver": "wire", "address": "127.0.0.9"}', f"skillbook.url={folder / 'book.db'}"]
    return load_experiment(registry, None, [*given, *driver, *overrides], SECTIONS, "put-the-cube-away", 0)


def run(person, tmp_path, script, *overrides: str):
    registry = registry_with(person, ScriptedModel(script))
    return run_experiment(experiment(registry, tmp_path, *overrides), registry, tmp_path / "runs")


@pytest.mark.process
def test_a_task_is_done_by_a_real_robot_with_a_person_who_releases_and_judges(person, tmp_path):
    script = {"plan": ["LIFT(cube)", "DONE"], "code": [UP], "template": [TEMPLATE]}
    report = run(person, tmp_path, script)
    assert report.success and "the person who watched" in report.outcome.reason and not report.problem
    *_, ended = (report.folder / "events.jsonl").read_text().splitlines()
    assert json.loads(ended)["judge"] == "the person who watched"
    [arm] = WireDriver.links
    tool = np.array([0.45, 0.1, 0.35])
    program, episode, whole = person.asked
    assert isinstance(program, Program) and program.subtask == "LIFT(cube)" and "move_to" in program.code
    assert isinstance(episode, Episode) and isinstance(whole, TaskEpisode)
    kinematics = Kinematics(arm.description)
    places = kinematics.forward(np.array(arm.sent).T)[1]
    assert np.linalg.norm(places[:, -1] - tool) < 0.01
    fastest = np.linalg.norm(np.diff(places, axis=1), axis=0).max() / arm.control_period
    assert 0.15 < fastest <= 0.25, "moves near the limit, never beyond it"
    assert not arm.health().ready, "closed at the end"


@pytest.mark.process
def test_a_person_who_says_that_the_task_is_not_done_is_right(person, tmp_path):
    person.whole = Verdict("correct", "the drawer is still open")
    script = {"plan": ["DONE", "DONE"], "feedback": ['{"corrections": [], "general": ["Close drawers."]}']}
    report = run(person, tmp_path, script)
    assert not report.success and report.outcome is not None and "not done" in report.outcome.reason


@pytest.mark.process
def test_a_trial_on_a_real_robot_keeps_a_sheet(person, tmp_path):
    person.whole = Verdict("correct", "it lies on the table")
    script = {"plan": ["DONE", "DONE"], "feedback": ['{"corrections": [], "general": ["Close drawers."]}']}
    report = run(person, tmp_path, script, "hardware.person=Ada")
    sheet = json.loads((report.folder / "trial.json").read_text(encoding="utf-8"))
    assert (sheet["person"], sheet["success"], sheet["run"]) == ("Ada", False, report.run)
    assert sheet["robot"] == {"name": "panda", "driver": "wire", "address": "127.0.0.9"}
    assert sheet["gripper"]["driver"] == "included" and sheet["commissioning"] is None
    assert {"corrections", "interruptions", "commit", "ended_at"} <= set(sheet)


@pytest.mark.process
def test_a_robot_is_not_started_that_is_not_as_it_was_commissioned(person, tmp_path):
    robot = panda()
    found = Commissioning(
        *("panda", "127.0.0.9", "295341", "Ada", "2026-11-22T12:00:00+00:00", tool_of(robot), 0.08, {}, 0.0),
        *([10.0, 0.0, 0.0], [], True),
    )
    file = tmp_path / "arm.json"
    found.write(file)
    assert run(person, tmp_path / "same", {"plan": ["DONE"]}, f"hardware.commissioning={file}").success
    attrs.evolve(found, stroke=0.11).write(file)
    report = run(person, tmp_path / "other", {"plan": ["DONE"]}, f"hardware.commissioning={file}")
    assert not report.success and "stroke was 0.11, is 0.08" in report.problem
    assert "memo robot commission" in report.problem


@pytest.mark.process
def test_nobody_on_the_whole_task_is_no_verdict(person, tmp_path):
    person.whole = Verdict("silent")
    report = run(person, tmp_path, {"plan": ["DONE"]})
    assert report.outcome is None and not report.success and not report.problem


@pytest.mark.process
def test_a_program_that_is_not_released_moves_nothing_and_its_refusal_is_a_lesson(person, tmp_path):
    person.releases += [Verdict("correct", "stay away from the lamp")]
    script = {"plan": ["LIFT(cube)", "LIFT(cube)", "DONE"], "code": [UP, UP], "feedback": [NOTES]}
    model = ScriptedModel({**script, "template": [TEMPLATE]})
    registry = registry_with(person, model)
    report = run_experiment(experiment(registry, tmp_path), registry, tmp_path / "runs")
    assert report.success and "put back" not in person.asked, "nothing had moved: nothing to put back"
    assert [type(one).__name__ for one in person.asked] == ["Program", "Program", "Episode", "TaskEpisode"]
    assert "stay away from the lamp" in model.prompts("code")[1]
    assert report.result.subtasks[0].corrected == 1


@pytest.mark.process
def test_a_program_that_nobody_releases_ends_the_subtask(person, tmp_path):
    person.releases += [Verdict("silent")]
    report = run(person, tmp_path, {"plan": ["LIFT(cube)", "DONE"], "code": [UP]})
    [arm] = WireDriver.links
    assert not arm.sent and report.result.subtasks[0].status == "unobserved"


@pytest.mark.process
def test_after_a_correction_a_person_puts_things_back_with_a_picture_of_how_they_stood(person, tmp_path):
    person.verdicts += [Verdict("correct", "not there")]
    script = {"plan": ["LIFT(cube)", "LIFT(cube)", "DONE"], "code": [UP, UP], "feedback": [NOTES]}
    report = run(person, tmp_path, {**script, "template": [TEMPLATE]})
    assert report.success and person.asked.count("put back") == 1
    [[picture]] = person.pictures
    assert Path(picture).read_bytes().startswith(b"\x89PNG")


@pytest.mark.process
def test_without_a_reset_a_corrected_subtask_ends(person, tmp_path):
    person.verdicts += [Verdict("correct", "not there")]
    script = {"plan": ["LIFT(cube)"], "code": [UP], "feedback": [NOTES]}
    report = run(person, tmp_path, script, "hardware.reset=never")
    assert "cannot be put back" in report.result.reason and "put back" not in person.asked


@pytest.mark.process
def test_what_was_in_doubt_is_confirmed_and_never_repeated(person, tmp_path):
    script = {"plan": ["LIFT(cube)"], "code": [UP]}
    with pytest.raises(SystemExit):
        run(person, tmp_path, script, "robot.dies_at=5")
    [folder] = (tmp_path / "runs").iterdir()
    [first] = WireDriver.links
    assert len(first.sent) == 5
    registry = registry_with(person, ScriptedModel({"plan": ["DONE"]}))
    again = resume_experiment(experiment(registry, tmp_path, "robot.dies_at=5"), registry, folder)
    assert person.asked.count("confirm") == 1 and again.success
    assert not WireDriver.links[1].sent, "the program was not run again"


def test_programs_that_wait_for_a_person_want_one(person, tmp_path):
    registry = registry_with(person, ScriptedModel({}))
    unattended = experiment(registry, tmp_path, teacher="silent")
    with pytest.raises(InvalidArgument, match=r"hardware\.release.*'silent'.*teacher=terminal"):
        run_experiment(unattended, registry, tmp_path / "runs")
    assert not WireDriver.links


# -- limits ------------------------------------------------------------------------------------------------------------
@pytest.fixture
def world(person, tmp_path):
    registry = registry_with(person, ScriptedModel({}))
    chosen = experiment(registry, tmp_path)
    with world_of(chosen, task_of(chosen, "put-the-cube-away"), 0) as world:
        assert isinstance(world, HardwareEnvironment)
        yield world


def test_the_link_refuses_what_leaves_the_limits_whoever_asks(world):
    home = world.link.joint_targets()
    [arm] = WireDriver.links
    for joint, change, problem in ((0, 0.5, "m/s"), (3, 3.0, "joint4"), (0, np.nan, "finite")):
        target = home.copy()
        target[joint] += change
        with pytest.raises(MotionError, match=problem):
            world.link.send(target)
        assert np.abs(arm.joint_targets() - home).max() < 1e-9


def test_a_motion_that_would_leave_the_workspace_is_refused_before_it_begins(world):
    [arm] = WireDriver.links
    with pytest.raises(MotionError, match=r"safety limits: the tool at [yz]"):
        world.control.move_to([0.2, -0.72, 0.3], None, None, 0.7, 1.0)
    assert not arm.sent


def test_a_force_that_is_felt_ends_the_motion_at_rest(world):
    [arm] = WireDriver.links
    arm.felt = lambda joints: np.array([0.0, 0.0, 50.0 if len(arm.sent) > 40 else 0.0, 0.0, 0.0, 0.0])
    with pytest.raises(MotionError, match="50 N felt, where 40 N") as caught:
        world.control.move_to([0.45, 0.3, 0.35], None, None, 0.7, 1.0)
    assert caught.value.cause == "force"
    sent = np.array(arm.sent)
    assert np.abs(np.diff(sent, axis=0)).max() > 0 and np.abs(sent[-1] - sent[-2]).max() < 1e-3, "it came to rest"
    limit = np.array([joint.acceleration for joint in arm.description.joints])
    assert (np.abs(np.diff(sent, 2, axis=0)) / arm.control_period**2 <= 1.05 * limit).all()


def test_an_arm_that_stands_outside_of_its_limits_is_not_started(person, tmp_path):
    registry = registry_with(person, ScriptedModel({}))
    chosen = experiment(registry, tmp_path, "hardware.safety.workspace=[0.5,-0.5,0,0.8,0.5,1]")
    with pytest.raises(BackendUnavailable, match=r"outside its limits.*x = 0.3.*by hand"):
        world_of(chosen, task_of(chosen, "put-the-cube-away"), 0).open()
    free = Lease("127.0.0.9")
    free.take()
    free.give_back()


def test_limits_that_cannot_be_are_said_with_their_key(person, tmp_path):
    registry = registry_with(person, ScriptedModel({}))
    with pytest.raises(ConfigErrors, match=r"hardware\.safety\.workspace"):
        experiment(registry, tmp_path, "hardware.safety.workspace=[1,0,0,0,1,1]")
    with pytest.raises(ConfigErrors, match=r"hardware\.safety\.tool_speed"):
        experiment(registry, tmp_path, "hardware.safety.tool_speed=2")
    with pytest.raises(InvalidArgument, match="joint_margin"):
        SafetyLimits(joint_margin=0.5).kept_by(attrs.evolve(fake_robot(), home=(2.6,)))


# -- the lease ---------------------------------------------------------------------------------------------------------
HOLDER = """
import sys
from pathlib import Path
from memo_core.environment.lease import Lease
Lease(sys.argv[1], Path(sys.argv[2])).take()
print("taken", flush=True)
sys.stdin.read()
"""


@pytest.mark.process
def test_one_process_at_a_time_moves_a_robot(tmp_path):
    command = [sys.executable, "-c", HOLDER, "10.0.0.2", str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "taken\n"
        with pytest.raises(BackendUnavailable, match=rf"process {other.pid} moves the robot at 10\.0\.0\.2"):
            Lease("10.0.0.2", tmp_path).take()
        Lease("10.0.0.3", tmp_path).take()
        other.kill()
        other.wait()
        Lease("10.0.0.2", tmp_path).take()


def test_a_lease_given_back_leaves_no_file_and_its_former_file_is_no_lease(tmp_path):
    first, second = Lease("10.0.0.2", tmp_path), Lease("10.0.0.2", tmp_path)
    first.take()
    opened = second._open
    late = iter([opened(), None])  # opened before the holder gave it back, and removed since
    second._open = lambda: next(late) or opened()
    first.give_back()
    assert not list(tmp_path.iterdir())
    second.take()
    with pytest.raises(BackendUnavailable, match="moves the robot"):
        Lease("10.0.0.2", tmp_path).take()
    second.give_back()
    assert not list(tmp_path.iterdir())


def test_a_driver_may_be_configured_beside_its_robot(person, tmp_path):
    registry = registry_with(person, ScriptedModel({}))
    chosen = experiment(registry, tmp_path, "robot.address=10.1.1.1")
    assert chosen.choice("robot_driver").settings.address == "10.1.1.1"
    assert chosen.public()["robot.driver.address"] == "10.1.1.1"
    with pytest.raises(ConfigErrors, match=r"robot\.adress.*address"):
        experiment(registry, tmp_path, "robot.adress=10.1.1.1")
    assert HardwareSettings().release == "ask"


@pytest.mark.parametrize(("typed", "agreed"), [(["ja", "y!"], True), (["hm", "no!"], False), ([""], False)])
def test_a_robot_goes_on_after_a_plain_yes_only_and_asks_again_after_anything_else(monkeypatch, typed, agreed):
    monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{line}\n" for line in typed)))
    assert robot_link.agreed("Go on? [y/n]") is agreed
