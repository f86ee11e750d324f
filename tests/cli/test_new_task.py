"""``memo new task`` writes a plugin that installs and is verified as it is; the example in ``examples/`` is one."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from memo_core.cli.scaffolds import write_scaffold

EXAMPLE = Path(__file__).parents[2] / "examples" / "own-task"
EXAMPLE_NAME = "put-the-block-on-the-mat"


def memo(*arguments: str, **more: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    environment = os.environ | more
    return subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)


def install(project: Path, target: Path) -> None:
    """Without isolation: the build backend is one of the development requirements, so no index is asked."""
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*command, "--target", str(target), str(project)], check=True, timeout=120)


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("new") / "sort-the-buttons"
    made = memo("new", "task", "sort-the-buttons", "--folder", str(folder), "--json")
    assert made.returncode == 0, made.stderr
    assert json.loads(made.stdout)["next"][0] == f"pip install --editable {folder}"
    assert sorted(Path(file).name for file in json.loads(made.stdout)["files"]) == [
        "memo_sort_the_buttons.py",
        "pyproject.toml",
        "test_memo_sort_the_buttons.py",
    ]
    return folder


@pytest.fixture(scope="module")
def installed(written, tmp_path_factory) -> str:
    """Where the new plugin is installed. The example is the same but for its names, as a test below says."""
    target = tmp_path_factory.mktemp("site")
    install(written, target)
    return str(target)


@pytest.mark.process
def test_the_plugin_is_verified_as_it_is(installed):
    done = memo("tasks", "verify", "--suite", "sort-the-buttons", "--seeds", "0", "--json", PYTHONPATH=installed)
    assert done.returncode == 0, done.stderr + done.stdout
    [task] = json.loads(done.stdout)["tasks"]
    assert (task["name"], task["reference"], task["null"]) == ("sort-the-buttons", 1, 0)


@pytest.mark.process
def test_the_plugin_keeps_the_rules_for_suites(installed):
    done = memo("plugins", "check", "sort-the-buttons", "--json", PYTHONPATH=installed)
    assert done.returncode == 0, done.stdout


def test_the_example_is_what_the_command_writes_in_fewer_than_sixty_lines(tmp_path):
    for file in write_scaffold("task", EXAMPLE_NAME, tmp_path).files:
        assert (EXAMPLE / file.name).read_text(encoding="utf-8") == file.read_text(encoding="utf-8")
    [module] = EXAMPLE.glob("memo_*.py")
    assert len(module.read_text(encoding="utf-8").splitlines()) < 60


def test_the_page_shows_the_example_as_it_is():
    page = (EXAMPLE.parents[1] / "docs" / "own-task.md").read_text(encoding="utf-8")
    [shown] = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    [module] = EXAMPLE.glob("memo_*.py")
    assert shown == module.read_text(encoding="utf-8")


@pytest.mark.process
@pytest.mark.parametrize("name", ["SortTheButtons", "sort_the_buttons", "sort--buttons", "4-buttons", "ä"])
def test_a_name_that_is_none_is_refused_with_what_would_be_right(tmp_path, name):
    done = memo("new", "task", name, "--folder", str(tmp_path / "x"))
    assert done.returncode == 2 and not (tmp_path / "x").exists()
    assert "NAME" in done.stderr and "lower case" in done.stderr


@pytest.mark.process
def test_what_is_said_to_be_installed_is_a_path_and_no_name_that_a_stranger_could_register(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = memo("new", "task", "sort-the-buttons", "--json")
    assert json.loads(made.stdout)["next"][0] == "pip install --editable ./sort-the-buttons"


@pytest.mark.process
def test_what_is_there_is_never_written_over(tmp_path):
    (tmp_path / "mine.py").write_text("precious")
    done = memo("new", "task", "sort-the-buttons", "--folder", str(tmp_path))
    assert done.returncode == 2 and "not empty" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.py"]
