"""A small skillbook with one of everything: the valid example that imports and books are damaged from."""

from __future__ import annotations

from pathlib import Path

from memo_core.skillbook.book import Skillbook
from memo_core.testing.fake_embedder import FakeEmbedder

TEMPLATE = "def pull(name):\n    '''Pulls {}.'''\n    move_to(get_position(name))\n"


def write_example(path: Path, notes: int = 6) -> None:
    """Write the book to ``path``."""
    with Skillbook(str(path), FakeEmbedder()) as book:
        for number in range(notes):
            subtask = ("OPEN(door)", "PLACE(cube, drawer)", "open(the door)")[number % 3]
            said = book.record_feedback(
                f"no, an arc {number}", f"ana{number % 2}", task="open the door", subtask=subtask, scene="door, table"
            )
            book.add_lessons(said, subtask, [f"Pull along an arc, {number} times."], [f"Go slowly ({number})."])
        for number in range(2):
            approval = book.record_feedback("", "ben", kind="approval", subtask="OPEN(door)", code="x = 1")
            book.add_template(approval, "OPEN(door)", TEMPLATE.format(number))
        book.record_feedback("nobody was asked about this yet", "cleo", subtask="OPEN(door)")
        book.forget("ana1")
