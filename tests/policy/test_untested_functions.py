"""A function that could not be run is shown as a template until programs written with it were approved."""

from __future__ import annotations

import pytest

from memo_core.policy.learnt_functions import as_used
from memo_core.skillbook import exchange
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import functions_of, record_of, store
from memo_core.skillbook.model.functions import FunctionUse, GeneralFunction
from memo_core.skillbook.retrieval.retriever import Retrieval
from memo_core.skillbook.writing.functions import GroupChange
from tests.support.cluster_books import new_book
from tests.support.function_books import MICROWAVE, OVEN, merged, program, teach_doors

CALLS = ("open_hinged('microwave door')", "open_hinged('oven door')")
CODE = program("microwave").replace('door="microwave door"', "door")
TRIED = (("run 1", True, ""), ("TASK seed 1001", False, "it did not open"))


def generalised(book: Skillbook, *, tested: bool = False) -> int:
    """Store a function that a model made of two templates; its entry."""
    first, second = teach_doors(book, MICROWAVE, OVEN)
    function = GeneralFunction(CODE, ((first, CALLS[0]), (second, CALLS[1])))
    store(book, GroupChange((function,), trials={first: TRIED} if tested else {}), "a model")
    return functions_of(book)[0].entry.id


def used(book: Skillbook, use: FunctionUse = "call", approvals: int = 2) -> Retrieval:
    return as_used(book.retrieve(MICROWAVE), use, (), approvals)


def test_an_untested_function_is_called_after_enough_approvals_only():
    with new_book() as book:
        function = generalised(book)
        for success in (True, False, True):
            found = used(book)
            assert not found.functions and [one.text.split("(")[0] for one in found.templates] == ["def open_hinged"]
            assert "door='microwave door'" in found.templates[0].text, "with the arguments of the call"
            book.note_use([function], success, MICROWAVE)
        assert [one.entry.id for one in used(book).functions] == [function]
        assert record_of(book, functions_of(book)[0]).tested == "not tested, approved 2 times"
        assert not used(book, "show").functions and not used(book, "off").templates


def test_a_function_whose_calls_succeeded_is_called_at_once():
    with new_book() as book:
        generalised(book, tested=True)
        assert used(book).functions and not used(book).templates
        assert record_of(book, functions_of(book)[0]).tested == "1 of 2 starts"


def test_code_that_was_approved_as_it_is_needs_no_test():
    with new_book() as book:
        teach_doors(book, MICROWAVE, OVEN)
        merged(book)
        assert used(book).functions


def test_a_function_that_a_person_edited_is_untested_again():
    with new_book() as book:
        function = generalised(book, tested=True)
        book.edit(function, CODE.replace("look()", "look()  # twice"), "ana")
        assert not used(book).functions


@pytest.mark.parametrize("tested", [True, False])
def test_an_imported_function_is_untested_here(tested):
    with new_book() as there, new_book() as here:
        generalised(there, tested=tested)
        exchange.merge(here, list(exchange.export(there)), "their lab")
        assert functions_of(here) and not used(here).functions
