"""Books with the programs and notes of ``tests.support.groups``, and what makes functions of them, for tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import attrs

from memo_core.interfaces.llm import LanguageModel
from memo_core.llm.budget import Budget
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.llm.prompt_files import Prompts
from memo_core.policy.generalising import Generalising, GroupOutcome
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog
from memo_core.skillbook import history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import store
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.functions import GeneralFunction, as_template
from memo_core.skillbook.writing.functions import GroupChange
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from memo_core.testing.fake_environment import fake_robot
from memo_core.testing.fake_llm import Line, ScriptedModel
from tests.support.cluster_books import approve, new_book, teach
from tests.support.groups import CALLS, NOTES, OPENED, TEMPLATE

NAMES = ("microwave", "oven", "cabinet")


def template(name: str, angle: int = 85) -> str:
    return TEMPLATE.format(name, angle, "x" * 200)


def teach_doors(book: Skillbook, notes: bool = True) -> None:
    """Three templates (entries 1 to 3) and with ``notes`` a note of each key (4 to 6), as ``groups.doors`` has them."""
    for name in NAMES:
        approve(book, f"OPEN({name})", template(name, 80 if name == "microwave" else 85))
    for key, text in NOTES if notes else ():
        teach(book, key, text)


def doors_book(notes: bool = False) -> Skillbook:
    book = new_book()
    teach_doors(book, notes)
    return book


def refined_book() -> Skillbook:
    """A book with ``open_hinged`` and its calls for microwave and oven, and a template for the cabinet."""
    book = new_book()
    teach_doors(book, notes=False)
    store(book, GroupChange((GeneralFunction(OPENED, ((1, CALLS[0]), (2, CALLS[1]))),)))
    return book


def state(book: Skillbook) -> tuple[list[Entry], list[int]]:
    """The active entries, and the numbers of the revisions."""
    return book.entries(), [one.id for one in history.revisions(book)]


def active(book: Skillbook, kind: str) -> dict[str, str]:
    """The texts of the active entries of a kind, by key."""
    return {str(entry.key): entry.text for entry in book.entries(kind)}


@attrs.frozen
class Judgement:
    """The verdict of a tester (``generalising.Verdict``)."""

    reason: str = ""
    untestable: str = ""
    starts: tuple[tuple[str, bool, str], ...] = (("run 1", True, ""),)

    @property
    def accepted(self) -> bool:
        return not self.reason


YES = Judgement()


def no(reason: str, *starts: tuple[str, bool, str]) -> Judgement:
    return Judgement(reason, starts=starts or (("run 1", False, reason),))


@attrs.define
class JudgedCalls:
    """A tester that runs nothing: it judges the last line of a program, its call. ``compared``: the ids of the
    templates, and the calls."""

    judge: Callable[[str], Judgement] = lambda call: YES
    compared: list[tuple[int, str]] = attrs.field(factory=list)

    def compare(self, template: Entry, program: str) -> Judgement:
        call = program.strip().splitlines()[-1]
        self.compared.append((template.id, call))
        return self.judge(call)


def failing(**reasons: str) -> JudgedCalls:
    """A tester that refuses every call with one of these words in it, for the reason given."""
    return JudgedCalls(lambda call: next((no(why) for word, why in reasons.items() if word in call), YES))


def generalising(
    book: Skillbook,
    model: LanguageModel | Sequence[Line],
    tester: object = None,
    reasks: int = 2,
    budget: Budget | None = None,
    stop: StopSwitch | None = None,
    **more: Any,
) -> tuple[Generalising, ScriptedModel]:
    llm = model if isinstance(model, ScriptedModel) else ScriptedModel({"generalise": model})
    calls = ModelCalls(llm, stop or StopSwitch(), RunLog(), lambda event: None, budget or Budget(), Retrying(0))
    skills = skill_library(BUILTIN_SKILLS)
    made = Generalising(book, calls, Prompts(), fake_robot(), skills, "Plain Python.", tester, reasks, seed=7, **more)
    return made, llm


def generalised(
    book: Skillbook, model: Sequence[Line], tester: object = None, commit: bool = True, **settings: Any
) -> tuple[GroupOutcome, ScriptedModel]:
    """The outcome of the only group of a book, and the model that was asked."""
    made, llm = generalising(book, model, tester, **settings)
    [group] = made.groups()
    return made.generalise(group, commit), llm


# -- for the loop ------------------------------------------------------------------------------------------------------

GRASPS = '''\
def grasp(thing, above=0.0):
    """Grasp a thing from above.

    thing: its name. above: metres above its middle.
    """
    open_gripper()
    place = get_position(thing)
    move_to([place[0], place[1], place[2] + above], top_orientation())
    close_gripper()
'''
CUBES = {"PICK_UP(red cube)": "grasp('red cube')", "PICK_UP(blue cube)": "grasp('blue cube', above=0.01)"}


def teach_grasping(book: Skillbook, code: str = GRASPS, calls: dict[str, str] = CUBES) -> Entry:
    """A function and its calls in place of a template for each key; the function."""
    told = [approve(book, key, as_template(code, call)) for key, call in calls.items()]
    change = GroupChange((GeneralFunction(code, tuple(zip(told, calls.values(), strict=True))),))
    store(book, change)
    return book.entries("function")[-1]
