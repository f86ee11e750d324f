"""A stream that was dropped half-read blocks no later call, whenever Python collects it."""

from __future__ import annotations

import gc
import threading

import httpcore
import httpx
import pytest
from memo_llm.litellm.connection import traced_transport
from memo_llm.litellm.library import quiet_litellm

from tests.support.fake_openai_server import Reply, Wire

pytestmark = pytest.mark.wire


def test_a_stream_that_is_collected_while_another_call_connects_does_not_block_it(monkeypatch):
    quiet_litellm()

    def collecting(pool, *arguments):
        gc.collect()  # Python may do so at any allocation; here the pool holds its lock
        return assign(pool, *arguments)

    assign = httpcore.ConnectionPool._assign_requests_to_connections
    answers: list[int] = []
    with Wire(lambda asked: Reply("word " * 200)) as wire, httpx.Client(transport=traced_transport()) as client:
        question = {"model": "x", "messages": [{"role": "user", "content": "hi"}], "stream": True}
        request = client.build_request("POST", f"{wire.base}/chat/completions", json=question)
        response = client.send(request, stream=True)
        pieces = response.iter_raw(16)
        next(pieces)
        dropped = [response, pieces]
        dropped.append(dropped)
        del response, pieces, dropped
        monkeypatch.setattr(httpcore.ConnectionPool, "_assign_requests_to_connections", collecting)
        later = threading.Thread(
            target=lambda: answers.append(client.post(request.url, json=question).status_code), daemon=True
        )
        later.start()
        later.join(10)
    assert answers == [200], "the later call waits for a lock that its own thread holds"
