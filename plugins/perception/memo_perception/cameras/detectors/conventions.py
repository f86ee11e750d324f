"""How models write coordinates. Pictures are resized by us to what a model takes, so that its pixels are ours."""

from __future__ import annotations

import math
from typing import Any, Literal

import attrs
import cv2
import numpy as np

from memo_perception.cameras.detectors.model_answers import Box, numbers_of

_SLACK = 0.02  # share of the picture by which a coordinate may lie outside of it


@attrs.frozen
class Convention:
    """``order`` of a point's coordinates, and of a box's: corner by corner. ``scale``: what the picture's far edge is
    called; 0 for pixels. ``key``: what a model calls a box. ``multiple`` and ``longest``: the picture is resized to
    sides that are multiples of the one and at most the other (px), where a model would otherwise do so itself."""

    order: Literal["xy", "yx"] = "xy"
    scale: float = 0.0
    key: str = "box_2d"
    multiple: int = 1
    longest: int = 1568

    def sent(self, picture: np.ndarray) -> np.ndarray:
        """The picture, RGB (H, W, 3), as it is sent."""
        high, wide = picture.shape[:2]
        shrink = min(1.0, self.longest / max(high, wide))
        size = [max(self.multiple, round(side * shrink / self.multiple) * self.multiple) for side in (wide, high)]
        if size == [wide, high]:
            return picture
        return cv2.resize(picture, (size[0], size[1]), interpolation=cv2.INTER_AREA)

    def place(
        self, said: dict[str, Any], sent: tuple[int, int], picture: tuple[int, int]
    ) -> tuple[dict[str, Any], str]:
        """Box or point of a thing in pixels of ``picture`` (width, height), from an answer about a picture that was
        sent with the size ``sent``; and what is wrong with it."""
        for key in (self.key, "box_2d", "bbox_2d", "box", "bbox"):
            if said.get(key) is not None:
                return self._box(numbers_of(said[key]), sent, picture)
        for key in ("point", "point_2d"):
            if said.get(key) is not None:
                order: Literal["xy", "yx"] = "xy" if said.get("xy") else self.order
                return self._point(numbers_of(said[key]), order, sent, picture)
        return {}, f'it has neither "{self.key}" nor "point"'

    def in_words(self, sent: tuple[int, int]) -> str:
        """What the prompt says of coordinates, for a picture sent with this size."""
        x, y = self.order
        box = f"[{x}min, {y}min, {x}max, {y}max]"
        if self.scale:
            return f'"{self.key}": {box}, normalised to 0-{self.scale:g} over the picture'
        return f'"{self.key}": {box} in pixels of the picture, which is {sent[0]} wide and {sent[1]} high'

    def _shares(self, values: list[float], order: str, sent: tuple[int, int]) -> list[float]:
        """Coordinates as shares of width and height, x before y."""
        if order == "yx":
            values = [values[i ^ 1] for i in range(len(values))]
        far = [self.scale or side for side in sent]
        return [value / far[i % 2] for i, value in enumerate(values)]

    def _box(self, values: list[float], sent: tuple[int, int], picture: tuple[int, int]) -> tuple[dict[str, Any], str]:
        if len(values) != 4:
            return {}, "its box is not four finite numbers"
        shares = self._shares(values, self.order, sent)
        wrong = ""
        if _outside(shares):
            other = self._shares(values, "xy" if self.order == "yx" else "yx", sent)
            if _outside(other):
                return {}, f"its box {_short(values)} lies outside of the picture"
            shares, wrong = other, f"its box {_short(values)} is outside of the picture unless x and y are exchanged"
        clipped = [min(1.0, max(0.0, value)) for value in shares]
        left, right = sorted(clipped[0::2])
        top, bottom = sorted(clipped[1::2])
        box: Box = (left * picture[0], top * picture[1], right * picture[0], bottom * picture[1])
        if box[2] - box[0] < 1 or box[3] - box[1] < 1:
            return {}, f"its box {_short(values)} has no area"
        if (right - left) * (bottom - top) > 0.95:
            wrong = wrong or "its box is the whole picture"
        return {"box": box}, wrong

    def _point(
        self, values: list[float], order: str, sent: tuple[int, int], picture: tuple[int, int]
    ) -> tuple[dict[str, Any], str]:
        if len(values) != 2:
            return {}, "its point is not two finite numbers"
        x, y = self._shares(values, order, sent)
        if _outside([x, y]):
            return {}, f"its point {_short(values)} lies outside of the picture"
        inside = [min(1.0, max(0.0, value)) for value in (x, y)]
        at = [min(side - 1.0, share * side) for share, side in zip(inside, picture, strict=True)]
        return {"point": (at[0], at[1])}, ""


CONVENTIONS = {
    "gemini-robotics-er": Convention("yx", 1000),
    "qwen2.5-vl": Convention("xy", 0, "bbox_2d", multiple=28),
    "qwen3-vl": Convention("xy", 1000, "bbox_2d"),
    "molmo": Convention("xy", 100, "box"),
    "molmo2": Convention("xy", 1000, "box"),
    "claude": Convention("xy", 0, "box"),
}


def _outside(shares: list[float]) -> bool:
    return any(not -_SLACK <= share <= 1 + _SLACK for share in shares)


def _short(values: list[float]) -> str:
    return "[" + ", ".join(f"{value:g}" if math.isfinite(value) else "?" for value in values) + "]"
