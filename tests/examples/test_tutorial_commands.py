"""The tutorial's lines for the shell, in a folder as it is after several runs."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial.md"


@pytest.mark.process
def test_the_code_of_the_newest_of_two_runs_is_compared(tmp_path):
    for age, name in enumerate(("20-open-the-fridge-seed0", "10-open-the-fridge-seed0")):
        code = tmp_path / "runs" / name / "code" / "01-OPEN.fridge"
        code.mkdir(parents=True)
        (code / "attempt-1.py").write_text("first\n")
        (code / "attempt-2.py").write_text(f"second of {name}\n")
        os.utime(tmp_path / "runs" / name, (1000 - age, 1000 - age))
    shown = TUTORIAL.read_text(encoding="utf-8")
    lines = re.findall(r"^\$ ((?:cd|diff) .*)$", shown, re.MULTILINE)
    assert len(lines) == 2
    ran = subprocess.run(["bash", "-c", "\n".join(lines)], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert "> second of 20-open-the-fridge-seed0" in ran.stdout, ran.stderr
