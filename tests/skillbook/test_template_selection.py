"""Templates are retrieved when they are near the best, each code once, within a number of characters."""

from __future__ import annotations

import attrs
import pytest

from memo_core.errors import InvalidArgument
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.code_shape import code_shape
from memo_core.skillbook.retrieval.retriever import Retrieval, RetrievalSettings
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

OPENS = ("OPEN(fridge)", "OPEN(oven)", "OPEN(crate)", "OPEN(chest)", "OPEN(tin)")
ALL = RetrievalSettings(cut=-1.0, template_reach=1.0, built_weight=0.0)


def program(steps: int) -> str:
    """A template whose code no other number of steps has."""
    return "def work(thing):\n" + "    look()\n" * steps


def retrieved(codes: dict[str, str], settings: RetrievalSettings, subtask: str = "OPEN(fridge)") -> Retrieval:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), settings) as book:
        for key, code in codes.items():
            book.add_template(book.record_feedback("", "ana", kind="approval", subtask=key), key, code)
        return book.retrieve(subtask)


def test_as_many_templates_are_retrieved_as_fit_the_characters() -> None:
    codes = {key: program(number) for number, key in enumerate(OPENS, start=1)}
    every = [len(one.text) for one in retrieved(codes, ALL).templates]
    assert len(every) == len(OPENS)
    for count in range(1, len(every)):
        fitting = attrs.evolve(ALL, template_characters=sum(every[:count]))
        assert [len(one.text) for one in retrieved(codes, fitting).templates][:count] == every[:count]
        assert sum(len(one.text) for one in retrieved(codes, fitting).templates) <= sum(every[:count])


def test_the_best_template_is_whole_even_if_it_is_longer_than_the_characters() -> None:
    codes = {"OPEN(fridge)": program(50), "OPEN(oven)": program(1)}
    found = retrieved(codes, attrs.evolve(ALL, template_characters=10))
    assert [one.text for one in found.templates] == [codes["OPEN(fridge)"]]
    assert [(one.key, one.rule) for one in found.cut] == [("OPEN(oven)", "beyond 10 characters of templates")]


def test_a_template_far_below_the_best_is_not_retrieved_however_much_fits() -> None:
    codes = {"OPEN(fridge)": program(1), "OPEN(oven)": program(2), "POUR(tea, cup)": program(3)}
    wide = retrieved(codes, ALL).templates
    near = attrs.evolve(ALL, template_reach=(wide[0].score - wide[-1].score) / 2)
    assert len(wide) == 3
    found = retrieved(codes, near)
    assert "POUR(tea, cup)" not in {one.key for one in found.templates}
    assert all(wide[0].score - one.score <= near.template_reach for one in found.templates)
    assert [one.rank for one in found.templates] == [*range(1, len(found.templates) + 1)]


OPEN_FRIDGE = '''\
def open_fridge(door, turn=1.2):
    """Opens it."""
    grasp(door)
    for step in (1, -2):
        swing(door, turn)
'''
OPEN_OVEN = '''\
def pull(flap, angle):
    """Of the oven."""
    grasp(flap)
    for n in (-3, 4):
        swing(flap, angle)
'''


def test_of_templates_with_the_same_code_only_the_best_is_retrieved() -> None:
    codes = {"OPEN(fridge)": OPEN_FRIDGE, "OPEN(oven)": OPEN_OVEN, "OPEN(tin)": program(1)}
    assert {one.key for one in retrieved(codes, ALL).templates} == {"OPEN(fridge)", "OPEN(tin)"}
    folded = next(one for one in retrieved(codes, ALL).cut if one.key == "OPEN(oven)")
    assert folded.rule == "the same code as template 1"
    assert retrieved(codes, ALL, "OPEN(oven)").templates[0].key == "OPEN(oven)"
    assert len(retrieved(codes, attrs.evolve(ALL, fold_templates=False)).templates) == 3


@pytest.mark.parametrize(
    "other",
    [
        OPEN_OVEN.replace("swing", "slide"),  # another skill
        OPEN_OVEN.replace("grasp(flap)", "grasp(angle)"),  # other data flow
        OPEN_OVEN.replace("    grasp(flap)\n", ""),
        "def broken(",
    ],
)
def test_code_that_does_something_else_is_another_code(other: str) -> None:
    assert code_shape(OPEN_OVEN) == code_shape(OPEN_FRIDGE) != code_shape(other)


def test_the_papers_preset_retrieves_every_note_and_template_above_its_score() -> None:
    paper = RetrievalSettings.preset("paper")
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), paper) as book:
        for number in range(25):
            feedback = book.record_feedback("", "ana", kind="approval", subtask=f"OPEN(box, place {number})")
            key = f"OPEN(box, place {number})"
            book.add_template(feedback, key, OPEN_FRIDGE + "    wait()\n" * 500)
            book.add_lessons(book.record_feedback("no", "ana", subtask=key), key, [f"Note {number}."])
        found = book.retrieve("OPEN(box, place 3)")
        above = {one.key for one in found.corrections}
    assert len(above) == 25 - sum(one.rule.startswith("below the cut") for one in found.cut) > 20
    assert {one.key for one in found.templates} == above
    assert min(one.score for one in found.served) >= paper.cut


@pytest.mark.parametrize("wrong", [-1, 2.5, True, "much"])
def test_a_number_of_characters_that_is_none_is_refused(wrong: object) -> None:
    with pytest.raises(InvalidArgument, match=r"retrieval\.template_characters"):
        RetrievalSettings(template_characters=wrong)  # type: ignore[arg-type]
