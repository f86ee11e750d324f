"""Prompt tokens that a provider read from its cache are counted and priced as such, wherever prompt tokens are."""

from __future__ import annotations

import io
import json
import sqlite3

import pytest
from memo_llm.litellm.model import LiteLLMModel
from memo_llm.settings import LiteLLMSettings
from rich.console import Console

from memo_core.cli.main import main
from memo_core.cli.narration import Narrator
from memo_core.errors import InvalidArgument
from memo_core.events import Event, ModelCalled
from memo_core.interfaces.llm import Answer, Message, Request, Usage
from memo_core.llm.budget import Budget
from memo_core.llm.calls import ModelCalls
from memo_core.llm.kept_calls import spent_in
from memo_core.llm.ledger import Ledger, read_ledger
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.log_file import read_lines
from memo_core.runlog.log_history import read_history
from memo_core.runlog.run_log import RunLog
from memo_core.testing.fake_llm import ScriptedModel
from memo_core.text.parsing import read_as
from tests.support.fake_openai_server import Reply, Wire, events, report

QUESTION = Request("plan", (Message("system", "Be brief. " * 30), Message("user", "hi " * 300)))
ASKED = (300 + 900) // 3  # tokens as the server counts them

CLAUDE = {"input_tokens": 100, "cache_read_input_tokens": 40, "cache_creation_input_tokens": 10, "output_tokens": 5}
CLAUDE_WHOLE = report(
    200,
    {
        "id": "m",
        "type": "message",
        "role": "assistant",
        "model": "claude-sonnet-4-5",
        "content": [{"type": "text", "text": "hello"}],
        "stop_reason": "end_turn",
        "usage": CLAUDE,
    },
)
CLAUDE_STREAM = events(
    {
        "type": "message_start",
        "message": {
            "id": "m",
            "type": "message",
            "role": "assistant",
            "model": "claude-sonnet-4-5",
            "content": [],
            "usage": CLAUDE | {"output_tokens": 1},
        },
    },
    {"type": "content_block_start", "index": 0, "content_block": {"type": "text", "text": ""}},
    {"type": "content_block_delta", "index": 0, "delta": {"type": "text_delta", "text": "hello"}},
    {"type": "content_block_stop", "index": 0},
    {"type": "message_delta", "delta": {"stop_reason": "end_turn"}, "usage": {"output_tokens": 5}},
    {"type": "message_stop"},
)
CLAUDE_COST = (100 * 3.0 + 40 * 0.3 + 10 * 3.75 + 5 * 15.0) / 1e6  # US dollars, from litellm's list
GEMINI = {
    "candidates": [{"content": {"role": "model", "parts": [{"text": "hello"}]}, "finishReason": "STOP"}],
    "usageMetadata": {
        "promptTokenCount": 150,
        "cachedContentTokenCount": 40,
        "candidatesTokenCount": 5,
        "totalTokenCount": 155,
    },
    "modelVersion": "gemini-2.5-flash",
}
DEEPSEEK = {
    "id": "d",
    "object": "chat.completion",
    "created": 1,
    "model": "deepseek-chat",
    "choices": [{"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": "hello"}}],
    "usage": {
        "prompt_tokens": 150,
        "completion_tokens": 5,
        "total_tokens": 155,
        "prompt_cache_hit_tokens": 40,
        "prompt_cache_miss_tokens": 110,
    },
}
DEEPSEEK_STREAM = events(
    {**DEEPSEEK, "object": "chat.completion.chunk", "choices": [{"index": 0, "delta": {"content": "hello"}}]}
    | {"usage": None},
    {
        **DEEPSEEK,
        "object": "chat.completion.chunk",
        "choices": [{"index": 0, "delta": {"content": ""}, "finish_reason": "stop"}],
    },
)


@pytest.fixture(autouse=True)
def keys(monkeypatch):
    for name in ("OPENAI_API_KEY", "GEMINI_API_KEY", "ANTHROPIC_API_KEY", "DEEPSEEK_API_KEY"):
        monkeypatch.setenv(name, "planted-0123456789")


def answered(reply: Reply, stream: bool = False, **settings) -> tuple[Usage, Wire]:
    """The usage of one call to a server that sends ``reply``, and the server, closed."""
    with Wire([reply]) as wire:
        given = {"model": "openai/x", "api_base": wire.base, "timeout_s": 60.0} | settings
        model = LiteLLMModel(LiteLLMSettings(**given))
        model.open()
        answer = model.answer(QUESTION, on_text=(lambda piece: None) if stream else None)
        assert answer.text == "hello" and "usage" not in model.unsupported()
        assert not stream or wire.asked[0].body.get("stream") or "stream" in wire.asked[0].path.lower()
        return answer.usage, wire


# -- reading -----------------------------------------------------------------------------------------------------------
@pytest.mark.wire
@pytest.mark.parametrize("stream", [False, True])
def test_cached_tokens_are_read_as_openai_reports_them_and_priced_from_litellms_list(stream):
    usage, _ = answered(Reply(cached=300), stream, model="openai/gpt-4o")
    assert (usage.prompt_tokens, usage.cached_tokens, usage.completion_tokens) == (ASKED, 300, 2)
    assert usage.cost == pytest.approx(((ASKED - 300) * 2.5 + 300 * 1.25 + 2 * 10.0) / 1e6)


@pytest.mark.wire
@pytest.mark.parametrize("stream", [False, True])
@pytest.mark.parametrize(
    ("model", "whole", "streamed"),
    [
        ("anthropic/claude-sonnet-4-5", CLAUDE_WHOLE, CLAUDE_STREAM),
        ("gemini/gemini-2.5-flash", report(200, GEMINI), events(GEMINI)),
        ("deepseek/deepseek-chat", report(200, DEEPSEEK), DEEPSEEK_STREAM),
    ],
)
def test_cached_tokens_are_read_as_each_provider_reports_them(model, whole, streamed, stream):
    usage, _ = answered(streamed if stream else whole, stream, model=model)
    assert (usage.prompt_tokens, usage.cached_tokens, usage.completion_tokens) == (150, 40, 5)
    full, _ = answered(uncached(model), model=model)
    assert full.cached_tokens == 0 and 0 < usage.cost < full.cost
    if model.startswith("anthropic"):
        assert usage.cost == pytest.approx(CLAUDE_COST)


def uncached(model: str) -> Reply:
    """The provider's whole answer to a question of which nothing was cached."""
    if model.startswith("anthropic"):
        said = json.loads(CLAUDE_WHOLE.body or b"")
        said["usage"] = {"input_tokens": 150, "output_tokens": 5}
        return report(200, said)
    if model.startswith("gemini"):
        return report(200, GEMINI | {"usageMetadata": {"promptTokenCount": 150, "candidatesTokenCount": 5}})
    return report(200, DEEPSEEK | {"usage": {"prompt_tokens": 150, "completion_tokens": 5, "total_tokens": 155}})


@pytest.mark.wire
@pytest.mark.parametrize(("cached_price", "paid"), [(None, 2.0), (0.0, 0.0), (0.5, 0.5)])
def test_a_configured_price_of_cached_tokens_is_that_of_others_unless_it_is_set(cached_price, paid):
    prices = {"prompt_price": 2.0, "completion_price": 10.0, "cached_price": cached_price}
    usage, _ = answered(Reply(cached=300), **prices)
    assert usage.cost == pytest.approx(((ASKED - 300) * 2.0 + 300 * paid + 2 * 10.0) / 1e6)


def test_a_price_of_cached_tokens_alone_is_refused():
    with pytest.raises(InvalidArgument, match=r"cached_price.*prompt_price and completion_price"):
        LiteLLMSettings(model="openai/x", cached_price=1.0)


@pytest.mark.wire
def test_a_server_that_claims_more_cached_tokens_than_it_was_asked_is_not_believed():
    usage, _ = answered(Reply(cached=10**9), prompt_price=1.0, completion_price=1.0, cached_price=0.0)
    assert usage.cached_tokens == usage.prompt_tokens == ASKED and usage.cost >= 0


# -- asking ------------------------------------------------------------------------------------------------------------
@pytest.mark.wire
def test_claude_is_asked_to_cache_the_system_message_and_others_are_not():
    _, claude = answered(CLAUDE_WHOLE, model="anthropic/claude-sonnet-4-5")
    body = claude.asked[0].body
    assert body["system"] == [{"type": "text", "text": "Be brief. " * 30, "cache_control": {"type": "ephemeral"}}]
    assert "cache_control" not in json.dumps(body["messages"])
    for model, reply in (("openai/gpt-4o", Reply()), ("gemini/gemini-2.5-flash", report(200, GEMINI))):
        _, other = answered(reply, model=model)
        assert len(other.asked) == 1 and "cache_control" not in json.dumps(other.asked[0].body)


# -- keeping -----------------------------------------------------------------------------------------------------------
def test_cached_tokens_are_kept_with_each_call_and_summed(tmp_path):
    told: list[Event] = []
    ledger = Ledger(tmp_path / "ledger")
    usage = Usage(867, 1, 0.5, 0.1, 600)
    budget = Budget(ledger=ledger, run="one")
    log = RunLog(tmp_path)
    log.begin({"run": "one"}, {})

    class Cached(ScriptedModel):
        def answer(self, request, on_text=None, cancelled=None):
            return Answer("GO(home)", usage=usage)

    calls = ModelCalls(Cached({}), StopSwitch(), log, told.append, budget)
    for _ in range(2):
        calls.answer(QUESTION)
    log.close()
    history = read_history(tmp_path, read_lines(tmp_path).records)
    assert [event.cached_tokens for event in told if isinstance(event, ModelCalled)] == [600, 600]
    assert budget.spent.cached_tokens == ledger.spent().cached_tokens == 1200
    assert spent_in(history, tmp_path) == budget.spent
    [file, _] = sorted((tmp_path / "calls").iterdir())
    assert json.loads(file.read_text())["answer"]["usage"]["cached_tokens"] == 600


def test_records_of_an_older_version_are_read_as_without_cached_tokens():
    older = {"prompt_tokens": 5, "completion_tokens": 1, "cost": 0.1, "latency_s": 1.0}
    assert read_as(Usage, older) == Usage(5, 1, 0.1, 1.0, 0)


def test_a_ledger_of_an_older_version_is_read_and_gone_on_with(tmp_path, capsys):
    path = tmp_path / "ledger"
    with sqlite3.connect(path) as old:
        old.execute(
            "CREATE TABLE calls (id INTEGER PRIMARY KEY, begun REAL NOT NULL, ended REAL, run TEXT NOT NULL, phase TEXT"
            " NOT NULL, model TEXT NOT NULL, prompt_tokens INTEGER NOT NULL, completion_tokens INTEGER NOT NULL DEFAULT"
            " 0, cost REAL, entry INTEGER)"
        )
        old.execute("INSERT INTO calls VALUES (1, 1.0, 2.0, 'old', 'plan', 'm', 10, 5, 0.5, 1)")
    before = path.read_bytes()
    assert read_ledger(path)[1].cached_tokens == 0
    assert path.read_bytes() == before
    ledger = Ledger(path)
    ledger.end(ledger.begin("new", "plan", "m", 1, lambda spent: None, 4), Usage(20, 5, 0.5, 1.0, 15))
    assert [(run, spent.prompt_tokens, spent.cached_tokens) for run, spent in read_ledger(path)[0]] == [
        ("old", 10, 0),
        ("new", 20, 15),
    ]
    with pytest.raises(SystemExit):
        main(["budget", str(path), "--json"])
    assert json.loads(capsys.readouterr().out)["total"]["cached_tokens"] == 15


def test_the_narration_tells_cached_tokens_where_there_are_any():
    shown = io.StringIO()
    narrator = Narrator(Console(file=shown, width=200))
    narrator(ModelCalled("plan", "m", 867, 1, None, 1.0, cached_tokens=600))
    narrator(ModelCalled("plan", "m", 867, 1, None, 1.0))
    assert [line.split(", ")[-1].strip() for line in shown.getvalue().splitlines()] == [
        "867 (600 cached) + 1 tokens",
        "867 + 1 tokens",
    ]
