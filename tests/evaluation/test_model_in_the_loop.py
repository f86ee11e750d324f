"""An empty and a taught book compared with a model behind a server: several trials ask at once, a killed command goes
on, and the recordings play the whole comparison back."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from memo_offline.model import OfflineModel

from memo_core.evaluation.table import VARYING, read_table
from memo_core.interfaces.llm import Message, Request
from tests.support.fake_openai_server import Asked, Reply, Wire

pytestmark = pytest.mark.process

FILE = """
suite: quirks
run: {video: "off", attempts: 1, repairs: 2, repairs_from: start}
evaluation:
  methods: [memo]
  tasks: [open-the-freezer, put-the-carton-on-the-board]
  hours: []
  books: [empty, lessons]
  scenes: 1
  first_scene: 0
  corrected: {corrections: 0}
"""


@pytest.fixture(scope="module")
def offline():
    model = OfflineModel()
    model.open()

    def reply(asked: Asked) -> Reply:
        roles = [message["role"] for message in asked.body["messages"]]
        messages = tuple(Message(role, text) for role, text in zip(roles, asked.texts, strict=True))
        return Reply(model.answer(Request("", messages)).text, silent_s=1.0)  # slow enough to be asked by two at once

    yield reply
    model.close()


def command(tmp_path: Path, out: str, *options: str) -> subprocess.Popen[str]:
    given = [sys.executable, "-m", "memo_core.cli.main", "evaluate", str(tmp_path / "quirks.yaml")]
    environment = os.environ | {"OPENAI_API_KEY": "none"}
    return subprocess.Popen(
        [*given, "--out", str(tmp_path / out), "--json", *options], stdout=subprocess.PIPE, text=True, env=environment
    )


def rows(folder: Path) -> list[dict]:
    return [{name: row[name] for name in row if name not in VARYING} for row in read_table(folder / "evaluation")]


@pytest.mark.slow
@pytest.mark.timeout(1800)  # three evaluations: a loaded machine may take long
def test_a_comparison_that_was_killed_goes_on_and_plays_back(tmp_path, offline):
    (tmp_path / "quirks.yaml").write_text(FILE)
    with Wire(offline) as wire:
        model = ("--model-in-the-loop", "--jobs", "2", "-s", "llm.backend=litellm", "-s", "llm.model=openai/x")
        model = (*model, "-s", f"llm.api_base={wire.base}", "-s", "llm.timeout_s=7000", "-s", "llm.stream=false")
        first = command(tmp_path, "out", *model)
        deadline = time.monotonic() + 600
        while len(wire.asked) < 4 and time.monotonic() < deadline:
            time.sleep(0.05)
        first.send_signal(signal.SIGKILL)
        first.wait()
        assert wire.asked and not (tmp_path / "out" / "evaluation" / "trials.jsonl").exists()
        again = command(tmp_path, "out", *model)
        told = json.loads(again.communicate(timeout=900)[0])
        assert wire.most_under_way == 2
        assert not any(asked.body.get("stream") for asked in wire.asked)
    assert told["trials"] == told["runs"] == 4
    by_book = {(row["given"], row["task"]): row for row in rows(tmp_path / "out")}
    freezer, carton = "open-the-freezer", "put-the-carton-on-the-board"
    assert by_book["lessons", carton]["success"] and not by_book["empty", carton]["success"]
    assert by_book["lessons", carton]["first_programs"]
    for task in (freezer, carton):
        assert by_book["empty", task]["lesson_served"] == 0 < by_book["empty", task]["lesson_needed"]
        assert by_book["lessons", task]["lesson_served"] == by_book["lessons", task]["lesson_needed"] > 0

    replay = command(tmp_path, "again", "--replay", str(tmp_path / "out"))
    assert json.loads(replay.communicate(timeout=900)[0])["trials"] == 4
    assert rows(tmp_path / "again") == rows(tmp_path / "out")
