"""Clustering a book: what is asked, what is committed, what is passed over, what stays when something goes wrong."""

from __future__ import annotations

import json

import attrs
import pytest
from memo_offline.model import OfflineModel

from memo_core.errors import Stopped
from memo_core.events import ClusterDone
from memo_core.interfaces.llm import LanguageModelError
from memo_core.policy.consolidation import ClusteringSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.skillbook import consolidating
from memo_core.skillbook.consolidation.condensing import ClusterChanged
from memo_core.skillbook.consolidation.rules import Condensed, Merged
from memo_core.testing.fake_llm import ScriptedModel
from tests.support.cluster_books import (
    ARC,
    Kept,
    approve,
    clustering,
    new_book,
    only_cluster,
    teach,
    teach_general,
    texts,
)


def answer(*entries: tuple[str, list[int]], dropped: tuple[tuple[int, int], ...] = ()) -> str:
    gone = [{"number": number, "template": template, "reason": "it swings"} for number, template in dropped]
    return json.dumps({"entries": [{"text": text, "from": numbers} for text, numbers in entries], "dropped": gone})


@pytest.fixture
def book():
    with new_book() as opened:
        yield opened


@pytest.fixture
def offline():
    model = OfflineModel()
    model.open()
    return model


def test_corrections_of_a_key_are_condensed_against_its_template(book, offline) -> None:
    teach(book, "OPEN(oven)", "Lead the handle along an arc about the hinge.", "Pull the handle straight out.")
    teach(book, "OPEN(oven)", "Swing it open around its hinge.", "Wait for the beep.", who="ben")
    approve(book, "OPEN(oven)")
    heard: list = []
    [outcome] = clustering(book, offline, emit=heard.append).condense_all()
    assert texts(book) == ["Wait for the beep.", "Swing it open around its hinge."]
    assert (outcome.entries_before, outcome.entries_after) == (4, 2)
    [done] = [event for event in heard if isinstance(event, ClusterDone)]
    assert (done.key, done.entries_before, done.entries_after) == ("OPEN(oven)", 4, 2)
    assert done.characters_after < done.characters_before


def test_general_statements_are_a_cluster_of_their_own_beside_all_templates(book) -> None:
    teach_general(book, "Doors swing.", "Every door swings.")
    approve(book, "OPEN(oven)")
    approve(book, "PULL(drawer)", "def pull(name):\n    ...\n")
    kept = Kept(ScriptedModel({"cluster": [answer(("Doors swing.", [1, 2]))]}))
    [outcome] = clustering(book, kept).condense_all()
    assert texts(book) == ["Doors swing."] and outcome.cluster.label == "*"
    prompt = kept.requests[0].messages[-1].text
    assert "def pull(name)" in prompt and "def open_door" in prompt


def test_related_templates_are_those_of_retrievals_rule(book) -> None:
    teach(book, "OPEN(oven)", "Pull.", "Push.")
    approve(book, "OPEN(oven door)")
    approve(book, "CLOSE(oven)", "def shut(name):\n    ...\n")
    approve(book, "WIPE(table)", "def wipe(name):\n    ...\n")
    related = [template.key for template in only_cluster(book).templates]
    book.settings = attrs.evolve(book.settings, template_reach=1.0, template_characters=None, fold_templates=False)
    assert related == [served.key for served in book.retrieve("OPEN(oven)").templates]
    assert related[0] == "OPEN(oven door)" and "CLOSE(oven)" not in related


def test_a_merged_entry_has_the_sources_and_the_most_uses_of_its_members(book) -> None:
    first, second = teach(book, "OPEN(oven)", "Swing the door.") + teach(book, "OPEN(oven)", "Do swing it.", who="ben")
    book.note_use([first], success=True)
    book.note_use([first, second], success=False)
    [outcome] = clustering(book, [answer(("Swing the door.", [1, 2]))]).condense_all()
    [merged] = outcome.committed.added
    assert (merged.uses, merged.confirmed_uses, merged.feedback) == (2, 1, None)
    assert book.sources([merged.id]) == book.sources([first, second])
    book.forget("ben")
    assert texts(book) == ["Swing the door."], "ana said so, too"
    book.forget("ana")
    assert texts(book) == []


def test_who_withdraws_a_template_gives_back_what_gave_way_to_it(book) -> None:
    teach(book, "OPEN(oven)", "Pull straight.", "Look first.")
    approve(book, "OPEN(oven)", who="ben")
    list(clustering(book, [answer(("Look first.", [2]), dropped=((1, 1),))]).condense_all())
    assert texts(book) == ["Look first."]
    book.forget("ben")
    assert sorted(texts(book)) == ["Look first.", "Pull straight."]


def test_the_same_words_said_twice_are_joined_without_asking(book) -> None:
    teach(book, "OPEN(oven)", "Swing it.", "swing  it")
    teach(book, "OPEN(oven)", "Swing it.", who="ben")
    [outcome] = clustering(book, []).condense_all()
    assert texts(book) == ["Swing it."] and outcome.duplicates == 2
    assert len(book.sources([entry.id for entry in book.entries()])) == 3


# -- what goes wrong --------------------------------------------------------------------------------------------------


def test_an_unusable_answer_is_asked_for_again_with_the_reason_then_the_cluster_stays(book) -> None:
    teach(book, "OPEN(oven)", "Swing it.", "Lift it.")
    before = book.entries()
    worse = answer(("Swing it.", [1]))
    kept = Kept(ScriptedModel({"cluster": ["no idea", worse, worse]}))
    [outcome] = clustering(book, kept).condense_all()
    assert (outcome.status, len(kept.requests), book.entries()) == ("left", 3, before)
    assert "the numbers 2 are neither" in kept.requests[2].messages[-1].text
    [better] = clustering(book, [worse, answer(("Swing, lift it.", [1, 2]))]).condense_all()
    assert better.status == "condensed" and texts(book) == ["Swing, lift it."], "the next call tries again"


def test_nothing_is_written_when_the_members_changed_meanwhile(book) -> None:
    teach(book, "OPEN(oven)", "Swing it.", "Do swing it.")

    def while_thinking(request) -> str:
        teach(book, "OPEN(oven)", "No, slide it.")
        return answer(("Swing it.", [1, 2]))

    [outcome] = clustering(book, [while_thinking]).condense_all()
    assert outcome.status == "changed" and len(texts(book)) == 3


def test_nothing_is_written_when_the_template_changed_meanwhile(book) -> None:
    teach(book, "OPEN(oven)", "Swing it.", "Pull it.")
    approve(book, "OPEN(oven)")
    cluster = only_cluster(book)
    approve(book, "OPEN(oven)", ARC.replace("80", "60"))
    with pytest.raises(ClusterChanged):
        consolidating.condense(book, cluster, Condensed((Merged("Swing it.", (1,)), Merged("Pull it.", (2,)))))


def test_after_an_error_or_a_stop_the_next_call_goes_on_with_the_rest(book) -> None:
    keys = ("OPEN(oven)", "PULL(drawer)", "WIPE(table)")
    for key in keys:
        teach(book, key, "One thing.", "Another thing.")
    both = answer(("One, another thing.", [1, 2]))
    with pytest.raises(LanguageModelError):
        list(clustering(book, [both, LanguageModelError("x", "is gone")]).condense_all())
    assert len(texts(book)) == 5
    stop = StopSwitch()

    def press(request) -> str:
        stop.press()
        return both

    with pytest.raises(Stopped):
        list(clustering(book, [press, both], stop=stop).condense_all())
    kept = Kept(ScriptedModel({"cluster": [both, both]}))
    list(clustering(book, kept).condense_all())
    assert all(len(texts(book, key)) == 1 for key in keys)
    assert len(kept.requests) <= 2, "what was done is not asked about again"
    assert texts(book) == ["One, another thing."], "and the same words of three keys are one note"


def test_what_has_not_changed_since_is_passed_over_unless_all_is_asked_for(book) -> None:
    teach(book, "OPEN(oven)", "Swing it.", "Lift it.")
    same = answer(("Swing it.", [1]), ("Lift it.", [2]))
    assert [one.status for one in clustering(book, [same]).condense_all()] == ["unchanged"]
    assert list(clustering(book, []).condense_all()) == []
    assert len(list(clustering(book, [same]).condense_all(unchanged=True))) == 1
    approve(book, "OPEN(oven)")
    assert len(list(clustering(book, [same]).condense_all())) == 1, "a new template is a reason to look again"
    teach(book, "OPEN(oven)", "Push it.")
    assert len(only_cluster(book).members) == 3


def test_a_correction_of_code_that_was_written_with_the_template_outweighs_it(book, offline) -> None:
    teach(book, "OPEN(oven)", "Pull it straight out.")
    template = approve(book, "OPEN(oven)")
    book.note_use([template], success=False, subtask="OPEN(oven)")
    teach(book, "OPEN(oven)", "No, draw it straight out in one line.")
    kept = Kept(offline)
    list(clustering(book, kept).condense_all())
    assert "2. No, draw it straight out in one line. [said of code" in kept.requests[0].messages[-1].text
    assert texts(book) == ["No, draw it straight out in one line."]


def test_a_large_cluster_is_taken_in_parts(book) -> None:
    teach(book, "OPEN(oven)", *(f"Thing {'abcdefghij'[n]}." for n in range(10)))
    settings = ClusteringSettings(members=4)

    def keep_all(request) -> str:
        lines = request.messages[-1].text.split("## Notes")[1].split("## Limits")[0].strip().splitlines()
        return answer(*((line.split(". ", 1)[1], [n]) for n, line in enumerate(lines, start=1)))

    outcomes = list(clustering(book, [keep_all] * 3, settings).condense_all())
    assert [one.entries_before for one in outcomes] == [4, 4, 2] and len(texts(book)) == 10
    assert list(clustering(book, [], settings).condense_all()) == []


def test_a_dry_run_writes_nothing(book, offline) -> None:
    teach(book, "OPEN(oven)", "Swing it open.", "Swing it open.", "Pull it straight out.")
    approve(book, "OPEN(oven)")
    before, generation = book.entries(), book.generation()
    work = clustering(book, offline)
    outcome = work.condense(next(iter(work.clusters())), commit=False)
    assert (outcome.status, outcome.committed, outcome.entries_after) == ("condensed", None, 1)
    assert (book.entries(), book.generation()) == (before, generation)


# -- the offline model's part ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("notes", "left"),
    [
        (("Pull it straight out.", "Swing it open."), ["Swing it open."]),
        (("Pull it straight out, and mind the cable behind it.",),) * 2,
        (("If it is locked, pull it straight out.",), ["If it is locked, pull it straight out."]),
        (("Do not pull it straight out.", "Lead it along an arc."), ["Lead it along an arc."]),
        (("Hold it by the rim.", "Take hold of the handle."), ["Take hold of the handle."]),
        (("If it is hot, mind it, and pull it straight out.",),) * 2,
        (("Frobnicate the latch.", "Please frobnicate the green latch."), ["Please frobnicate the green latch."]),
        (("Keep 3 cm away.", "Keep 5 cm away."), ["Keep 3 cm away.", "Keep 5 cm away."]),
    ],
)
def test_the_offline_model_keeps_what_a_template_does_not_contradict(book, offline, notes, left) -> None:
    teach(book, "OPEN(oven)", *notes)
    approve(book, "OPEN(oven)")
    list(clustering(book, offline).condense_all())
    assert sorted(texts(book)) == sorted(left)


def test_the_offline_model_lets_no_other_things_template_overrule_a_note(book, offline) -> None:
    teach(book, "OPEN(oven drawer)", "Pull it straight out.", "Look first.")
    approve(book, "OPEN(oven)")
    assert only_cluster(book).templates
    list(clustering(book, offline, ClusteringSettings(join_keys=False)).condense_all())
    assert len(texts(book)) == 2


def test_the_offline_model_gives_up_a_general_statement_only_where_every_template_it_is_about_is_against_it(
    book, offline
) -> None:
    teach_general(book, "Always pull straight.", "Doors swing: lead them along an arc.")
    approve(book, "OPEN(oven)")
    list(clustering(book, offline).condense_all())
    assert texts(book) == ["Doors swing: lead them along an arc."]
    teach_general(book, "Always pull straight, I say.")
    approve(book, "PULL(drawer)", 'def pull(name):\n    """Pulls it straight out."""\n    ...\n')
    list(clustering(book, offline).condense_all())
    assert len(texts(book)) == 2
