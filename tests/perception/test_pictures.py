"""What was seen is drawn over the pictures, and kept in the folder of a run."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from memo_perception.cameras.backend import Cameras
from memo_perception.cameras.settings import CamerasSettings, SimulatedSettings

from memo_core.runs.folder import RunFolder
from tests.perception.small_scene import looking_at, scene

pytestmark = pytest.mark.sim


def test_every_look_is_drawn_and_kept_and_no_glance(tmp_path):
    folder = RunFolder(tmp_path / "run")
    with looking_at(scene(1.0)) as context:
        eyes = Cameras(CamerasSettings(detector="oracle", simulated=SimulatedSettings(width=320)))
        eyes.show_looks(folder.add_look)
        eyes.start(context)
        eyes.look()
        eyes.glance()
        eyes.look()
        plain = {view.frame.name: view.frame.rgb for view in eyes.latest.views}
    folder.close()
    files = sorted(file.name for file in (tmp_path / "run" / "looks").iterdir())
    assert files == ["0001-left.png", "0001-right.png", "0002-left.png", "0002-right.png"]
    for name, rgb in plain.items():
        picture = cv2.imread(str(tmp_path / "run" / "looks" / f"0002-{name}.png"))[:, :, ::-1]
        changed = np.any(picture != rgb, axis=2)
        assert picture.shape == rgb.shape and 0.01 < changed.mean() < 0.5
