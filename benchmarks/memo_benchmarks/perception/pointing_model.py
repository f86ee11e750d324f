"""A double of a model that points as Gemini Robotics-ER does, behind OpenAI's protocol on loopback.

It is told beforehand what each picture shows, and answers in that model's coordinates: boxes ``[ymin, xmin, ymax,
xmax]`` of whole things and points ``[y, x]`` of parts, 0 to 1000, both a little off. It makes no mistakes of other
kinds, so what is measured with it is what becomes of its answers, not the model.
"""

from __future__ import annotations

import base64
import io
import json
import threading
from collections.abc import Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import attrs
import numpy as np

OFF = 0.02  # standard deviation of each side of a box, of its length; of a point, of the thing's length
_ALIKE = 8.0  # mean difference of two pictures (of 255) up to which they may be one


@attrs.frozen(eq=False)
class Shown:
    """One thing in a picture, with its mask (H, W) there."""

    label: str
    kind: str
    part_of: str | None
    state: str | None
    mask: np.ndarray


class PointingModel:
    """The server, while it is entered. ``asked`` counts its questions."""

    def __init__(self, seed: int) -> None:
        self.asked = 0
        self._rng = np.random.default_rng([seed, *b"points"])
        self._pictures: list[tuple[np.ndarray, list[Shown]]] = []
        model = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                data = json.dumps(model._completion(body)).encode()
                self.send_response(200)
                self.send_header("Content-Type", "application/json")
                self.send_header("Content-Length", str(len(data)))
                self.end_headers()
                self.wfile.write(data)

            def log_message(self, *_: Any) -> None: ...

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    @property
    def base(self) -> str:
        return f"http://127.0.0.1:{self._server.server_address[1]}/v1"

    def __enter__(self) -> PointingModel:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def show(self, picture: np.ndarray, things: Sequence[Shown]) -> None:
        """Register the things that a picture, RGB (H, W, 3), shows."""
        self._pictures.append((picture, list(things)))

    def _completion(self, body: dict[str, Any]) -> dict[str, Any]:
        self.asked += 1
        contents = [one["content"] for one in body["messages"] if isinstance(one["content"], list)]
        url = next(part["image_url"]["url"] for parts in contents for part in parts if part["type"] == "image_url")
        said = {"things": [self._said(one) for one in self._things(base64.b64decode(url.partition(",")[2]))]}
        message = {"role": "assistant", "content": f"```json\n{json.dumps(said)}\n```"}
        return {
            "id": "points",
            "object": "chat.completion",
            "created": 0,
            "model": body["model"],
            "choices": [{"index": 0, "message": message, "finish_reason": "stop"}],
            "usage": {"prompt_tokens": 1, "completion_tokens": 1, "total_tokens": 2},
        }

    def _things(self, png: bytes) -> list[Shown]:
        """Things of the registered picture that is most like this one; none if no picture is alike."""
        from PIL import Image

        sent = Image.open(io.BytesIO(png)).convert("RGB")
        best: tuple[float, list[Shown]] = (_ALIKE, [])
        for picture, things in self._pictures:
            own = np.asarray(Image.fromarray(picture).resize(sent.size), dtype=float)
            off = float(np.abs(own - np.asarray(sent, dtype=float)).mean())
            best = min(best, (off, things), key=lambda one: one[0])
        return best[1]

    def _said(self, thing: Shown) -> dict[str, Any]:
        rows, columns = np.nonzero(thing.mask)
        high, wide = thing.mask.shape
        low = np.array([rows.min(), columns.min()])
        size = np.array([rows.max() + 1, columns.max() + 1]) - low
        told = {"label": thing.label, "kind": thing.kind, "part_of": thing.part_of, "state": thing.state}
        if thing.kind == "part":
            at = int(np.argmin(np.abs(rows - np.median(rows)) + np.abs(columns - np.median(columns))))
            point = np.array([rows[at], columns[at]]) + OFF * size * self._rng.normal(size=2)
            return told | {"point": _normalised(point, (high, wide))}
        near = low + OFF * size * self._rng.normal(size=2)
        far = low + size + OFF * size * self._rng.normal(size=2)
        return told | {"box_2d": [*_normalised(near, (high, wide)), *_normalised(far, (high, wide))]}


def _normalised(place: np.ndarray, size: tuple[int, int]) -> list[int]:
    return [int(np.clip(round(1000 * value / side), 0, 1000)) for value, side in zip(place, size, strict=True)]
