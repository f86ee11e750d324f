"""What will not work is named before anything moves, with its line and what would be right."""

from __future__ import annotations

import importlib
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from pydantic_monty import Monty, NameLookupSnapshot

from memo_core.sandbox import Execution, Limits, Sandbox, Workspace
from memo_core.sandbox.modules import BUILTINS, MODULES
from memo_core.sandbox.prelude import array_names, source
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from memo_core.testing.fake_control import FakeControl


@pytest.fixture(scope="module")
def sandbox():
    with Sandbox(skill_library(BUILTIN_SKILLS), Limits(seconds_between_calls=2.0)) as opened:
        yield opened


def run(sandbox: Sandbox, code: str) -> Execution:
    control = FakeControl()
    return sandbox.run(code, control, stopped=control.stopped)


# -- findings --------------------------------------------------------------------------------------------------------

FINDINGS = {
    "move_to(postion=[0.4, 0, 0.3])": "line 1: move_to has no argument 'postion'; did you mean 'position'?",
    "x = 1\nmove_to()": "line 2: move_to needs the argument 'position'",
    "open_gripper(0.04, 20)": "line 1: open_gripper takes 1 arguments, not 2",
    "move_to([0.4, 0, 0.3], position=[0.4, 0, 0.3])": "line 1: move_to gets one argument twice",
    "\n\nmov_to([0.4, 0, 0.3])": "line 3: unknown name 'mov_to'; did you mean 'move_to'?",
    "import os": "line 1: module 'os' is not available",
    "import numpy as np\nnp.fft": "line 2: numpy has no 'fft'",
    "from numpy import lianlg": "line 1: numpy has no 'lianlg' in robot code; did you mean 'linalg'?",
    "import numpy as np\nnp.linalg.svd([[1]])": "line 2: numpy.linalg has no 'svd'",
    "import math as m\nm.coss(1)": "line 2: math has no 'coss' in robot code; did you mean 'cos'?",
    "def f():\n    yield 1": "line 2: generators (yield) are not available",
    "class A(Exception):\n    pass": "line 1: exception classes cannot be defined",
    "x = 1\ndel x": "line 2: del works on one item",
    "x = (1\n": "syntax error",
    "x = 5 5": "line 1: syntax error",
    "async def f():\n    pass": "line 1: async functions are not available",
    "f'{(yield)}'": "generators",
    "type X = int": "line 1:",
    "class A:\n    def __bool__(self):\n        return False": "line 2: __bool__ would have no effect",
    "raise ValueError('a', 'b')": "line 1: an exception takes one argument",
    "print(().__class__)": "line 1: the attribute '__class__' is not available",
}


@pytest.mark.process
@pytest.mark.parametrize("code", FINDINGS)
def test_a_finding_names_its_line_and_what_would_be_right(code, sandbox):
    findings = sandbox.check(code)
    assert findings
    assert any(FINDINGS[code] in str(finding) for finding in findings), findings
    execution = run(sandbox, "go_home()\n" + code)
    assert (execution.ended, execution.kind, execution.calls) == ("error", "subset", ())


def test_all_findings_are_reported_at_once(sandbox):
    code = "import os\nmove_to(pos=[1, 2, 3])\nfoo()\nclass A(B):\n    pass"
    assert [finding.line for finding in sandbox.check(code)] == [1, 2, 3, 4, 4]
    assert all(f"line {n}" in run(sandbox, code).error for n in (1, 2, 3, 4))


@pytest.mark.parametrize(
    "code",
    [
        "def move_to(a, b, c, d, e, f, g):\n    return a\nmove_to(1, 2, 3, 4, 5, 6, 7)",
        "args = ([0.4, 0, 0.3],)\nmove_to(*args, **{})",
        "for np in [1, 2]:\n    print(np)",
        "x = [n for n in range(3)]\nprint(x)",
        "try:\n    pass\nexcept MotionError as error:\n    print(error)",
        "def f(x: 'list[float]' = None) -> 'SomeType':\n    return x\nf()",
        "print(np.array([1.0]) + 1, math.pi, time.time())",
    ],
)
def test_good_code_has_no_findings(code, sandbox):
    assert sandbox.check(code) == []
    assert run(sandbox, code).error == ""


# -- errors keep the model's lines -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "line", "kind"),
    [
        ("x = 1\n\nprint(1 / 0)", 3, "ZeroDivisionError"),
        ("import numpy as np\n# a comment\n\na = np.zeros(3)\n\nb = a + [1, 2]\n", 6, "ValueError"),
        ("from __future__ import annotations\n\n\ndef f():\n    # why\n    return {}['k']\n\n\nf()", 6, "KeyError"),
        ("names = [\n    'red cube',\n    'cup',\n]\nall(get_position(n)\n    for n in names)", 5, "UnknownName"),
        ("from numpy import (\n    array,\n    pi,\n)\n\nmove_to(array([9, 0, pi]))", 6, "MotionError"),
        ("import numpy as np\nd = {'a': 1}\ndel d['a']\nd['a']", 4, "KeyError"),
    ],
)
def test_an_error_gives_the_line_of_the_code_as_it_was_written(code, line, kind, sandbox):
    execution = run(sandbox, code)
    assert (execution.line, execution.kind) == (line, kind), execution.error
    assert execution.error.startswith(f"line {line}: {kind}: ")


# -- what the checks offer is what there is --------------------------------------------------------------------------


def test_the_published_names_are_those_of_the_interpreter():
    with Monty() as pool:
        for name in sorted(BUILTINS - {"MotionError", "SkillError", "InvalidArgument", "UnknownName", "callable"}):
            with pool.checkout() as session:
                assert not isinstance(session.feed_start(name), NameLookupSnapshot), name
        for module, names in MODULES.items():
            if module.startswith(("numpy", "__future__")):
                continue
            with pool.checkout() as session:
                code = f"import {module}\n[n for n in {list(names)!r} if not hasattr({module}, n)]"
                assert session.feed_run(code) == [], module


def test_what_numpy_offers_is_bound_by_the_prelude():
    with Monty() as pool, pool.checkout() as session:
        session.feed_run(source("base"))
        session.feed_run(source("arrays") + source("array_functions"))
        names = array_names()
        assert session.feed_run(f"[n for n in {list(names['numpy'])!r} if not hasattr(np, n)]") == []
        assert session.feed_run(f"[n for n in {list(names['numpy.linalg'])!r} if not hasattr(np.linalg, n)]") == []
        assert len(names["numpy"]) > 80
    assert all(hasattr(np, name) for name in names["numpy"])


def test_the_prompt_names_every_module_and_limit(sandbox):
    text = sandbox.subset()
    assert all(module in text for module in MODULES if module not in ("__future__", "numpy.linalg"))
    assert "{" not in text and "256 MiB" in text
    assert all(importlib.import_module(m) for m in MODULES)


# -- arrays: numpy's own results -------------------------------------------------------------------------------------

NUMBER = st.floats(-10, 10).map(lambda v: round(v, 3))
VECTOR = st.lists(NUMBER, min_size=3, max_size=3)
MATRIX = st.lists(VECTOR, min_size=2, max_size=4)
SAME = [
    "a + b", "a - b * 2", "2 * a / 3", "a @ b", "-a", "abs(a)", "a ** 2", "3 - a", "np.cross(a, b)",
    "np.dot(a, b)", "np.linalg.norm(a - b)", "np.stack([a, b])", "np.vstack([m, a])", "m @ a", "m.T", "m[:, 1]",
    "m[0]", "m[0, 2]", "m[-1, :2]", "m.mean(axis=0)", "m.sum(axis=1)", "m.max()", "np.argmin(a)", "np.argsort(a)",
    "np.sort(a)", "a < b", "a[a > 0]", "np.where(a > b, a, b)", "np.clip(a, -1, 1)", "np.minimum(a, b)",
    "np.outer(a, b)", "m - m.mean(axis=0)", "np.linalg.norm(m, axis=1)", "np.concatenate([a, b[:2]])",
    "np.append(a, 1.0)", "np.linspace(0, 1, 7)", "np.diff(a)", "np.linspace(a, b, 4)", "np.arange(0, 1, 0.25)",
    "np.cumsum(a)", "np.hstack([a, b])", "np.column_stack([a, b])", "np.sign(a)", "np.arctan2(a, b)",
    "np.degrees(a)", "np.isclose(a, b)", "m.reshape(-1)", "np.std(a)", "np.median(a)", "np.all(a > -20)",
    "np.any(a > b)", "m.shape", "np.eye(3) @ a", "a.dot(b)", "m * a", "np.hypot(a, b)", "np.flip(a)",
    "np.roll(a, 1)", "np.interp(0.5, [0, 1], [0, 10])", "np.floor(a)", "(a > 0) & (b > 0)", "a == b", "len(m)",
    "m[::-1]", "np.prod(a)", "np.mean([a, b], axis=0)", "np.round(a, 1)", "np.ones((2, 3)) * a",
]  # fmt: skip


@pytest.mark.process
@settings(max_examples=12, deadline=None)
@given(VECTOR, VECTOR, MATRIX)
def test_arrays_compute_what_numpy_computes(a, b, m):
    setup = f"import numpy as np\na = np.array({a!r})\nb = np.array({b!r})\nm = np.array({m!r})\n"
    names: dict = {"np": np, "a": np.array(a), "b": np.array(b), "m": np.array(m)}
    shown = "".join(f"print(np.ravel(np.array({expression})).tolist())\n" for expression in SAME)
    with Sandbox(skill_library(BUILTIN_SKILLS)) as sandbox:
        execution = run(sandbox, setup + shown)
    assert execution.error == ""
    for expression, line in zip(SAME, execution.printed.splitlines(), strict=True):
        expected = np.ravel(np.array(eval(expression, names))).astype(float)
        found = np.array(eval(line, {"nan": math.nan, "inf": math.inf, "True": True, "False": False}), dtype=float)
        assert np.allclose(found, expected, atol=1e-9, equal_nan=True), expression


def test_arrays_solve_and_invert_like_numpy(sandbox):
    code = (
        "import numpy as np\nA = np.array([[2.0, 1, 0], [1, 3, 1], [0, 1, 4]])\n"
        "print(np.linalg.solve(A, [1, 2, 3]).tolist())\n"
        "print(np.ravel(np.linalg.inv(A)).tolist())\nprint(np.linalg.det(A))"
    )
    A = np.array([[2.0, 1, 0], [1, 3, 1], [0, 1, 4]])
    solved, inverse, determinant = (eval(line) for line in run(sandbox, code).printed.splitlines())
    assert np.allclose(solved, np.linalg.solve(A, [1, 2, 3]))
    assert np.allclose(inverse, np.linalg.inv(A).ravel())
    assert math.isclose(determinant, np.linalg.det(A))


# -- the workspace ---------------------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_a_motion_passes_exactly_where_the_workspace_allows_it(position):
    from memo_core.errors import MotionError
    from memo_core.skills.contract import move_to, turn_point

    workspace = Workspace((-0.5, -1.0, 0.0), (1.0, 1.0, 1.5), 1.2)
    inside = all(low <= v <= high for low, v, high in zip(workspace.lower, position, workspace.upper, strict=True))
    arguments = move_to.bind((position,), {})
    if inside and math.hypot(*position) <= 1.2:
        workspace.refuse(move_to, arguments)
    else:
        with pytest.raises(MotionError) as error:
            workspace.refuse(move_to, arguments)
        assert error.value.cause == "workspace"
    workspace.refuse(turn_point, turn_point.bind((position, position, [0, 0, 1], 0.1), {}))


def test_limits_are_checked_at_the_edge():
    with pytest.raises(ValueError, match="memory"):
        Limits(memory=0)
    with pytest.raises(ValueError, match="calls"):
        Limits(calls=True)


@pytest.mark.parametrize(
    ("code", "kind"),
    [
        ("raise TimeoutError('time limit exceeded')", "TimeoutError"),
        ("raise TimeoutError('turn time limit exceeded: 5s > 5s')", "TimeoutError"),
        ("raise MemoryError('no room on the table')", "MemoryError"),
        ("raise RuntimeError('the suspension broke')", "RuntimeError"),
    ],
)
def test_an_exception_of_the_codes_own_is_not_reported_as_a_limit(code, kind, sandbox):
    execution = run(sandbox, code)
    assert (execution.ended, execution.kind, execution.line) == ("error", kind, 1)
