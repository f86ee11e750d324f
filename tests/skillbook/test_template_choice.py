"""How many templates are retrieved: those near the best, within a number of characters, no two alike."""

from __future__ import annotations

import pytest

from memo_core.config.layers import preset_sections
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.result import RetrievedEntry
from memo_core.skillbook.retrieval.settings import RetrievalSettings
from memo_core.skillbook.retrieval.template_choice import shape_of, with_room

ARC = """def open_door(name="fridge", angle=1.2):
    \"\"\"Open a door.\"\"\"
    grasp(name)
    for step in range(10):
        move_along(name, angle * step / 10)
"""
SAME = ARC.replace("open_door", "swing").replace("fridge", "oven").replace("1.2", "0.9").replace("a door", "it")
PULL = "def pull(name):\n    grasp(name)\n    move_by([-0.2, 0, 0])\n"


def ranked(*texts: str, scores: tuple[float, ...] = ()) -> list[RetrievedEntry]:
    given = scores or (0.9,) * len(texts)
    key = Key.parse("OPEN(fridge)")
    return [
        RetrievedEntry(Entry(rank, "template", key, text, "", None, 1, None, 0, 0, 0.0), rank, score, 1.0, 1.0, 1.0)
        for rank, (text, score) in enumerate(zip(texts, given, strict=True), start=1)
    ]


def chosen(found: list[RetrievedEntry], **settings) -> list[int]:
    return [one.entry.id for one in with_room(found, RetrievalSettings(**settings))]


def test_of_templates_alike_but_for_names_docstring_and_constants_the_best_is_shown():
    assert shape_of(ARC) == shape_of(SAME) != shape_of(PULL)
    assert chosen(ranked(SAME, ARC, PULL)) == [1, 3]


def test_code_that_cannot_be_parsed_is_like_itself_only():
    assert shape_of("def (") == "def (" and chosen(ranked("def (", "def (", "def [")) == [1, 3]


def test_the_best_is_shown_however_long_and_others_where_there_is_room():
    assert chosen(ranked(ARC, PULL), template_characters=10) == [1]
    assert chosen(ranked(PULL, ARC, "look()"), template_characters=len(PULL) + 10) == [1, 3]


def test_those_far_below_the_best_score_are_not_shown():
    assert chosen(ranked(ARC, PULL, "look()", scores=(0.9, 0.8, 0.6)), reach=0.17) == [1, 2]


def test_the_papers_method_shows_all_above_its_score():
    paper = RetrievalSettings.preset("paper")
    found = ranked(ARC, SAME, PULL, "look()", scores=(0.9, 0.9, 0.82, 0.81))
    assert [one.entry.id for one in with_room(found, paper)] == [1, 2, 3, 4]
    assert preset_sections("retrieval")["paper"]["templates"] == 1000


@pytest.mark.parametrize("wrong", [-1, 1.5, True, "many"])
def test_a_wrong_number_of_characters_is_refused(wrong):
    with pytest.raises(Exception, match="template_characters"):
        RetrievalSettings(template_characters=wrong)
