"""The prompt of a group: it shows of programs, functions and notes, and who does not answer it."""

from __future__ import annotations

import re

import attrs
import pytest

from memo_core.llm.budget import Budget
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.llm.prompt_files import Prompts
from memo_core.llm.prompt_sections import Prompt
from memo_core.llm.readers import Unreadable
from memo_core.llm.readers.generalised import read_generalised
from memo_core.plugin import LanguageModel
from memo_core.policy.generalising import PHASE, prompt_context
from memo_core.policy.model_questions import put
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog
from memo_core.skillbook.consolidation.function_rules import Group
from memo_core.testing.fake_llm import ScriptedModel
from tests.support.groups import CALLS, NOTES, OPENED, SKILLS, doors, good_answer, refinement
from tests.support.offline_prompts import MODEL


def messages(group: Group):
    return Prompts().messages(PHASE, prompt_context(group, "turn_about(name)", "No classes."))


def asked(model: LanguageModel, group: Group, reasks: int = 1):
    calls = ModelCalls(model, StopSwitch(), RunLog(), lambda event: None, Budget(), Retrying(0))
    return put(calls, PHASE, messages(group), lambda text: read_generalised(text, group, SKILLS, ()), reasks)


def test_programs_stand_with_key_build_and_what_was_tried():
    group = doors()
    tried = "open_hinged('oven door') failed: RuntimeError: the door\nis closed"
    oven = attrs.evolve(group.members[1], tried=(tried,))
    system, user = messages(attrs.evolve(group, members=(group.members[0], oven, group.members[2])))
    assert "turn_about(name)" in system.text and "No classes." in system.text
    shown = f"### Program 2 [OPEN(oven)]\nBuilt: a door on an upright hinge\n```python\n{oven.code}```\n"
    assert shown + "- Tried before: open_hinged('oven door') failed: RuntimeError: the door is closed\n" in user.text
    assert f"2. [OPEN(oven)] {NOTES[1][1]}\n" in user.text
    assert f"at most {group.characters} characters" in user.text and "every note from 1 to 3" in user.text


def test_a_group_without_notes_and_functions_says_so():
    sections = Prompt.read(messages(doors(notes=False))).sections
    assert sections["notes"].strip() == sections["functions so far"].strip() == "none"
    assert "every note" not in sections["limits"]


def test_a_function_that_is_refined_is_shown_once_and_its_calls_as_calls():
    _, user = messages(refinement())
    assert user.text.count("def open_hinged") == 1 and OPENED in user.text
    assert f"### Program 1 [OPEN(microwave)]\n```python\n{CALLS[0]}\n```\n" in user.text


def test_a_call_of_a_function_that_is_not_shown_is_shown_with_it():
    _, user = messages(attrs.evolve(refinement(), functions=()))
    assert user.text.count("def open_hinged") == 2


def test_the_form_of_the_answer_is_one_that_is_read():
    """The keys that the prompt names are those that the reader looks for."""
    system, _ = messages(doors())
    form = re.search(r'then JSON: (\{"functions".*\})$', system.text, re.MULTILINE)
    assert form and set(re.findall(r'"(\w+)":', form[1])) - {"1", "3"} == {
        *("functions", "name", "calls", "left", "program", "why", "notes", "text", "from", "inside", "note", "function")
    }


def test_an_answer_that_cannot_be_used_is_asked_for_again_with_the_reason():
    model = ScriptedModel({PHASE: [good_answer().replace('"from": [1, 2]', '"from": [1]'), good_answer()]})
    proposal, told = asked(model, doors())
    assert told.calls == 2 and len(proposal.functions) == 1


def test_the_offline_backend_declines_and_is_not_asked_again():
    assert Prompt.read(messages(doors())).phase == PHASE
    with pytest.raises(Unreadable, match="offline: it writes no functions from several programs") as error:
        asked(MODEL, doors())
    assert error.value.cause == "refusal"
