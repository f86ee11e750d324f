"""Asking language models: calls, budget, prompt files, readers of answers."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.llm.prompt_sections import (
        Prompt as Prompt,
        PromptEntry as PromptEntry,
        UnreadablePrompt as UnreadablePrompt,
        read_subtask as read_subtask,
    )

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
