"""The litellm backend against a real server: each thing that can happen has its stated outcome, in bounded time."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator

import attrs
import pytest
from memo_llm.litellm.model import LiteLLMModel
from memo_llm.settings import LiteLLMSettings

from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.interfaces.llm import Answer, Image, LanguageModelError, Message, Request
from memo_core.testing.llm import RULES, check_language_model, user
from tests.support.fake_openai_server import Reply, Wire, error

pytestmark = pytest.mark.wire

SCHEMA = {"type": "object", "properties": {"general": {"type": "string"}}, "required": ["general"]}


@pytest.fixture(autouse=True)
def no_keys(monkeypatch):
    for name in ("OPENAI_API_KEY", "GEMINI_API_KEY", "GOOGLE_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="module", autouse=True)
def imported() -> None:
    """LiteLLM takes seconds to import, some of it with the first answer: no call's time is about that."""
    with Wire() as wire:
        model_at(wire, timeout_s=250.0).answer(user("hi"))


@pytest.fixture
def served() -> Iterator[Wire]:
    with Wire() as wire:
        yield wire


def model_at(wire: Wire, **settings) -> LiteLLMModel:
    model = LiteLLMModel(LiteLLMSettings(**{"model": "openai/x", "api_base": wire.base, "timeout_s": 5.0, **settings}))
    model.open()
    return model


def failed(model: LiteLLMModel, request: Request | None = None, **how) -> LanguageModelError:
    with pytest.raises(LanguageModelError) as raised:
        model.answer(request or user("hi"), **how)
    return raised.value


def test_an_answer_comes_as_written_with_what_it_cost(served):
    model = model_at(served, prompt_price=2.0, completion_price=10.0, temperature=0.5, max_answer_tokens=77)
    answer = model.answer(Request("plan", (Message("system", "Be brief."), Message("user", "hi")), seed=7))
    assert (answer.text, answer.finish, answer.model) == ("hello", "stop", "x")
    [asked] = served.asked
    assert asked.path == "/v1/chat/completions"
    assert asked.texts == ["Be brief.", "hi"]
    sent = asked.body
    assert (sent["model"], sent["seed"], sent["temperature"], sent["max_tokens"]) == ("x", 7, 0.5, 77)
    assert not sent.get("stream") and "response_format" not in sent
    assert (answer.usage.prompt_tokens, answer.usage.completion_tokens) == (3, 2)
    assert answer.usage.cost == pytest.approx((3 * 2.0 + 2 * 10.0) / 1e6)
    assert answer.usage.latency_s > 0


def test_a_price_is_litellms_or_the_configs_or_unknown_with_the_remedy(served):
    known = model_at(served, model="openai/gpt-4o")
    assert known.unpriced() == "" and known.answer(user("hi")).usage.cost > 0
    unlisted = model_at(served, model="gemini/gemini-3-pro-preview")
    assert unlisted.unpriced(), "on litellm's list without a price, and that is no price of 0"
    unknown = model_at(served)
    assert "llm.prompt_price" in unknown.unpriced() and unknown.answer(user("hi")).usage.cost is None
    assert model_at(served, prompt_price=0.0, completion_price=0.0).unpriced() == ""
    own = model_at(served, model="ollama_chat/llama3")
    assert own.unpriced() == "", "a server of one's own costs nothing"


@pytest.mark.parametrize("model", ["openai/x", "hosted_vllm/x"])
def test_a_stream_arrives_in_pieces_and_is_counted(model):
    with Wire(["one two three"]) as wire:
        pieces: list[str] = []
        answer = model_at(wire, model=model).answer(user("hi"), on_text=pieces.append)
        assert answer.text == "one two three" == "".join(pieces) and len(pieces) >= 3
        assert wire.asked[0].body["stream"] is True
        assert answer.usage.completion_tokens == len("one two three") // 3 + 1


def test_a_stream_that_nobody_counts_is_counted_here():
    with Wire([Reply("one two three four", counts=False)]) as wire:
        usage = model_at(wire).answer(user("a question of some length"), on_text=lambda piece: None).usage
        assert usage.prompt_tokens > 0 and usage.completion_tokens > 0


def test_a_whole_answer_of_a_server_that_cannot_stream_is_taken_and_asked_for_from_then_on():
    with Wire([Reply("whole", streams=False, finish="length", cached=1)]) as wire:
        model = model_at(wire)
        answers = [model.answer(user("hi"), on_text=lambda piece: None) for _ in range(2)]
        assert [bool(asked.body.get("stream")) for asked in wire.asked] == [True, False]
    first, second = (attrs.evolve(one, usage=attrs.evolve(one.usage, latency_s=0.0)) for one in answers)
    assert first == second and (first.text, first.finish, first.usage.cached_tokens) == ("whole", "length", 1)


def test_a_whole_answer_that_is_too_long_to_be_recorded_is_asked_for_again():
    with Wire([Reply("word " * 5000, streams=False)]) as wire:
        assert model_at(wire).answer(user("hi"), on_text=lambda piece: None).text == "word " * 5000
        assert [bool(asked.body.get("stream")) for asked in wire.asked] == [True, False]


def test_pictures_are_sent_inline(served):
    message = Message("user", "What is this?", (Image(b"\x89PNG", "image/png"), Image(b"\xff\xd8", "image/jpeg")))
    model_at(served).answer(Request("look", (message,)))
    assert served.asked[0].texts == ["What is this?"]
    assert served.asked[0].pictures == ["data:image/png;base64,iVBORw==", "data:image/jpeg;base64,/9g="]


# -- schemas -----------------------------------------------------------------------------------------------------------
def test_a_schema_is_sent_where_the_server_takes_it(served):
    model_at(served).answer(Request("feedback", (Message("user", "hi"),), SCHEMA))
    assert served.asked[0].body["response_format"]["json_schema"]["schema"] == SCHEMA
    assert served.asked[0].texts == ["hi"]


def picky(asked) -> Reply:
    if "response_format" in asked.body:
        return error(400, "'response_format' of type 'json_schema' is not supported with this model")
    return Reply('{"general": "go slowly"}')


@pytest.mark.parametrize("stream", [True, False])
def test_a_schema_that_the_server_rejects_is_said_in_words_and_that_is_remembered(stream):
    with Wire(picky) as wire:
        model = model_at(wire)
        on_text = (lambda piece: None) if stream else None
        request = Request("feedback", (Message("user", "hi"),), SCHEMA)
        assert json.loads(model.answer(request, on_text=on_text).text) == {"general": "go slowly"}
        tries = len(wire.asked)
        assert json.dumps(SCHEMA) in wire.asked[-1].texts[-1] and wire.asked[-1].texts[0] == "hi"
        model.answer(request, on_text=on_text)
        assert len(wire.asked) == tries + 1, "it forgot"
        assert "response_format" not in wire.asked[-1].body and json.dumps(SCHEMA) in wire.asked[-1].texts[-1]


def test_a_schema_can_be_turned_off(served):
    model_at(served, schema="off").answer(Request("feedback", (Message("user", "hi"),), SCHEMA))
    assert "response_format" not in served.asked[0].body and json.dumps(SCHEMA) in served.asked[0].texts[-1]


def test_a_question_that_is_rejected_for_another_reason_changes_nothing():
    with Wire([error(400, "too long"), error(400, "too long"), "fine"]) as wire:
        model = model_at(wire)
        request = Request("feedback", (Message("user", "hi"),), SCHEMA)
        problem = failed(model, request)
        assert "too long" in problem.problem and not problem.retryable and problem.usage is None
        model.answer(request)
        assert "response_format" in wire.asked[-1].body


# -- how it ends -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("stream", [True, False])
@pytest.mark.parametrize(
    ("reply", "finish", "text"),
    [
        (Reply("half a", finish="length"), "length", "half a"),
        (Reply("", finish="content_filter"), "refusal", ""),
        (Reply("", refusal="I would rather not."), "refusal", "I would rather not."),
        (Reply(""), "stop", ""),
    ],
)
def test_it_says_why_an_answer_ended(reply, finish, text, stream):
    with Wire([reply]) as wire:
        answer = model_at(wire).answer(user("hi"), on_text=(lambda piece: None) if stream else None)
        assert (answer.finish, answer.text) == (finish, text)


@pytest.mark.parametrize(
    ("reply", "words", "retryable", "after"),
    [
        (error(429, "slow down", Retry_After="7"), "429", True, 7.0),
        (error(429, "slow down"), "429", True, None),
        (error(429, "You exceeded your current quota: insufficient_quota"), "quota", False, None),
        (error(500, "oops"), "500", True, None),
        (error(503, "overloaded", Retry_After="2"), "503", True, 2.0),
        (error(400, "bad question"), "bad question", False, None),
        (error(401, "no such key"), "api_key_env", False, None),
        (error(404, "no such model"), "no such model", False, None),
        (Reply(body=b'{"choices": ['), "cannot be read", False, None),
        (Reply(body=b"<html>a proxy's page</html>"), "cannot be read", False, None),
        (Reply(body=b'{"choices": []}'), "cannot be read", False, None),
        (Reply(body=b"null"), "cannot be read", False, None),
        (Reply(cut_after=0), "cut the connection", True, None),
        (Reply(cut_after=30), "cut the connection", True, None),
    ],
)
@pytest.mark.parametrize("model", ["openai/x", "hosted_vllm/x"])
def test_an_error_says_what_the_server_said_and_whether_asking_again_may_help(model, reply, words, retryable, after):
    with Wire([reply]) as wire:
        started = time.monotonic()
        problem = failed(model_at(wire, model=model, timeout_s=60.0))
        assert words in problem.problem, problem.problem
        assert (problem.retryable, problem.retry_after_s) == (retryable, after)
        assert len(wire.asked) == 1, "it asked again by itself"
        assert (problem.usage is not None) == (reply.status == 200), "an answer that was lost was paid for"
        assert time.monotonic() - started < 30.0, "it waited for the time-out instead"


def test_a_stream_that_is_cut_is_no_answer():
    with Wire([Reply("one two three four five", cut_after=3)]) as wire:
        problem = failed(model_at(wire), on_text=lambda piece: None)
        assert problem.retryable and "cut the connection" in problem.problem
        assert problem.usage is not None and problem.usage.prompt_tokens > 0


@pytest.mark.parametrize("stream", [True, False])
@pytest.mark.parametrize("reply", [Reply(silent_s=60.0), Reply("w " * 400, drip_s=0.05)], ids=["silent", "dripping"])
def test_the_time_limit_bounds_all_of_a_call_and_the_connection_is_closed(reply, stream):
    with Wire([reply]) as wire:
        model = model_at(wire, timeout_s=0.4)
        started = time.monotonic()
        problem = failed(model, on_text=(lambda piece: None) if stream else None)
        assert 0.35 < time.monotonic() - started < 10.0
        assert "timeout_s" in problem.problem and not problem.retryable
        assert problem.usage is not None, "it was asked, so it probably costs"
        assert wire.hung_up.wait(10.0), "the server still works for nobody"


@pytest.mark.parametrize("stream", [True, False])
def test_a_call_that_is_given_up_ends_at_once_and_closes_the_connection(stream):
    with Wire([Reply("w " * 400, silent_s=0.3, drip_s=0.05)]) as wire:
        model = model_at(wire, timeout_s=30.0)
        given_up = threading.Event()
        threading.Timer(0.6, given_up.set).start()
        started = time.monotonic()
        problem = failed(model, on_text=(lambda piece: None) if stream else None, cancelled=given_up.is_set)
        assert time.monotonic() - started < 10.0
        assert "given up" in problem.problem and not problem.retryable and problem.usage is not None
        assert wire.hung_up.wait(10.0)


def test_an_address_where_nobody_ever_answered_is_not_worth_another_try():
    with Wire() as wire:
        model = model_at(wire)
        gone = model_at(wire)
        gone.answer(user("hi"))
    problem = failed(model)
    assert "cannot be reached" in problem.problem and wire.base in problem.problem
    assert not problem.retryable and problem.usage is None
    assert failed(gone).retryable, "a server that was there may come back"


def test_no_more_calls_are_under_way_than_allowed():
    with Wire([Reply(silent_s=0.15)]) as wire:
        model = model_at(wire, max_concurrent=2)
        answers: list[Answer] = []
        threads = [threading.Thread(target=lambda: answers.append(model.answer(user("hi")))) for _ in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(10.0)
        assert len(answers) == 6 and wire.most_under_way == 2


# -- keys and names ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("model", "variable"),
    [
        ("gemini/gemini-3-flash-preview", "GEMINI_API_KEY"),
        ("openai/gpt-4o", "OPENAI_API_KEY"),
        ("anthropic/claude-sonnet-4-5", "ANTHROPIC_API_KEY"),
    ],
)
def test_a_missing_key_names_the_variable_to_set(model, variable):
    with pytest.raises(BackendUnavailable, match=f"export {variable}="):
        LiteLLMModel(LiteLLMSettings(model=model)).open()


def test_the_key_is_read_from_the_variable_that_the_config_names(served, monkeypatch):
    with pytest.raises(BackendUnavailable, match="export LAB_KEY="):
        model_at(served, api_key_env="LAB_KEY")
    monkeypatch.setenv("LAB_KEY", "key-of-the-lab")
    monkeypatch.setenv("OPENAI_API_KEY", "another-key")
    model_at(served, api_key_env="LAB_KEY").answer(user("hi"))
    model_at(served).answer(user("hi"))
    assert [asked.headers["authorization"] for asked in served.asked] == ["Bearer key-of-the-lab", "Bearer another-key"]


def test_a_server_of_ones_own_needs_no_key(served):
    model_at(served).answer(user("hi"))
    assert "none" in served.asked[0].headers["authorization"]


def test_names_that_mean_nothing_are_refused_with_what_would_be_right():
    with pytest.raises(InvalidArgument, match="provider/model"):
        LiteLLMSettings(model="gpt-4o")
    with pytest.raises(InvalidArgument, match="no provider 'opnai'"):
        LiteLLMModel(LiteLLMSettings(model="opnai/gpt-4o")).open()
    with pytest.raises(InvalidArgument, match="api_key_env"):
        LiteLLMSettings(model="openai/x", options={"api_key": "sk-1"})
    with pytest.raises(InvalidArgument, match="completion_price"):
        LiteLLMSettings(model="openai/x", prompt_price=1.0)


def test_further_options_reach_the_server(served):
    model_at(served, options={"top_p": 0.5, "extra_body": {"guided": True}}).answer(user("hi"))
    assert served.asked[0].body["top_p"] == 0.5 and served.asked[0].body["guided"] is True


# -- the suites --------------------------------------------------------------------------------------------------------
def echo(asked) -> Reply:
    return Reply(f"You said: {asked.texts[-1][:200]}")


@pytest.mark.parametrize("rule", RULES)
def test_it_keeps_the_rules_of_language_backends(rule):
    with Wire(echo) as wire:
        RULES[rule](lambda: LiteLLMModel(LiteLLMSettings(model="openai/x", api_base=wire.base, timeout_s=10.0)))


def test_it_keeps_the_rules_for_questions_it_can_answer():
    with Wire(echo) as wire:
        make = lambda: LiteLLMModel(LiteLLMSettings(model="openai/x", api_base=wire.base, timeout_s=10.0))
        check_language_model(make, [user("one"), user("two")], deterministic=True)
