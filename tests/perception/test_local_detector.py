"""Models on this machine: loaded as a user's weights are, asked for names, their boxes and masks put where they belong.
The models here are tiny and know nothing; what real ones find was not tried."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from memo_perception.cameras.backend import Cameras
from memo_perception.cameras.detectors.detector import Request
from memo_perception.cameras.detectors.local import LocalDetector
from memo_perception.cameras.detectors.local_models import FoundThing, finder_of, nearest_name, segmenter_of
from memo_perception.cameras.detectors.oracle import OracleDetector
from memo_perception.cameras.inventory import Item
from memo_perception.cameras.settings import CamerasSettings, LocalSettings, SimulatedSettings

from memo_core.errors import BackendUnavailable, InvalidArgument
from tests.perception import tiny_models
from tests.perception.small_scene import looking_at, scene

PICTURE = (np.random.default_rng(0).random((60, 80, 3)) * 255).astype(np.uint8)
NAMES = ["cup", "red can"]


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    folder = tmp_path_factory.mktemp("weights")
    return {name: getattr(tiny_models, name)(folder / name) for name in ("owl", "dino", "sam2", "sam3")}


@pytest.mark.parametrize("kind", ["owl", "dino", "sam3"])
def test_saved_weights_are_loaded_and_find_what_they_are_asked_for(weights, kind):
    found = finder_of(str(weights[kind]), "cpu", False).find(PICTURE, NAMES, 0.0)
    assert found
    for one in found:
        left, top, right, bottom = one.box
        assert one.name in NAMES and 0 <= one.score <= 1
        assert 0 <= left <= right <= 80 and 0 <= top <= bottom <= 60
        assert (one.mask is not None and one.mask.shape == (60, 80)) if kind == "sam3" else one.mask is None


@pytest.mark.parametrize(("kind", "square"), [("owl", True), ("dino", False)])
def test_boxes_are_in_pixels_of_the_picture(weights, kind, square):
    finder = finder_of(str(weights[kind]), "cpu", False)
    real = finder._model.forward
    high = 80 if square else 60  # OWLv2 sees a square: the picture, and nothing below it

    def planted(**given):
        outputs = real(**given)
        outputs.pred_boxes = torch.zeros_like(outputs.pred_boxes)
        outputs.pred_boxes[0, 3] = torch.tensor([50 / 80, 30 / high, 20 / 80, 20 / high])
        outputs.logits = torch.full_like(outputs.logits, -9.0)
        outputs.logits[0, 3, 1 if square else 3] = 9.0  # the second name; the third token
        return outputs

    finder._model.forward = planted
    (one,) = finder.find(PICTURE, ["cup", "can"], 0.5)
    assert one.name == "can" and one.score > 0.99
    assert one.box == pytest.approx((40, 20, 60, 40), abs=0.01)


def test_a_segmenter_is_given_boxes_and_gives_masks_in_pixels_of_the_picture(weights):
    segmenter = segmenter_of(str(weights["sam2"]), "cpu", False)
    assert [mask.shape for mask in segmenter.masks(PICTURE, [(10, 10, 40, 30), (5, 5, 20, 20)])] == [(60, 80)] * 2
    assert segmenter.masks(PICTURE, []) == []
    asked = []

    def planted(**given):
        asked.append(given["input_boxes"])
        masks = torch.full((1, 1, 1, 32, 32), -1.0)
        masks[..., 8:16, 16:24] = 1.0
        return SimpleNamespace(pred_masks=masks)

    segmenter._model.forward = planted
    (mask,) = segmenter.masks(PICTURE, [(40, 15, 60, 30)])
    assert asked[0].tolist()[0][0] == pytest.approx([64, 32, 96, 64])  # of 128 x 128
    rows, columns = np.nonzero(mask)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == pytest.approx((15, 29, 40, 59), abs=1.5)


def test_what_a_model_read_of_the_sentence_is_the_name_it_shares_most_with():
    assert nearest_name("red can", ["can", "red can", "cup"]) == "red can"
    assert nearest_name("can", ["cup", "red can"]) == "red can"
    assert nearest_name("##x", ["cup"]) == ""


class Double:
    """A finder that puts boxes around what the simulator says is there, each twice, a little apart."""

    def __init__(self, context, masks: bool) -> None:
        self._oracle, self._masks = OracleDetector(), masks
        self._oracle.start(context)
        self.frames = ()

    def find(self, rgb, names, threshold):
        frame = next(one for one in self.frames if one.rgb is rgb)
        found = []
        for one in self._oracle.detect(Request((frame,))):
            mask = one.masks.get(frame.name)
            if mask is None or not mask.any() or one.label not in names:
                continue
            rows, columns = np.nonzero(mask)
            box = (float(columns.min()), float(rows.min()), columns.max() + 1.0, rows.max() + 1.0)
            own = mask if self._masks else None
            found += [FoundThing(one.label, box, 0.8, own), FoundThing(one.label, (box[0] + 1, *box[1:]), 0.7, own)]
        return found


@pytest.mark.sim
@pytest.mark.parametrize("masks", [False, True], ids=["boxes", "masks"])
def test_a_scene_is_measured_from_what_a_finder_finds(masks):
    with looking_at(scene()) as context:
        detector = LocalDetector(LocalSettings(weights="double"))
        detector._finder = double = Double(context, masks)
        detect = detector.detect

        def with_frames(request):
            double.frames = request.frames
            return detect(request)

        detector.detect = with_frames
        eyes = Cameras(CamerasSettings(simulated=SimulatedSettings(width=320)), detector=detector)
        eyes.open()
        eyes.start(context)
        graph = eyes.look()
    block = graph.node("red block")
    assert np.linalg.norm(np.subtract(block.pose.position, (0.42, -0.22, 0.02))) < 0.01 and block.confidence <= 0.8
    assert [node.label for node in graph.nodes if node.kind == "object"].count("can") == 1
    assert graph.node("cupboard door").part_of == graph.node("cupboard").id


def test_what_is_missing_is_said_in_one_line_with_the_remedy(weights, tmp_path, monkeypatch):
    with pytest.raises(InvalidArgument, match=r"perception\.local\.weights"):
        LocalDetector().open()
    with pytest.raises(BackendUnavailable, match=r"nowhere: .*download=true"):
        LocalDetector(LocalSettings(weights=str(tmp_path / "nowhere"))).open()
    with pytest.raises(BackendUnavailable, match="finds nothing by name"):
        LocalDetector(LocalSettings(weights=str(weights["sam2"]))).open()
    with pytest.raises(BackendUnavailable, match="SAM 2"):
        LocalDetector(LocalSettings(weights=str(weights["dino"]), masks=str(weights["dino"]))).open()
    (weights["dino"] / "model.safetensors").rename(tmp_path / "gone")
    try:
        with pytest.raises(BackendUnavailable, match="dino"):
            LocalDetector(LocalSettings(weights=str(weights["dino"]))).open()
    finally:
        (tmp_path / "gone").rename(weights["dino"] / "model.safetensors")
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(BackendUnavailable, match=r"transformers.*\[local\]"):
        LocalDetector(LocalSettings(weights=str(weights["owl"]))).open()


def test_without_names_to_look_for_it_says_so():
    detector = LocalDetector(LocalSettings(weights="double"))
    detector._finder = SimpleNamespace(find=lambda *_: [])
    with pytest.raises(InvalidArgument, match=r"perception\.items"):
        detector.detect(Request((), (), ()))
    assert detector.detect(Request((), (), (Item("cup"),))) == ()
