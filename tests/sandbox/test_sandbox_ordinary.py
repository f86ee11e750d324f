"""Ordinary programs, as a language model writes them, run in the sandbox and do there what Python itself does."""

from __future__ import annotations

import contextlib
import io
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from memo_core.errors import InvalidArgument, MemoError, UnknownName
from memo_core.sandbox import Execution, Sandbox, Workspace
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import Skill, skill_library
from memo_core.testing.fake_control import FakeControl

TABLES = Path(__file__).parents[1] / "data" / "programs"
PROGRAMS: dict[str, str] = yaml.safe_load((TABLES / "ordinary.yaml").read_text("utf-8"))
LANGUAGE: dict[str, str] = yaml.safe_load((TABLES / "language.yaml").read_text("utf-8"))
WORKSPACE = Workspace((-0.2, -0.9, -0.1), (1.0, 0.9, 1.2), 1.0)

REFUSED = {  # outside the published subset: named before anything moves, with the line
    "context_manager": "line 1: module 'contextlib' is not available",
    "custom_exception": "line 1: exception classes cannot be defined",
    "enum_states": "line 1: module 'enum' is not available",
    "generator_function": "line 5: generators (yield) are not available",
    "scipy_rotation": "line 1: module 'scipy.spatial.transform' is not available",
    "static_methods": "line 3: methods cannot be decorated (@staticmethod)",
}


@pytest.fixture(scope="module")
def sandbox():
    with Sandbox(skill_library(BUILTIN_SKILLS)) as opened:
        yield opened


def in_sandbox(sandbox: Sandbox, code: str) -> tuple[Execution, FakeControl]:
    control = FakeControl()
    execution = sandbox.run(code, control, stopped=control.stopped, workspace=WORKSPACE, clock=lambda: control.time)
    return execution, control


def in_python(code: str, monkeypatch: pytest.MonkeyPatch) -> tuple[str, FakeControl]:
    """The same program in CPython with real numpy, on the same skills and an equal world."""
    control = FakeControl()
    monkeypatch.setattr("time.sleep", control.wait)
    monkeypatch.setattr("time.time", lambda: control.time)
    names: dict[str, Any] = {s.name: as_function(s, control) for s in BUILTIN_SKILLS}
    names.update(MotionError=RuntimeError, SkillError=RuntimeError, __name__="__main__")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "code", "exec"), names)
    return printed.getvalue(), control


def as_function(skill: Skill, control: FakeControl):
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            arguments = skill.bind(tuple(plain(a) for a in args), {name: plain(a) for name, a in kwargs.items()})
            WORKSPACE.refuse(skill, arguments)
            return skill.function(control, **arguments)
        except (InvalidArgument, UnknownName) as error:
            raise ValueError(str(error)) from None
        except MemoError as error:
            raise RuntimeError(str(error)) from None

    return call


def plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return [plain(v) for v in value] if isinstance(value, (list, tuple)) else value


NUMBER = re.compile(r"(?<![A-Za-z_])-?\d+\.?\d*(?:e-?\d+)?")


def spoken(text: str) -> tuple[list[str], list[float]]:
    """Printed text in words and numbers, so that numpy's way of laying out an array does not matter."""
    text = re.sub(r"np\.float64\(([^)]*)\)", r"\1", text).replace("array(", "").replace("np.True_", "True")
    return NUMBER.sub(" ", text).replace("[", " ").replace("]", " ").replace(",", " ").split(), [
        float(n) for n in NUMBER.findall(text)
    ]


@pytest.mark.process
@pytest.mark.parametrize("name", [name for name in PROGRAMS if name not in REFUSED])
def test_an_ordinary_program_does_what_python_does(name, sandbox, monkeypatch):
    code = PROGRAMS[name]
    execution, control = in_sandbox(sandbox, code)
    assert execution.error == ""
    assert execution.ended == "done"
    if "random" in code:  # the generators differ
        return
    printed, expected = in_python(code, monkeypatch)
    words, numbers = spoken(execution.printed)
    assert words == spoken(printed)[0]
    assert numbers == pytest.approx(spoken(printed)[1], abs=2e-6)
    assert control.commands == expected.commands
    assert np.allclose(control.trail, expected.trail, atol=1e-9)
    assert control.held == expected.held


@pytest.mark.filterwarnings("ignore::SyntaxWarning")
@pytest.mark.parametrize("name", LANGUAGE)
def test_the_language_means_what_it_means_in_python(name, sandbox, monkeypatch):
    code = LANGUAGE[name]
    execution, _ = in_sandbox(sandbox, code)
    assert execution.error == ""
    printed, _ = in_python(code, monkeypatch)
    assert spoken(execution.printed)[0] == spoken(printed)[0]
    assert spoken(execution.printed)[1] == pytest.approx(spoken(printed)[1], abs=1e-9, nan_ok=True)


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_outside_the_subset_is_named_before_anything_moves(name, sandbox):
    execution, control = in_sandbox(sandbox, PROGRAMS[name])
    assert execution.kind == "subset"
    assert REFUSED[name] in execution.error
    assert "\n" not in execution.error
    assert control.commands == []


def test_most_ordinary_programs_run_unchanged():
    assert len(PROGRAMS) >= 40
    assert set(REFUSED) <= set(PROGRAMS)
    assert len(REFUSED) / len(PROGRAMS) < 0.15


if __name__ == "__main__":  # python tests/sandbox/test_sandbox_ordinary.py: the share that docs/sandbox.md reports
    with Sandbox(skill_library(BUILTIN_SKILLS)) as opened:
        endings = {name: in_sandbox(opened, code)[0] for name, code in PROGRAMS.items()}
    for name, execution in endings.items():
        print(f"{'ok ' if execution.succeeded else 'NO '} {name} {execution.error}")
    print(sum(e.succeeded for e in endings.values()), "of", len(endings))
    sys.exit(0)


@pytest.mark.process
@pytest.mark.parametrize(
    ("call", "moved"),
    [("move_to([0.4, 0.0, 0.3], speed=2)", 1.0), ("move_until_contact([0, 0, -1], 0.1, 5.0, 2.0)", 0.2)],
)
def test_code_that_asks_for_more_than_the_fastest_gets_that_and_is_told(call, moved):
    with Sandbox(skill_library(BUILTIN_SKILLS)) as sandbox:
        execution = sandbox.run(call, FakeControl(), stopped=lambda: False)
    [done] = execution.calls
    assert done.arguments["speed"] == moved
    assert f"2 is faster than this robot may move; it moves at its limit, {moved:g}" in execution.printed
