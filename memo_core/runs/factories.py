"""Creating the parts of an experiment: tasks, environment, sandbox, book. Nothing is opened here."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from memo_core.config import Choice, Experiment
from memo_core.environment.hardware import HardwareEnvironment, World
from memo_core.environment.simulated import SimulatedEnvironment, find_task
from memo_core.errors import BackendUnavailable
from memo_core.interfaces.llm import Usage
from memo_core.interfaces.task import Task
from memo_core.llm.budget import Budget, Limit
from memo_core.llm.ledger import Ledger
from memo_core.llm.prompt_files import Prompts
from memo_core.llm.spending import Spent
from memo_core.policy.settings import RunSettings
from memo_core.sandbox.sandbox import Sandbox
from memo_core.skillbook.book import Skillbook
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import Skill, skill_library


def tasks_of(experiment: Experiment) -> tuple[Task, ...]:
    """Create the tasks of the experiment's suite.

    Args:
        experiment: selects the suite.

    Returns:
        The tasks in the suite's order.

    Raises:
        NoDefaultBackend: if neither the experiment nor the installed plugins determine a suite.
        BackendUnavailable: if the suite cannot be created.
    """
    return tuple(experiment.create("suite"))


def task_of(experiment: Experiment, name: str) -> Task:
    """Create one task of the experiment's suite.

    Args:
        experiment: selects the suite.
        name: name of the task.

    Returns:
        The task.

    Raises:
        UnknownName: if the suite has no such task; lists the names that exist.
        NoDefaultBackend: as ``tasks_of``.
        BackendUnavailable: as ``tasks_of``.
    """
    return find_task(tasks_of(experiment), name)


def library_of(experiment: Experiment) -> dict[str, Skill]:
    """The skills robot code may call: the built-in ones and those of the experiment's skills backends."""
    further = [skill for choice in experiment.skills for skill in choice.create()]
    return skill_library([*BUILTIN_SKILLS, *further])


def environment_of(experiment: Experiment, task: Task, seed: int) -> SimulatedEnvironment:
    """Create the simulated environment of a task, unopened, with its own simulator, robot and perception.

    Args:
        experiment: selects the backends.
        task: the task that the environment is for.
        seed: seed of the scene.

    Returns:
        The environment.

    Raises:
        BackendUnavailable: if the robot's driver moves hardware, because callers run unattended, in parallel, or need a
            success check; also if a backend cannot be created.
        NoDefaultBackend: if neither the experiment nor the installed plugins determine a backend.
        InvalidArgument: if the simulator's control period is too long for the driver and cannot be changed.
    """
    world = world_of(experiment, task, seed)
    if isinstance(world, HardwareEnvironment):
        name = experiment.choice("robot_driver").backend.name
        problem = "a real robot moves only in `memo run`, with a person beside it"
        raise BackendUnavailable("robot_driver", name, problem, "robot.driver=simulated")
    return world


def world_of(experiment: Experiment, task: Task, seed: int) -> World:
    """An unopened environment of a task, with its own parts: simulated, or on a real robot."""
    driver, gripper = experiment.create("robot_driver"), experiment.create("gripper_driver")
    if not driver.simulated:
        return HardwareEnvironment(
            task,
            seed,
            driver,
            gripper,
            robot=experiment.create("robot"),
            perception=experiment.create("perception"),
            settings=experiment.section("hardware"),
        )
    simulator = experiment.create("simulator")
    simulator.shorten_tick(driver.longest_tick)
    return SimulatedEnvironment(
        task,
        seed,
        simulator=simulator,
        robot=experiment.create("robot"),
        perception=experiment.create("perception"),
        link=lambda simulator, robot: driver.link(robot, gripper, simulator),
        wrist_camera=experiment.section("scene").wrist_camera,
    )


def perception_model(experiment: Experiment) -> Choice | None:
    """The language model that the perception's own settings name (``perception.llm``); None: the experiment's."""
    perception = experiment.choices.get("perception")
    model: Choice | None = getattr(perception.settings, "llm", None) if perception is not None else None
    return model


def models_of(experiment: Experiment) -> tuple[Choice, ...]:
    """The language models of a run: the experiment's, and the perception's own if it names one."""
    own = perception_model(experiment)
    return (experiment.choice("llm"), *(() if own is None else (own,)))


def sandbox_of(experiment: Experiment) -> Sandbox:
    """Create a sandbox with the experiment's skills and limits, unopened.

    Args:
        experiment: names the skills backends; has the section ``sandbox``.

    Returns:
        The sandbox.
    """
    return Sandbox(library_of(experiment), experiment.section("sandbox"))


def prompts_of(experiment: Experiment) -> Prompts:
    """The texts that the experiment's language model is sent. Raises ``BadPrompt``."""
    return Prompts(experiment.section("prompts"))


def book_of(experiment: Experiment, url: str | None = None, read_only: bool | None = None) -> Skillbook:
    """The experiment's skillbook, unopened, with its embedder and store; ``url`` and ``read_only`` take precedence."""
    settings = experiment.section("skillbook")
    return Skillbook(
        url or settings.url,
        experiment.create("embedder"),
        experiment.create("vectorstore"),
        experiment.section("retrieval"),
        settings.read_only if read_only is None else read_only,
    )


def budget_of(
    settings: RunSettings, run: str, already: Spent = Spent(), known: Mapping[int, Usage | None] | None = None
) -> Budget:
    """The budget for language models from the ``run`` section of an experiment."""
    ledger = Ledger(Path(settings.study_ledger)) if settings.study_ledger else None
    study = Limit(settings.study_max_cost, settings.study_max_tokens)
    return Budget(Limit(settings.max_cost, settings.max_tokens), ledger, study, run, already, known)
