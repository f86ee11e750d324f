"""Functions are made of the programs of several keys: what a model proposes is checked and run before it is stored, and
whatever does worse than the programs it replaces leaves them as they were."""

from __future__ import annotations

import shutil

import pytest

from memo_core.errors import MemoError, Stopped
from memo_core.events import ClusterDone
from memo_core.interfaces.llm import LanguageModelError
from memo_core.llm.budget import Budget, BudgetExceeded, Limit
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.maintenance.paired_trials import PairedTrials
from memo_core.plugins.registry import Registry
from memo_core.policy.consolidation import Clustering
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog
from memo_core.runs.consolidation import watch
from memo_core.skillbook import history, track_record
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import functions_of, merge_notes, program_behind, store
from memo_core.skillbook.model.functions import GeneralFunction, as_program, as_template
from memo_core.skillbook.writing.functions import GroupChange
from memo_core.testing.fake_llm import ScriptedModel
from tests.support.cluster_books import approve, new_book, teach
from tests.support.generalising_books import (
    JudgedCalls,
    Judgement,
    active,
    doors_book,
    failing,
    generalised,
    generalising,
    no,
    refined_book,
    state,
    template,
)
from tests.support.groups import CALLS, NOTES, OPENED, answered, good_answer
from tests.support.taught_book import GRASP, PICK, teach as teach_in_a_run

KEYS = ("OPEN(microwave)", "OPEN(oven)", "OPEN(cabinet)")


def answer(*calls: str, code: str = OPENED, left: tuple[int, ...] = (), **said: object) -> str:
    """One function with these calls for the programs from 1 on, but for those that are left."""
    numbers = [number for number in range(1, len(calls) + len(left) + 1) if number not in left]
    name = code.partition("(")[0].removeprefix("def ")
    made = [{"name": name, "calls": dict(zip(map(str, numbers), calls, strict=True))}] if calls else []
    given = {"notes": [], "inside": [], "left": [{"program": one, "why": "it is built otherwise"} for one in left]}
    return answered(*([code] if calls else []), functions=made, **given | said)


ALL = answer(*CALLS)
LEFT = answer(left=(1, 2, 3))


@pytest.fixture
def book():
    with doors_book() as opened:
        yield opened


# -- a good answer -----------------------------------------------------------------------------------------------------


def test_a_good_answer_is_stored_with_the_calls_in_place_of_the_programs():
    with doors_book(notes=True) as book:
        tester = JudgedCalls()
        outcome, llm = generalised(book, [good_answer()], tester)
        assert (outcome.status, outcome.calls, outcome.problem, outcome.untested) == ("generalised", 1, "", "")
        [function] = functions_of(book)
        assert function.function.name == "open_hinged" and active(book, "call") == dict(zip(KEYS, CALLS, strict=True))
        assert not book.entries("template")
        [note] = book.entries("correction")
        assert note.text == "Lead the handle along an arc, by 85 degrees."
        assert tester.compared == [(1, CALLS[0]), (2, CALLS[1]), (3, CALLS[2])]
        assert llm.asked[0].seed == 7
        trials = track_record.trials_of(book, [call.id for call in function.calls])
        assert {entry: [one.success for one in kept] for entry, kept in trials.items()} == {
            call.id: [True] for call in function.calls
        }
        assert outcome.made.revision == history.revisions(book)[-1].id and not book.problems()


def test_the_programs_are_there_again_after_a_rollback(book):
    before = book.entries()
    outcome, _ = generalised(book, [ALL], JudgedCalls())
    history.roll_back(book, outcome.made.revision)
    assert book.entries() == before


def test_a_dry_run_asks_and_runs_and_writes_nothing(book):
    before, tester = state(book), JudgedCalls()
    outcome, _ = generalised(book, [ALL], tester, commit=False)
    assert outcome.status == "generalised" and outcome.made.revision is None and len(tester.compared) == 3
    assert [one.name for one in outcome.made.change.functions] == ["open_hinged"]
    assert state(book) == before
    assert len(generalising(book, [])[0].groups()) == 1, "not even that the group was considered"


def test_a_book_that_is_open_read_only_takes_a_dry_run(tmp_path):
    url = f"sqlite:///{tmp_path / 'book.db'}"
    with new_book(url) as book:
        for name in ("microwave", "oven"):
            approve(book, f"OPEN({name})", template(name))
    with new_book(url, read_only=True) as book:
        outcome, _ = generalised(book, [answer(*CALLS[:2])], JudgedCalls(), commit=False)
        assert outcome.status == "generalised" and not book.entries("call")


def test_where_nothing_belongs_together_nothing_changes_and_nobody_is_asked_again(book):
    before = state(book)
    outcome, _ = generalised(book, [LEFT], JudgedCalls())
    assert (outcome.status, outcome.made) == ("unchanged", None) and state(book) == before
    assert set(outcome.left.values()) == {"it is built otherwise"}
    assert not generalising(book, [])[0].groups() and len(generalising(book, [])[0].groups(again=True)) == 1


def test_a_group_with_a_new_template_is_asked_about_again(book):
    generalised(book, [LEFT], JudgedCalls())
    approve(book, "OPEN(fridge)", template("fridge"))
    [group] = generalising(book, [])[0].groups()
    assert [str(member.key) for member in group.members] == [*KEYS, "OPEN(fridge)"]


def test_a_group_with_a_new_note_is_asked_about_again(book):
    generalised(book, [LEFT], JudgedCalls())
    teach(book, KEYS[0], "Pull gently.")
    [group] = generalising(book, [])[0].groups()
    assert [note.text for note in group.notes] == ["Pull gently."]


def test_what_was_made_of_a_group_is_not_asked_about_again(book):
    generalised(book, [answer(*CALLS[:2], left=(3,))], JudgedCalls())
    assert not generalising(book, [])[0].groups()


# -- answers that cannot be used ---------------------------------------------------------------------------------------

SKILL = OPENED.replace("open_hinged", "move_to")
RUNS = OPENED.replace("turn_about(door, angle, room=0.02)", "move_straight(get_position(door))")
BAD = [
    ("I would rather not.", "no JSON object"),
    (answer(*CALLS[:2], "open_hinged('cabinet door', speed=3)"), "got an unexpected keyword argument 'speed'"),
    (answer(*CALLS[:2], "open_hinged('cabinet door', angle=wide)"), "not a literal"),
    (
        answer(*(call.replace("open_hinged", "move_to") for call in CALLS), code=SKILL),
        "the name move_to belongs to a function of the robot",
    ),
    (answer(*CALLS[:2]), "account for every program"),
    (answer(*CALLS, code=OPENED.replace("room=0.02", "at=[0.4, 0.2, 0.3]")), "hard-coded position"),
    (answer(*CALLS, code=OPENED + "\n\nopen_hinged('oven door')\n"), "must be a single function"),
    (answer(*CALLS, code=OPENED + f"    # {'long' * 300}\n"), "write less"),
]
NAMES_OF_BAD = [
    "no answer",
    "wrong keywords",
    "no literal",
    "shadows a skill",
    "a program forgotten",
    "a place",
    "does something when it is read",
    "longer than before",
]


@pytest.mark.parametrize(("bad", "says"), BAD, ids=NAMES_OF_BAD)
def test_an_answer_that_cannot_be_used_is_asked_for_again_with_the_reason_and_then_the_group_is_left(book, bad, says):
    before, tester = state(book), JudgedCalls()
    outcome, llm = generalised(book, [bad] * 3, tester)
    assert (outcome.status, outcome.made, outcome.calls) == ("left", None, 3)
    assert says in outcome.problem and all(says in one for one in llm.prompts("generalise")[1:])
    assert state(book) == before and not tester.compared, "nothing was run"
    assert len(generalising(book, [])[0].groups()) == 1, "the next memo cluster asks anew"


def test_a_function_that_the_sandbox_refuses_is_asked_for_again(book, sandbox):
    made, llm = generalising(book, [ALL, answer(*CALLS, code=RUNS)], JudgedCalls(), check=sandbox.check)
    [group] = made.groups()
    outcome = made.generalise(group)
    assert "open_hinged cannot be run: line " in llm.prompts("generalise")[1]
    assert "turn_about" in llm.prompts("generalise")[1].splitlines()[0]
    assert outcome.status == "generalised" and functions_of(book)[0].entry.text == RUNS


def test_an_answer_that_is_mended_is_stored(book):
    outcome, _ = generalised(book, [BAD[0][0], ALL], JudgedCalls())
    assert (outcome.status, outcome.calls) == ("generalised", 2) and len(book.entries("call")) == 3


def test_a_refusal_leaves_the_group(book):
    refused = LanguageModelError("scripted", "it is about knives", cause="refusal")
    before = state(book)
    outcome, _ = generalised(book, [refused], JudgedCalls())
    assert outcome.status == "left" and "knives" in outcome.problem and state(book) == before


# -- calls that fail ---------------------------------------------------------------------------------------------------


def test_a_call_that_fails_is_shown_with_what_happened_and_mended(book):
    tester = JudgedCalls(lambda call: no("it slipped off") if call == CALLS[2] else Judgement())
    mended = "open_hinged('cabinet door', push_first=True)"
    outcome, llm = generalised(book, [ALL, answer(*CALLS[:2], mended)], tester)
    first, second = (request.messages[1].text for request in llm.asked if request.phase == "generalise")
    assert "Tried before:" not in first and f"- Tried before: {CALLS[2]} failed: it slipped off" in second
    assert second.index("[OPEN(cabinet)]") < second.index("Tried before:"), "beside the program"
    assert (outcome.status, outcome.calls, outcome.left) == ("generalised", 2, {})
    assert active(book, "call")[KEYS[2]] == mended
    assert outcome.tested[3] == (("run 1", True, ""),), "of the call that is stored"


def test_a_program_whose_call_keeps_failing_is_left_and_the_rest_is_stored(book):
    outcome, llm = generalised(book, [ALL] * 3, failing(cabinet="it slipped off"))
    assert (outcome.status, outcome.calls) == ("generalised", 3)
    assert outcome.left == {3: f"{CALLS[2]} failed: it slipped off"}
    assert llm.asked[-1].messages[1].text.count("Tried before:") == 2
    assert active(book, "call") == dict(zip(KEYS[:2], CALLS[:2], strict=True))
    assert list(active(book, "template")) == [KEYS[2]] and not book.problems()
    assert not generalising(book, [])[0].groups(), "it is asked about again once something is new"


def test_a_function_that_only_one_program_is_left_with_is_given_up(book):
    before = state(book)
    outcome, _ = generalised(book, [ALL] * 3, failing(oven="it hit the door", cabinet="it slipped off"))
    assert (outcome.status, outcome.made, outcome.calls) == ("unchanged", None, 3) and state(book) == before
    assert outcome.left == {
        1: "its function was given up",
        2: f"{CALLS[1]} failed: it hit the door",
        3: f"{CALLS[2]} failed: it slipped off",
    }
    assert outcome.tested[1] == (("run 1", True, ""),), "what was measured is reported"


def test_a_function_that_is_longer_than_the_programs_it_is_left_with_is_given_up(book):
    longer = OPENED + f"    # {'x' * 500}\n"
    before = state(book)
    outcome, _ = generalised(book, [answer(*CALLS, code=longer)] * 3, failing(cabinet="it slipped off"))
    assert outcome.status == "unchanged" and state(book) == before
    assert "write less" in outcome.left[1] and "it slipped off" in outcome.left[3]


def test_one_that_fails_from_one_start_only_is_left_with_all_that_was_measured(book):
    starts = (("run 1", True, ""), ("open seed 1001", False, "it stayed shut"))
    slipped = Judgement("it succeeded from 1 of 2 starts and the template from 2", starts=starts)
    tester = JudgedCalls(lambda call: slipped if "oven" in call else Judgement())
    outcome, _ = generalised(book, [ALL], tester, reasks=0)
    assert outcome.left == {2: f"{CALLS[1]} failed: {slipped.reason}"} and outcome.tested[2] == starts
    assert list(active(book, "template")) == [KEYS[1]]


def test_answers_about_failures_that_cannot_be_used_lose_nothing_that_worked(book):
    outcome, _ = generalised(book, [ALL, *["no idea"] * 3], failing(cabinet="it slipped off"))
    assert (outcome.status, outcome.calls) == ("generalised", 4)
    assert active(book, "call") == dict(zip(KEYS[:2], CALLS[:2], strict=True))
    assert outcome.left == {3: f"{CALLS[2]} failed: it slipped off"}


def test_calls_that_cannot_be_run_are_stored_as_untested(book):
    tester = JudgedCalls(lambda call: Judgement("no start", untestable="no start is stored", starts=()))
    outcome, llm = generalised(book, [ALL], tester)
    assert (outcome.status, outcome.untested, outcome.tested) == ("generalised", "no start is stored", {})
    assert len(llm.asked) == 1, "nothing is held against them"
    assert not track_record.trials_of(book)


def test_without_a_simulator_nothing_is_tested_and_that_is_said(book):
    outcome, _ = generalised(book, [ALL], None)
    assert outcome.status == "generalised" and "no simulator" in outcome.untested and not track_record.trials_of(book)


# -- notes -------------------------------------------------------------------------------------------------------------


def test_a_note_inside_a_function_that_is_given_up_stays(book):
    with doors_book(notes=True) as book:
        before = state(book)
        kept = [{"text": NOTES[0][1], "from": [1]}, {"text": NOTES[1][1], "from": [2]}]
        inside = [{"note": 3, "function": "open_hinged"}]
        tester = failing(oven="it hit the door", cabinet="it slipped off")
        outcome, _ = generalised(book, [answer(*CALLS, notes=kept, inside=inside)], tester, reasks=0)
        assert outcome.status == "unchanged" and state(book) == before


def test_notes_that_tell_of_a_function_that_is_given_up_stay_as_they_were():
    with doors_book(notes=True) as book:
        before = state(book)
        about = "Lead the handle along an arc by 85 degrees: open_hinged does that."
        kept = [{"text": about, "from": [1, 2]}, {"text": NOTES[2][1], "from": [3]}]
        outcome, _ = generalised(book, [answer(*CALLS, notes=kept)], failing(open_hinged="it slipped"), reasks=0)
        assert outcome.status == "unchanged" and state(book) == before


def test_notes_that_are_merged_for_themselves_are_merged_even_if_the_function_is_given_up():
    with doors_book(notes=True) as book:
        outcome, _ = generalised(book, [good_answer()], failing(open_hinged="it slipped"), reasks=0)
        assert outcome.status == "generalised" and not book.entries("call") and len(book.entries("template")) == 3
        assert [note.text for note in book.entries("correction")] == [
            NOTES[2][1],
            "Lead the handle along an arc, by 85 degrees.",
        ]


def test_a_note_that_also_holds_for_another_key_is_no_part_of_a_group():
    with new_book() as book:
        approve(book, "OPEN(microwave)", template("microwave"))
        approve(book, "OPEN(oven)", template("oven"))
        for key in ("OPEN(oven)", "POUR(bottle)"):
            teach(book, key, "Be slow.")
        assert len(merge_notes(book, ())) == 1
        [group] = generalising(book, [])[0].groups()
        assert not group.notes, "what is said of bottles may not go inside a function for doors"


# -- stops, budgets and changes meanwhile ------------------------------------------------------------------------------


def test_a_stop_leaves_the_group_as_it_was(book):
    before, stop = state(book), StopSwitch()
    made, _ = generalising(book, [ALL], JudgedCalls(), stop=stop)
    [group] = made.groups()
    stop.press()
    with pytest.raises(Stopped):
        made.generalise(group)
    assert state(book) == before and len(made.groups()) == 1


def test_a_stop_while_programs_run_leaves_the_group_as_it_was(book):
    def interrupted(call: str) -> Judgement:
        raise KeyboardInterrupt

    before = state(book)
    with pytest.raises(KeyboardInterrupt):
        generalised(book, [ALL], JudgedCalls(interrupted))
    assert state(book) == before and len(generalising(book, [])[0].groups()) == 1


def test_a_budget_that_is_spent_while_failures_are_mended_leaves_the_group_as_it_was(book):
    before = state(book)
    with pytest.raises(BudgetExceeded):
        generalised(book, [ALL] * 3, failing(oven="it slipped"), budget=Budget(Limit(max_tokens=100)))
    assert state(book) == before and len(generalising(book, [])[0].groups()) == 1


def test_a_model_that_cannot_be_reached_leaves_the_group_as_it_was(book):
    before = state(book)
    with pytest.raises(LanguageModelError):
        generalised(book, [LanguageModelError("scripted", "no network")], JudgedCalls())
    assert state(book) == before and len(generalising(book, [])[0].groups()) == 1


def test_a_simulator_that_fails_leaves_the_group_as_it_was(book):
    class Broken(MemoError):
        pass

    def broken(call: str) -> Judgement:
        raise Broken

    before = state(book)
    with pytest.raises(Broken):
        generalised(book, [ALL], JudgedCalls(broken))
    assert state(book) == before


def test_a_program_that_was_replaced_meanwhile_is_reported_and_nothing_is_written(book):
    def learns(request) -> str:
        approve(book, KEYS[0], template("microwave", 70))
        return ALL

    outcome, _ = generalised(book, [learns], JudgedCalls())
    assert (outcome.status, outcome.made) == ("changed", None) and "entry 1 is not active" in outcome.problem
    assert not book.entries("function") and len(book.entries("template")) == 3
    assert len(generalising(book, [])[0].groups()) == 1


def test_a_call_that_was_approved_meanwhile_is_not_lost_with_the_function_that_it_calls():
    with refined_book() as book:
        [function] = functions_of(book)

        def learns(request) -> str:
            approval = book.record_feedback("", "ana", subtask="OPEN(fridge)", kind="approval")
            book.add_call(approval, "OPEN(fridge)", "open_hinged('fridge door')", function.entry.id)
            return RENEWED

        outcome, _ = generalised(book, [learns], JudgedCalls())
        assert (outcome.status, outcome.made) == ("changed", None) and "would be replaced" in outcome.problem
        [function] = functions_of(book)
        assert [str(call.key) for call in function.calls] == [*KEYS[:2], "OPEN(fridge)"]


# -- refinement --------------------------------------------------------------------------------------------------------

WIDER = OPENED.replace("room=0.02", "room=0.02, hold=True")
RENEWED = answer(CALLS[2], *CALLS[:2], code=WIDER)  # the template is older than the calls


@pytest.fixture
def refined():
    with refined_book() as opened:
        yield opened


def test_a_new_template_joins_the_calls_and_the_next_version_replaces_the_function(refined):
    [former] = functions_of(refined)
    tester = JudgedCalls()
    outcome, llm = generalised(refined, [RENEWED], tester)
    [prompt] = llm.prompts("generalise")
    assert OPENED.strip() in prompt and prompt.count("turn_about(door") == 1, "calls stand as calls"
    [function] = functions_of(refined)
    assert function.entry.text == WIDER and active(refined, "call") == dict(zip(KEYS, CALLS, strict=True))
    assert refined.entry(former.entry.id).superseded_by == outcome.made.revision
    assert all(refined.entry(call.id).superseded_by == outcome.made.revision for call in former.calls)
    assert [entry for entry, _ in tester.compared] == [3, 1, 2], "against the programs that calls stand in for"
    assert not refined.entries("template") and not refined.problems()
    assert [program_behind(refined, call).id for call in function.calls] == [3, 1, 2]


def test_a_version_that_an_earlier_call_fails_with_is_given_up_and_the_function_stays(refined):
    before = state(refined)
    outcome, _ = generalised(refined, [RENEWED] * 3, failing(oven="it hit the door"))
    assert (outcome.status, outcome.made) == ("unchanged", None) and state(refined) == before
    assert outcome.left[3] == "its function was given up"


def test_a_new_program_that_a_version_does_not_do_is_left_and_the_version_stored(refined):
    approve(refined, "OPEN(fridge)", template("fridge"))
    said = answer(CALLS[2], *CALLS[:2], "open_hinged('fridge door')", code=WIDER)
    outcome, _ = generalised(refined, [said] * 3, failing(cabinet="it slipped off"))
    [function] = functions_of(refined)
    assert function.entry.text == WIDER and len(function.calls) == 3 and outcome.status == "generalised"
    assert list(active(refined, "template")) == [KEYS[2]]


def test_a_longer_version_that_does_no_new_program_is_given_up(refined):
    before = state(refined)
    outcome, _ = generalised(refined, [RENEWED] * 3, failing(cabinet="it slipped off"))
    assert outcome.status == "unchanged" and state(refined) == before


def test_the_answer_counts_whose_calls_replace_most_programs(book):
    tester = failing(cabinet="it slipped off", push_first="it jammed")
    worse = answer(CALLS[0], "open_hinged('oven door', push_first=True)", CALLS[2])
    outcome, _ = generalised(book, [ALL, worse, worse], tester)
    assert outcome.status == "generalised" and list(outcome.left) == [3]
    assert active(book, "call") == dict(zip(KEYS[:2], CALLS[:2], strict=True))


def test_a_call_that_was_approved_is_tested_against_itself_and_not_what_it_took_the_place_of(refined):
    """It is what was approved last."""
    [function] = functions_of(refined)
    approve(refined, "OPEN(fridge)", template("fridge", 20))
    approval = refined.record_feedback("", "ana", subtask="OPEN(fridge)", kind="approval")
    call = refined.add_call(approval, "OPEN(fridge)", "open_hinged('fridge door')", function.entry.id)
    behind = program_behind(refined, call)
    assert behind.id == call.id and behind.text == as_template(OPENED, call.text)


def test_an_edited_call_is_tested_against_what_it_stands_in_for(refined):
    [function] = functions_of(refined)
    edited = refined.edit(function.calls[0].id, "open_hinged('microwave door', angle=70)", "ana")
    assert program_behind(refined, edited).id == 1


def test_a_call_that_is_active_again_is_tested_against_what_it_stands_in_for(refined):
    """Not against the version that was tried in between and corrected."""
    [function] = functions_of(refined)
    worse = approve(refined, KEYS[0], template("microwave", 5))
    refined.note_use([worse], success=False, subtask=KEYS[0])
    refined.note_use([1], success=False, subtask=KEYS[0])
    [again] = [call for call in refined.entries("call") if str(call.key) == KEYS[0]]
    assert again.id == function.calls[0].id and program_behind(refined, again).id == 1


def test_a_function_that_is_not_written_anew_stays_with_its_calls(refined):
    before = state(refined)
    outcome, _ = generalised(refined, [LEFT], JudgedCalls())
    assert outcome.status == "unchanged" and state(refined) == before and not generalising(refined, [])[0].groups()


def test_a_version_is_given_up_too_if_a_call_that_went_to_another_function_fails():
    """The call that is left needs the function as it was, under the name it has."""
    with new_book() as book:
        names = ("microwave", "oven", "cabinet", "fridge", "locker")
        for name in names:
            approve(book, f"OPEN({name})", template(name))
        store(book, GroupChange((GeneralFunction(OPENED, tuple((n, CALLS[0]) for n in (1, 2, 3))),)))
        before = state(book)
        [group] = generalising(book, [])[0].groups()
        numbers = {str(member.key): number for number, member in enumerate(group.members, start=1)}
        pulled = OPENED.replace("open_hinged", "pull_open")
        mine = {str(numbers[f"OPEN({name})"]): CALLS[0] for name in ("microwave", "oven")}
        theirs = {
            str(numbers[f"OPEN({name})"]): f"pull_open('{name} door')" for name in ("cabinet", "fridge", "locker")
        }
        functions = [{"name": "open_hinged", "calls": mine}, {"name": "pull_open", "calls": theirs}]
        said = answered(WIDER, pulled, functions=functions, left=[], notes=[], inside=[])
        outcome, _ = generalised(book, [said], failing(cabinet="it slipped off"), reasks=0)
        assert (outcome.status, outcome.problem) == ("generalised", "")
        by_name = {one.function.name: one for one in functions_of(book)}
        assert by_name["open_hinged"].entry.text == OPENED and len(by_name["open_hinged"].calls) == 3
        assert [str(call.key) for call in by_name["pull_open"].calls] == ["OPEN(fridge)", "OPEN(locker)"]
        assert len(before[0]) == len(book.entries()) - 1


# -- more programs than one question holds -----------------------------------------------------------------------------


def test_programs_that_did_not_fit_are_asked_about_once_those_before_are_settled():
    with new_book() as book:
        for number in range(11):
            approve(book, f"OPEN(door {number})", template(f"door {number}"))
        asked = []
        for _ in range(3):
            made, _ = generalising(book, [lambda request: answer(left=tuple(range(1, request_size(request) + 1)))])
            for group in made.groups():
                asked.append([str(member.key) for member in group.members])
                made.generalise(group)
        assert [len(keys) for keys in asked] == [8, 3] and len({key for keys in asked for key in keys}) == 11


def request_size(request) -> int:
    return request.messages[-1].text.count("### Program ")


def test_a_program_that_is_too_long_for_a_question_keeps_no_others_out():
    with new_book() as book:
        for number, length in enumerate((30_000, 20_000, 1000)):
            approve(book, f"OPEN(door {number})", template(f"door {number}") + f"    # {'y' * length}\n")
        [group] = generalising(book, [])[0].groups()
        assert [str(member.key) for member in group.members] == ["OPEN(door 0)", "OPEN(door 2)"]


# -- as a part of clustering -------------------------------------------------------------------------------------------


def clustering_of(book: Skillbook, answers: object, tester: object = None) -> tuple[Clustering, ScriptedModel, list]:
    made, llm = generalising(book, answers, tester)
    heard: list = []
    calls = ModelCalls(llm, StopSwitch(), RunLog(), heard.append, Budget(), Retrying(0))
    return Clustering(book, calls, llm.name, emit=heard.append, generalising=made), llm, heard


def unlike_book() -> Skillbook:
    """A book whose programs only a model can make one of."""
    book = new_book()
    approve(book, KEYS[0], template("microwave"))
    approve(book, KEYS[1], template("oven").replace("look()", "pass"))
    return book


def test_clustering_makes_functions_after_the_notes_of_each_key_and_says_so():
    with unlike_book() as book:
        clustering, _, heard = clustering_of(book, [answer(*CALLS[:2])], JudgedCalls())
        [outcome] = clustering.condense_all()
        assert outcome.status == "generalised" and list(active(book, "call")) == list(KEYS[:2])
        [done] = [event for event in heard if isinstance(event, ClusterDone)]
        assert (done.key, done.entries_before, done.entries_after) == ("OPEN(microwave), OPEN(oven)", 2, 3)
        assert not list(clustering.condense_all())


def test_watching_asks_about_a_group_once_until_it_changes():
    with unlike_book() as book:
        same = '{"entries": [{"text": "Pour slowly.", "from": [1]}], "dropped": []}'
        lines = ["no idea"] * 3 + [answer(left=(1, 2, 3))]
        clustering, llm, _ = clustering_of(book, ScriptedModel({"generalise": lines, "cluster": [same]}), JudgedCalls())
        stop, seen = StopSwitch(), []

        def report(news) -> None:
            seen.append(news)
            if len(seen) == 1:
                teach(book, "POUR(tea)", "Pour slowly.")
            elif len(seen) == 2:
                assert len(llm.prompts("generalise")) == 3, "the group is as it was"
                approve(book, KEYS[2], template("cabinet").replace("look()", "close_gripper()"))
            else:
                stop.press()

        with pytest.raises(Stopped):
            watch(book, clustering, stop, 0.01, report)
        assert [one.status for one in seen] == ["left", "unchanged", "unchanged"]
        assert len(llm.prompts("generalise")) == 4


# -- in a simulator ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def registry():
    return Registry()


@pytest.fixture(scope="module")
def taught(registry, tmp_path_factory):
    folder = tmp_path_factory.mktemp("taught")
    teach_in_a_run(registry, folder)
    return folder


@pytest.fixture
def lifting(taught, tmp_path):
    """A book with the template that a run taught, and two templates without a run."""
    shutil.copy(taught / "book.db", tmp_path / "book.db")
    with Skillbook(str(tmp_path / "book.db")) as opened:
        for name in ("ball", "can"):
            approve(opened, f"LIFT({name})", PICK.replace("thing", f"thing='{name}'", 1))
        yield opened


def lift(before: str) -> str:
    """A function for the three of them, with lines that it begins with, and its calls."""
    code = f'def lift(thing):\n    """Grasp a thing from above and lift it."""\n    {before}{GRASP}'
    return answer("lift('cube')", "lift('ball')", "lift('can')", code=code)


@pytest.mark.sim
@pytest.mark.parametrize(
    ("before", "scenes", "says"),
    [
        ("while True:\n        wait(5)", 0, "the robot was busy"),
        ("while True:\n        pass", 0, "the code computed longer"),
        ("wait(20)", 0, "s on the robot's clock, where the template took"),
        ("raise RuntimeError('the hand is full')", 0, "the hand is full"),
        ("turn_about(thing)", 0, "turn_about"),
        ("if get_position(thing)[0] != HERE:\n        raise RuntimeError('not there')", 1, "1 of 2 starts"),
    ],
    ids=["always moves", "always computes", "is slow", "raises", "calls what is not there", "in one scene only"],
)
def test_what_a_call_does_in_a_simulator_decides(lifting, registry, before, scenes, says):
    if "HERE" in before:
        [own] = [entry for entry in lifting.entries("template") if str(entry.key) == "LIFT(cube)"]
        printing = as_program(
            PICK.replace("    look()\n", "    look()\n    print(get_position(thing)[0])\n", 1), "pick('cube')"
        )
        [trial] = PairedTrials(lifting, registry, scenes=0).compare(own, printing).trials
        before = before.replace("HERE", trial.after.printed.strip())
    outcome, _ = generalised(lifting, [lift(before)], PairedTrials(lifting, registry, scenes=scenes), reasks=0)
    [(entry, why)] = outcome.left.items()
    assert str(lifting.entry(entry).key) == "LIFT(cube)" and why.startswith("lift('cube') failed: ") and says in why
    assert outcome.status == "generalised" and "not approved in a run" in outcome.untested
    assert active(lifting, "call") == {"LIFT(ball)": "lift('ball')", "LIFT(can)": "lift('can')"}
    assert [str(one.key) for one in lifting.entries("template")] == ["LIFT(cube)"]


@pytest.mark.sim
def test_a_call_that_does_as_well_in_a_simulator_is_stored_with_its_trials(lifting, registry):
    outcome, _ = generalised(lifting, [lift("pass")], PairedTrials(lifting, registry, scenes=1), reasks=0)
    assert outcome.left == {} and len(lifting.entries("call")) == 3
    [call] = [one for one in lifting.entries("call") if str(one.key) == "LIFT(cube)"]
    assert [one.success for one in track_record.trials_of(lifting, [call.id])[call.id]] == [True, True]
