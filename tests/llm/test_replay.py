"""A recording holds every call and plays it back: the same answer to the same question, and a clear word otherwise."""

from __future__ import annotations

import gzip
import json
import threading
from pathlib import Path

import attrs
import pytest
from hypothesis import given, settings, strategies as st
from memo_llm.replay.model import Player, Recorder
from memo_llm.replay.recording import BadRecording, Call, RecordingFile, read_recording
from memo_llm.replay.settings import ReplaySettings

from memo_core.config import ConfigErrors, load_experiment
from memo_core.errors import InvalidArgument
from memo_core.interfaces.llm import Answer, Image, LanguageModelError, Message, Request
from memo_core.plugins.registry import Registry
from memo_core.runs.record_replay import recorded, replayed, shipped
from memo_core.runs.run import run_experiment
from memo_core.runs.sections import SECTIONS
from memo_core.testing.fake_llm import ScriptedModel
from memo_core.testing.llm import check_language_model, check_llm, user


def question(text: str, phase: str = "code", **more) -> Request:
    return Request(phase, (Message("system", "You move a robot arm."), Message("user", text)), seed=0, **more)


def record(path: Path, script: dict, requests: list[Request]) -> list[Answer | LanguageModelError]:
    heard: list[Answer | LanguageModelError] = []
    with_file = Recorder(ScriptedModel(script), path)
    with_file.open()
    for request in requests:
        try:
            heard.append(with_file.answer(request))
        except LanguageModelError as error:
            heard.append(error)
    with_file.close()
    return heard


def player(path: Path, **settings) -> Player:
    opened = Player(ReplaySettings(str(path), **settings))
    opened.open()
    return opened


def test_what_was_answered_is_answered_again_with_its_tokens_and_cost(tmp_path):
    asked = [question("open the oven", "plan"), question("write code"), question("write more code")]
    heard = record(tmp_path / "r.jsonl", {"plan": ["OPEN(oven)"], "code": ["a = 1", "b = 2"]}, asked)
    again = player(tmp_path / "r.jsonl")
    for request, answer in reversed(list(zip(asked, heard, strict=True))):  # in any order
        assert again.answer(request) == answer
        assert again.answer(attrs.evolve(request, phase="other")) == answer


def test_one_question_asked_twice_gets_its_answers_in_their_order_and_then_the_last(tmp_path):
    record(tmp_path / "r.jsonl", {"code": ["first", "second"]}, [question("same")] * 2)
    again = player(tmp_path / "r.jsonl")
    assert [again.answer(question("same")).text for _ in range(3)] == ["first", "second", "second"]
    again.close()
    again.open()
    assert again.answer(question("same")).text == "second", "the runs of one demo share a recording"


def test_an_error_comes_back_in_its_place(tmp_path):
    error = LanguageModelError("scripted", "slow down", retryable=True, cause="busy")
    record(tmp_path / "r.jsonl", {"code": [error, "now"]}, [question("same")] * 2)
    again = player(tmp_path / "r.jsonl")
    with pytest.raises(LanguageModelError, match="slow down") as raised:
        again.answer(question("same"))
    assert raised.value.retryable and raised.value.cause == "busy"
    assert again.answer(question("same")).text == "now"


def test_an_answer_that_was_withheld_comes_back_with_the_reason(tmp_path):
    withheld = Answer("", "refusal", note="the provider's content filter withheld the answer")
    record(tmp_path / "r.jsonl", {"code": [withheld]}, [question("same")])
    again = player(tmp_path / "r.jsonl").answer(question("same"))
    assert (again.finish, again.note) == (withheld.finish, withheld.note)


def test_a_recording_of_an_earlier_version_is_played(tmp_path):
    file = tmp_path / "r.jsonl"
    record(file, {"code": ["one", LanguageModelError("scripted", "no")]}, [question("first"), question("second")])
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    lines[1]["answer"].pop("note")
    lines[2]["error"].pop("cause")
    file.write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    again = player(file)
    assert again.answer(question("first")).text == "one"
    with pytest.raises(LanguageModelError) as raised:
        again.answer(question("second"))
    assert raised.value.cause == ""


def test_a_call_that_was_given_up_is_kept_and_answered_with_last(tmp_path):
    model = Recorder(ScriptedModel({"code": ["late", "in time"]}), tmp_path / "r.jsonl")
    model.open()
    model.answer(question("same"), cancelled=lambda: True)
    model.answer(question("same"), cancelled=lambda: False)
    model.close()
    assert [call.abandoned for call in read_recording(tmp_path / "r.jsonl")] == [True, False]
    again = player(tmp_path / "r.jsonl")
    assert [again.answer(question("same")).text for _ in range(2)] == ["in time", "late"]


def test_an_answer_that_comes_after_the_end_is_kept_all_the_same(tmp_path):
    inner = ScriptedModel({"code": ["late"]}, delay_s=0.2)
    model = Recorder(inner, tmp_path / "r.jsonl")
    model.open()
    thread = threading.Thread(target=lambda: model.answer(question("slow"), cancelled=lambda: True))
    thread.start()
    inner.called.wait(5)
    model.close()
    thread.join()
    assert [call.answer.text for call in read_recording(tmp_path / "r.jsonl") if call.answer] == ["late"]


SCENE = "# Scene\n| cube | 0.450 -0.320 0.025 |\n| bowl | 0.600 0.100 0.030 | yaw 34 deg |\n# Task\nput it in"


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (question(SCENE.replace("bowl", "dish")), ["message 2 (user)", "section '# Scene'", "line 3", "bowl", "dish"]),
        (question(SCENE + "\nnow"), ["message 2", "section '# Task'", "line 6", "asked:    now"]),
        (attrs.evolve(question(SCENE), seed=3), ["the seed differs: asked 3, recorded 0"]),
        (question(SCENE, response_schema={"type": "object"}), ["the schema of the answer differs"]),
        (
            attrs.evolve(question(SCENE), messages=(Message("system", "You do."), *question(SCENE).messages[1:])),
            ["message 1 (system)", "You move a robot arm.", "You do."],
        ),
        (
            attrs.evolve(question(SCENE), messages=(*question(SCENE).messages, Message("user", "once more"))),
            ["has 3 messages, that one 2", "once more"],
        ),
    ],
)
def test_a_question_that_was_not_recorded_says_what_differs(tmp_path, asked, said):
    record(tmp_path / "r.jsonl", {"plan": ["x"], "code": ["y"]}, [question("something else", "plan"), question(SCENE)])
    with pytest.raises(LanguageModelError) as raised:
        player(tmp_path / "r.jsonl").answer(asked)
    assert "call 2 (code)" in raised.value.problem and not raised.value.retryable
    for words in said:
        assert words in raised.value.problem


def test_numbers_that_differ_by_a_hair_are_matched_only_when_asked_for_and_said(tmp_path):
    other = SCENE.replace("0.450", "0.670")
    record(tmp_path / "r.jsonl", {"code": ["near", "far"]}, [question(SCENE), question(other)])
    noisy = question(SCENE.replace("0.450", "0.451").replace("yaw 34", "yaw 35"))
    with pytest.raises(LanguageModelError, match="line 2 differs"):
        player(tmp_path / "r.jsonl").answer(noisy)
    loose = player(tmp_path / "r.jsonl", match="numbers")
    answer = loose.answer(noisy)
    assert answer.text == "near" and "2 slightly other numbers" in answer.note
    assert loose.answer(question(SCENE)).note == ""
    with pytest.raises(LanguageModelError, match="no answer to this question"):
        loose.answer(question(SCENE.replace("0.450", "0.520")))
    with pytest.raises(LanguageModelError, match="no answer to this question"):
        loose.answer(question(SCENE.replace("cube |", "cube 2 |")))


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-2, 2), min_size=1, max_size=4), st.floats(-0.03, 0.03))
def test_a_loose_match_is_never_further_off_than_allowed(tmp_path_factory, values, shift):
    path = tmp_path_factory.mktemp("loose") / "r.jsonl"
    text = " ".join(f"{value:.3f}" for value in values)
    record(path, {"code": ["a"]}, [question(text)])
    moved = " ".join(f"{value + shift:.3f}" for value in values)
    off = max(abs(float(a) - float(b)) for a, b in zip(text.split(), moved.split(), strict=True))
    loose = player(path, match="numbers", tolerance=0.02)
    try:
        assert loose.answer(question(moved)).text == "a"
        assert off <= 0.02 + 1e-6
    except LanguageModelError:
        assert off > 0.02 - 1e-6


def test_pictures_are_kept_once_and_are_part_of_the_question(tmp_path):
    def look(data: bytes) -> Request:
        return Request("plan", (Message("user", "what is this?", (Image(data),)),))

    record(tmp_path / "r.jsonl", {"plan": ["a cup", "a cup", "a pan"]}, [look(b"cup"), look(b"cup"), look(b"pan")])
    lines = [json.loads(line) for line in (tmp_path / "r.jsonl").read_text().splitlines()]
    assert sum("image" in line for line in lines) == 2
    again = player(tmp_path / "r.jsonl")
    assert again.answer(look(b"pan")).text == "a pan"
    [image] = read_recording(tmp_path / "r.jsonl")[0].request.messages[0].images
    assert image.data == b"cup"
    with pytest.raises(LanguageModelError, match="other pictures"):
        again.answer(look(b"pot"))


def test_each_call_is_on_disk_before_its_answer_is_used_and_half_a_line_is_mended(tmp_path):
    path = tmp_path / "r.jsonl"
    record(path, {"code": ["one", "two"]}, [question("1"), question("2")])
    whole = path.read_bytes()
    path.write_bytes(whole[:-20])  # killed while it wrote
    assert [call.answer.text for call in read_recording(path)] == ["one"]
    record(path, {"code": ["three"]}, [question("3")])
    assert [call.answer.text for call in read_recording(path)] == ["one", "three"]


def test_a_secret_never_comes_into_a_recording(tmp_path, monkeypatch):
    monkeypatch.setenv("SOME_API_KEY", "sk-very-secret-0123")
    error = LanguageModelError("scripted", "401: sk-very-secret-0123 is no key")
    record(tmp_path / "r.jsonl", {"code": ["sk-very-secret-0123", error]}, [question("sk-very-secret-0123")] * 2)
    kept = (tmp_path / "r.jsonl").read_text()
    assert "very-secret" not in kept and kept.count("[SOME_API_KEY]") == 4


def test_a_compressed_recording_is_played_and_not_added_to(tmp_path):
    record(tmp_path / "r.jsonl", {"code": ["one"]}, [question("1")])
    packed = tmp_path / "r.jsonl.gz"
    packed.write_bytes(gzip.compress((tmp_path / "r.jsonl").read_bytes()))
    assert player(packed).answer(question("1")).text == "one"
    with pytest.raises(InvalidArgument, match="compressed"):
        ReplaySettings(str(packed), record=True, inner=object())


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "it is empty"),
        (b'{"hello": 1}\n', "line 1: this is not a recording"),
        (b'{"memo_recording": 9}\n', "line 1: it is of version 9"),
        (b'{"memo_recording": 1}\n{"call": 3}\n{}\n', "line 2: this is not a recorded call .it lacks 'answer'"),
        (b'{"memo_recording": 1}\n{"foo": 3}\n{}\n', "line 2: this is not a recorded call .it lacks 'call'"),
    ],
)
def test_a_file_that_is_no_recording_is_named_with_its_line(tmp_path, content, said):
    (tmp_path / "r.jsonl").write_bytes(content)
    with pytest.raises(BadRecording, match=said):
        player(tmp_path / "r.jsonl")
    with pytest.raises(BadRecording, match="No such file"):
        player(tmp_path / "none.jsonl")


@pytest.mark.parametrize("name", ["zero", "zero.gz"])
def test_a_device_is_no_recording_and_is_not_read_for_ever(name, tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "read_bytes", lambda path: pytest.fail("it has no end"))
    (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(BadRecording, match="not a file"):
        read_recording(tmp_path / name)


def test_a_damaged_compressed_recording_is_named(tmp_path):
    packed = bytearray(gzip.compress(b"x" * 1000 + bytes(range(256)) * 9))
    packed[20:60] = b"z" * 40
    (tmp_path / "r.jsonl.gz").write_bytes(packed)
    with pytest.raises(BadRecording, match=r"r\.jsonl\.gz"):
        player(tmp_path / "r.jsonl.gz")


def test_a_recording_that_cannot_be_used_is_said_before_a_run_begins(registry, tmp_path):
    experiment = load_experiment(registry, None, [], SECTIONS)
    with pytest.raises(InvalidArgument, match=r"^--replay: .*none\.jsonl.* there is no such file"):
        replayed(experiment, registry, tmp_path / "none.jsonl")
    for wrong in (tmp_path, tmp_path / "packed.jsonl.gz"):
        with pytest.raises(InvalidArgument, match=r"^--record: .*" + wrong.name):
            recorded(experiment, registry, wrong)


def test_a_file_that_cannot_be_written_is_said_before_the_first_call(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidArgument, match="cannot be written"):
        RecordingFile(tmp_path / "file" / "r.jsonl")


def test_recording_and_replaying_keep_the_rules_of_language_backends(tmp_path):
    requests = [user("one"), user("two")]
    path = tmp_path / "r.jsonl"

    def echo() -> Recorder:
        return Recorder(ScriptedModel({"code": [lambda r: r.messages[-1].text.upper()] * 99}), path)

    check_llm(echo)
    opened = echo()
    opened.open()
    for request in requests:
        opened.answer(request)
    check_llm(lambda: Player(ReplaySettings(str(path))))
    check_language_model(lambda: Player(ReplaySettings(str(path))), requests, deterministic=True)


# -- in an experiment --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def registry():
    return Registry()


def test_the_recorded_backend_is_checked_like_any_other(registry, tmp_path):
    chosen = ["llm.backend=replay", f"llm.file={tmp_path / 'r.jsonl'}", "llm.record=true"]
    inner = ["llm.inner.backend=offline"]
    experiment = load_experiment(registry, None, [*chosen, *inner], SECTIONS)
    assert isinstance(experiment.create("llm"), Recorder)
    assert experiment.public()["llm.inner.backend"] == "offline"
    other = ["llm.inner.backend=litellm", "llm.inner.model=openai/x", "llm.inner.time_out=1"]
    with pytest.raises(ConfigErrors, match=r"llm\.inner\.time_out.*did you mean 'timeout_s'"):
        load_experiment(registry, None, [*chosen, *other], SECTIONS)
    with pytest.raises(ConfigErrors, match="unknown llm 'oflline'"):
        load_experiment(registry, None, [*chosen, "llm.inner=oflline"], SECTIONS)
    with pytest.raises(ConfigErrors, match="nothing to record"):
        load_experiment(registry, None, chosen, SECTIONS)


def events_of(folder: Path) -> list[dict]:
    """All that was observed, without what two runs cannot share."""
    lines = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
    for line in lines:
        for name in ("time", "run", "config", "wall_s"):
            line.pop(name, None)
        if line["event"] == "ModelAsked":
            line.pop("model")  # the recording is asked
    return lines


@pytest.mark.sim
def test_a_recorded_run_replays_with_the_same_events_and_no_model(registry, tmp_path):
    chosen = ["teacher.backend=simulated", "teacher.misjudges=0.0", "run.video=off"]
    told = []
    for name in ("recorded", "replayed"):
        book = [f"skillbook.url={tmp_path / name}.db"]
        experiment = load_experiment(registry, None, [*chosen, *book], SECTIONS, "put-the-cube-away", 0)
        wrap = recorded if name == "recorded" else replayed
        experiment = wrap(experiment, registry, tmp_path / "run.jsonl")
        told.append(run_experiment(experiment, registry, tmp_path / name))
    first, second = told
    assert first.success and second.success and not second.problem
    assert events_of(first.folder) == events_of(second.folder)
    assert (first.prompt_tokens, first.completion_tokens, first.cost) == (
        second.prompt_tokens,
        second.completion_tokens,
        second.cost,
    )
    kept = (tmp_path / "run.jsonl").read_text()
    assert str(tmp_path) not in kept and str(Path.home()) not in kept
    calls: list[Call] = read_recording(tmp_path / "run.jsonl")
    assert len(calls) == first.calls


# -- the demo's own recording ------------------------------------------------------------------------------------------


def with_recording(experiment, recording: str):
    """The experiment, its suite's demo coming with that recording, made on seed 4."""
    suite = experiment.choices["suite"]
    demo = attrs.evolve(suite.backend.demo, recording=recording, seed=4)
    chosen = attrs.evolve(suite, backend=attrs.evolve(suite.backend, demo=demo))
    return attrs.evolve(experiment, choices={**experiment.choices, "suite": chosen})


@pytest.fixture
def package(tmp_path, monkeypatch) -> str:
    """A package with a recording in it: a stand-in, made without any real model."""
    folder = tmp_path / "standin_suite" / "recordings"
    folder.mkdir(parents=True)
    (folder.parent / "__init__.py").write_text("")
    record(tmp_path / "r.jsonl", {"plan": ["DONE"]}, [question("what next?", "plan")])
    (folder / "demo.jsonl.gz").write_bytes(gzip.compress((tmp_path / "r.jsonl").read_bytes()))
    monkeypatch.syspath_prepend(str(tmp_path))
    return "standin_suite/recordings/demo.jsonl.gz"


def test_the_demo_plays_the_recording_that_ships_with_its_suite_on_its_seed(registry, package, monkeypatch, tmp_path):
    import memo_core.cli.demo as command
    import memo_core.demo.running as story

    taken = []

    def cut_short(experiment, *_, **__):
        taken.append(experiment)
        raise KeyboardInterrupt

    experiment = load_experiment(registry, None, [], SECTIONS)
    monkeypatch.setattr(command, "load", lambda *_, **__: (registry, with_recording(experiment, package)))
    monkeypatch.setattr(story, "run_demo", cut_short)
    with pytest.raises(KeyboardInterrupt):
        command.command(out=tmp_path, replay=True)
    [used] = taken
    assert used.seed == 4 and used.public()["llm.match"] == "situation"
    model = used.create("llm")
    model.open()
    assert model.answer(question("what next?", "plan")).text == "DONE"
    with pytest.raises(InvalidArgument, match="was made on seed 4"):
        command.command(out=tmp_path, replay=True, seed=5)
    with pytest.raises(InvalidArgument, match="one of them"):
        command.command(out=tmp_path, replay=True, record=tmp_path / "x.jsonl")


def test_a_suite_without_its_recording_says_so(registry, package):
    experiment = load_experiment(registry, None, [], SECTIONS)
    with pytest.raises(InvalidArgument, match="ships no recording"):
        shipped(with_recording(experiment, ""))
    with pytest.raises(InvalidArgument, match=r"standin_suite lacks its recording other\.gz"):
        shipped(with_recording(experiment, "standin_suite/other.gz"))
