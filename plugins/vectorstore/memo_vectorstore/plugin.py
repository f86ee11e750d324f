"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from memo_core.plugin import Backend, Needs, hookimpl
from memo_vectorstore.settings import ChromaSettings, FaissSettings


def _faiss(config: FaissSettings) -> Any:
    from memo_vectorstore.faiss_store import FaissStore

    return FaissStore(config)


def _chroma(config: ChromaSettings) -> Any:
    from memo_vectorstore.chroma_store import ChromaStore

    return ChromaStore(config)


@hookimpl
def memo_vector_stores() -> Iterable[Backend]:
    return (
        Backend(
            kind="vectorstore",
            name="faiss",
            summary="inner products in memory, exact up to a size, optionally kept in a file",
            factory=_faiss,
            config=FaissSettings,
            default=True,
            needs=Needs(modules={"faiss": "faiss-cpu"}),
        ),
        Backend(
            kind="vectorstore",
            name="chroma",
            summary="approximate inner products in memory, in a folder, or on a Chroma server that several share",
            factory=_chroma,
            config=ChromaSettings,
            needs=Needs(modules={"chromadb": "chromadb"}),
        ),
    )
