"""Files that an earlier version made open, continue, or are refused in one line (tests/data/kept/README.md)."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest

from memo_core.llm.prompt_files import PHASES, PLACEHOLDERS, SAMPLES, Prompts, PromptSettings
from tests.cli.test_scaffolds import write_metadata
from tests.support.commands import run

KEPT = Path(__file__).parent / "data" / "kept"
CORRECTION = "Lead the handle along an arc about the hinge edge, the edge farthest from the handle."


@pytest.fixture
def kept(tmp_path, monkeypatch) -> Path:
    """A working folder with everything that was kept."""
    for archive in KEPT.glob("*.tar.gz"):
        with tarfile.open(archive) as packed:
            packed.extractall(tmp_path, filter="data")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def memo(*arguments: str) -> str:
    """Standard output of a command that must succeed."""
    code, out, err = run(arguments)
    assert code == 0, err
    return out


def listed(book: str) -> list[dict]:
    return json.loads(memo("skillbook", "list", "-b", book, "--json"))["entries"]


def memo_process(*arguments: str) -> subprocess.CompletedProcess[str]:
    """A command that runs robots, in a process of its own."""
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, env=os.environ | {"COLUMNS": "200"})


def test_they_are_small():
    assert sum(file.stat().st_size for file in KEPT.iterdir()) < 2_000_000


@pytest.mark.parametrize("version", [1, 5])
def test_a_book_opens_and_gives_what_was_taught(kept, version):
    book = f"books/schema-{version}.db"
    entries = listed(book)
    assert [entry["text"] for entry in entries if entry["kind"] == "correction"] == [CORRECTION]
    assert {entry["key"] for entry in entries if entry["kind"] == "template"} == {
        "OPEN(microwave)",
        "PICK_UP(food)",
        "PLACE(food, microwave)",
    }
    found = json.loads(memo("skillbook", "search", "-b", book, "OPEN(oven)", "--json"))
    assert CORRECTION in json.dumps(found)
    assert "nothing is wrong" in memo("skillbook", "check", "-b", book)
    memo("skillbook", "remove", "-b", book, "2")
    assert (kept / f"{book}.schema-{version}.backup").exists(), "kept before its first change"


def test_an_exported_book_is_imported(kept):
    memo("skillbook", "import", "book-export.jsonl", "-b", "new.db")
    ours, theirs = listed("new.db"), listed("books/schema-5.db")
    assert [(e["kind"], e["key"], e["text"]) for e in ours] == [(e["kind"], e["key"], e["text"]) for e in theirs]


def test_the_folder_of_a_chroma_index_is_used_or_made_anew(kept, monkeypatch):
    monkeypatch.chdir(kept / "chroma")
    found = memo("skillbook", "search", "-c", "chroma.yaml", "OPEN(oven)", "--json")
    assert CORRECTION in found


@pytest.mark.process
def test_a_run_that_was_killed_goes_on(kept, monkeypatch):
    monkeypatch.chdir(kept / "run")
    log = kept / "run" / "run" / "log.jsonl"
    log.write_text(log.read_text().replace('"/home/ab"', json.dumps(str(kept / "run")), 1))  # where it was started
    done = memo_process("run", "--resume", "run")
    assert done.returncode == 0, done.stderr
    assert json.loads((kept / "run" / "run" / "summary.json").read_text())["success"] is True
    assert [entry["text"] for entry in listed("run-book.db") if entry["kind"] == "correction"] == [CORRECTION]  # once


@pytest.mark.process
def test_a_study_that_was_killed_goes_on(kept):
    done = memo_process("study", "run", "study.yaml", "-o", "study")
    assert done.returncode == 0, done.stderr
    journal = (kept / "study/study/history-0/journal.jsonl").read_text().splitlines()
    assert [json.loads(line)["end"] for line in journal if "end" in json.loads(line)] == [1, 2]


@pytest.mark.process
def test_an_evaluation_that_was_killed_goes_on(kept):
    done = memo_process("evaluate", "evaluation.yaml", "-o", "evaluation")
    assert done.returncode == 0, done.stderr
    assert "trials that are over stay as they are" in done.stderr
    rows = (kept / "evaluation/evaluation/trials.jsonl").read_text().splitlines()
    assert len(rows) == 4 and not (kept / "evaluation/evaluation/errors.jsonl").exists()


@pytest.mark.process
def test_a_recording_is_replayed(kept):
    chosen = ("-t", "open-the-fridge", "--seed", "0", "--teacher", "simulated", "-s", "run.video=off", "-b", "new.db")
    replay = ("-s", "llm.backend=replay", "-s", "llm.file=recording.jsonl", "-s", "llm.match=situation")
    done = memo_process("run", *chosen, *replay)
    assert done.returncode == 0, done.stderr
    done = memo_process("run", *chosen, "--replay", "recording.jsonl")  # prompts have changed since
    assert done.returncode == 1 and "llm.match=situation" in done.stderr, done.stderr


def test_exported_prompts_are_used_or_refused_in_one_line(kept):
    code, _, err = run(["config", "check", "experiments/oven.yaml", "--set", "prompts.folder=prompts"])
    assert code == 0, err


@pytest.mark.parametrize("phase", [phase for phase in PHASES if phase != "generalise"])  # which came later
def test_exported_prompts_are_rendered_as_before(kept, phase):
    """The text of the file in one user message, every placeholder filled in."""
    text = Path("prompts", f"{phase}.md.j2").read_text(encoding="utf-8")
    prompts = Prompts(PromptSettings(folder="prompts"))
    *system, user = prompts.messages(phase, {name: SAMPLES[name] for name in PLACEHOLDERS[phase]})
    assert all(message.text.startswith("You control a robot arm") for message in system)
    assert user.text.splitlines()[0] == text.splitlines()[3] and "## Answer" in user.text


@pytest.mark.parametrize("name", ["gemini", "microwave", "noisy-camera", "oven", "own-server", "paper", "quirks"])
def test_an_experiment_file_is_in_order(kept, name):
    assert "in order" in memo("config", "check", f"experiments/{name}.yaml")


# What the driver of a former scaffold does that makes a real arm move too fast, or does without its gripper driver.
UNSAFE_DRIVER = [
    f"test_memo_kept_driver.py::test_it_keeps_the_rule[{rule}]"
    for rule in (
        "sends_take_a_control_period_of_real_time",
        "the_clock_goes_by_itself",
        "the_gripper_that_is_configured_moves",
    )
]


@pytest.mark.process
def test_scaffolded_plugins_load_and_pass_their_own_tests_but_for_what_is_unsafe(kept):
    site = kept / "site"
    site.mkdir()
    for project in sorted((kept / "scaffolds").iterdir()):
        write_metadata(site, tomllib.loads((project / "pyproject.toml").read_text())["project"])
        for entry in project.iterdir():
            if entry.name not in ("pyproject.toml", "README.md"):
                entry.rename(site / entry.name)
    quick = "not (simulator and not starts_at_home)"  # its rules of physics take a while
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n0", "-k", quick, str(site)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=site)
    failed = re.findall(r"^FAILED (.*?)(?: - .*)?$", done.stdout, re.MULTILINE)
    assert sorted(failed) == UNSAFE_DRIVER, done.stdout[-3000:]
    assert int(re.search(r"(\d+) passed", done.stdout)[1]) > 50
