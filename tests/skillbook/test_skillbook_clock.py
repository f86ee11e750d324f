"""Within a book its own numbering decides what is newer, also when the computer's clock is set back."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from memo_core.skillbook import consolidating, exchange
from memo_core.skillbook.book import Skillbook
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

KEY = "OPEN(drawer)"


@pytest.fixture
def book() -> Iterator[Skillbook]:
    """Its clock goes back by an hour each time it is read."""
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore()) as opened:
        times = iter(range(1_000_000, 0, -3600))
        opened.database.now = lambda: float(next(times))
        yield opened


def template(book: Skillbook, number: int) -> int:
    approval = book.record_feedback("", "ann", kind="approval", subtask=KEY)
    return book.add_template(approval, KEY, f"def pull_{number}(drawer):\n    move_to(drawer)\n").id


def test_of_templates_with_equal_records_the_newest_is_served(book: Skillbook) -> None:
    first, second, third = (template(book, number) for number in range(3))
    for _ in range(2):
        book.note_use([third], success=False, subtask=KEY)
    assert [entry.id for entry in book.entries("template")] == [second], first


def test_a_note_that_was_made_after_a_template_is_known_to_correct_it(book: Skillbook) -> None:
    early = book.add_lessons(book.record_feedback("pull it", "ann"), KEY, ["Pull it."])[0]
    own = template(book, 0)
    late = book.add_lessons(book.record_feedback("lift it", "ann"), KEY, ["Lift it."])[0]
    book.note_use([own], success=False, subtask=KEY)
    [cluster] = consolidating.clusters(book)
    assert cluster.said_after == {late.id} and early.id in cluster.whole


def test_a_reworded_note_is_newer_than_what_was_there(book: Skillbook) -> None:
    first = book.add_lessons(book.record_feedback("pull it", "ann"), KEY, ["Pull it."])[0]
    second = book.add_lessons(book.record_feedback("lift it", "ann"), KEY, ["Lift it."])[0]
    book.edit(first.id, "Pull it slowly.", "ann")
    third = next(entry for entry in book.entries() if entry.text == "Pull it slowly.")
    assert first.created <= second.created <= third.created


def test_another_laboratorys_clock_does_not_date_the_books_own_entries(book: Skillbook) -> None:
    with Skillbook("sqlite://", FakeEmbedder()) as other:
        other.database.now = lambda: 9_000_000.0
        other.add_lessons(other.record_feedback("push it", "bob"), KEY, ["Push it."])
        exchange.merge(book, exchange.export(other), "another laboratory")
    assert book.add_lessons(book.record_feedback("pull it", "ann"), KEY, ["Pull it."])[0].created < 9_000_000
