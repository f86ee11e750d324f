"""Demonstrations as datasets: what was recorded comes out again, in both versions; an interrupted command goes on."""

from __future__ import annotations

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from memo_vla.dataset import statistics
from memo_vla.dataset.reading import Dataset
from memo_vla.dataset.recorder import Recorder
from memo_vla.dataset.video import read_video
from memo_vla.dataset.writer import About
from memo_vla.demonstrating import (
    REFERENCE,
    WITH_WRIST,
    Piece,
    dataset_in,
    demonstrate,
    layout_of,
    record_references,
    record_run,
    run_experiment_of,
    run_pieces,
)
from memo_vla.errors import TooFewDemonstrations
from memo_vla.recipe import write_recipe

import memo_core
from memo_core.environment import run_program
from memo_core.errors import InvalidArgument
from memo_core.runs import sandbox_of, task_of

pytestmark = [pytest.mark.sim, pytest.mark.process]

TASK = "turn-on-the-faucet"
CAMERAS = ["front", "wrist"]
PROGRAM = """
open_gripper(0.04)
p = get_gripper_position()
move_straight([p[0], p[1] + 0.1, p[2]])
close_gripper()
"""
CODEC_TOLERANCE = 6.0  # of 255, mean over the pixels of a picture: H.264 halves the resolution of colours


@pytest.fixture(scope="module")
def experiment():
    return memo_core.load(None, WITH_WRIST)


@pytest.fixture(scope="module")
def recorded(experiment, tmp_path_factory):
    """A recording of a program that moves the arm and the fingers, with the pictures as they were drawn."""
    task, folder = task_of(experiment, TASK), tmp_path_factory.mktemp("recording")
    drawn = {name: [] for name in CAMERAS}
    with memo_core.make_environment(experiment, TASK, 0) as world, sandbox_of(experiment) as sandbox:
        photograph = world.photograph

        def kept(cameras, height=None):
            taken = photograph(cameras, height)
            for name, picture in taken.items():
                drawn[name].append(picture.copy())
            return taken

        world.photograph = kept
        recorder = Recorder(world, CAMERAS, 120, 10.0, folder)
        with recorder.recording_now() as recording:
            recorder.say("subtask", "WAVE(hand)")
            execution = run_program(world, PROGRAM, sandbox)
            recorder.say("interjection", "that is enough", role="user")
        assert not execution.error, execution.error
    return task, recording, drawn


@pytest.mark.parametrize(("version", "preset"), [("v3.0", "libero"), ("v2.1", "libero"), ("v3.0", "droid")])
def test_a_dataset_read_back_equals_the_recording(version, preset, experiment, recorded, tmp_path):
    task, recording, drawn = recorded
    copy = type(recording)(
        recording.rate_hz,
        recording.frames,
        {name: tmp_path / f"{name}.mp4" for name in CAMERAS},
        recording.pictures,
        recording.size,
        recording.said,
    )
    for name, path in copy.videos.items():
        path.write_bytes(recording.videos[name].read_bytes())
    writer = dataset_in(tmp_path / "set", experiment, layout_of(preset, CAMERAS, 10), version, 120)
    writer.add(copy, About(task.name, task.instruction, 0, REFERENCE, True, "done"))

    read = Dataset(tmp_path / "set")
    episode = read.episode(0)
    frames = recording.frames
    assert len(read) == 1 and episode.instruction == task.instruction
    for name, values in {
        "observation.joints": [one.state.joints for one in frames[:-1]],
        "observation.gripper": [one.state.width for one in frames[:-1]],
        "sent.joints": [one.sent for one in frames[1:]],
        "sent.gripper": [one.opening for one in frames[1:]],
    }.items():
        np.testing.assert_array_equal(np.stack(episode.columns[name]), np.asarray(values, np.float32), err_msg=name)
    assert {0.04, 0.0} <= {round(one.opening, 6) for one in frames}  # as commanded, not as measured
    np.testing.assert_allclose(episode.columns["timestamp"], np.arange(len(frames) - 1) / 10, atol=1e-6)
    for camera in CAMERAS:
        again = np.stack(list(read.pictures(0, camera)))
        assert again.shape == (len(frames) - 1, 120, 160, 3)
        wrong = np.abs(again.astype(float) - np.stack(drawn[camera][:-1])).mean(axis=(1, 2, 3))
        assert wrong.max() < CODEC_TOLERANCE
        moved = np.abs(np.diff(again.astype(float), axis=0)).mean(axis=(1, 2, 3)).max()
        assert moved > 1.0  # and they are pictures of a motion, in order


def test_language_columns_say_what_was_done_and_said_when(experiment, recorded, tmp_path):
    recording = recorded[1]
    writer = dataset_in(tmp_path / "set", experiment, layout_of("libero", CAMERAS, 10), height=120)
    lasting, events = writer._language(recording.said, len(recording) - 1)
    assert all(rows is lasting[0] for rows in lasting) and lasting[0][0]["timestamp"] == 0.0
    assert (lasting[0][0]["style"], lasting[0][0]["content"]) == ("subtask", "WAVE(hand)")
    [said] = [row for rows in events for row in rows]
    assert (said["style"], said["role"], said["content"]) == ("interjection", "user", "that is enough")
    assert events[-1] == [said] and said["camera"] is None and "timestamp" not in said


def test_an_interrupted_command_goes_on_and_another_kind_is_refused(experiment, tmp_path):
    task, layout = task_of(experiment, TASK), layout_of("joints", CAMERAS)
    writer = dataset_in(tmp_path, experiment, layout, height=96)
    first = record_references(experiment, task, 1, 3, writer)
    assert [one.seed for one in first] == [3] and first[0].number == 0
    (tmp_path / "data/chunk-000/file-001.parquet").write_bytes(b"left by a crash")
    again = dataset_in(tmp_path, experiment, layout, height=96)
    assert [one.seed for one in record_references(experiment, task, 2, 3, again)] == [4]
    assert record_references(experiment, task, 2, 3, again) == []
    read = Dataset(tmp_path)
    info = read.info
    assert (info["total_episodes"], info["total_tasks"], info["splits"]) == (2, 1, {"train": "0:2"})
    index = np.concatenate([read.episode(number).columns["index"] for number in range(2)])
    assert index.tolist() == list(range(info["total_frames"]))
    assert not list(tmp_path.glob(".recording-*"))
    page = write_recipe(again)
    assert "v2.1" in page.read_text() and "num_train_steps=20_000" in (tmp_path / "pi05_memo.py").read_text()
    with pytest.raises(InvalidArgument, match="begun with height 96"):
        dataset_in(tmp_path, experiment, layout)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "thesis.txt").write_text("mine")
    with pytest.raises(InvalidArgument, match="something else"):
        dataset_in(tmp_path / "elsewhere", experiment, layout)


def test_failures_are_left_out_unless_they_are_wanted(experiment, tmp_path):
    task, layout = task_of(experiment, TASK), layout_of("joints", CAMERAS)
    writer = dataset_in(tmp_path, experiment, layout, height=96)
    idle = (Piece("wait(1)\n"),)
    assert demonstrate(experiment, task, 0, idle, writer).number is None and writer.episodes == 0
    kept = demonstrate(experiment, task, 0, idle, writer, keep_failures=True)
    assert (kept.number, kept.success) == (0, False)
    assert not np.any(Dataset(tmp_path).episode(0).columns["next.success"])
    with pytest.raises(InvalidArgument, match="no dataset"):
        Dataset(tmp_path / "nowhere")


def test_a_task_that_is_never_done_is_told_with_its_last_reason(experiment, tmp_path, monkeypatch):
    task = task_of(experiment, TASK)
    monkeypatch.setattr(type(task), "reference_solution", "wait(0.2)\n")
    writer = dataset_in(tmp_path, experiment, layout_of("joints", CAMERAS), height=96)
    with pytest.raises(TooFewDemonstrations, match=r"0 of 1 .*the lever"):
        record_references(experiment, task, 1, 0, writer)


def test_approved_programs_of_a_run_are_demonstrations_with_their_words(tmp_path):
    experiment = memo_core.load(
        None, "teacher.backend=scripted", "teacher.lines=[{subtask: '*'}]", "llm=offline", "run.video=off",
        f"skillbook.url={tmp_path / 'book.db'}", task="pick-the-left-can", seed=0,
    )  # fmt: skip
    report = memo_core.run(experiment, tmp_path / "runs")
    assert report.success, report.why
    pieces = run_pieces(report.folder)
    assert [one.subtask for one in pieces] == [one.subtask for one in report.result.subtasks]
    again = run_experiment_of(report.folder, ())
    writer = dataset_in(tmp_path / "set", again, layout_of("joints", CAMERAS), height=96)
    [shown] = record_run(report.folder, (), writer)
    assert shown.success and shown.number == 0 and shown.source == report.folder.name
    assert record_run(report.folder, (), writer) == []
    rows = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")["language_persistent"].to_pylist()
    assert [one["content"] for one in rows[0] if one["style"] == "subtask"] == [one.subtask for one in pieces]


def test_what_people_said_and_the_notes_of_a_run_are_kept(tmp_path):
    subtask = {"subtask": "OPEN(oven)", "status": "approved", "taken_back": False, "code": "wait(1)"}
    other = {"subtask": "LOOK(oven)", "status": "corrected", "taken_back": True, "code": "wait(2)"}
    note = {"kind": "correction", "text": "pull the handle in an arc"}
    events = [
        {"event": "FeedbackGiven", "subtask": "OPEN(oven)", "words": "not straight"},
        {"event": "Retrieved", "subtask": "OPEN(oven)", "served": [note, {"kind": "template", "text": "def f(): ..."}]},
        {"event": "FeedbackGiven", "subtask": "LOOK(oven)", "words": "elsewhere"},
    ]
    (tmp_path / "summary.json").write_text(json.dumps({"subtasks": [other, subtask]}))
    (tmp_path / "events.jsonl").write_text("".join(json.dumps(one) + "\n" for one in events))
    assert run_pieces(tmp_path) == (Piece("wait(1)", "OPEN(oven)", ("pull the handle in an arc",), ("not straight",)),)
    with pytest.raises(InvalidArgument, match="run that has ended"):
        run_pieces(tmp_path / "nowhere")


def test_statistics_of_all_episodes_are_those_of_all_frames():
    rng = np.random.default_rng(0)
    parts = [rng.normal(size=(length, 3)) * [1, 5, 0.1] + [0, 2, -1] for length in (5, 40, 17)]
    found = statistics.together([{"a": statistics.of_numbers(one)} for one in parts])["a"]
    every = np.concatenate(parts)
    for name in ("min", "max", "mean", "std"):
        np.testing.assert_allclose(found[name], getattr(every, name)(axis=0), err_msg=name)
    assert found["count"] == [62] and set(found) >= {"q01", "q10", "q50", "q90", "q99"}


def test_a_recording_that_is_stopped_leaves_no_video(experiment, tmp_path):
    with memo_core.make_environment(experiment, TASK, 0) as world:
        recorder = Recorder(world, CAMERAS, 96, 10.0, tmp_path)
        with pytest.raises(KeyboardInterrupt), recorder.recording_now():
            world.settle(0.5)
            raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_a_video_is_read_as_it_was_written(recorded):
    _, recording, drawn = recorded
    assert sum(1 for _ in read_video(recording.videos["front"])) == len(drawn["front"]) - 1
