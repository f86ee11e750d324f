"""Books in memory and a clustering over them, for the tests of clustering."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from memo_core.events import Event
from memo_core.interfaces.llm import Answer, LanguageModel, Request
from memo_core.llm.budget import Budget
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.policy.consolidation import Clustering, ClusteringSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog
from memo_core.skillbook import consolidating
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.rules import Cluster
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_llm import ScriptedModel
from memo_core.testing.fake_store import FakeStore

ARC = """def open_door(name, angle=80):
    '''Takes hold of the handle and leads it along an arc about the hinge.'''
    ...
"""


class Kept(LanguageModel):
    """Passes requests on to a model, and keeps them."""

    def __init__(self, inner: LanguageModel) -> None:
        self.name = inner.name
        self.requests: list[Request] = []
        self._inner = inner

    def open(self) -> None: ...

    def close(self) -> None: ...

    def answer(self, request, on_text=None, cancelled=None) -> Answer:
        self.requests.append(request)
        return self._inner.answer(request, on_text, cancelled)


def new_book(url: str = "sqlite://", read_only: bool = False) -> Skillbook:
    return Skillbook(url, FakeEmbedder(), FakeStore(), read_only=read_only).open()


def teach(book: Skillbook, key: str, *texts: str, who: str = "ana") -> list[int]:
    """One piece of feedback a text; the entries' ids."""
    return [book.add_lessons(book.record_feedback(text, who, subtask=key), key, [text])[0].id for text in texts]


def teach_general(book: Skillbook, *texts: str, who: str = "ana") -> list[int]:
    return [book.add_lessons(book.record_feedback(text, who), "OPEN(thing)", [], [text])[0].id for text in texts]


def approve(book: Skillbook, key: str, code: str = ARC, who: str = "ana") -> int:
    return book.add_template(book.record_feedback("", who, subtask=key, kind="approval"), key, code).id


def clustering(
    book: Skillbook,
    model: LanguageModel | Sequence[str | Callable[[Request], str] | BaseException],
    settings: ClusteringSettings | None = None,
    emit: Callable[[Event], None] = lambda event: None,
    stop: StopSwitch | None = None,
) -> Clustering:
    llm = model if isinstance(model, LanguageModel) else ScriptedModel({"cluster": model})
    calls = ModelCalls(llm, stop or StopSwitch(), RunLog(), emit, Budget(), Retrying(0))
    return Clustering(book, calls, llm.name, settings, emit=emit)


def only_cluster(book: Skillbook, unchanged: bool = False) -> Cluster:
    [cluster] = consolidating.clusters(book, unchanged)
    return cluster


def texts(book: Skillbook, key: str | None = None) -> list[str]:
    return [entry.text for entry in book.entries(key=key) if entry.kind != "template"]
