"""Names and keys of litellm's providers, without importing it, which takes seconds, so that settings are checked at
once."""

from __future__ import annotations

import functools
import importlib.util
import json
import re
from pathlib import Path

# Environment variables that may hold a provider's key, the usual one first. Of other providers litellm knows them.
KEYS = {
    "anthropic": ("ANTHROPIC_API_KEY", "ANTHROPIC_AUTH_TOKEN"),
    "cerebras": ("CEREBRAS_API_KEY",),
    "cohere": ("COHERE_API_KEY",),
    "deepinfra": ("DEEPINFRA_API_KEY",),
    "deepseek": ("DEEPSEEK_API_KEY",),
    "gemini": ("GEMINI_API_KEY", "GOOGLE_API_KEY"),
    "groq": ("GROQ_API_KEY",),
    "mistral": ("MISTRAL_API_KEY",),
    "moonshot": ("MOONSHOT_API_KEY",),
    "openai": ("OPENAI_API_KEY",),
    "openrouter": ("OPENROUTER_API_KEY",),
    "perplexity": ("PERPLEXITYAI_API_KEY",),
    "together_ai": ("TOGETHERAI_API_KEY",),
    "xai": ("XAI_API_KEY",),
}


@functools.cache
def known_providers() -> frozenset[str]:
    """The providers of the installed litellm, from its files. Empty if it is not installed, or has other files in this
    version: then it says itself what it does not know."""
    spec = importlib.util.find_spec("litellm")
    if spec is None or not spec.submodule_search_locations:
        return frozenset()
    folder = Path(spec.submodule_search_locations[0])
    try:
        source = (folder / "types" / "utils.py").read_text(encoding="utf-8")
        listed = json.loads((folder / "llms" / "openai_like" / "providers.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return frozenset()
    _, _, rest = source.partition("\nclass LlmProviders(")
    named = re.findall(r'^    [A-Z]\w* = "([^"]+)"', rest.partition("\nclass ")[0], re.MULTILINE)
    return frozenset([*named, *listed]) if named else frozenset()
