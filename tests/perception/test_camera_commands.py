"""``memo cameras`` and ``memo see``, in simulation, from the command line."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
from memo_perception.calibration.board import Board
from memo_perception.calibration.file import load
from memo_perception.cameras.frames import Intrinsics
from memo_perception.cameras.overlay import overlaid
from PIL import Image

from memo_core.cli.app import run_app
from memo_core.errors import InvalidArgument
from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Pose, look_at
from memo_core.scene.scene_table import scene_table
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.errors import SkillbookError

CAMERAS = ["--set", "perception.backend=cameras", "--set", "perception.detector=oracle"]


def said(capsys, *arguments: str) -> dict:
    assert run_app([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("setting", "module", "extra"),
    [
        ("source=realsense", "pyrealsense2", "realsense"),
        ("source=orbbec", "pyorbbecsdk", "orbbec"),
        ("source=[simulated,orbbec]", "pyorbbecsdk", "orbbec"),
        ("detector=local", "transformers", "local"),
        ("detector=[local,tags]", "torch", "local"),
    ],
)
def test_checking_a_file_says_which_library_of_a_source_or_detector_is_missing(
    setting, module, extra, capsys, tmp_path, monkeypatch
):
    file = tmp_path / "lab.yaml"
    file.write_text("task: stack-the-cubes\nperception: {backend: cameras}\n")
    assert said(capsys, "config", "check", str(file))["missing"] == [], "the simulator's cameras need none"
    monkeypatch.setitem(sys.modules, module, None)
    [missing] = said(capsys, "config", "check", str(file), "--set", f"perception.{setting}")["missing"]
    assert f"Python module {module}" in missing and f"[{extra}]" in missing


def test_a_board_is_written_as_large_as_it_is_to_be_printed(tmp_path):
    assert run_app(["cameras", "board", "--out", str(tmp_path / "board.png"), "--square", "20"]) == 0
    with Image.open(tmp_path / "board.png") as picture:
        assert picture.size[0] / picture.info["dpi"][0] * 25.4 == pytest.approx(140, rel=0.01)
        assert Board(square=0.02, marker=0.015).seen_in(
            np.pad(np.asarray(picture.convert("L")), 50, constant_values=255)
        )


@pytest.mark.parametrize("wrong", [["--squares", "7"], ["--squares", "2x9"], ["--square", "0"], ["--marker", "40"]])
def test_an_impossible_board_is_refused(tmp_path, wrong):
    with pytest.raises(InvalidArgument):
        run_app(["cameras", "board", "--out", str(tmp_path / "board.png"), *wrong])


@pytest.mark.sim
@pytest.mark.slow
def test_a_simulated_camera_is_calibrated_from_end_to_end(tmp_path, capsys):
    """The arm moves in the simulator; the board is drawn into its pictures; the true error is known."""
    file = tmp_path / "front.json"
    board = ["--squares", "5x4", "--square", "45", "--poses", "14"]
    told = said(capsys, "cameras", "calibrate", "front", "--board", "hand", *board, "--out", str(file))
    assert told["pictures"] == 14 and told["held_out_mm"] < 5
    assert told["true_error_mm"] < 3 and told["true_error_degrees"] < 0.15
    assert load(file).found.camera.position == pytest.approx(told["position"])


@pytest.mark.sim
def test_a_camera_that_is_not_there_is_named_beside_those_that_are():
    from memo_core.errors import UnknownName

    with pytest.raises(UnknownName, match="front"):
        run_app(["cameras", "calibrate", "fronted", "--board", "hand"])


@pytest.mark.sim
def test_what_is_recorded_is_seen_again(tmp_path, capsys):
    told = said(capsys, "cameras", "record", "--out", str(tmp_path), "--looks", "2", "--every", "0")
    assert [look[-4:] for look in told["looks"]] == ["0000", "0001"]
    folder = ["--set", "perception.source=folder", "--set", f"perception.folder.path={tmp_path}"]
    seen = said(capsys, "see", *CAMERAS, *folder, "--out", str(tmp_path / "see.png"))
    assert len(seen["pictures"]) >= 1


@pytest.mark.sim
def test_see_shows_the_graph_and_draws_it(tmp_path, capsys):
    seen = said(capsys, "see", "--task", "put-the-cube-away", *CAMERAS, "--out", str(tmp_path / "see.png"))
    assert any("cube" in node["label"] for node in seen["scene"]["nodes"])
    for file in seen["pictures"]:
        with Image.open(file) as picture:
            assert picture.size == (640, 480)


@pytest.mark.sim
def test_see_works_without_cameras(capsys):
    assert run_app(["see", "--task", "put-the-cube-away"]) == 0
    assert "cube" in capsys.readouterr().out


def test_a_box_is_drawn_where_it_is_and_one_behind_the_camera_is_not():
    eye = look_at((0.0, -1.0, 0.5), (0.0, 0.0, 0.0))
    lens = Intrinsics(500, 500, 319.5, 239.5)
    empty = np.zeros((480, 640, 3), dtype=np.uint8)

    def drawn(position) -> np.ndarray:
        node = Node("a", "cup", Pose(position), (0.1, 0.1, 0.1))
        graph = SceneGraph((node,), (), Observation(Pose(), 0.0, False))
        return overlaid(empty, lens, eye, graph)

    rows, columns = np.nonzero(drawn((0.0, 0.0, 0.0)).any(axis=2))
    assert abs(columns.mean() - 319.5) < 8 and abs(rows.mean() - 239.5) < 30
    assert not drawn((0.0, -2.0, 0.5)).any() and not drawn((30.0, 1.0, 0.0)).any()
    assert not empty.any()


def a_book_that_corrects(file, words):
    """A skillbook in which somebody said this of the only cube of a scene."""
    cube = Node("cube", "cube", Pose((0.4, 0.0, 0.02)), (0.045, 0.045, 0.045), attributes=("red",))
    scene = scene_table(SceneGraph((cube,), (), Observation(Pose(), 0.0, False)))
    with Skillbook(f"sqlite:///{file}") as book:
        book.record_feedback(words, "ann", subtask="GRASP(cube)", scene_graph=scene)


@pytest.mark.sim
def test_what_people_said_of_names_in_the_book_is_used(tmp_path, capsys):
    a_book_that_corrects(tmp_path / "book.db", "That is not a cube, it is a sugar box.")
    look = ["see", "--task", "put-the-cube-away", *CAMERAS]

    def labels(*more):
        return {node["label"] for node in said(capsys, *look, *more)["scene"]["nodes"]}

    assert "cube" in labels("--set", f"skillbook.url={tmp_path / 'no-book-yet.db'}")
    for more in (["--book", str(tmp_path / "book.db")], ["--set", f"skillbook.url={tmp_path / 'book.db'}"]):
        found = labels(*more)
        assert "sugar box" in found and "cube" not in found
    assert not (tmp_path / "no-book-yet.db").exists()


def test_a_book_that_is_asked_for_must_be_there(tmp_path):
    with pytest.raises(SkillbookError, match=r"none\.db"):
        run_app(["see", "--task", "put-the-cube-away", *CAMERAS, "--book", str(tmp_path / "none.db")])
