"""The offline model as the answers of a server that speaks OpenAI's protocol."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from memo_offline.model import OfflineModel

from memo_core.interfaces.llm import Message, Request
from tests.support.fake_openai_server import Asked, Reply


@contextmanager
def offline_replies() -> Iterator[Callable[[Asked], Reply]]:
    """Open an offline model; the function answers one request with it."""
    model = OfflineModel()
    model.open()

    def reply(asked: Asked) -> Reply:
        roles = [message["role"] for message in asked.body["messages"]]
        messages = tuple(Message(role, text) for role, text in zip(roles, asked.texts, strict=True))
        return Reply(model.answer(Request("", messages)).text)

    yield reply
    model.close()
