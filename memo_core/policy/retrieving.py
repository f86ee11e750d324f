"""What a subtask is served from the book, as far as the method remembers that kind of thing."""

from __future__ import annotations

import threading

import attrs

from memo_core.events import Retrieved
from memo_core.policy.memories import Memory
from memo_core.policy.session import Session
from memo_core.policy.stopping import abandonable
from memo_core.skillbook import retrieval
from memo_core.skillbook.keys import Key

_ONE_AT_A_TIME = threading.Lock()  # one that was given up may still be at work on the book's index


@attrs.frozen
class Served:
    """Entries for the code prompt, each with ``key`` and ``text``."""

    corrections: tuple[retrieval.Served, ...] = ()
    general: tuple[retrieval.Served, ...] = ()
    templates: tuple[retrieval.Served, ...] = ()
    sources: tuple[int, ...] = ()  # feedback that the entries derive from

    @property
    def entries(self) -> tuple[int, ...]:
        return tuple(one.entry.id for one in (*self.corrections, *self.general, *self.templates))


def retrieve(session: Session, memory: Memory, key: Key) -> Served:
    """Entries for a subtask; nothing where there is no book. Emits ``Retrieved``. Raises ``Stopped``."""
    session.stop.check("retrieval")
    book = session.book
    if book is None or not memory.any:
        return Served()

    def work() -> retrieval.Retrieval:
        with _ONE_AT_A_TIME:
            return book.retrieve(key, task=session.stage.instruction)

    found = abandonable(session.stop, "retrieval", work, late=lambda _: None)
    served = Served(
        found.corrections if memory.corrections else (),
        found.general if memory.general else (),
        found.templates if memory.templates else (),
    )
    served = attrs.evolve(served, sources=tuple(book.sources(served.entries)))
    shown = set(served.entries)
    event = found.event()
    session.emit(Retrieved(event.subtask, tuple(one for one in event.served if one.entry in shown), event.cut))
    return served
