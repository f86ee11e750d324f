"""Generalising a group: a call that failed is shown to the model together with its answer."""

from __future__ import annotations

import attrs

from memo_core.llm.budget import Budget
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.llm.prompt_files import Prompts
from memo_core.maintenance.paired_trials import Verdict
from memo_core.policy.generalising import PHASE, Generalising
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog
from memo_core.skillbook.model.entries import Entry
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.testing.fake_llm import ScriptedModel
from tests.support.cluster_books import new_book
from tests.support.groups import SKILLS, doors, good_answer
from tests.support.offline_prompts import ROBOT


@attrs.define
class Failing:
    """A tester in whose simulator the first ``fails`` calls do worse than their programs."""

    fails: int

    def compare(self, template: Entry, program: str) -> Verdict:
        self.fails -= 1
        return Verdict(self.fails < 0, "the door is shut" if self.fails >= 0 else "")


def generalised(fails: int, answers: int, said: str = good_answer()):
    model = ScriptedModel({PHASE: [said] * answers})
    calls = ModelCalls(model, StopSwitch(), RunLog(), lambda event: None, Budget(), Retrying(0))
    skills = {skill.name: skill for skill in BUILTIN_SKILLS if skill.name in SKILLS}
    with new_book() as book:
        asking = Generalising(book, calls, Prompts(), ROBOT, skills, "No classes.", Failing(fails))
        return asking.generalise(doors(), commit=False), model.asked


def test_a_call_that_failed_is_mended_in_view_of_the_answer_that_it_is_of():
    outcome, asked = generalised(fails=1, answers=2)
    first, second = asked
    assert [message.role for message in first.messages] == ["system", "user"]
    assert [message.role for message in second.messages] == ["system", "user", "assistant", "user"]
    assert "- Tried before: open_hinged('microwave door', angle=80) failed: the door is shut" in second.messages[1].text
    assert second.messages[2].text == good_answer() and "Mend it" in second.messages[3].text
    assert outcome.status == "generalised" and not outcome.left and outcome.calls == 2


def test_a_program_whose_call_fails_to_the_end_is_left():
    outcome, asked = generalised(fails=9, answers=3)
    assert len(asked) == 3 and len(outcome.left) == 3
    assert outcome.made is not None and not outcome.made.change.functions


def test_a_note_that_names_a_function_given_up_is_not_reworded():
    said = good_answer().replace("Lead the handle along an arc, by 85 degrees.", "For open_hinged: arc of 85 degrees.")
    assert said != good_answer()
    outcome, _ = generalised(fails=9, answers=3, said=said)
    assert outcome.status == "unchanged" and outcome.made is None
