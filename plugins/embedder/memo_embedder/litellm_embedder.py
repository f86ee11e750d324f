"""The ``litellm`` backend: embeddings of any provider that litellm knows, or of any OpenAI-compatible server."""

from __future__ import annotations

import logging
import os
import queue
import random
import threading
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from memo_core.plugin import BackendUnavailable, Embedder, Redactor
from memo_embedder.settings import LiteLLMEmbedderSettings

_LONGEST = 24_000  # characters of a text that are sent; models take some 8000 tokens, keys and entries are far shorter
_BLANK = "(no text)"  # providers refuse an empty text
_LONGEST_WAIT_S = 60.0
_NO_KEY = "none"  # what a server of one's own is sent where no key is set; clients insist on one


class LiteLLMEmbedder(Embedder):
    """Texts go in batches. A request that fails with a rate limit, a server error or a lost connection is retried here,
    since callers do not retry; each is abandoned after ``timeout_s``."""

    def __init__(self, settings: LiteLLMEmbedderSettings) -> None:
        self._settings = settings
        self.name = f"litellm/{settings.model}" + (f"@{settings.dimensions}" if settings.dimensions else "")
        self._litellm: Any = None
        self._key = ""
        self._redact = Redactor()

    def open(self) -> None:
        """Imports litellm and asks for one vector, to know the dimension. Idempotent. Raises ``BackendUnavailable``."""
        if self._litellm is not None:
            return
        litellm = _quiet_litellm()
        self._find_key(litellm)
        self._redact = Redactor.of_environment([self._settings.api_key_env] if self._settings.api_key_env else [])
        self._litellm = litellm
        try:
            self.dimension = self._batch(["dimension"]).shape[1]
        except BaseException:
            self._litellm = None
            raise

    def close(self) -> None:
        self._litellm = None

    def embed(self, texts: Sequence[str]) -> np.ndarray:
        if self._litellm is None:
            raise _unavailable("it is not open", "call open() first")
        vectors = np.zeros((len(texts), self.dimension), dtype=np.float32)
        for start in range(0, len(texts), self._settings.batch):
            batch = [
                text[:_LONGEST] if text.strip() else _BLANK for text in texts[start : start + self._settings.batch]
            ]
            found = self._batch(batch)
            if found.shape[1] != self.dimension:
                raise _unavailable(f"{self.name} sent vectors of {found.shape[1]} and of {self.dimension} dimensions")
            vectors[start : start + len(batch)] = found
        return vectors

    def _find_key(self, litellm: Any) -> None:
        settings = self._settings
        if settings.api_key_env:
            self._key = os.environ.get(settings.api_key_env, "")
            missing = [] if self._key else [settings.api_key_env]
        else:
            said = litellm.validate_environment(settings.model)
            missing = [name for name in said["missing_keys"] if name.endswith(("_KEY", "_TOKEN"))]
            usual = f"{settings.model.partition('/')[0].upper()}_API_KEY"
            missing = [usual] if usual in missing else missing
            if missing and settings.api_base:
                self._key, missing = _NO_KEY, []
        if missing:
            raise _unavailable(f"{settings.model} needs a key and {missing[0]} is not set", f"export {missing[0]}=…")

    # -- one batch -----------------------------------------------------------------------------------------------------
    def _batch(self, texts: list[str]) -> np.ndarray:
        """Unit vectors, shape (len(texts), dimension)."""
        for attempt in range(self._settings.retries + 1):
            try:
                return self._once(texts)
            except _Failed as failed:
                wait = max(failed.wait_s, min(30.0, 2.0**attempt) * random.uniform(0.75, 1.25))
                if not failed.retryable or attempt == self._settings.retries or failed.wait_s > _LONGEST_WAIT_S:
                    raise _unavailable(failed.problem) from None
                time.sleep(wait)
        raise AssertionError("unreachable")

    def _once(self, texts: list[str]) -> np.ndarray:
        news: queue.SimpleQueue[Any] = queue.SimpleQueue()

        def work() -> None:
            try:
                news.put(self._asked(texts))
            except Exception as error:
                news.put(error)

        threading.Thread(target=work, name="memo-embedding", daemon=True).start()
        where = self._settings.api_base or self._settings.model.partition("/")[0]
        try:
            told = news.get(timeout=self._settings.timeout_s)
        except queue.Empty:
            seconds = f"{self._settings.timeout_s:g} s"
            raise _Failed(f"{where} did not finish within embedder.timeout_s ({seconds})", False) from None
        if isinstance(told, Exception):
            raise self._failure(told, where) from None
        return _unit_vectors(told, len(texts), where)

    def _asked(self, texts: list[str]) -> list[Any]:
        settings = self._settings
        given: dict[str, Any] = {
            "model": settings.model,
            "input": texts,
            "timeout": settings.timeout_s,
            "num_retries": 0,
            "max_retries": 0,
            "encoding_format": "float",
        }
        given |= {"api_base": settings.api_base} if settings.api_base else {}
        given |= {"api_key": self._key} if self._key else {}
        given |= {"dimensions": settings.dimensions} if settings.dimensions else {}
        found = sorted(self._litellm.embedding(**given).data, key=lambda item: item["index"])
        return [item["embedding"] for item in found]

    def _failure(self, error: Exception, where: str) -> _Failed:
        said = " ".join(str(error).partition("Traceback (most recent call last)")[0].split())[:400]
        status = getattr(error, "status_code", None)
        cut = isinstance(error, (self._litellm.APIConnectionError, ConnectionError)) or status is None
        retryable = cut or status == 429 or (isinstance(status, int) and status >= 500)
        headers = getattr(getattr(error, "response", None), "headers", None) or {}
        headers = {**headers, **(getattr(error, "litellm_response_headers", None) or {})}
        after = str({name.lower(): value for name, value in headers.items()}.get("retry-after", ""))
        wait = float(after) if after.replace(".", "", 1).isdigit() else 0.0
        return _Failed(self._redact(f"{where}: {said or type(error).__name__}"), retryable, wait)


class _Failed(Exception):
    """One request that returned no vectors."""

    def __init__(self, problem: str, retryable: bool, wait_s: float = 0.0) -> None:
        super().__init__(problem)
        self.problem = problem
        self.retryable = retryable
        self.wait_s = wait_s


def _unit_vectors(found: list[Any], wanted: int, where: str) -> np.ndarray:
    try:
        vectors = np.asarray(found, dtype=np.float64)
    except (TypeError, ValueError):
        vectors = np.zeros(0)
    if vectors.ndim != 2 or vectors.shape[0] != wanted or not vectors.shape[1]:
        raise _Failed(f"{where} sent {len(found)} vectors for {wanted} texts, or vectors that are none", False)
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not (np.isfinite(vectors).all() and (lengths > 0).all()):
        raise _Failed(f"{where} sent a vector without a direction", False)
    return (vectors / lengths).astype(np.float32)


def _quiet_litellm() -> Any:
    """Import litellm without network access, telemetry, .env files or advice on the terminal."""
    os.environ.setdefault("LITELLM_LOCAL_MODEL_COST_MAP", "True")
    os.environ.setdefault("LITELLM_MODE", "PRODUCTION")
    try:
        import litellm
    except ImportError as error:
        raise _unavailable("litellm is not installed", "pip install litellm") from error
    litellm.telemetry = False
    litellm.suppress_debug_info = True
    litellm.turn_off_message_logging = True
    litellm.drop_params = True
    logging.getLogger("LiteLLM").setLevel(logging.CRITICAL)
    for name in ("httpx", "httpcore", "openai"):  # their lines hold addresses, and some providers' hold the key
        logger = logging.getLogger(name)
        logger.setLevel(max(logger.level, logging.WARNING))
    return litellm


def _unavailable(reason: str, remedy: str = "") -> BackendUnavailable:
    return BackendUnavailable("embedder", "litellm", reason, remedy)
