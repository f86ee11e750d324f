"""A note that says no more than the template of its key goes where the setting allows it, and can be brought back."""

from __future__ import annotations

import json

import attrs
import pytest
from memo_offline.model import OfflineModel

from memo_core.config.layers import preset_sections
from memo_core.policy.consolidation import ClusteringSettings
from memo_core.skillbook import history
from memo_core.skillbook.consolidation.rules import Condensed, Dropped, Merged, problem_with
from tests.support.cluster_books import ARC, approve, clustering, new_book, teach, texts

ON = ClusteringSettings(join_keys=False, drop_covered=True)
KEY = "OPEN(oven)"
COVERED, FURTHER = "Lead the handle along an arc about the hinge.", "Keep 3 cm away from the wall."


def cluster(key: str = KEY, template: str = KEY, note: str = COVERED):
    with new_book() as book:
        teach(book, key, note, FURTHER)
        approve(book, template)
        return next(iter(clustering(book, [], ON).clusters()))


def dropping(found) -> Condensed:
    return Condensed((Merged(found.members[1].text, (2,)),), (Dropped(1, 1, "it does", covered=True),))


def test_a_covered_note_may_go_only_where_the_setting_allows_it():
    found = cluster()
    assert found.drop_covered and problem_with(found, dropping(found)) == ""
    assert "stays" in problem_with(attrs.evolve(found, drop_covered=False), dropping(found))
    assert not ClusteringSettings().drop_covered


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"note": "Lead the handle 5 cm along an arc."}, "amount 5"),
        ({"note": "Gently!"}, "no word in common"),
        ({"template": "OPEN(old oven)"}, "not of OPEN"),
    ],
)
def test_what_a_template_does_not_say_is_not_covered(more, said):
    found = cluster(**more)
    assert said in problem_with(found, dropping(found))


def test_what_was_said_of_the_templates_own_code_stays():
    found = cluster()
    said_after = attrs.evolve(found, said_after=frozenset({found.members[0].id}))
    assert "what is wrong with it" in problem_with(said_after, dropping(found))


def test_the_offline_model_drops_it_a_rollback_restores_it_and_its_source_is_kept():
    model = OfflineModel()
    model.open()
    with new_book() as book:
        [covered, _] = teach(book, KEY, COVERED, FURTHER)
        approve(book, KEY)
        [outcome] = clustering(book, model, ON).condense_all()
        assert texts(book) == [FURTHER] and outcome.committed is not None
        assert book.sources([covered]) and book.entry(covered).superseded_by == outcome.committed.revision
        history.roll_back(book, outcome.committed.revision)
        assert sorted(texts(book)) == sorted([COVERED, FURTHER])


def test_without_the_setting_it_stays():
    model = OfflineModel()
    model.open()
    with new_book() as book:
        teach(book, KEY, COVERED, FURTHER)
        approve(book, KEY)
        list(clustering(book, model, attrs.evolve(ON, drop_covered=False)).condense_all())
        assert sorted(texts(book)) == sorted([COVERED, FURTHER])


@pytest.mark.parametrize("allowed", [True, False])
def test_the_question_and_its_schema_speak_of_covered_notes_where_they_may_go(allowed):
    def answer(request) -> str:
        assert ('"covered": true' in request.messages[-1].text) == allowed
        dropped = request.response_schema["properties"]["dropped"]["items"]
        assert ("covered" in dropped["properties"]) == ("covered" in dropped["required"]) == allowed
        entries = [{"text": text, "from": [number]} for number, text in enumerate((COVERED, FURTHER), 1)]
        gone = {"number": 1, "template": 1, "reason": "it does", "covered": True}
        return json.dumps({"entries": entries[1:] if allowed else entries, "dropped": [gone] if allowed else []})

    with new_book() as book:
        teach(book, KEY, COVERED, FURTHER)
        approve(book, KEY, ARC)
        list(clustering(book, [answer], attrs.evolve(ON, drop_covered=allowed)).condense_all())
        assert (COVERED in texts(book)) != allowed


def test_the_papers_preset_has_it_on():
    assert preset_sections("clustering")["paper"]["drop_covered"] is True
