"""Importing litellm so that it stays quiet: no network, no telemetry, no files read, no secrets in its logs."""

from __future__ import annotations

import contextlib
import logging
import os
import threading
from typing import Any

_lock = threading.Lock()


def quiet_litellm() -> Any:
    """The module ``litellm``, imported on first use, which takes some seconds."""
    with _lock:
        # Read at import: else it downloads a price list, and reads an .env file of wherever memo was started.
        os.environ.setdefault("LITELLM_LOCAL_MODEL_COST_MAP", "True")
        os.environ.setdefault("LITELLM_MODE", "PRODUCTION")
        import httpx
        import litellm

        from memo_llm.litellm.connection import traced_transport

        litellm.telemetry = False
        litellm.suppress_debug_info = True  # it prints advice to stdout otherwise
        litellm.turn_off_message_logging = True
        litellm.drop_params = True  # a model that knows no seed is asked without one
        for name in ("LiteLLM", "LiteLLM Router", "LiteLLM Proxy"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        for name in ("httpx", "httpcore", "openai"):  # their lines hold addresses, and some providers' hold the key
            logger = logging.getLogger(name)
            logger.setLevel(max(logger.level, logging.WARNING))
        if not isinstance(getattr(litellm, "sync_transport", None), httpx.BaseTransport):
            # The two places where litellm looks for a connection: OpenAI's client library, and its own.
            litellm.sync_transport = traced_transport()
            litellm.client_session = httpx.Client(transport=litellm.sync_transport, follow_redirects=True)
        return litellm


def warm_up(litellm: Any, model: str) -> None:
    """Import now what litellm would import at its first call, because importing blocks other threads and a stop must be
    noticed during a call. Sends no request."""

    with contextlib.suppress(Exception):  # the first real call says what is wrong
        litellm.completion(model, [{"role": "user", "content": ""}], mock_response="ready", api_key="none")
