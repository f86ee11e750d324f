"""Models that run on this machine (Hugging Face transformers): finders, which put boxes around what names describe
(OWLv2, Grounding DINO) or masks over it (SAM 3), and a segmenter, which cuts out what is in a box or at a point
(SAM 2).

Their weights are the user's: a folder, or the name of a repository that has been downloaded. Which kind of model it is,
its own configuration says.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import attrs
import cv2
import numpy as np

from memo_core.plugin import BackendUnavailable, install
from memo_perception.cameras.detectors.detector import Prompt
from memo_perception.cameras.detectors.model_answers import Box

_IMAGENET = ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))  # mean and standard deviation of RGB, 0 to 1
_HALVES = ((0.5, 0.5, 0.5), (0.5, 0.5, 0.5))


@attrs.frozen(eq=False)
class FoundThing:
    """What a finder found for a name: a box (left, top, right, bottom; px), a score from 0 to 1, perhaps a mask."""

    name: str
    box: Box
    score: float
    mask: np.ndarray | None = None  # (H, W) bool


class Finder(ABC):
    """Finds what names describe."""

    @abstractmethod
    def find(self, rgb: np.ndarray, names: Sequence[str], threshold: float) -> list[FoundThing]:
        """In a picture, RGB uint8 (H, W, 3), everything with at least this score, in no order."""


class Owl(Finder):
    """OWLv2 (Minderer et al., 2023)."""

    def __init__(self, weights: str, device: str, download: bool) -> None:
        self._model, self._processor = _loaded("Owlv2ForObjectDetection", "Owlv2Processor", weights, device, download)

    def find(self, rgb: np.ndarray, names: Sequence[str], threshold: float) -> list[FoundThing]:
        asked = [[f"a photo of a {name}" for name in names]]
        most = int(self._model.config.text_config.max_position_embeddings)
        given = self._processor(
            text=asked, images=_pil(rgb), return_tensors="pt", padding="max_length", truncation=True, max_length=most
        ).to(self._model.device)
        outputs = _run(self._model, **given)
        high, wide = rgb.shape[:2]
        side = max(high, wide)  # the picture is padded to a square, below and to the right
        (found,) = self._processor.post_process_grounded_object_detection(
            outputs, threshold=threshold, target_sizes=[(side, side)]
        )
        return [
            FoundThing(names[label], _clipped(box, wide, high), score)
            for label, box, score in zip(
                found["labels"].tolist(), found["boxes"].tolist(), found["scores"].tolist(), strict=True
            )
        ]


class Dino(Finder):
    """Grounding DINO (Liu et al., 2023). All names are in one sentence; what it reads of it is matched to the names."""

    def __init__(self, weights: str, device: str, download: bool) -> None:
        self._model, self._processor = _loaded(
            "GroundingDinoForObjectDetection", "GroundingDinoProcessor", weights, device, download
        )

    def find(self, rgb: np.ndarray, names: Sequence[str], threshold: float) -> list[FoundThing]:
        text = "".join(f"{name.lower()}. " for name in names).strip()
        given = self._processor(text=text, images=_pil(rgb), return_tensors="pt").to(self._model.device)
        outputs = _run(self._model, **given)
        high, wide = rgb.shape[:2]
        (found,) = self._processor.post_process_grounded_object_detection(
            outputs, given["input_ids"], threshold=threshold, text_threshold=threshold, target_sizes=[(high, wide)]
        )
        return [
            FoundThing(name, _clipped(box, wide, high), score)
            for said, box, score in zip(
                found["text_labels"], found["boxes"].tolist(), found["scores"].tolist(), strict=True
            )
            if (name := nearest_name(said, names))
        ]


class Sam3(Finder):
    """SAM 3 (Meta, 2025): one question a name, masks with the boxes."""

    def __init__(self, weights: str, device: str, download: bool) -> None:
        self._model, self._tokenizer = _loaded("Sam3Model", "AutoTokenizer", weights, device, download)
        self.side = int(self._model.config.vision_config.backbone_config.image_size)

    def find(self, rgb: np.ndarray, names: Sequence[str], threshold: float) -> list[FoundThing]:
        pixels = _pixels(rgb, self.side, *_HALVES).to(self._model.device)
        seen = _run(self._model.get_vision_features, pixel_values=pixels)
        high, wide = rgb.shape[:2]
        most = int(self._model.config.text_config.max_position_embeddings)
        found = []
        for name in names:
            words = self._tokenizer(name, return_tensors="pt", padding="max_length", truncation=True, max_length=most)
            given = {key: words[key].to(self._model.device) for key in ("input_ids", "attention_mask")}
            outputs = _run(self._model, vision_embeds=seen, **given)
            scores = outputs.pred_logits[0].sigmoid()
            if outputs.presence_logits is not None:
                scores = scores * outputs.presence_logits[0].sigmoid()
            for i in (scores >= threshold).nonzero().flatten().tolist():
                box = (outputs.pred_boxes[0, i].cpu().numpy() * [wide, high, wide, high]).tolist()
                mask = _resized(outputs.pred_masks[0, i].float().cpu().numpy(), wide, high)
                found.append(FoundThing(name, _clipped(box, wide, high), float(scores[i]), mask))
        return found


class Sam2:
    """SAM 2 (Ravi et al., 2024): what is in a box, or at a point."""

    def __init__(self, weights: str, device: str, download: bool) -> None:
        self._model, _ = _loaded("Sam2Model", "", weights, device, download)
        self.side = int(self._model.config.prompt_encoder_config.image_size)

    def masks(self, rgb: np.ndarray, prompts: Sequence[Prompt]) -> list[np.ndarray]:
        """A mask (H, W) bool for each prompt."""
        if not prompts:
            return []
        pixels = _pixels(rgb, self.side, *_IMAGENET).to(self._model.device)
        seen = _run(self._model.get_image_embeddings, pixel_values=pixels)
        found: dict[int, np.ndarray] = {}
        for length in {len(prompt) for prompt in prompts}:  # boxes and points do not go into one question
            numbers = [number for number, prompt in enumerate(prompts) if len(prompt) == length]
            masks = self._cut_out(seen, [prompts[number] for number in numbers], rgb.shape[1], rgb.shape[0])
            found.update(zip(numbers, masks, strict=True))
        return [found[number] for number in range(len(prompts))]

    def _cut_out(self, seen: Any, prompts: Sequence[Prompt], wide: int, high: int) -> list[np.ndarray]:
        import torch

        scale = np.array([self.side / wide, self.side / high] * (len(prompts[0]) // 2))
        given = torch.tensor(np.asarray(prompts) * scale, dtype=torch.float32)[None].to(self._model.device)
        asked: dict[str, Any] = {"input_boxes": given}
        if len(prompts[0]) == 2:
            inside = torch.ones(1, len(prompts), 1, dtype=torch.int64, device=self._model.device)
            asked = {"input_points": given[:, :, None], "input_labels": inside}
        outputs = _run(self._model, image_embeddings=seen, multimask_output=False, **asked)
        return [_resized(one[0].float().cpu().numpy(), wide, high) for one in outputs.pred_masks[0]]


FINDERS: dict[str, type[Owl] | type[Dino] | type[Sam3]] = {"owlv2": Owl, "grounding-dino": Dino, "sam3": Sam3}


def finder_of(weights: str, device: str, download: bool) -> Finder:
    """The finder with these weights. Raises ``BackendUnavailable`` with the remedy."""
    kind = _kind(weights, download)
    if kind not in FINDERS:
        known = ", ".join(FINDERS)
        raise _unavailable(weights, f"it is a {kind!r} model, which finds nothing by name", f"one of: {known}")
    return FINDERS[kind](weights, device, download)


def segmenter_of(weights: str, device: str, download: bool) -> Sam2:
    """The segmenter with these weights. Raises ``BackendUnavailable`` with the remedy."""
    kind = _kind(weights, download)
    if kind not in ("sam2", "sam2_video"):
        raise _unavailable(weights, f"it is a {kind!r} model, which cuts out no boxes", "weights of SAM 2")
    return Sam2(weights, device, download)


def nearest_name(said: str, names: Sequence[str]) -> str:
    """The name that shares most words with what a model read of the sentence of all names; empty if none does."""
    words = set(said.lower().split())
    alike = {name: len(words & (own := set(name.lower().split()))) / len(words | own) for name in names}
    best = max(alike, key=lambda name: alike[name], default="")
    return best if best and alike[best] else ""


def _kind(weights: str, download: bool) -> str:
    transformers = _transformers()
    try:
        config = transformers.AutoConfig.from_pretrained(weights, local_files_only=not download)
    except (OSError, ValueError) as error:
        raise _unavailable(weights, _first_line(error), _remedy(download)) from None
    return str(config.model_type)


def _loaded(model: str, processor: str, weights: str, device: str, download: bool) -> tuple[Any, Any]:
    transformers = _transformers()
    given = {"local_files_only": not download}
    try:
        loaded = getattr(transformers, model).from_pretrained(weights, **given).to(device).eval()
        reads = getattr(transformers, processor).from_pretrained(weights, **given) if processor else None
    except (OSError, ValueError, RuntimeError, ImportError) as error:
        raise _unavailable(weights, _first_line(error), _remedy(download)) from None
    return loaded, reads


def _transformers() -> Any:
    try:
        import torch  # noqa: F401
        import transformers
    except ImportError as error:
        raise BackendUnavailable(
            "detector", "local", f"{error.name} is not installed", install("memo-perception[local]")
        ) from None
    return transformers


def _unavailable(weights: str, problem: str, remedy: str) -> BackendUnavailable:
    return BackendUnavailable("detector", "local", f"{weights}: {problem}", remedy)


def _remedy(download: bool) -> str:
    wanted = "a folder with a model's weights, its configuration and its tokenizer"
    return wanted if download else f"{wanted}, or perception.local.download=true"


def _first_line(error: Exception) -> str:
    return next((line.strip() for line in str(error).splitlines() if line.strip()), type(error).__name__)


def _run(model: Any, **given: Any) -> Any:
    import torch

    with torch.inference_mode():
        return model(**given)


def _pil(rgb: np.ndarray) -> Any:
    from PIL import Image

    return Image.fromarray(rgb)


def _pixels(rgb: np.ndarray, side: int, mean: Sequence[float], deviation: Sequence[float]) -> Any:
    """A picture as a tensor (1, 3, side, side), stretched to a square as SAM is trained."""
    import torch

    square = cv2.resize(rgb, (side, side), interpolation=cv2.INTER_LINEAR).astype(np.float32) / 255
    square = (square - np.asarray(mean, np.float32)) / np.asarray(deviation, np.float32)
    return torch.from_numpy(np.ascontiguousarray(square.transpose(2, 0, 1)))[None]


def _resized(logits: np.ndarray, wide: int, high: int) -> np.ndarray:
    return cv2.resize(logits, (wide, high), interpolation=cv2.INTER_LINEAR) > 0


def _clipped(box: Sequence[float], wide: int, high: int) -> Box:
    left, right = sorted(float(np.clip(x, 0, wide)) for x in (box[0], box[2]))
    top, bottom = sorted(float(np.clip(y, 0, high)) for y in (box[1], box[3]))
    return left, top, right, bottom
