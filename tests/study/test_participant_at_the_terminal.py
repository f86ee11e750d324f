"""A real participant of a study: answers come from a terminal, a pipe or a file; input that ends pauses the study."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

FILE = """
llm: offline
suite: quirks
run: {video: "off"}
study:
  tasks: [open-the-cupboard]
  participants: [{id: P01, teacher: {backend: terminal}}]
  rounds: 1
  clock: real
  consent: CONSENT
"""
CONSENT = "Words go to the provider of the language model. You may withdraw at any time."
AGREES, OF_THEMSELVES, SATISFIED = ("I agree",), ("30", "f", "none", "daily"), ("y", "y")


def study(tmp_path: Path, *typed: str, command: str = "run") -> subprocess.CompletedProcess[str]:
    file, consent = tmp_path / "study.yaml", tmp_path / "consent.txt"
    consent.write_text(CONSENT)
    file.write_text(FILE.replace("CONSENT", str(consent)))
    given = ["resume", str(tmp_path / "out")] if command == "resume" else ["run", str(file), "--out", "out"]
    return subprocess.run(
        [sys.executable, "-m", "memo_core.cli.main", "study", *given],
        input="".join(f"{line}\n" for line in typed), capture_output=True, text=True, cwd=tmp_path,
    )  # fmt: skip


def told(tmp_path: Path) -> dict[str, object]:
    return json.loads((tmp_path / "out" / "study" / "people.jsonl").read_text().splitlines()[-1])


@pytest.mark.slow
def test_a_study_takes_all_answers_from_a_pipe_and_writes_to_one(tmp_path):
    held = study(tmp_path, *AGREES, *OF_THEMSELVES, *SATISFIED)
    assert held.returncode == 0, held.stderr
    assert "1 round of 1 task is done" in held.stdout
    assert told(tmp_path) == {
        "participant": "P01", "age": 30, "gender": "f", "robots": "none", "language_models": "daily",
    }  # fmt: skip


def test_an_age_that_is_none_is_asked_for_again(tmp_path):
    held = study(tmp_path, *AGREES, "abc", "-3", "9" * 5000, "30")
    assert held.stderr.count("Your age in years") == 4
    assert "'abc' is no age" in held.stderr and "Your gender" in held.stderr


@pytest.mark.parametrize("typed", [(), AGREES, (*AGREES, "30")])
def test_input_that_ends_before_a_session_pauses_the_study_and_says_how_to_go_on(tmp_path, typed):
    held = study(tmp_path, *typed)
    assert held.returncode == 130
    assert "the input ended; to continue: memo study resume out" in held.stderr
    assert "Aborted" not in held.stderr and "a bug" not in held.stderr


@pytest.mark.slow
def test_input_that_ends_during_a_run_pauses_it_at_the_question_and_what_was_answered_is_kept(tmp_path):
    left = study(tmp_path, *AGREES, *OF_THEMSELVES, SATISFIED[0])
    assert left.returncode == 130 and "to continue: memo study resume out" in left.stderr
    journal = (tmp_path / "out" / "study" / "history-0" / "journal.jsonl").read_text()
    assert '"begin": 1' in journal and '"end": 1' not in journal, "the task counts as taught with nobody there"
    back = study(tmp_path, SATISFIED[1], command="resume")
    assert back.returncode == 0, back.stderr
    asked = [held.stderr.count("Did it work?") for held in (left, back)]
    assert asked == [2, 1], "only the question that stayed open is put again"


def test_a_closed_standard_input_is_refused_in_one_line(tmp_path):
    study(tmp_path)
    command = f"{sys.executable} -m memo_core.cli.main study resume out <&-"
    held = subprocess.run(command, shell=True, capture_output=True, text=True, cwd=tmp_path)
    assert held.returncode == 2 and "standard input is closed" in held.stderr
