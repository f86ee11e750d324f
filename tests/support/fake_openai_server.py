"""A server on loopback that speaks OpenAI's protocol, well or badly: what a language backend meets in the world."""

from __future__ import annotations

import contextlib
import json
import select
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import attrs


@attrs.frozen
class Reply:
    """How one request is answered. ``text`` becomes a whole completion, or a stream where one is asked for; ``body``
    is sent as it is instead."""

    text: str = "hello"
    status: int = 200
    headers: dict[str, str] = attrs.field(factory=dict)
    body: bytes | None = None
    finish: str | None = "stop"  # None: a stream that gives no reason for its end
    refusal: str | None = None
    silent_s: float = 0.0  # before the first byte
    drip_s: float = 0.0  # between two bytes of the body, or two pieces of a stream
    cut_after: int | None = None  # bytes of the body, or pieces of a stream, then the connection is cut
    counts: bool = True  # whether it says how many tokens were used
    cached: int = 0  # of the prompt tokens, as it says
    streams: bool = True  # whether it heeds "stream"
    done: bool = True  # whether a stream ends with its end mark
    last: bytes = b""  # what a stream sends after its pieces


def error(status: int, message: str, *, code: str | None = None, **headers: str) -> Reply:
    """An error as OpenAI's servers report it."""
    said = {"error": {"message": message, "type": code or "error", "code": code}}
    return report(status, said, **{name.replace("_", "-"): value for name, value in headers.items()})


def report(status: int, said: Any, **headers: str) -> Reply:
    """JSON as it is given, such as an error as another provider reports it."""
    return Reply(status=status, body=json.dumps(said).encode(), headers=headers)


def events(*said: Any, protocol: str = "text/event-stream") -> Reply:
    """A stream of JSON as it is given, such as an answer in another provider's protocol."""
    mark = b"data: %s\n\n" if protocol == "text/event-stream" else b"%s\n"
    body = b"".join(mark % json.dumps(one).encode() for one in said)
    return Reply(body=body, headers={"Content-Type": protocol})


@attrs.define
class Asked:
    """One request as it arrived."""

    path: str
    headers: dict[str, str]
    body: dict[str, Any]
    time: float

    @property
    def texts(self) -> list[str]:
        """Of the messages; pictures left out."""
        return ["".join(part.get("text", "") for part in _parts(message)) for message in self.body["messages"]]

    @property
    def pictures(self) -> list[str]:
        parts = [part for message in self.body["messages"] for part in _parts(message)]
        return [part["image_url"]["url"] for part in parts if part["type"] == "image_url"]


def _parts(message: dict[str, Any]) -> list[dict[str, Any]]:
    content = message["content"]
    return content if isinstance(content, list) else [{"type": "text", "text": content}]


class Wire:
    """Answers with ``reply(asked)``, or with a script of replies one after the other, the last again and again."""

    def __init__(self, reply: Callable[[Asked], Reply | str] | Sequence[Reply | str] = ("hello",)) -> None:
        self.asked: list[Asked] = []
        self.hung_up = threading.Event()  # a client closed the connection before it had its answer
        self.under_way = self.most_under_way = 0
        self._reply = reply
        self._lock = threading.Lock()
        self._over = threading.Event()
        wire = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def log_message(self, *_: object) -> None:
                pass

            def do_POST(self) -> None:
                body = json.loads(self.rfile.read(int(self.headers.get("Content-Length", 0))) or b"{}")
                headers = {name.lower(): value for name, value in self.headers.items()}
                with contextlib.suppress(BrokenPipeError, ConnectionResetError, _HungUp):
                    wire._answer(self, Asked(self.path, headers, body, time.monotonic()))
                self.close_connection = True

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self.base = f"http://127.0.0.1:{self._server.server_port}/v1"

    def __enter__(self) -> Wire:
        threading.Thread(target=self._server.serve_forever, args=(0.01,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._server.shutdown()
        self._server.server_close()

    # -- one request ---------------------------------------------------------------------------------------------------
    def _answer(self, handler: BaseHTTPRequestHandler, asked: Asked) -> None:
        with self._lock:
            number = len(self.asked)
            self.asked.append(asked)
            self.under_way += 1
            self.most_under_way = max(self.most_under_way, self.under_way)
        try:
            if callable(self._reply):
                reply = self._reply(asked)
            else:
                reply = self._reply[min(number, len(self._reply) - 1)]
            reply = Reply(reply) if isinstance(reply, str) else reply
            self._pause(handler, reply.silent_s)
            if asked.path.endswith("/embeddings") and reply.body is None:
                self._send(handler, attrs.evolve(reply, body=_vectors(asked.body)))
            elif reply.body is None and asked.body.get("stream") and reply.streams and reply.status == 200:
                self._stream(handler, asked, reply)
            else:
                self._send(
                    handler, attrs.evolve(reply, body=_completion(asked, reply) if reply.body is None else reply.body)
                )
        finally:
            with self._lock:
                self.under_way -= 1

    def _send(self, handler: BaseHTTPRequestHandler, reply: Reply) -> None:
        body = reply.body or b""
        handler.send_response(reply.status)
        headers = {"Content-Type": "application/json", "Content-Length": str(len(body)), **reply.headers}
        for name, value in headers.items():
            handler.send_header(name, value)
        handler.end_headers()
        if reply.drip_s or reply.cut_after is not None:
            self._in_pieces(handler, reply, [body[i : i + 1] for i in range(len(body))])
        else:
            handler.wfile.write(body)

    def _stream(self, handler: BaseHTTPRequestHandler, asked: Asked, reply: Reply) -> None:
        handler.send_response(200)
        handler.send_header("Content-Type", "text/event-stream")
        handler.send_header("Connection", "close")
        handler.end_headers()
        pieces = [f"{word} " for word in reply.text.split(" ")]
        pieces[-1] = pieces[-1][:-1]
        events = [_chunk(asked, {"role": "assistant", "content": piece}, None) for piece in pieces]
        events += [_chunk(asked, {"refusal": reply.refusal}, None)] if reply.refusal else []
        events += [_chunk(asked, {}, reply.finish)] if reply.finish else []
        if reply.counts and (asked.body.get("stream_options") or {}).get("include_usage"):
            events.append({**_chunk(asked, {}, None), "choices": [], "usage": _usage(asked, reply)})
        lines = [f"data: {json.dumps(event)}\n\n".encode() for event in events]
        self._in_pieces(handler, reply, [*lines, reply.last, b"data: [DONE]\n\n" if reply.done else b""])

    def _in_pieces(self, handler: BaseHTTPRequestHandler, reply: Reply, pieces: Iterable[bytes]) -> None:
        for number, piece in enumerate(pieces):
            if reply.cut_after is not None and number >= reply.cut_after:
                handler.connection.close()
                raise BrokenPipeError
            handler.wfile.write(piece)
            handler.wfile.flush()
            self._pause(handler, reply.drip_s)

    def _pause(self, handler: BaseHTTPRequestHandler, seconds: float) -> None:
        """Wait, and notice when the client has gone."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0 and not self._over.is_set():
            readable, _, _ = select.select([handler.connection], [], [], min(0.02, left))
            if readable and not handler.connection.recv(1):
                self.hung_up.set()
                raise _HungUp


class _HungUp(Exception):
    pass


def _usage(asked: Asked, reply: Reply) -> dict[str, Any]:
    prompt, completion = sum(len(words) for words in asked.texts) // 3, len(reply.text) // 3 + 1
    usage = {"prompt_tokens": prompt, "completion_tokens": completion, "total_tokens": prompt + completion}
    return usage | ({"prompt_tokens_details": {"cached_tokens": reply.cached}} if reply.cached else {})


def _completion(asked: Asked, reply: Reply) -> bytes:
    message = {"role": "assistant", "content": reply.text, "refusal": reply.refusal}
    whole: dict[str, Any] = {
        "id": "wire",
        "object": "chat.completion",
        "created": int(time.time()),
        "model": asked.body.get("model", ""),
        "choices": [{"index": 0, "finish_reason": reply.finish, "message": message}],
    }
    if reply.counts:
        whole["usage"] = _usage(asked, reply)
    return json.dumps(whole).encode()


def _chunk(asked: Asked, delta: dict[str, Any], finish: str | None) -> dict[str, Any]:
    return {
        "id": "wire",
        "object": "chat.completion.chunk",
        "created": int(time.time()),
        "model": asked.body.get("model", ""),
        "choices": [{"index": 0, "delta": delta, "finish_reason": finish}],
    }


def _vectors(body: dict[str, Any]) -> bytes:
    """Vectors that mean something: of the words and their beginnings; not of length 1, as many servers send them."""
    from memo_core.testing.fake_embedder import FakeEmbedder

    texts = body["input"] if isinstance(body["input"], list) else [body["input"]]
    vectors = 3.0 * FakeEmbedder().embed(texts)
    data = [
        {"object": "embedding", "index": number, "embedding": [float(x) for x in vector]}
        for number, vector in enumerate(vectors)
    ]
    usage = {"prompt_tokens": sum(map(len, texts)) // 3, "total_tokens": sum(map(len, texts)) // 3}
    return json.dumps({"object": "list", "model": body.get("model", ""), "data": data, "usage": usage}).encode()
