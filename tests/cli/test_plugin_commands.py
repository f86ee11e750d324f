"""Commands that distributions add to ``memo``: installed for real, broken ones included, in a path of their own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

GOOD = """
import typer
app = typer.Typer()

@app.command()
def hello() -> None:
    print("hello there")

@app.command()
def bye() -> None:
    print("bye")
"""


def install(site: Path, name: str, source: str, command: str = "") -> None:
    module = name.replace("-", "_")
    (site / f"{module}.py").write_text(source)
    info = site / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\nSummary: Lab {name}: Say {name}.\n"
    )
    (info / "entry_points.txt").write_text(f"[memo.commands]\n{command or name} = {module}:app\n")


@pytest.fixture
def memo(tmp_path):
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "memo_core.cli.main", *arguments],
            env={**os.environ, "PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            timeout=60,
        )

    return run


def test_a_command_of_a_distribution_is_listed_and_runs(tmp_path, memo):
    install(tmp_path, "greet", GOOD)
    shown = memo("--help").stdout
    assert shown.startswith("Usage: memo") and "Say greet." in shown
    assert memo("greet", "hello").stdout == "hello there\n"


def test_a_function_is_a_command_without_subcommands(tmp_path, memo):
    source = "def app(names: list[str], times: int = 1) -> None:\n    print(names * times)\n"
    install(tmp_path, "greet", source)
    assert "Say greet." in memo("--help").stdout
    assert memo("greet", "ana", "ben", "--times", "2").stdout == "['ana', 'ben', 'ana', 'ben']\n"
    wrong = memo("greet", "ana", "--times", "twice")
    assert wrong.returncode == 2 and "--times" in wrong.stderr and "Traceback" not in wrong.stderr


def test_plugins_are_listed_in_lines_of_a_sensible_width_and_json_is_complete(memo):
    shown = memo("plugins", "list")
    assert max(map(len, shown.stdout.splitlines())) <= 120
    listed = json.loads(memo("plugins", "list", "--json").stdout)
    for backend in listed["backends"]:
        assert f"{backend['kind']} " in shown.stdout and backend["name"] in shown.stdout
    needing = [one for one in listed["backends"] if one["missing"]]
    for one in needing:
        assert f"{one['kind']} {one['name']} needs " in shown.stdout


def test_help_imports_no_command(tmp_path, memo):
    install(tmp_path, "loud", "raise SystemExit('imported')")
    listed = memo("--help")
    assert listed.returncode == 0 and "Say loud." in listed.stdout and "imported" not in listed.stderr


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("import no_such_library", "no_such_library"),
        ("app = 3", "expected a typer.Typer"),
        ("raise SystemExit('not today')", "not today"),
    ],
)
def test_a_broken_command_says_why_and_stops_no_other(tmp_path, memo, source, reason):
    install(tmp_path, "broken", source)
    typed = memo("broken")
    assert typed.returncode == 2 and "the command 'broken' of broken:app is broken" in typed.stderr
    assert reason in typed.stderr and "Traceback" not in typed.stderr
    assert memo("budget", "--help").returncode == 0


def test_no_distribution_takes_the_place_of_a_command_of_the_core(tmp_path, memo):
    install(tmp_path, "thief", GOOD, command="run")
    assert "Run a task" in memo("run", "--help").stdout or "--task" in memo("run", "--help").stdout
    assert "hello" not in memo("run", "--help").stdout
