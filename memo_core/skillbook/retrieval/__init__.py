"""Retrieval of entries for a subtask."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.skillbook.retrieval.result import Retrieval as Retrieval, RetrievedEntry as RetrievedEntry
    from memo_core.skillbook.retrieval.retriever import Retriever as Retriever
    from memo_core.skillbook.retrieval.settings import RetrievalSettings as RetrievalSettings

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
