"""Broken and quarrelling plugins, really installed: every command goes on working, and says what is wrong."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

DECLARES = """
from memo_core.plugins.hooks import hookimpl
from memo_core.interfaces.backend import Backend

@hookimpl
def {hook}():
    return [Backend("{kind}", "{name}", "for tests", lambda settings: settings, default=True)]
"""


def install(folder: Path, distribution: str, module: str, source: str) -> None:
    """What an installer leaves behind: the module, and a dist-info with its entry point."""
    (folder / f"{module}.py").write_text(source)
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[memo]\n{module} = {module}\n")


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    site = tmp_path / "site"
    site.mkdir()
    install(site, "raising-plugin", "raising", "raise RuntimeError('the licence server is down')")
    install(site, "exiting-plugin", "exiting", "import sys; sys.exit('no')")
    install(site, "misspelt-plugin", "misspelt", DECLARES.format(hook="memo_robot", kind="robot", name="arm"))
    declared = DECLARES.format(hook="memo_vector_stores", kind="vectorstore", name="twin")
    install(site, "first-twin", "first_twin", declared)
    install(site, "second-twin", "second_twin", declared)
    return os.environ | {"PYTHONPATH": str(site)}


def memo(environment: dict[str, str], *arguments: str, code: int = 0) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=environment)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done


def test_they_are_reported_with_their_distributions_and_reasons(environment):
    problems = json.loads(memo(environment, "plugins", "list", "--json").stdout)["problems"]
    told = "\n".join(problems)
    assert len(problems) == 4
    for said in (
        "raising-plugin",
        "licence server",
        "exiting-plugin",
        "misspelt-plugin",
        "memo_robots",
        "first-twin",
        "second-twin",
    ):
        assert said in told


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["plugins", "list"],
        ["tasks", "list"],
        ["config", "show", "--set", "vectorstore=faiss"],
        ["prompts", "show"],
    ],
    ids=" ".join,
)
def test_every_command_goes_on_working(environment, arguments, tmp_path):
    memo(environment, *arguments)


def test_selecting_the_twins_names_both(environment):
    said = memo(environment, "config", "show", "--set", "vectorstore=twin", code=2).stderr
    assert "first-twin" in said and "second-twin" in said


def test_nothing_is_taken_in_the_place_of_what_two_declare(environment):
    """Two that both want to be the default do not leave the place to a third."""
    shown = json.loads(memo(environment, "config", "show", "--json").stdout)["values"]
    assert not [value for value in shown if value["path"].startswith("vectorstore")]
    said = memo(environment, "bench", "retrieval", code=2).stderr
    assert "first-twin" in said and "second-twin" in said


def test_selecting_what_a_broken_plugin_might_have_offered_says_why(environment):
    said = memo(environment, "config", "show", "--set", "vectorstore=licensed", code=2).stderr
    assert "raising-plugin" in said and "the licence server is down" in said
