"""What ``memo_core`` exports for scripts and notebooks: importing costs nothing, and the page's example runs."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import memo_core

PAGE = Path(__file__).parents[1] / "docs" / "python.md"


def test_everything_exported_exists_and_is_documented():
    page = PAGE.read_text(encoding="utf-8")
    for name in memo_core.__all__:
        assert getattr(memo_core, name).__doc__, name
        assert name in dir(memo_core) and f"`{name}" in page, name
    with pytest.raises(AttributeError, match="no attribute 'lode'"):
        memo_core.lode  # noqa: B018


@pytest.mark.process
def test_importing_the_package_imports_nothing_else():
    shown = subprocess.run(
        [sys.executable, "-c", "import sys, memo_core; print(*sorted(m.partition('.')[0] for m in sys.modules))"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert not {"attrs", "attr", "numpy", "sqlalchemy", "pluggy", "typer"} & set(shown.stdout.split())


@pytest.mark.sim
def test_the_pages_examples_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) >= 3
    namespace: dict = {}
    for block in blocks:
        exec(compile(block, PAGE.name, "exec"), namespace)
    assert list((tmp_path / "runs").iterdir())


@pytest.mark.sim
def test_an_environment_can_be_stepped_and_put_back_exactly():
    with memo_core.make_environment(memo_core.load(), "open-the-fridge", seed=2) as environment:
        start = environment.checkpoint()
        home = environment.link.joint_positions()
        target = home + 0.1

        def moved() -> np.ndarray:
            for share in np.linspace(0, 1, 60):
                environment.step(home + share * (target - home))
            for _ in range(20):
                environment.step()
            return environment.link.joint_positions()

        first = moved()
        assert np.abs(first - target).max() < 0.02
        environment.restore(start)
        assert np.array_equal(environment.link.joint_positions(), home)
        assert np.array_equal(moved(), first)


def test_a_task_is_asked_for_by_name():
    with pytest.raises(memo_core.MemoError, match="which scene"):
        memo_core.make_environment(memo_core.load())
