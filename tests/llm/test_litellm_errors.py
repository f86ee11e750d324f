"""Errors of providers keep their cause and their words, and say whether asking again may help."""

from __future__ import annotations

import json
import socket

import pytest
from memo_llm.litellm.model import LiteLLMModel
from memo_llm.settings import LiteLLMSettings

from memo_core.interfaces.llm import Answer, LanguageModelError
from memo_core.testing.llm import user
from tests.support.fake_openai_server import Reply, Wire, error, events, report

pytestmark = pytest.mark.wire

KEYS = {
    "OPENAI_API_KEY": "sk-0123456789abcdef",
    "GEMINI_API_KEY": "AIza0123456789abcdef",
    "ANTHROPIC_API_KEY": "sk-ant-0123456789abcdef",
}


@pytest.fixture(autouse=True)
def keys(monkeypatch):
    monkeypatch.delenv("GOOGLE_API_KEY", raising=False)
    for name, value in KEYS.items():
        monkeypatch.setenv(name, value)


def model_at(base: str, name: str = "openai/x", **settings) -> LiteLLMModel:
    model = LiteLLMModel(LiteLLMSettings(**{"model": name, "api_base": base, "timeout_s": 60.0, **settings}))
    model.open()
    return model


def ask(model: LiteLLMModel, stream: bool = False) -> Answer:
    return model.answer(user("hi"), on_text=(lambda piece: None) if stream else None)


def failed(model: LiteLLMModel, stream: bool = False) -> LanguageModelError:
    with pytest.raises(LanguageModelError) as raised:
        ask(model, stream)
    return raised.value


# -- causes ------------------------------------------------------------------------------------------------------------
def google(status: int, code: str, message: str, *details: dict) -> Reply:
    return report(status, {"error": {"code": status, "message": message, "status": code, "details": list(details)}})


def anthropic(status: int, kind: str, message: str) -> Reply:
    return report(status, {"type": "error", "error": {"type": kind, "message": message}})


def page(status: int, title: str) -> Reply:
    body = f"<!DOCTYPE html><html><head><title>{title}</title></head><body>…</body></html>".encode()
    return Reply(status=status, body=body, headers={"Content-Type": "text/html"})


def text(status: int, words: str) -> Reply:
    return Reply(status=status, body=words.encode(), headers={"Content-Type": "text/plain; charset=utf-8"})


RETRY = {"@type": "type.googleapis.com/google.rpc.RetryInfo", "retryDelay": "22.5s"}
PER_MINUTE = {"violations": [{"quotaId": "GenerateRequestsPerMinutePerProjectPerModel-FreeTier"}]}
PER_DAY = {"violations": [{"quotaId": "GenerateRequestsPerDayPerProjectPerModel-FreeTier"}]}
BAD_KEY = {"reason": "API_KEY_INVALID", "domain": "googleapis.com"}
QUOTA = "You exceeded your current quota, please check your plan and billing details."
TOO_FAST = (
    "Rate limit reached for x on tokens per min (TPM): Limit 10000, Used 9990. Please try again in 6ms. You can "
    "increase your rate limit by adding a payment method at https://platform.openai.com/account/billing."
)
FILTERED = "The response was filtered due to the prompt triggering the content management policy."

REPORTS = [
    ("openai/x", error(401, "Incorrect API key provided", code="invalid_api_key"), "access"),
    ("openai/x", error(400, "Incorrect API key provided: xai-..."), "access"),
    ("openai/x", error(403, "Country, region, or territory not supported"), "access"),
    ("openai/x", error(404, "The model `x` does not exist or you do not have access to it."), "access"),
    ("openai/x", error(400, "x is not a valid model ID"), "access"),
    ("openai/x", error(404, "No endpoints found for x."), "access"),
    ("gemini/x", google(400, "INVALID_ARGUMENT", "API key not valid. Please pass a valid API key.", BAD_KEY), "access"),
    ("gemini/x", google(404, "NOT_FOUND", "models/x is not found for API version v1beta"), "access"),
    ("anthropic/x", anthropic(401, "authentication_error", "invalid x-api-key"), "access"),
    ("anthropic/x", anthropic(404, "not_found_error", "model: x"), "access"),
    ("ollama_chat/x", report(404, {"error": "model 'x' not found, try pulling it first"}), "access"),
    ("openai/x", error(429, QUOTA, code="insufficient_quota"), "quota"),
    ("openai/x", error(429, QUOTA), "quota"),
    ("openai/x", error(402, "Insufficient Balance"), "quota"),
    ("openai/x", error(403, "Your billing account is not active"), "quota"),
    ("anthropic/x", anthropic(400, "invalid_request_error", "Your credit balance is too low."), "quota"),
    ("gemini/x", google(429, "RESOURCE_EXHAUSTED", QUOTA), "quota"),
    ("gemini/x", google(429, "RESOURCE_EXHAUSTED", QUOTA, PER_DAY, RETRY), "quota"),
    ("gemini/x", google(429, "RESOURCE_EXHAUSTED", f"{QUOTA} Quota exceeded, limit: 0, model: x", RETRY), "quota"),
    ("gemini/x", google(429, "RESOURCE_EXHAUSTED", QUOTA, PER_MINUTE, RETRY), "busy"),
    ("gemini/x", google(429, "RESOURCE_EXHAUSTED", f"{QUOTA} Please retry in 22.5s."), "busy"),
    ("openai/x", error(429, TOO_FAST, code="rate_limit_exceeded"), "busy"),
    ("openai/x", error(429, QUOTA, Retry_After="7"), "busy"),
    ("openai/x", error(408, "Request timed out."), "busy"),
    ("openai/x", error(503, "The server is overloaded"), "busy"),
    ("anthropic/x", anthropic(529, "overloaded_error", "Overloaded"), "busy"),
    ("openai/x", page(502, "502 Bad Gateway"), "busy"),
    ("openai/x", report(200, {"error": {"message": "Provider returned error", "code": 502}}), "busy"),
    ("openai/x", report(200, {"error": {"message": "slow down", "type": "rate_limit_error"}}), "busy"),
    ("openai/x", report(200, {"error": {"message": "no money", "code": 402}}), "quota"),
    ("openai/x", report(200, {"error": {"message": "Something odd happened"}}), ""),
    ("openai/x", page(200, "Sign in to the hospital's network"), "unreachable"),
    ("openai/x", page(403, "Access denied by the proxy"), "unreachable"),
    ("openai/x", text(200, "Blocked by your network's policy"), "unreachable"),
    ("openai/x", text(401, "Unauthorized"), "access"),
    ("openai/x", report(404, {"detail": "Not Found"}), "unreachable"),
    ("openai/x", text(404, "404 page not found"), "unreachable"),
    ("openai/x", error(400, FILTERED, code="content_filter"), "refusal"),
    ("openai/x", error(400, "This model's maximum context length is 8192 tokens."), ""),
]


@pytest.mark.parametrize(("name", "reply", "cause"), REPORTS)
@pytest.mark.parametrize("stream", [False, True], ids=["whole", "stream"])
def test_an_error_has_the_cause_that_its_provider_means(name, reply, cause, stream):
    with Wire([reply]) as wire:
        problem = failed(model_at(wire.base, name), stream)
    assert problem.cause == cause, problem
    assert problem.retryable == (cause == "busy")
    assert problem.persistent == (cause in ("access", "quota", "unreachable"))


@pytest.mark.parametrize(("name", "reply", "cause"), REPORTS)
def test_an_error_is_in_its_providers_words_and_says_who_where_and_no_name_of_an_exception(name, reply, cause):
    with Wire([reply]) as wire:
        said = str(failed(model_at(wire.base, name)))
        assert f"language model {name!r}" in said and wire.base in said
    body = reply.body.decode()
    if reply.headers.get("Content-Type") == "text/html":
        words = body.partition("<title>")[2].partition("</title>")[0]
    elif body.startswith("{"):
        found = json.loads(body)
        found = found.get("error") or found["detail"]
        words = found["message"] if isinstance(found, dict) else found
    else:
        words = body
    assert words in said
    assert "Error:" not in said and "Exception" not in said and "{" not in said


def test_the_words_of_the_provider_behind_a_router_are_passed_on():
    metadata = {"raw": "upstream: model is warming up", "provider_name": "Somewhere"}
    with Wire(
        [report(200, {"error": {"message": "Provider returned error", "code": 503, "metadata": metadata}})]
    ) as wire:
        assert "Provider returned error: upstream: model is warming up" in failed(model_at(wire.base)).problem


def test_a_delay_in_the_body_counts_as_one_in_the_head():
    with Wire([google(429, "RESOURCE_EXHAUSTED", QUOTA, PER_MINUTE, RETRY)]) as wire:
        assert failed(model_at(wire.base, "gemini/x")).retry_after_s == 22.5


def test_a_refused_key_is_named_by_its_variable_and_never_shown():
    with Wire([error(401, f"Incorrect API key provided: {KEYS['OPENAI_API_KEY']}")]) as wire:
        problem = failed(model_at(wire.base))
    assert "refuses the key in OPENAI_API_KEY (401; export another)" in problem.problem
    assert KEYS["OPENAI_API_KEY"] not in str(problem)


def test_a_time_limit_is_a_cause():
    with Wire([Reply(silent_s=60.0)]) as wire:
        problem = failed(model_at(wire.base, timeout_s=0.4))
    assert problem.cause == "timeout" and not problem.persistent and not problem.retryable


def free_port() -> int:
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])


@pytest.mark.parametrize(
    "where", ["http://127.0.0.1:{free}/v1", "http://no-such-host.invalid/v1", "https://127.0.0.1:{wire}"]
)
def test_an_address_without_a_model_behind_it_is_unreachable(where):
    with Wire() as wire:
        base = where.format(free=free_port(), wire=wire.base.rpartition(":")[2])
        problem = failed(model_at(base))
    assert problem.cause == "unreachable" and not problem.retryable, problem
    assert "cannot be reached" in problem.problem and base in problem.problem and problem.usage is None


def test_a_web_server_that_is_no_server_of_models_is_said_to_be_none_and_not_asked_again():
    with Wire([page(501, "Error response")]) as wire:
        problem = failed(model_at(wire.base))
    assert problem.cause == "unreachable" and not problem.retryable
    assert "does not look like an OpenAI-compatible server" in problem.problem and "llm.api_base" in problem.problem


def test_a_proxy_that_does_not_connect_makes_a_server_unreachable(monkeypatch):
    with Wire() as proxy:
        monkeypatch.setenv("HTTPS_PROXY", proxy.base)
        problem = failed(model_at("https://llm.lab.invalid/v1"))
    assert problem.cause == "unreachable" and "the proxy refuses to connect to it (501)" in problem.problem
    assert problem.usage is None


# -- streams -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "reply",
    [Reply("one two three", finish=None), Reply("one two three", done=False)],
    ids=["no finish reason", "no end mark"],
)
def test_a_stream_that_is_complete_is_an_answer_though_one_sign_of_its_end_is_missing(reply):
    with Wire([reply]) as wire:
        answer = ask(model_at(wire.base), stream=True)
    assert (answer.text, answer.finish, answer.note) == ("one two three", "stop", "")


def test_a_stream_without_any_sign_of_its_end_is_told_as_cut_off_and_asked_for_whole_from_then_on():
    with Wire([Reply("one two three", finish=None, done=False)]) as wire:
        model = model_at(wire.base)
        problem = failed(model, stream=True)
        assert problem.retryable and "cut the connection in the middle of the answer" in problem.problem
        assert problem.usage is not None
        assert ask(model, stream=True).text == "one two three"
        assert [bool(asked.body.get("stream")) for asked in wire.asked] == [True, False]


def test_a_stream_that_says_nothing_at_all_is_no_answer():
    body = b"data: [DONE]\n\n"
    with Wire([Reply(body=body, headers={"Content-Type": "text/event-stream"})]) as wire:
        problem = failed(model_at(wire.base), stream=True)
    assert "cannot be read: it holds no choices" in problem.problem


def gemini(**candidate) -> dict:
    usage = {"promptTokenCount": 5, "candidatesTokenCount": 1, "totalTokenCount": 6}
    return {"candidates": [{"index": 0, **candidate}], "modelVersion": "x", "usageMetadata": usage}


HELLO = {"content": {"role": "model", "parts": [{"text": "hello"}]}}


def test_a_stream_of_gemini_whose_reason_comes_with_the_text_is_an_answer():
    with Wire([events(gemini(**HELLO, finishReason="STOP"))]) as wire:
        assert ask(model_at(wire.base, "gemini/x"), stream=True).text == "hello"


def claude(*last: dict) -> Reply:
    empty = {"id": "m", "type": "message", "role": "assistant", "model": "x", "content": [], "stop_reason": None}
    return events(
        {"type": "message_start", "message": {**empty, "usage": {"input_tokens": 10, "output_tokens": 1}}},
        {"type": "content_block_start", "index": 0, "content_block": {"type": "text", "text": ""}},
        {"type": "content_block_delta", "index": 0, "delta": {"type": "text_delta", "text": "hello"}},
        *last,
    )


def cut_by(said: dict) -> Reply:
    return Reply("one two", finish=None, done=False, last=f"data: {json.dumps(said)}\n\n".encode())


OVERLOADED = {"type": "error", "error": {"type": "overloaded_error", "message": "Overloaded"}}
NO_QUOTA = {"error": {"message": QUOTA, "type": "insufficient_quota", "code": "insufficient_quota"}}


@pytest.mark.parametrize(
    ("name", "reply", "cause", "words"),
    [
        ("anthropic/x", claude(OVERLOADED), "busy", "Overloaded"),
        ("openai/x", cut_by({"error": {"message": "overloaded", "code": 503}}), "busy", "overloaded"),
        ("openai/x", cut_by({"error": {"message": "The model is overloaded"}}), "busy", "is overloaded"),
        ("openai/x", cut_by(NO_QUOTA), "quota", "your current quota"),
        (
            "ollama_chat/x",
            events(
                {"model": "x", "message": {"role": "assistant", "content": "hello"}, "done": False},
                {"error": "server at capacity"},
                protocol="application/x-ndjson",
            ),
            "busy",
            "server at capacity",
        ),
    ],
)
def test_an_error_in_the_middle_of_a_stream_is_what_it_would_be_at_its_beginning(name, reply, cause, words):
    with Wire([reply]) as wire:
        problem = failed(model_at(wire.base, name), stream=True)
    assert (problem.cause, problem.retryable) == (cause, cause == "busy"), problem
    assert words in problem.problem and "Exception" not in problem.problem
    assert problem.usage is not None, "what had arrived is probably paid for"


# -- answers that are withheld or cut off ------------------------------------------------------------------------------
@pytest.mark.parametrize("stream", [False, True], ids=["whole", "stream"])
@pytest.mark.parametrize(
    ("reply", "settings", "note"),
    [
        (Reply("", finish="content_filter"), {}, "content filter withheld the answer (content_filter)"),
        (Reply("half", finish="content_filter"), {}, "content filter withheld the answer (content_filter)"),
        (Reply("", refusal="I would rather not."), {}, "the model refuses to answer"),
        (
            Reply("half", finish="length"),
            {"max_answer_tokens": 77},
            "limit of tokens; raise llm.max_answer_tokens (77)",
        ),
        (Reply("", finish="length"), {}, "before its first word; set a higher llm.max_answer_tokens"),
        (Reply("whole"), {}, ""),
    ],
)
def test_an_answer_that_is_not_complete_says_why_and_what_would_help(reply, settings, note, stream):
    with Wire([reply]) as wire:
        answer = ask(model_at(wire.base, **settings), stream)
    assert note in answer.note and bool(note) == bool(answer.note) == (answer.finish != "stop")


@pytest.mark.parametrize("stream", [False, True], ids=["whole", "stream"])
@pytest.mark.parametrize(
    "said",
    [
        {"promptFeedback": {"blockReason": "SAFETY"}, "usageMetadata": {"promptTokenCount": 5, "totalTokenCount": 5}},
        gemini(finishReason="SAFETY", content={"role": "model", "parts": []}),
    ],
    ids=["question", "answer"],
)
def test_what_gemini_blocks_is_told_as_withheld_in_its_word(said, stream):
    with Wire([events(said) if stream else report(200, said)]) as wire:
        answer = ask(model_at(wire.base, "gemini/x"), stream)
    assert answer.finish == "refusal" and "content filter withheld the answer (SAFETY)" in answer.note
