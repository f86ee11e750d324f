"""Embeddings from a server: batched, normalised, retried where that may help, and cached by the book."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from memo_embedder.litellm_embedder import LiteLLMEmbedder
from memo_embedder.settings import LiteLLMEmbedderSettings

from memo_core.errors import BackendUnavailable
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.store.database import SkillbookError
from memo_core.testing.embedder import RULES
from memo_core.testing.fake_store import FakeStore
from tests.support.fake_openai_server import Reply, Wire, error

pytestmark = pytest.mark.wire


@pytest.fixture(autouse=True)
def no_keys(monkeypatch):
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)


@pytest.fixture
def wire() -> Iterator[Wire]:
    with Wire() as served:
        yield served


def embedder_at(wire: Wire, **settings) -> LiteLLMEmbedder:
    given = {"model": "openai/words", "api_base": wire.base, "timeout_s": 5.0, **settings}
    return LiteLLMEmbedder(LiteLLMEmbedderSettings(**given))


@pytest.mark.parametrize("rule", RULES)
def test_it_keeps_the_rules_of_embedders(rule, wire):
    RULES[rule](lambda: embedder_at(wire))


def test_texts_go_in_batches_and_come_back_in_order(wire):
    embedder = embedder_at(wire, batch=4)
    embedder.open()
    texts = [f"text number {number}" for number in range(10)]
    together = embedder.embed(texts)
    sent = [asked.body["input"] for asked in wire.asked]
    assert sent == [["dimension"], texts[:4], texts[4:8], texts[8:]]
    assert wire.asked[0].path == "/v1/embeddings"
    assert np.allclose(together[6], embedder.embed([texts[6]])[0])


def test_a_book_asks_for_each_text_once_and_refuses_another_model(wire, tmp_path: Path):
    url = f"sqlite:///{tmp_path / 'book.db'}"

    def retrieve(model: str) -> None:
        with Skillbook(url, embedder_at(wire, model=model), FakeStore()) as book:
            book.retrieve(Key("OPEN", ("oven",)))

    retrieve("openai/words")
    asked = len(wire.asked)
    assert asked > 1
    retrieve("openai/words")
    assert len(wire.asked) == asked, "it was asked again for what the book holds"
    with pytest.raises(SkillbookError, match="litellm/openai/words"):
        retrieve("openai/others")


@pytest.mark.parametrize(
    ("first", "tries"),
    [(error(429, "slow down", Retry_After="0.2"), 2), (error(500, "oops"), 2), (error(400, "bad"), 1)],
)
def test_what_may_pass_is_tried_again_and_nothing_else(first, tries, monkeypatch):
    waits: list[float] = []
    sleep = time.sleep

    def wait(seconds: float) -> None:
        waits.append(seconds)
        sleep(min(seconds, 0.2))  # a call at once may meet the connection that the server is closing

    monkeypatch.setattr("memo_embedder.litellm_embedder.time.sleep", wait)
    with Wire([first, "fine"]) as wire:
        embedder = embedder_at(wire)
        if tries == 1:
            with pytest.raises(BackendUnavailable, match="bad"):
                embedder.open()
        else:
            embedder.open()
            assert len(waits) == 1 and waits[0] >= 0.2
        assert len(wire.asked) == tries


@pytest.mark.parametrize("reply", [Reply(silent_s=200.0), Reply(drip_s=0.05)], ids=["silent", "dripping"])
def test_a_request_is_given_up_after_its_time(reply):
    with Wire([reply]) as wire:
        started = time.monotonic()
        with pytest.raises(BackendUnavailable, match="timeout_s"):
            embedder_at(wire, timeout_s=0.4).open()
        assert time.monotonic() - started < 100.0


@pytest.mark.parametrize("body", [b"{}", b'{"data": []}', b"<html>", b'{"data": [{"index": 0, "embedding": [0, 0]}]}'])
def test_what_is_no_vector_is_said(body):
    with Wire([Reply(body=body)]) as wire, pytest.raises(BackendUnavailable):
        embedder_at(wire, retries=0).open()


def test_a_missing_key_names_the_variable_and_a_sent_one_is_never_repeated(monkeypatch):
    with pytest.raises(BackendUnavailable, match="export OPENAI_API_KEY="):
        LiteLLMEmbedder(LiteLLMEmbedderSettings("openai/text-embedding-3-small")).open()
    monkeypatch.setenv("OPENAI_API_KEY", "sk-planted-0123456789")
    with Wire(lambda asked: error(401, f"bad key {asked.headers['authorization']}")) as wire:
        with pytest.raises(BackendUnavailable) as raised:
            embedder_at(wire).open()
        assert "planted" in wire.asked[0].headers["authorization"]
    assert "planted" not in str(raised.value) and "bad key" in str(raised.value)
