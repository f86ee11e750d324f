"""The page of a run shows what perception saw in each look."""

from __future__ import annotations

import json

import numpy as np

from memo_core.demo.page import _Pictures
from memo_core.policy.pictures import png
from memo_core.report.run_reader import read_story
from memo_core.report.writing import write_run_page
from memo_core.runs.folder import RunFolder


def run_with_looks(folder, looks):
    kept = RunFolder(folder)
    for number in range(looks):
        picture = np.full((30, 40, 3), 10 * number, np.uint8)
        kept.add_look({"front": png(picture), "wrist camera": png(picture)})
    kept.close()
    started = {"event": "RunStarted", "time": 1.0, "instruction": "put the cube away"}
    (folder / "events.jsonl").write_text(json.dumps(started) + "\n")


def test_the_page_of_a_run_shows_every_look_in_order(tmp_path):
    run_with_looks(tmp_path / "run", 3)
    page = write_run_page(tmp_path / "run").page.read_text(encoding="utf-8")
    names = [f"looks/{number:04d}-{camera}.png" for number in (1, 2, 3) for camera in ("front", "wrist_camera")]
    places = [page.index(f'src="{name}"') for name in names]
    assert places == sorted(places) and "look 3 of 3" in page
    run_with_looks(tmp_path / "blind", 0)
    assert "What the robot saw" not in write_run_page(tmp_path / "blind").page.read_text(encoding="utf-8")


def test_the_page_of_the_demo_holds_them_and_leaves_out_a_damaged_one(tmp_path):
    run_with_looks(tmp_path / "run", 2)
    (tmp_path / "run" / "looks" / "0002-front.png").write_bytes(b"no picture")
    first, second = _Pictures().looks(read_story(tmp_path / "run"))
    assert len(first) == 2 and all(uri.startswith("data:image/jpeg;base64,") for uri in first)
    assert second[0] == "" and second[1].startswith("data:image/jpeg;base64,")
