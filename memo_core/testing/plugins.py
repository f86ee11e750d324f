"""``memo plugins check NAME``: the conformance suite of a backend's kind, and the rules that hold for every kind.

Each kind's suite is a module here with ``RULES``: rule name -> a check that takes ``make`` (which returns a new,
unopened instance) and raises ``AssertionError`` where its docstring's promise is broken.
"""

from __future__ import annotations

import functools
import importlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Literal

import attrs

from memo_core.config import ConfigErrors, load_experiment
from memo_core.config.experiment import DRIVERS, plain
from memo_core.config.fields import field_types
from memo_core.errors import BackendUnavailable, MemoError, TaskCodeError, UnknownName
from memo_core.interfaces.backend import KINDS, Backend
from memo_core.plugins.registry import Registry, missing_needs
from memo_core.testing.rules import Limited, Rules

if TYPE_CHECKING:
    from memo_core.testing.robot_check.trial import RobotTrial

Make = Callable[[], Any]
Outcome = Literal["kept", "broken", "limited", "skipped"]

SUITES = {kind: f"memo_core.testing.{kind}" for kind in KINDS}
INTERFACES = {
    "llm": "memo_core.interfaces.llm:LanguageModel",
    "embedder": "memo_core.interfaces.embedder:Embedder",
    "vectorstore": "memo_core.interfaces.vectorstore:VectorStore",
    "simulator": "memo_core.interfaces.simulator:Simulator",
    "robot": "memo_core.robot.description:RobotDescription",
    "robot_driver": "memo_core.interfaces.driver:RobotDriver",
    "gripper_driver": "memo_core.interfaces.driver:GripperDriver",
    "perception": "memo_core.interfaces.perception:Perception",
    "teacher": "memo_core.interfaces.teacher:Teacher",
    "method": "memo_core.policy.method_interface:Method",
}
# Run on its own: what a plugin's module loads beyond what the core itself brings.
_LOADS = """
import sys, memo_core.plugins.registry, memo_core.config, jinja2, numpy, sqlalchemy, yaml
before = set(sys.modules)
import importlib
importlib.import_module(sys.argv[1])
own = sys.argv[1].partition(".")[0]
tops = lambda names: {name.partition(".")[0] for name in names}
new = tops(sys.modules) - tops(before) - {own, "memo_core"}
print(*sorted(name for name in new if "site-packages" in (getattr(sys.modules.get(name), "__file__", None) or "")))
"""


@attrs.frozen
class Result:
    """The result of one rule on one backend; ``why`` is empty if the rule holds. "limited": what is declared is right,
    but can only do a part of what tasks ask for."""

    backend: str
    rule: str
    outcome: Outcome
    why: str = ""

    def as_json(self) -> dict[str, Any]:
        return attrs.asdict(self)


def find_backends(registry: Registry, name: str) -> tuple[Backend, ...]:
    """The backends called ``name`` or ``kind/name``. Raises ``UnknownName`` or ``AmbiguousBackend``."""
    kind, slash, rest = name.partition("/")
    if slash:
        if kind not in KINDS:
            raise UnknownName("kind of backend", kind, KINDS)
        return (registry.get(kind, rest),)
    found = tuple(backend for kind in KINDS for backend in registry.backends(kind) if backend.name == name)
    if not found:
        for kind in KINDS:
            if (kind, name) in registry.ambiguous:
                registry.get(kind, name)
        known = dict.fromkeys(backend.name for kind in KINDS for backend in registry.backends(kind))
        raise UnknownName("backend", name, tuple(known))
    return found


def check_backend(
    registry: Registry,
    backend: Backend,
    settings: Any = None,
    trials: dict[str, RobotTrial] | None = None,
    arm: Backend | None = None,
) -> Iterator[Result]:
    """Run the rules for every kind, then the suite of this one, on the backend's default settings or those given.
    ``trials`` receives, under ``KIND/NAME``, what was tried of a robot. ``arm``: the robot that a robot driver is
    checked with; None: one of one joint."""
    name = f"{backend.kind}/{backend.name}"
    for rule, check in GENERAL.items():
        result = _run(name, rule, functools.partial(check, registry, backend))
        yield result
        if rule == "factory_makes_the_kinds_interface" and result.outcome == "broken":
            return
    missing = missing_needs(attrs.evolve(backend.needs, keys=()))
    if missing:
        yield Result(name, "conformance", "skipped", "; ".join(f"{m.what} is missing: {m.remedy}" for m in missing))
        return
    try:
        suite = importlib.import_module(SUITES[backend.kind])
    except ModuleNotFoundError:
        yield Result(name, "conformance", "skipped", f"there is no suite for {backend.kind} yet")
        return
    if settings is None:
        try:
            settings = backend.config()
        except TypeError:
            yield Result(name, "conformance", "skipped", "its settings have no defaults; check it from a test of yours")
            return

    def make() -> Any:
        return backend.factory(settings)

    if backend.kind == "robot":
        yield from check_robot(registry, name, make, trials)
        return
    if backend.kind == "simulator" and not make().any_scene:
        suite = importlib.import_module("memo_core.testing.own_scenes")
    rules = _rules_of(suite, backend.kind)
    if arm is not None and backend.kind == "robot_driver":
        rules = suite.rules_for(arm.factory(arm.config()))
    checks = {rule: functools.partial(conforms, make) for rule, conforms in rules.items()}
    if backend.kind == "suite":  # one mistake in a scene breaks nearly every rule, with the same words
        yield from _in_turn(name, checks, suite.FOLLOWS)
        return
    for rule, check in checks.items():
        yield _run(name, rule, check)


def check_robot(
    registry: Registry, name: str, make: Make, trials: dict[str, RobotTrial] | None = None
) -> Iterator[Result]:
    """The static rules for a robot, and where they hold the dynamic ones, in the default simulator and for the default
    suite's tasks. What only follows from an earlier failure is skipped, so that what is broken is the cause."""
    from memo_core.testing import robot
    from memo_core.testing.robot_check import motion as robot_motion

    broken = ""
    static = {rule: functools.partial(check, make) for rule, check in robot.RULES.items()}
    for result in _in_turn(name, static, robot.FOLLOWS):
        broken = broken or (result.rule if result.outcome == "broken" else "")
        yield result
    if broken:
        yield Result(name, "in motion", "skipped", f"not tried: {broken} comes first")
        return
    try:
        trial = trial_of(registry, make())
    except MemoError as error:
        yield Result(name, "in motion", "skipped", f"not tried: {error}")
        return
    if trials is not None:
        trials[name] = trial
    checks = {rule: functools.partial(check, trial) for rule, check in robot_motion.RULES.items()}
    yield from _in_turn(name, checks, robot_motion.FOLLOWS)


def _in_turn(
    name: str, checks: Mapping[str, Callable[[], None]], follows: Mapping[str, tuple[str, ...]]
) -> Iterator[Result]:
    """Run the checks, but not those that would only repeat what an earlier one has found. What fails after a limitation
    that it may follow from counts as that."""
    cause: dict[str, str] = {}
    limits: set[str] = set()
    said: dict[str, str] = {}
    for rule, check in checks.items():
        earlier = follows.get(rule, ())
        before = next((cause[other] for other in earlier if other in cause), "")
        result = Result(name, rule, "skipped", f"follows from {before}") if before else _run(name, rule, check)
        if result.outcome in ("broken", "limited"):
            before = next((other for other in earlier if other in limits), said.get(result.why, ""))
            if before:
                result = Result(name, rule, "skipped", f"follows from {before}")
        if result.outcome == "limited":
            limits.add(rule)
        elif result.outcome == "broken":
            said[result.why] = cause[rule] = rule
        elif before:
            cause[rule] = before
        yield result


def trial_of(registry: Registry, robot: Any) -> RobotTrial:
    """The robot in the default simulator, with the default suite's tasks. Raises as ``Registry.default``, and
    ``BackendUnavailable`` where the simulator is not installed."""
    from memo_core.testing.robot_check.trial import RobotTrial

    simulator = registry.default("simulator")
    missing = missing_needs(attrs.evolve(simulator.needs, keys=(), system={}))
    if missing:
        remedy = "; ".join(one.remedy for one in missing)
        raise BackendUnavailable("simulator", simulator.name, f"missing {missing[0].what}", remedy)
    try:
        suite = registry.default("suite")
        tasks = tuple(suite.factory(suite.config()))
    except MemoError:
        tasks = ()
    return RobotTrial(robot, lambda: simulator.factory(simulator.config()), tasks)


def _rules_of(suite: Any, kind: str) -> dict[str, Callable[[Make], None]]:
    return suite.RULES if hasattr(suite, "RULES") else {"conformance": getattr(suite, f"check_{kind}")}


def _run(name: str, rule: str, check: Callable[[], None]) -> Result:
    try:
        check()
    except AssertionError as error:
        outcome: Outcome = "limited" if isinstance(error, Limited) else "broken"
        return Result(name, rule, outcome, " ".join(str(error).split()) or "the assertion says no more")
    except BackendUnavailable as error:
        return Result(name, rule, "skipped", str(error))
    except TaskCodeError as error:
        return Result(name, rule, "broken", " ".join(str(error).split()))
    except Exception as error:
        return Result(name, rule, "broken", f"raised {type(error).__name__}: {' '.join(str(error).split())}")
    return Result(name, rule, "kept")


# -- rules for every kind ----------------------------------------------------------------------------------------------
GENERAL: Rules[Callable[[Registry, Backend], None]] = Rules()
rule = GENERAL.rule


@rule
def default_settings_pass_their_own_checks(registry: Registry, backend: Backend) -> None:
    """What the config class gives by default is what a config file may say."""
    try:
        settings = plain(backend.config())
    except TypeError:
        return  # needs settings that only its user knows
    section = {"backend": backend.name} | settings
    key = f"robot.{DRIVERS[backend.kind]}" if backend.kind in DRIVERS else backend.kind
    try:
        load_experiment(registry, None, [f"{key}={json.dumps([section] if backend.kind == 'skills' else section)}"])
    except ConfigErrors as errors:
        raise AssertionError(str(errors)) from None


@rule
def every_setting_is_explained(registry: Registry, backend: Backend) -> None:
    """Each field of the config class has a line of help in its metadata."""
    silent = [field.name for field in attrs.fields(backend.config) if field.init and not field.metadata.get("help")]
    assert not silent, f"no metadata 'help' on {', '.join(silent)}"
    field_types(backend.config)


@rule
def declaring_imports_nothing_heavy(registry: Registry, backend: Backend) -> None:
    """Importing the plugin's module loads no library but those of the core: the heavy ones wait for ``open``."""
    module = registry.plugin_of(backend).module.partition(":")[0]
    done = subprocess.run([sys.executable, "-c", _LOADS, module], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, f"{module} cannot be imported on its own: {done.stderr.strip().splitlines()[-1:]}"
    assert not done.stdout.strip(), f"importing {module} imports {done.stdout.strip()}"


@rule
def factory_makes_the_kinds_interface(registry: Registry, backend: Backend) -> None:
    """The factory returns an instance of the kind's interface, made new each time."""
    try:
        settings = backend.config()
    except TypeError:
        return  # needs settings that only its user knows
    try:
        made, again = backend.factory(settings), backend.factory(settings)
    except MemoError as error:
        raise AssertionError(f"the factory raised {type(error).__name__} on default settings: {error}") from None
    if backend.kind in INTERFACES:
        module, _, name = INTERFACES[backend.kind].partition(":")
        interface = getattr(importlib.import_module(module), name)
        assert isinstance(made, interface), f"it returned {type(made).__name__}, expected {interface.__name__}"
    else:
        assert list(made), f"it returned no {backend.kind}"
    if hasattr(made, "close"):
        assert made is not again, "it returned the same instance twice, so closing one closes both"


@rule
def closing_before_opening_is_fine(registry: Registry, backend: Backend) -> None:
    """``close`` may be called at any time, also twice and also before ``open``."""
    try:
        made = backend.factory(backend.config())
    except TypeError:
        return
    close = getattr(made, "close", None)
    if close is not None:
        close()
        close()
