"""``memo llm check``: what a server does with MEMO's questions, and what an experiment will cost."""

from __future__ import annotations

import io
import json
from collections.abc import Callable

import pytest

from memo_core.cli.main import main
from memo_core.interfaces.llm import Message, Request
from memo_core.policy.example_questions import SCENE
from tests.support.fake_openai_server import Asked, Reply, Wire, error
from tests.support.offline_prompts import MODEL

PHASES = ["plan", "code", "code again", "feedback", "template", "merge", "cluster"]
PRICES = ("llm.prompt_price=2", "llm.completion_price=10", "llm.cached_price=0.5")


def sensible(asked: Asked, **how) -> Reply:
    """The offline backend's answer, as a server sends it."""
    messages = [Message(one["role"], text) for one, text in zip(asked.body["messages"], asked.texts, strict=True)]
    return Reply(MODEL.answer(Request("", tuple(messages))).text, **how)


class Memory:
    """A server that has cached the prompts that it has seen."""

    def __init__(self) -> None:
        self.seen: list[list[str]] = []

    def __call__(self, asked: Asked) -> Reply:
        known = asked.texts in self.seen
        self.seen.append(asked.texts)
        return sensible(asked, cached=1000 if known else 0)


def picky(asked: Asked) -> Reply:
    if "response_format" in asked.body:
        return error(400, "'response_format' of type 'json_schema' is not supported with this model")
    return sensible(asked)


@pytest.fixture(autouse=True)
def elsewhere(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in ("OPENAI_API_KEY", "GEMINI_API_KEY", "GOOGLE_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.delenv(name, raising=False)


def memo(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(["llm", "check", *arguments])
    return int(ended.value.code or 0)


def checked(reply: Callable[[Asked], Reply], capsys, *settings: str, file: str = "") -> tuple[int, dict, str, Wire]:
    """Exit code, the document on stdout, stderr, and the server."""
    with Wire(reply) as wire:
        own = ("llm.backend=litellm", "llm.model=openai/x", f"llm.api_base={wire.base}", "run.retries=0", *settings)
        code = memo(*([file] if file else []), "--json", "--yes", *(part for one in own for part in ("--set", one)))
    told = capsys.readouterr()
    return code, json.loads(told.out), told.err, wire


def states(shown: dict) -> dict[str, str]:
    return {name: state for name, (state, _) in shown["abilities"].items()}


# -- servers that answer well ------------------------------------------------------------------------------------------
@pytest.mark.wire
def test_a_server_that_can_do_everything_is_reported_as_such(capsys):
    code, shown, err, wire = checked(Memory(), capsys, *PRICES)
    assert code == 0 and shown["works"] and not shown["ended"]
    assert states(shown) == {"streaming": "yes", "JSON schema": "yes", "caching": "yes"}
    assert [one["phase"] for one in shown["asked"]] == PHASES and len(wire.asked) == 7
    code_first, code_again = shown["asked"][1:3]
    assert (code_first["usage"]["cached_tokens"], code_again["usage"]["cached_tokens"]) == (0, 1000)
    assert code_again["usage"]["cost"] < code_first["usage"]["cost"]
    assert all(one["first_text_s"] <= one["usage"]["latency_s"] + 0.1 and not one["problem"] for one in shown["asked"])
    assert "7 questions to openai/x, about $0.0" in err


@pytest.mark.wire
def test_the_questions_are_those_of_a_run(capsys):
    _, _, _, wire = checked(Memory(), capsys)
    systems = {asked.texts[0] for asked in wire.asked if asked.body["messages"][0]["role"] == "system"}
    assert len(systems) >= 1 and sum("response_format" in asked.body for asked in wire.asked) == 2
    assert wire.asked[1].body["messages"] == wire.asked[2].body["messages"]


def test_the_offline_backend_answers_all_questions_for_nothing_and_unasked(capsys):
    assert memo("--set", "llm.backend=offline") == 0
    told = capsys.readouterr()
    assert [line.split("  ")[0] for line in told.out.splitlines()[2:9]] == PHASES
    assert "streaming: no" in told.out and "typical: 3 subtasks" in told.out
    assert "7 questions to offline, free" in told.err


@pytest.mark.wire
def test_the_correction_of_the_example_names_what_it_measures_from_and_keeps_the_fingers_above_the_table(capsys):
    _, _, _, wire = checked(sensible, capsys)
    corrected = [text for asked in wire.asked for text in asked.texts if "2 cm" in text]
    assert len(corrected) >= 4, "code twice, feedback, cluster"
    for text in corrected:
        assert text.count("2 cm below its middle") == text.count("2 cm")
    brick = next(node for node in SCENE.nodes if node.label == "brick")
    assert brick.pose.position[2] - 0.02 > 0.03 and brick.pose.position[2] == brick.size[2] / 2


# -- servers that do not -----------------------------------------------------------------------------------------------
@pytest.mark.wire
def test_a_refused_key_is_one_line_and_no_other_question_is_asked(capsys):
    code, shown, err, wire = checked(lambda asked: error(401, "invalid api key", code="invalid_api_key"), capsys)
    assert code == 1 and len(wire.asked) == 1 and not shown["works"]
    assert "(401" in shown["ended"] and shown["ended"] in err and len(shown["asked"]) == 1
    assert shown["experiment"] == {"problem": "the question of 'code' was not asked"}


@pytest.mark.wire
def test_an_address_at_which_nobody_listens_is_one_line(capsys):
    given = ("llm.backend=litellm", "llm.model=openai/x", "llm.api_base=http://127.0.0.1:9/v1")
    assert memo("--yes", *(part for one in given for part in ("--set", one))) == 1
    assert "cannot be reached" in capsys.readouterr().err


@pytest.mark.wire
def test_a_server_that_refuses_schemas_can_be_used_and_that_is_said(capsys):
    code, shown, _, _ = checked(picky, capsys)
    assert code == 0 and shown["abilities"]["JSON schema"] == [
        "no",
        "the server rejects it, so the form of an answer is described in words",
    ]


@pytest.mark.wire
def test_a_server_that_cannot_stream_can_be_used_and_that_is_said(capsys):
    code, shown, err, wire = checked(lambda asked: sensible(asked, streams=False), capsys)
    assert code == 0 and states(shown)["streaming"] == "no"
    assert "7 questions to openai/x" in err and len(wire.asked) == 7
    assert all(one["first_text_s"] is None for one in shown["asked"])


@pytest.mark.wire
@pytest.mark.parametrize(("text", "problem"), [("", "is empty"), ("Certainly! I am glad to assist.", "no subtask")])
def test_answers_that_no_run_could_use_are_named_and_all_questions_are_asked(text, problem, capsys):
    code, shown, _, wire = checked(lambda asked: Reply(text), capsys)
    assert code == 1 and not shown["works"] and not shown["ended"]
    assert [one["phase"] for one in shown["asked"] if one["problem"]] == PHASES
    assert problem in shown["asked"][0]["problem"]
    assert len(wire.asked) >= 7 and states(shown)["JSON schema"] == "unknown"


@pytest.mark.wire
def test_without_a_count_of_tokens_nothing_is_claimed_of_caching(capsys):
    code, shown, _, _ = checked(lambda asked: sensible(asked, counts=False), capsys)
    assert code == 0 and states(shown)["caching"] == "unknown"
    assert "does not count tokens" in shown["abilities"]["caching"][1]
    assert shown["experiment"]["runs"][0]["typical"]["cost"] is None, "nobody knows the price either"


@pytest.mark.wire
def test_a_server_that_counts_and_caches_nothing_is_said_not_to_cache(capsys):
    _, shown, _, _ = checked(sensible, capsys)
    assert states(shown)["caching"] == "no"


@pytest.mark.wire
def test_the_limit_of_a_run_holds_for_the_check(capsys):
    with Wire(sensible) as wire:
        given = ("llm.backend=litellm", "llm.model=openai/x", f"llm.api_base={wire.base}", "run.max_tokens=100")
        assert memo("--yes", *(part for one in given for part in ("--set", one))) == 1
        assert len(wire.asked) == 1 and "run.max_tokens is 100" in capsys.readouterr().err


@pytest.mark.wire
def test_nothing_is_asked_of_a_model_that_costs_before_a_person_agrees(capsys, monkeypatch):
    monkeypatch.setattr("memo_core.cli.standard_input.answer_to", lambda question: "n")
    with Wire(sensible) as wire:
        given = ("llm.backend=litellm", "llm.model=openai/x", f"llm.api_base={wire.base}")
        assert memo(*(part for one in given for part in ("--set", one))) == 2
    assert not wire.asked and "nothing was asked" in capsys.readouterr().err


def test_where_no_answer_can_come_the_option_that_needs_none_is_named(capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    given = ("llm.backend=litellm", "llm.model=openai/x", "llm.api_base=http://127.0.0.1:9/v1")
    assert memo(*(part for one in given for part in ("--set", one))) == 2
    assert "--yes" in capsys.readouterr().err


# -- prices ------------------------------------------------------------------------------------------------------------
@pytest.mark.wire
def test_an_experiment_is_priced_by_its_runs_and_the_measured_tokens(capsys, tmp_path):
    (tmp_path / "e.yaml").write_text(
        "suite: tabletop\n"
        "study: {histories: 2, rounds: 3, tasks: [put-the-food-in-the-microwave]}\n"
        "evaluation: {methods: [memo], hours: [0, 1], scenes: 4, tasks: [put-the-food-in-the-microwave]}\n"
    )
    _, shown, _, _ = checked(sensible, capsys, *PRICES, file="e.yaml")
    runs = {one["kind"]: one for one in shown["experiment"]["runs"]}
    assert {kind: one["runs"] for kind, one in runs.items()} == {
        "study": 2 * 3,
        "evaluation, zero-shot": 2 * 4 * 2,
        "evaluation, corrected": 2 * 4,
    }
    usage = {one["phase"]: one["usage"] for one in shown["asked"]}
    typical = {"plan": 5, "code": 5, "feedback": 1, "template": 3}  # of a run that is corrected once
    study = runs["study"]["typical"]
    assert study["questions"] == 6 * sum(typical.values())
    assert study["cost"] == pytest.approx(6 * sum(n * usage[phase]["cost"] for phase, n in typical.items()))
    zero = runs["evaluation, zero-shot"]
    assert zero["upper"]["questions"] == 16 * (13 + 12 * 3), "12 subtasks with 2 repairs each, and nobody corrects"
    assert all(one["typical"]["cost"] < one["upper"]["cost"] for one in runs.values())


def test_a_file_with_neither_study_nor_evaluation_is_priced_as_one_run_within_its_limits(capsys):
    given = ("llm.backend=offline", "run.subtasks=2", "run.attempts=2", "run.repairs=0")
    assert memo("--json", *(part for one in given for part in ("--set", one))) == 0
    [run] = json.loads(capsys.readouterr().out)["experiment"]["runs"]
    assert (run["runs"], run["upper"]["questions"]) == (1, 5 + 4 + 4 + 2 + 2)  # plan, code, feedback, template, merge
    assert run["typical"]["questions"] <= run["upper"]["questions"]
