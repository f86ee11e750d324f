"""The ``sentence-transformers`` backend: unit vectors by onnxruntime, or by torch if the export does not work."""

from __future__ import annotations

import importlib.util
import logging
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from memo_core.plugin import BackendUnavailable, Embedder
from memo_embedder.export import FORMAT
from memo_embedder.model_folder import ModelFolder, default_cache, find_model
from memo_embedder.settings import SentenceTransformersSettings

log = logging.getLogger(__name__)

_EXPORT_TIMEOUT_S = 600.0


# Kept beyond close(), as are the vectors of recent texts: an evaluation opens hundreds of books that say much the same.
_KEPT_TEXTS = 4096  # 6 MB


@lru_cache(maxsize=1)
def _onnx_vector(path: Path, changed: int, model: Path, max_tokens: int, threads: int) -> Callable[[str], np.ndarray]:
    """The exported model at ``path`` as a function. ``changed``: when the file was written, so that another is read."""
    try:
        import onnxruntime
        from tokenizers import Tokenizer
    except ImportError as error:
        raise _unavailable(f"{error.name} is not installed", f"pip install {error.name}") from error
    onnxruntime.disable_telemetry_events()  # what a lab runs is nobody else's business
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    tokenizer = Tokenizer.from_file(str(model / "tokenizer.json"))
    tokenizer.no_padding()
    tokenizer.enable_truncation(max_tokens)

    @lru_cache(maxsize=_KEPT_TEXTS)
    def vector(text: str) -> np.ndarray:
        ids = np.array([tokenizer.encode(text).ids], dtype=np.int64)
        found: np.ndarray = session.run(None, {"input_ids": ids, "attention_mask": np.ones_like(ids)})[0][0]
        return found

    return vector


class SentenceTransformersEmbedder(Embedder):
    """Texts are embedded one at a time, so that a text's vector does not depend on what is embedded beside it."""

    def __init__(self, settings: SentenceTransformersSettings) -> None:
        self._settings = settings
        self._folder: ModelFolder | None = None
        self._vector: Callable[[str], np.ndarray] | None = None
        self.runtime = ""  # "onnxruntime" or "torch", once open

    @property
    def name(self) -> str:  # type: ignore[override]
        """The model and a fingerprint of its weights. Raises ``BackendUnavailable``."""
        folder = self._model()
        return f"{folder.title}#{folder.fingerprint}"

    def open(self) -> None:
        """Idempotent. The first time on a machine the model is exported into the cache, which takes some 20 s."""
        if self._vector is not None:
            return
        folder = self._model()
        self._vector = self._with_torch(folder) if self._settings.runtime == "torch" else self._with_onnxruntime(folder)
        self.dimension = int(self._vector("dimension").shape[0])

    def close(self) -> None:
        self._vector = None

    def embed(self, texts: Sequence[str]) -> np.ndarray:
        if self._vector is None:
            raise BackendUnavailable("embedder", "sentence-transformers", "it is not open", "call open() first")
        vectors = np.zeros((len(texts), self.dimension), dtype=np.float32)
        for row, text in zip(vectors, texts, strict=True):
            row[:] = self._vector(text)
        return vectors

    def export_path(self) -> Path:
        """The folder of this model's export, under whichever title, existing or not."""
        base = Path(self._settings.cache_dir).expanduser() if self._settings.cache_dir else default_cache()
        folder = self._model()
        kept = f"{folder.fingerprint}-{FORMAT}.onnx"
        return next(iter(sorted(base.glob(f"*-{kept}"))), base / f"{folder.title}-{kept}")

    # -- inside --------------------------------------------------------------------------------------------------------
    def _model(self) -> ModelFolder:
        if self._folder is None:
            self._folder = find_model(self._settings.model)
        return self._folder

    def _with_onnxruntime(self, folder: ModelFolder) -> Callable[[str], np.ndarray]:
        path = self.export_path()
        try:
            if path.is_file():
                try:
                    return self._session(folder, path)
                except Exception as error:
                    log.warning("the exported model %s cannot be read and is recreated: %s", path, error)
            self._export(folder, path)
            return self._session(folder, path)
        except BackendUnavailable as error:
            if self._settings.runtime == "onnxruntime" or not _installed("torch", "sentence_transformers"):
                raise
            log.warning("%s; torch is used instead, which starts more slowly", error)
            return self._with_torch(folder)

    def _session(self, folder: ModelFolder, path: Path) -> Callable[[str], np.ndarray]:
        state = path.stat()
        vector = _onnx_vector(path, state.st_mtime_ns, folder.path, folder.max_tokens, self._settings.threads)
        self.runtime = "onnxruntime"
        return vector

    def _with_torch(self, folder: ModelFolder) -> Callable[[str], np.ndarray]:
        if not _installed("torch", "sentence_transformers"):
            raise _unavailable("torch or sentence-transformers is not installed", "pip install sentence-transformers")
        os.environ["HF_HUB_OFFLINE"] = "1"
        import torch
        from sentence_transformers import SentenceTransformer

        torch.set_num_threads(self._settings.threads)
        model = SentenceTransformer(str(folder.path), device="cpu")
        self.runtime = "torch"

        def vector(text: str) -> np.ndarray:
            return np.asarray(model.encode([text], normalize_embeddings=True, show_progress_bar=False)[0])

        return vector

    def _export(self, folder: ModelFolder, target: Path) -> None:
        if not _installed("torch", "transformers", "onnxscript"):
            raise _unavailable(
                f"there is no exported model at {target} and torch, transformers or onnxscript to make it are missing",
                "pip install torch transformers onnxscript, or copy the file from a machine that has it",
            )
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            scratch = tempfile.TemporaryDirectory(dir=target.parent, prefix=".export-")
        except OSError as error:
            raise _unavailable(
                f"the cache {target.parent} cannot be written: {error.strerror}", "set cache_dir"
            ) from error
        with scratch as folder_name:
            made = Path(folder_name) / "model.onnx"
            command = [sys.executable, "-m", "memo_embedder.export", str(folder.path), str(made)]
            environment = {**os.environ, "HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": str(self._settings.threads)}
            environment["TMPDIR"] = folder_name  # torch leaves a cache in the temporary directory
            try:
                ended = subprocess.run(
                    [*command, "--max-tokens", str(folder.max_tokens)],
                    env=environment,
                    stdin=subprocess.DEVNULL,
                    capture_output=True,
                    text=True,
                    timeout=_EXPORT_TIMEOUT_S,
                    check=False,
                )
            except subprocess.TimeoutExpired as error:
                raise _unavailable(f"exporting the model took more than {_EXPORT_TIMEOUT_S:g} s") from error
            if ended.returncode or not made.is_file():
                last = (ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"])[-1]
                raise _unavailable(f"exporting the model failed: {last}")
            with made.open("rb+") as stream:
                os.fsync(stream.fileno())
            os.replace(made, target)  # atomic: another process sees the whole file or none


def _installed(*modules: str) -> bool:
    return all(importlib.util.find_spec(module) is not None for module in modules)


def _unavailable(reason: str, remedy: str = "") -> BackendUnavailable:
    return BackendUnavailable("embedder", "sentence-transformers", reason, remedy)
