"""A study that is killed goes on with the run that was cut off, and ends like one that was not."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from memo_core.config import load_experiment
from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.evaluation.evaluating import unread
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.plugins.registry import Registry
from memo_core.runs.background import CONFIG, LOG
from memo_core.runs.factories import book_of
from memo_core.skillbook import raw_log
from memo_core.study.export import export_study
from memo_core.study.running import run_study, study_sections
from memo_core.study.settings import StudySettings
from memo_core.study.study import DECIDED, open_study, status

FILE = """
llm: offline
suite: quirks
run: {video: "off"}
study:
  tasks: [open-the-cupboard]
  rounds: 2
  session_minutes: 1
"""


def opened(tmp_path: Path, name: str, text: str = FILE):
    registry, file = Registry(), tmp_path / "study.yaml"
    file.write_text(text)
    return registry, open_study(registry, file, study_sections(), (), tmp_path / name / "study")


def journal(folder: Path) -> list[dict]:
    lines = [json.loads(line) for line in (folder / "history-0" / "journal.jsonl").read_text().splitlines() if line]
    return [{key: value for key, value in line.items() if key != "time"} for line in lines]


@pytest.mark.sim
@pytest.mark.slow
def test_a_session_ends_with_the_attempt_at_hand_and_the_next_begins_with_its_task(tmp_path):
    text = FILE.replace("open-the-cupboard", "open-the-cupboard, open-the-locker").replace("rounds: 2", "rounds: 1")
    registry, load = opened(tmp_path, "short", text.replace("session_minutes: 1", "session_minutes: 4"))
    folder = tmp_path / "short" / "study"
    run_study(load, registry, folder)
    [history] = status(load(), folder)["histories"]
    runs = [line for line in journal(folder) if "begin" in line]
    ends = [line for line in journal(folder) if "end" in line]
    cut = [run["task"] for run, end in zip(runs, ends, strict=True) if end["session_over"]]
    assert cut == ["open-the-locker", "open-the-locker"]  # the second had a session of its own, so that was it
    assert [run["task"] for run in runs] == ["open-the-cupboard", "open-the-locker", "open-the-locker"]
    assert [run["session"] for run in runs] == [1, 1, 2] and len({run["seed"] for run in runs}) == 3
    assert history["over"] == "1 round of 2 tasks is done"


@pytest.mark.sim
@pytest.mark.slow
def test_a_killed_study_goes_on_and_ends_like_one_that_was_not_and_is_exported_without_ids(tmp_path):
    registry, load = opened(tmp_path, "whole")
    whole = tmp_path / "whole" / "study"
    run_study(load, registry, whole)
    command = [sys.executable, "-m", "memo_core.cli.main", "study"]
    cut = tmp_path / "cut" / "study"
    arguments = ["run", str(tmp_path / "study.yaml"), "--out", str(cut.parent)]
    with (tmp_path / "err").open("w") as err:
        running = subprocess.Popen([*command, *arguments], stderr=err, stdout=err)
        log = cut / "history-0" / "runs" / "0002-open-the-cupboard" / "log.jsonl"
        while running.poll() is None and not (log.exists() and log.read_text().count('"end": "execute"')):
            time.sleep(0.02)
        assert running.poll() is None, (tmp_path / "err").read_text()
        running.send_signal(signal.SIGKILL)
        running.wait()
    assert "end" not in journal(cut)[-1]
    ended = subprocess.run([*command, "resume", str(cut.parent), "--json"], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert journal(cut) == journal(whole)
    assert [line["participant"] for line in journal(whole) if "consent" in line] == ["S01", "S02"]
    said = []
    for folder in (whole, cut):
        with book_of(load(), str(folder / "history-0" / "skillbook.db"), read_only=True) as book:
            said.append([(one.kind, one.words, one.who, one.subtask) for one in raw_log.raw_log(book).feedback])
    assert said[0] == said[1] and any(words for _, words, _, _ in said[0])
    assert status(load(), whole)["histories"][0]["over"] == "2 rounds of 1 task are done"

    export_study(load(), whole, tmp_path / "public", demographics=False)
    assert not (tmp_path / "public" / "people.jsonl").exists()
    public = "".join(file.read_text() for file in (tmp_path / "public").iterdir())
    assert "S01" not in public and "S02" not in public and said[0][0][1] in public


def test_another_protocol_in_the_same_folder_is_refused(tmp_path):
    opened(tmp_path, "one")
    with pytest.raises(InvalidArgument, match=r"study\.rounds was 2, is 3"):
        opened(tmp_path, "one", FILE.replace("rounds: 2", "rounds: 3"))


def test_real_people_need_a_text_of_ones_own_and_a_real_clock(tmp_path):
    people = FILE + "  participants: [{id: P01, teacher: {backend: terminal}}]\n"
    with pytest.raises(InvalidArgument, match="no text for real people"):
        opened(tmp_path, "people", people)
    (tmp_path / "text.txt").write_text("To the provider of the model. You may withdraw.")
    with pytest.raises(InvalidArgument, match=r"study\.clock: simulated"):
        opened(tmp_path, "people", people + f"  consent: {tmp_path / 'text.txt'}\n")


@pytest.mark.sim
@pytest.mark.slow
def test_each_run_of_a_study_ends_with_clustering_where_the_file_says_so(tmp_path):
    text = FILE.replace("rounds: 2", "rounds: 1").replace("session_minutes: 1", "session_minutes: 30")
    registry, load = opened(tmp_path, "clustered", text + "skillbook: {cluster: after-run}\n")
    folder = tmp_path / "clustered" / "study"
    run_study(load, registry, folder)
    events = (folder / "history-0" / "runs" / "0001-open-the-cupboard" / "events.jsonl").read_text()
    assert '"event": "ClusterDone"' in events


@pytest.mark.sim
@pytest.mark.slow
@pytest.mark.process
def test_a_history_is_clustered_in_the_background_and_each_of_its_runs_pins_what_it_began_with(tmp_path):
    text = FILE.replace("session_minutes: 1", "session_minutes: 30")
    settings = "skillbook: {cluster: background}\nclustering: {interval_s: 0.2}\n"
    registry, load = opened(tmp_path, "beside", text + settings)
    history = tmp_path / "beside" / "study" / "history-0"
    told: list[str] = []
    run_study(load, registry, history.parent, report=told.append)
    assert told[-1].startswith("clustering in the background: ") and told[-1].endswith(f"({history / LOG})")
    assert (history / LOG).read_text().count('"spent"') == 1
    assert yaml.safe_load((history / CONFIG).read_text())["skillbook"]["url"] == str(history / "skillbook.db")
    pinned = []
    for file in sorted(history.glob("runs/*/log.jsonl")):
        lines = [json.loads(line) for line in file.read_text().splitlines()]
        pinned += [line["value"] for line in lines if line.get("end") == "pin the skillbook"]
    assert pinned[0] == 0 < pinned[1], "the second run sees what the first was taught"


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ("skillbook: {cluster: background}\nmethod: memo-c", "'memo-c' does not cluster"),
        ("skillbook: {cluster: after-run}\nmethod: memo-c", "'memo-c' does not cluster"),
        ("skillbook: {read_only: true}", "a study keeps what is taught"),
    ],
)
def test_a_setting_that_contradicts_a_study_is_refused_before_it_begins(tmp_path, section, said):
    with pytest.raises(InvalidArgument, match=said):
        opened(tmp_path, "refused", f"{FILE}{section}\n")


def test_a_model_without_its_key_is_refused_before_anybody_is_asked(tmp_path, monkeypatch):
    monkeypatch.delenv("NO_KEY_HERE", raising=False)
    text = FILE.replace("llm: offline", "llm: {backend: litellm, model: openai/x, api_key_env: NO_KEY_HERE}")
    with pytest.raises(BackendUnavailable, match="NO_KEY_HERE"):
        opened(tmp_path, "keyless", text)


def test_a_setting_that_a_study_or_an_evaluation_decides_otherwise_is_named_with_its_line(tmp_path):
    compared = "evaluation: {methods: [memo-c]}\n"
    set_by_hand = compared + "teacher: silent\nmethod: memo\nskillbook: {url: mine.db, cluster: after-run}\n"
    file = tmp_path / "study.yaml"
    file.write_text(FILE + set_by_hand)
    experiment = load_experiment(Registry(), file, (), ALL_SECTIONS)
    lines = (FILE + set_by_hand).splitlines()
    at = {key: f"{file}:{lines.index(line) + 1}: {key}" for key, line in (
        ("teacher.backend", "teacher: silent"), ("method.backend", "method: memo"),
        ("skillbook.url", lines[-1]), ("skillbook.cluster", lines[-1]),
    )}  # fmt: skip
    told = {line.partition(" is not read by ")[0] for line in experiment.unread("a study", DECIDED)}
    assert told == {at["teacher.backend"], at["skillbook.url"]}
    told = {line.partition(" is not read by ")[0] for line in unread(experiment)}
    assert told == set(at.values())
    plain = load_experiment(Registry(), None, (), ALL_SECTIONS)
    assert not plain.unread("a study", DECIDED) and not unread(plain), "defaults need no notice"


def test_one_book_for_each_participant_is_one_history_each():
    with pytest.raises(InvalidArgument, match="histories"):
        StudySettings(book="participant", histories=2)
