"""Looking around costs nothing: commands that only look import none of the heavy libraries, and help is quick."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

pytestmark = pytest.mark.process

HEAVY = ("torch", "mujoco", "pybullet", "litellm", "pinocchio", "faiss", "onnxruntime", "transformers")

RUN = """
import sys
from memo_core.cli.main import main
code = None
try:
    main(sys.argv[1:])
except SystemExit as ended:
    code = ended.code
import json
print("LOADED", json.dumps([code, sorted(m for m in sys.modules if "." not in m)]), file=sys.stderr)
"""


def loaded_by(*arguments: str) -> tuple[int, set[str]]:
    done = subprocess.run([sys.executable, "-c", RUN, *arguments], capture_output=True, text=True, timeout=60)
    line = next(line for line in done.stderr.splitlines() if line.startswith("LOADED "))
    code, modules = json.loads(line.removeprefix("LOADED "))
    return code, set(modules)


@pytest.mark.parametrize(
    "arguments", [["--help"], ["run", "--help"], ["plugins", "list", "--json"], ["config", "show"]]
)
def test_looking_around_imports_nothing_heavy(arguments):
    code, modules = loaded_by(*arguments)
    assert code == 0
    assert not modules & set(HEAVY)


def test_checking_a_config_imports_nothing_heavy(tmp_path):
    file = tmp_path / "experiment.yaml"
    file.write_text("seed: 1\nretrieval: {cut: 0.9}\nllm: {backend: litellm, model: openai/gpt-5}\n")
    code, modules = loaded_by("config", "check", str(file))
    assert code == 0
    assert not modules & set(HEAVY)


def test_help_needs_only_the_names_of_the_commands():
    _, modules = loaded_by("--help")
    assert not modules & {"numpy", "sqlalchemy", "omegaconf", "pluggy", "rich", "markdown_it"}


def test_the_check_itself_would_notice():
    done = subprocess.run(
        [sys.executable, "-c", "import sys, faiss\n" + RUN, "--help"], capture_output=True, text=True, timeout=60
    )
    assert '"faiss"' in done.stderr
