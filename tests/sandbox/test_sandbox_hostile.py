"""Hostile code: each program a clear one-line error within its limit, nothing sent to the robot, the session alive."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import attrs
import pytest
import yaml
from hypothesis import HealthCheck, given, settings, strategies as st

from memo_core.sandbox import Execution, Limits, Sandbox, Workspace
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from memo_core.testing.fake_control import FakeControl

ROOT = Path(__file__).parents[2]
TABLES = ROOT / "tests" / "data" / "programs"
WRITTEN_OUT = {  # too long for a table
    "names_by_the_thousand": "\n".join(f"unknown_{i}_thing(np.foo_{i})" for i in range(2500)),
}
EXPECTED: dict[str, dict[str, Any]] = yaml.safe_load((TABLES / "hostile.yaml").read_text("utf-8"))
LIMITS = Limits(
    seconds_between_calls=0.8, seconds_in_all=3.0, robot_seconds=60, memory=64 << 20, output=10_000, calls=300
)
# Filling 64 MiB and checking thousands of names take long on a loaded machine; what is asked there is what ends it.
PATIENT = attrs.evolve(LIMITS, seconds_between_calls=10.0, seconds_in_all=20.0)
WORKSPACE = Workspace((-0.2, -0.9, -0.1), (1.0, 0.9, 1.2), 1.0)
GRACE = 0.5 + 2.0  # s until the parent kills, and for a loaded machine
GOOD = "p = get_position('red cube')\nmove_to([p[0], p[1], p[2] + 0.1])\nprint('fine')"


@pytest.fixture(scope="module")
def sandbox():
    with Sandbox(skill_library(BUILTIN_SKILLS), LIMITS) as opened:
        yield opened


@pytest.fixture(scope="module")
def patient():
    with Sandbox(skill_library(BUILTIN_SKILLS), PATIENT) as opened:
        yield opened


def run(sandbox: Sandbox, code: str, stop_after: int | None = None) -> tuple[Execution, FakeControl]:
    control = FakeControl(stop_after=stop_after)
    return sandbox.run(code, control, stopped=control.stopped, workspace=WORKSPACE, clock=lambda: control.time), control


@pytest.mark.process
@pytest.mark.parametrize("name", EXPECTED)
def test_hostile_code_ends_in_a_clear_error_and_the_session_goes_on(name, sandbox, patient):
    expected, code = EXPECTED[name], WRITTEN_OUT.get(name) or EXPECTED[name]["code"]
    if expected.get("kind") == "memory limit" or name in WRITTEN_OUT:
        sandbox = patient
    limits = sandbox.limits
    started = time.perf_counter()
    execution, control = run(sandbox, code, expected.get("stop_after"))
    assert time.perf_counter() - started < limits.seconds_in_all + GRACE
    assert (execution.ended, execution.kind) == (expected["ends"], expected.get("kind", ""))
    assert expected.get("says", "") in execution.error
    assert bool(execution.error) == (expected["ends"] != "done")
    assert "\n" not in execution.error and len(execution.error) < 2100
    assert len(execution.printed) <= 6 * LIMITS.output  # control characters are spelt out
    for ours in ("Traceback", "site-packages", "memo_core", "python-input", str(ROOT)):
        assert ours not in execution.error + execution.printed
    assert control.commands == expected.get("commands", [])
    good, control = run(sandbox, GOOD)
    assert (good.ended, good.printed, control.commands) == ("done", "fine\n", ["move_to"])


def test_there_is_a_program_for_every_expectation_and_the_other_way_round():
    assert {name for name, program in EXPECTED.items() if "code" in program} | set(WRITTEN_OUT) == set(EXPECTED)
    assert len(EXPECTED) >= 60


def test_a_plain_exec_would_fail_these_tests():
    """The expectations can fail: Python's own exec moves the robot where they say that nothing may."""
    reached: list[str] = []
    names: dict[str, Any] = {
        "go_home": lambda: reached.append("go_home"),
        "move_to": lambda *_: reached.append("move_to"),
    }
    for name in ("builtin_eval", "builtin_eval_aliased"):
        assert EXPECTED[name].get("commands", []) == []
        exec(EXPECTED[name]["code"], dict(names))
    assert reached == ["move_to", "go_home"]


ORDINARY = list(yaml.safe_load((TABLES / "ordinary.yaml").read_text("utf-8")).values())


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_whatever_the_text_is_the_sandbox_answers_in_one_line(sandbox, data):
    """Arbitrary text, and ordinary programs with pieces cut out and put elsewhere."""
    if data.draw(st.booleans()):
        code = data.draw(st.text(max_size=200))
    else:
        code = data.draw(st.sampled_from(ORDINARY))
        for _ in range(data.draw(st.integers(1, 4))):
            a, b, to = sorted(data.draw(st.lists(st.integers(0, len(code)), min_size=3, max_size=3)))
            code = code[:a] + code[b:to] + code[a:b] + code[to:]
    execution, _ = run(sandbox, code)
    assert execution.ended in ("done", "error", "limit")
    assert "\n" not in execution.error
    assert all(finding.line >= 1 for finding in execution.findings)


@pytest.mark.process
@pytest.mark.parametrize(("robot_seconds", "ended_at"), [(20.0, 30.0), (-5.0, 10.0), (900.0, 70.0), (None, 70.0)])
def test_one_run_may_be_given_less_time_on_the_robots_clock_and_never_more(sandbox, robot_seconds, ended_at):
    control = FakeControl()
    execution = sandbox.run(
        "while True:\n    wait(10)",
        control,
        stopped=control.stopped,
        clock=lambda: control.time,
        robot_seconds=robot_seconds,
    )
    assert execution.ended == "limit" and control.time == ended_at
