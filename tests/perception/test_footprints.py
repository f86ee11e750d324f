"""What lies flat is measured by outlines, however noisy depth is."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from memo_perception.cameras.frames import Frame, Intrinsics
from memo_perception.cameras.geometry.fitting import Seen, fit_thing
from memo_perception.cameras.geometry.silhouettes import silhouette
from memo_perception.cameras.geometry.table import View

from memo_core.scene.pose import look_at

LENS = Intrinsics(560, 560, 319.5, 239.5)
EYES = ((0.4, -0.9, 0.9), (1.3, 0.1, 0.8), (0.1, 0.7, 1.0))
HIGH = 0.014


def prism(yaw: float, width: float) -> np.ndarray:
    """Points (N, 3) of a spoon: a handle 0.15 m long and 12 mm wide, with a bowl of this width at its end."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(-0.075, 0.0751, 0.001), np.arange(-0.03, 0.031, 0.001)))
    inside = np.where(x > 0.03, np.abs(y) <= width / 2, np.abs(y) <= 0.006)
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    flat = np.column_stack([x, y])[inside] @ turn + np.array([0.45, 0.1])
    return np.concatenate([np.column_stack([flat, np.full(len(flat), z)]) for z in np.linspace(0, HIGH, 8)])


def seen(points: np.ndarray, noise: float) -> Seen:
    """What three cameras see of it, with this deviation of depth (m)."""
    rng = np.random.default_rng(3)
    shown, cameras, outlines = [], [], []
    for number, eye in enumerate(EYES):
        empty = np.zeros((480, 640, 3), dtype=np.uint8)
        blank = Frame(str(number), empty, np.zeros((480, 640), np.float32), LENS, look_at(eye, (0.45, 0.1, 0.0)))
        pixels, depths = blank.project(points)
        u, v = np.round(pixels).astype(int).T
        depth = np.full((480, 640), np.inf)
        np.minimum.at(depth, (v, u), depths)
        mask = cv2.morphologyEx(np.isfinite(depth).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0
        measured = np.where(np.isfinite(depth), depth + rng.normal(0, noise, depth.shape), 0.0).astype(np.float32)
        frame = Frame(str(number), empty, measured, LENS, blank.pose)
        view = View(frame, frame.points(), max(noise, 0.0005), True)
        own = view.points[mask]
        own = own[np.isfinite(own[:, 0])]
        shown.append(own)
        cameras.append(np.full(len(own), number))
        outlines.append(silhouette(view, mask))
    return Seen(np.concatenate(shown), np.concatenate(cameras), tuple(outlines), max(noise, 0.0005), 0.0)


@pytest.mark.parametrize("noise", [0.0, 0.007])
@pytest.mark.parametrize("width", [0.026, 0.036])
def test_the_width_of_cutlery_is_told_to_millimetres(noise, width):
    fit = fit_thing(seen(prism(0.4, width), noise))
    long, wide, _ = sorted(fit.size)[::-1]
    assert fit.explained and wide == pytest.approx(width, abs=0.004) and long == pytest.approx(0.15, abs=0.004)
    assert np.linalg.norm(np.subtract(fit.pose.position[:2], (0.45, 0.1))) < 0.003
    along = fit.pose.rotation[:, int(np.argmax(fit.size))]
    assert abs(along @ (np.cos(0.4), np.sin(0.4), 0.0)) > np.cos(np.radians(3))
