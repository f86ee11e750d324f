"""Retrieving entries for a subtask, of the kinds that the method uses."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from itertools import islice
from typing import Any

import attrs
import cattrs

from memo_core.events import Problem
from memo_core.interfaces.backend import Memory
from memo_core.policy.learnt_functions import as_used, used_by
from memo_core.policy.logged_book import entries_of
from memo_core.policy.plan_feedback import is_of_plans
from memo_core.policy.run_context import Session
from memo_core.policy.settings import TeachingSettings
from memo_core.process.stop_switch import abandonable
from memo_core.runlog.run_log import Effect
from memo_core.scene.graph import SceneGraph
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import longest_entry
from memo_core.skillbook.model.functions import FunctionUse
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.model.scene_context import SubtaskContext
from memo_core.skillbook.retrieval.result import RetrievedFunction, Standing
from memo_core.skillbook.retrieval.retriever import Cut, Retrieval, RetrievedEntry

_ONE_AT_A_TIME = threading.Lock()  # one that was given up may still be at work on the book's index


def retrieve(session: Session, memory: Memory, key: Key, scene: SceneGraph) -> Retrieval:
    """Entries for a subtask in a scene; none without a book. Emits ``Retrieved``. Raises ``Stopped``."""
    found = _found(session, memory, key, SubtaskContext.of(key, scene))
    if found is None:
        return Retrieval(key)
    corrections = tuple(one for one in found.corrections if not is_of_plans(one.entry.key))
    found = as_used(attrs.evolve(found, corrections=corrections), _use(session), session.skills, session.approvals)
    session.emit(found.event())
    return found


def retrieve_for_plans(session: Session, memory: Memory, key: Key, scene: SceneGraph) -> tuple[RetrievedEntry, ...]:
    """What people said about the plans of this and similar tasks, best first. Emits ``Retrieved`` if there is
    something. Raises ``Stopped``."""
    found = _found(session, memory, key, SubtaskContext.of(key, scene))
    notes = tuple(one for one in found.corrections if is_of_plans(one.entry.key)) if found is not None else ()
    if notes:
        session.emit(Retrieval(key, notes).event())
    return notes


def _found(session: Session, memory: Memory, key: Key, context: SubtaskContext) -> Retrieval | None:
    book = session.book
    if book is None or not memory.any:
        return None

    def work() -> Retrieval:
        with _ONE_AT_A_TIME:
            return book.retrieve(key, context, clustered=memory.clusters, functions=_use(session))

    def ask(_: int) -> Retrieval:
        found = abandonable(session.stop, "retrieval", work, late=lambda _: None)
        of_method = attrs.evolve(
            found,
            query=key,
            corrections=found.corrections if memory.corrections else (),
            general=found.general if memory.general else (),
            templates=found.templates if memory.templates else (),
            functions=found.functions if memory.templates else (),
        )
        return attrs.evolve(of_method, sources=tuple(book.sources(of_method.entry_ids)))

    kind: Effect[Retrieval] = Effect("retrieve", _keep, lambda record: _read(record, key, book))
    return _usable(session, session.log.effect(kind, str(key), ask))


def _use(session: Session) -> FunctionUse:
    """The use of functions in this run: a model that cannot call them is shown them."""
    return used_by(session.llm, session.functions)


def _usable(session: Session, found: Retrieval) -> Retrieval:
    """The retrieved entries without those that are too long for a prompt, such as a book from elsewhere may have."""
    for one in found.served:
        if not _fits(one):
            told = f"it has {len(one.text)} characters, and at most {longest_entry(one.entry.kind)} fit into a prompt"
            session.emit(Problem(f"entry {one.entry.id} is not used (see `memo skillbook edit`)", told))
    return attrs.evolve(
        found,
        corrections=tuple(filter(_fits, found.corrections)),
        general=tuple(filter(_fits, found.general)),
        templates=tuple(filter(_fits, found.templates)),
        functions=tuple(one for one in found.functions if len(one.entry.text) <= longest_entry(one.entry.kind)),
    )


def _fits(one: RetrievedEntry) -> bool:
    return len(one.text) <= longest_entry(one.entry.kind)


# -- in the prompt -----------------------------------------------------------------------------------------------------


def shown(
    corrections: Sequence[RetrievedEntry], general: Sequence[RetrievedEntry], teaching: TeachingSettings
) -> tuple[list[RetrievedEntry], list[RetrievedEntry]]:
    """Corrections and general statements for the code prompt, each with its ``origin``: who said it, when in relation
    to the others, how similar its key is, what else the same words were said of, and whether it is a hint.

    Corrections of one person under one key are sorted newest first, within the positions that the ranking gave them.
    The same words are shown once, with all that they were said of, at their best position and as a correction if they
    are one.
    """
    ordered = _newer_first(corrections) if teaching.newer_first else list(corrections)
    said: dict[str, list[RetrievedEntry]] = {}
    for one in (*ordered, *general):
        said.setdefault(_words(one.text), []).append(one)
    of_keys = [[one for one in same if one.entry.kind == "correction"] for same in said.values()]
    # Of several the one that is about the subtask stands for all: its key is the one to compare with.
    chosen = [next((one for one in same if one.passes), same[0]) for same in of_keys if same]
    moments = sorted({one.provenance.when for one in ordered})
    people = list(dict.fromkeys(name for one in ordered for name in one.provenance.who))
    lines = []
    for one in chosen:
        same = said[_words(one.text)]
        origin = _origin(one, same, people, moments) if teaching.competing else _also(one, same)
        lines.append(attrs.evolve(one, origin=origin))
    told = {_words(one.text) for one in chosen}
    return lines, [one for one in general if _words(one.text) not in told]


def from_several_remarks(corrections: Sequence[RetrievedEntry]) -> bool:
    """Whether corrections derive from more than one remark, so that they may compete."""
    moments = [one.provenance.when for one in corrections]
    return len({when for when in moments if when}) + moments.count(0.0) > 1


def _words(text: str) -> str:
    """What is compared of two texts: neither case, spaces nor a final full stop."""
    return " ".join(text.casefold().split()).rstrip(".!")


def _newer_first(served: Sequence[RetrievedEntry]) -> list[RetrievedEntry]:
    places: dict[tuple[object, tuple[str, ...]], list[int]] = {}
    for place, one in enumerate(served):
        if len(one.provenance.who) == 1:
            places.setdefault((one.entry.key, one.provenance.who), []).append(place)
    ordered = list(served)
    for held in places.values():
        newest = sorted((served[place] for place in held), key=lambda one: -one.provenance.when)
        for place, one in zip(held, newest, strict=True):
            ordered[place] = one
    return ordered


def _origin(
    one: RetrievedEntry, same: Sequence[RetrievedEntry], people: Sequence[str], moments: Sequence[float]
) -> str:
    """Of all who said the ``same``; the newest time counts. Without names and dates: the model does not need them, and
    recordings are replayed on other days."""
    corrections = [other for other in same if other.entry.kind == "correction"]
    names = dict.fromkeys(name for other in corrections for name in other.provenance.who)
    who = ", ".join(f"person {people.index(name) + 1}" for name in names)
    newest = max(other.provenance.when for other in corrections)
    when = f"remark {moments.index(newest) + 1} of {len(moments)}" if newest else ""
    hint = "" if any(other.passes for other in same) else "only a hint"
    return ", ".join(part for part in (who, when, one.alike, _also(one, same), hint) if part)


def _also(one: RetrievedEntry, same: Sequence[RetrievedEntry]) -> str:
    """What else the same words were said of."""
    keys = dict.fromkeys("everything" if other.entry.kind == "general" else other.key for other in same)
    others = [key for key in keys if key != one.key]
    return f"also said of {' and '.join(others)}" if others else ""


# -- in the run's log: entries by their ids ----------------------------------------------------------------------------


def _keep(found: Retrieval) -> dict[str, Any]:
    rows = [cattrs.unstructure(one) | {"entry": one.entry.id} for one in found.served]
    parts = [len(found.corrections), len(found.general), len(found.templates)]
    cut = [[one.key, one.score, one.rule] for one in found.cut]
    kept = {"served": rows, "parts": parts, "sources": list(found.sources), "cut": cut}
    functions = [[one.entry.id, len(one.calls), one.standing.tested, one.standing.approved] for one in found.functions]
    return kept | ({"functions": functions} if functions else {})


def _read(record: dict[str, Any], key: Key, book: Skillbook) -> Retrieval:
    rows = record["served"]
    types: dict[str, Any] = {field.name: field.type for field in attrs.fields(attrs.resolve_types(RetrievedEntry))}
    every = [
        RetrievedEntry(
            entry, **{name: cattrs.structure(value, types[name]) for name, value in row.items() if name != "entry"}
        )
        for entry, row in zip(entries_of(book, [row["entry"] for row in rows]), rows, strict=True)
    ]
    of_kinds = iter(every)
    corrections, general, templates = (tuple(islice(of_kinds, count)) for count in record["parts"])
    functions = tuple(
        RetrievedFunction(entries_of(book, [function])[0], tuple(islice(of_kinds, calls)), Standing(tested, approved))
        for function, calls, tested, approved in record.get("functions", ())
    )
    cut = tuple(Cut(*cut) for cut in record["cut"])
    return Retrieval(key, corrections, general, templates, cut, sources=tuple(record["sources"]), functions=functions)
