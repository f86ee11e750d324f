"""Whatever is done in whatever order, each key keeps a program that does what was approved, and a call its function."""

from __future__ import annotations

import contextlib
import random

from hypothesis import given, settings, strategies as st

from memo_core.skillbook import exchange, history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import functions_of, merge_notes, merge_programs
from memo_core.skillbook.history import CannotRollBack
from memo_core.skillbook.writing.functions import FUNCTIONS, SAME_WORDS
from tests.support.cluster_books import approve, new_book, teach
from tests.support.function_books import approve_call, content, exported, program, programs, tree

THINGS = ("microwave", "oven", "fridge", "chest", "crate", "safe")
PEOPLE = ("ana", "ben", "cleo")
GROUP = st.lists(
    st.tuples(st.sampled_from(PEOPLE), st.sampled_from((85, 70, 60.5)), st.booleans()), min_size=2, max_size=6
)
SHARED = ("merge", "merge again", "roll back", "edit", "approve", "approve call", "use", "join notes")
ACTS = (*SHARED, "forget", "copy")  # which end an exchange: a book withdraws only feedback that was given in it


class Doing:
    """A book that acts are done in, with what each key's programs may do."""

    def __init__(self, book: Skillbook, draw: random.Random) -> None:
        self.book, self.draw = book, draw
        self.allowed: dict[str, set[str]] = {}  # by key, what was ever approved for it

    def teach(self, thing: str, who: str, angle: float, longer: bool) -> None:
        code = program(thing, angle) if not longer else program(thing, angle).replace("look()", "look()\n    wait()")
        approve(self.book, f"OPEN({thing})", code, who)
        teach(self.book, f"OPEN({thing})", "Slowly." if longer else f"{who} says so.", who=who)
        self.allowed.setdefault(f"OPEN({thing})", set()).add(tree(code))

    def act(self, name: str) -> None:
        before = sum(len(entry.text) for entry in self.book.entries())
        getattr(self, name.replace(" ", "_"))()
        if name in ("merge", "merge again", "join notes"):
            assert sum(len(entry.text) for entry in self.book.entries()) <= before, f"{name} made the book longer"

    def merge(self) -> None:
        merge_programs(self.book, ("open_hinged_2",))

    def merge_again(self) -> None:
        merge_programs(self.book, (), again=True)

    def join_notes(self) -> None:
        merge_notes(self.book)

    def roll_back(self) -> None:
        changes = (FUNCTIONS, SAME_WORDS, "rollback", "edit")
        numbers = [one.id for one in history.revisions(self.book) if one.reason.startswith(changes)]
        if numbers:
            with contextlib.suppress(CannotRollBack):
                history.roll_back(self.book, self.draw.choice(numbers))

    def forget(self) -> None:
        if len(self.book.people()) > 1:
            self.book.forget(self.draw.choice(self.book.people()))

    def edit(self) -> None:
        """Something that does the same: a docstring's words."""
        programs_here = [entry for entry in self.book.entries() if entry.kind in ("template", "function")]
        if programs_here:
            entry = self.draw.choice(programs_here)
            text = entry.text.replace("Open a", self.draw.choice(("Open one", "Open some", "Open a")), 1)
            self.book.edit(entry.id, text, self.draw.choice(PEOPLE))

    def approve(self) -> None:
        self.teach(self.draw.choice(THINGS), self.draw.choice(PEOPLE), self.draw.choice((85, 40)), False)

    def approve_call(self) -> None:
        learnt = functions_of(self.book)
        if learnt:
            one, thing = self.draw.choice(learnt), self.draw.choice(THINGS)
            call = f"{one.function.name}(door={f'{thing} door'!r}, angle=50)"
            entry = approve_call(self.book, f"OPEN({thing})", call, self.draw.choice(PEOPLE), one.entry.id)

            longer = "wait()" in one.entry.text
            code = program(thing, 50) if not longer else program(thing, 50).replace("look()", "look()\n    wait()")
            self.allowed.setdefault(str(entry.key), set()).add(tree(code))

    def use(self) -> None:
        entries = [entry for entry in self.book.entries() if entry.kind in ("template", "call")]
        if entries:
            entry = self.draw.choice(entries)
            self.book.note_use([entry.id], self.draw.random() < 0.5, entry.key)

    def copy(self) -> None:
        with new_book() as other:
            exchange.merge(other, exported(self.book), "one")
            assert content(other) == content(self.book) and programs(other) == programs(self.book)
            assert not exchange.merge(other, exported(self.book), "one").changed

    def check(self) -> None:
        found = programs(self.book)
        for key, does in found.items():
            assert does <= self.allowed[key], key
        said = {str(entry.key) for entry in self.book.entries(superseded=True) if entry.kind in ("template", "call")}
        assert said == set(found), "a key has no program any more"
        names = [one.function.name for one in functions_of(self.book)]
        assert len(set(names)) == len(names)


@settings(max_examples=40)
@given(GROUP, st.lists(st.sampled_from(ACTS), min_size=1, max_size=6), st.integers(0, 2**16))
def test_each_key_keeps_a_program_and_each_call_its_function(
    group: list[tuple[str, float, bool]], acts: list[str], seed: int
) -> None:
    with new_book() as book:
        doing = Doing(book, random.Random(seed))
        for thing, (who, angle, longer) in zip(THINGS, group, strict=False):
            doing.teach(thing, who, angle, longer)
        for act in ["merge", *acts]:
            doing.act(act)
            doing.check()
        for key in list(programs(book))[:1]:
            for way in ({}, {"functions": False}, {"clustered": False}):
                found = book.retrieve(key, **way)
                assert found.templates or found.functions
        assert book.problems() == []


@settings(max_examples=8)
@given(st.lists(st.tuples(st.booleans(), st.sampled_from(SHARED)), max_size=8), st.integers(0, 2**16))
def test_two_books_that_import_each_other_come_to_hold_the_same_functions(acts: list, seed: int) -> None:
    with new_book() as one, new_book() as other:
        draw = random.Random(seed)
        books = [Doing(one, draw), Doing(other, draw)]
        for place, thing in enumerate(THINGS):
            books[place % 2].teach(thing, PEOPLE[place % 3], 85, False)
        exchange.merge(other, exported(one), "one")
        for first, act in acts:
            books[first].allowed = books[not first].allowed = books[0].allowed | books[1].allowed
            books[first].act(act)
            if draw.random() < 0.3:
                exchange.merge(one, exported(other), "other")
        for _ in range(4):
            changed = exchange.merge(one, exported(other), "other").changed
            changed |= exchange.merge(other, exported(one), "one").changed
        assert not changed, "they never agree"
        assert content(one) == content(other) and programs(one) == programs(other)
        assert one.problems() == other.problems() == []
