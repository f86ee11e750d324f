"""Each rule of a conformance suite rejects what breaks it: one deliberately wrong fake a rule. Right ones pass."""

from __future__ import annotations

import random
import threading
from typing import Any

import attrs
import pytest

from memo_core.interfaces.llm import Answer, LanguageModel, LanguageModelError, Usage
from memo_core.interfaces.task import Monitor, Outcome, Task
from memo_core.interfaces.teacher import ReadBack, Teacher, Verdict
from memo_core.policy.method_interface import Method
from memo_core.policy.results import RunResult
from memo_core.scene.description import Body, Geom, SceneDescription
from memo_core.scene.pose import Pose
from memo_core.skills.skill import skill
from memo_core.testing import llm, method, skills, suite, teacher


# -- teachers ----------------------------------------------------------------------------------------------------------
class Quiet(Teacher):
    who = "quiet"
    words: Verdict = Verdict("correct", "a bit higher")

    def __init__(self) -> None:
        self.open_now = False

    def open(self) -> None:
        self.open_now = True

    def close(self) -> None:
        self.open_now = False

    def judge(self, episode):
        return self.words


class Nameless(Quiet):
    who = "  "


class Mute(Quiet):
    def judge(self, episode):
        return None if not episode.sightings else self.words


class Deaf(Quiet):
    def interrupted(self, episode):
        return "stop"


class Wordless(Quiet):
    words = Verdict("correct", "  ")


class Nodding(Quiet):
    """Finds every task done, but does not say so in a word that counts."""

    def judge_task(self, episode):
        return Verdict("silent", "well done")


class Planless(Quiet):
    def judge_plan(self, proposal):
        return True


class StrikesAnything(Quiet):
    def read_back(self, noted):
        return ReadBack("struck", struck=(len(noted.notes),))


class Meddler(Quiet):
    def judge(self, episode):
        if episode.before.nodes:
            object.__setattr__(episode.before, "nodes", ())
        return self.words


class Moody(Quiet):
    """Says another thing every time, and keeps nothing of where it was."""

    def __init__(self) -> None:
        super().__init__()
        self.judged = 0

    def judge(self, episode):
        self.judged += 1
        return Verdict("correct", f"{self.judged} cm higher")


class Evasive(Quiet):
    def put_back(self, episode):
        return None


class OnceOnly(Quiet):
    def close(self) -> None:
        if not self.open_now:
            raise AssertionError("closed twice")
        self.open_now = False


WRONG_TEACHERS = {
    "says_who_speaks": Nameless,
    "gives_a_verdict_on_any_episode": Mute,
    "answers_an_interruption": Deaf,
    "a_correction_has_words": Wordless,
    "judges_a_whole_task": Nodding,
    "judges_a_plan": Planless,
    "answers_a_read_back": StrikesAnything,
    "leaves_the_episode_alone": Meddler,
    "goes_on_from_its_state": Moody,
    "says_whether_things_were_put_back": Evasive,
    "closes_twice_and_opens_again": OnceOnly,
}


# -- skills ------------------------------------------------------------------------------------------------------------
@skill("query")
def get_luck(control) -> float:
    """How lucky the robot is, from 0 to 1."""
    return 0.5


@skill("query")
def look(control) -> float:
    """Shadows a skill that is built in."""
    return 0.0


@skill("query")
def get_less(control) -> float:
    """Less"""
    return 0.0


@skill("query")
def get_many(control, *things: float) -> float:
    """Takes as many things as there are."""
    return 0.0


class Careless:
    """A skill that swallows every argument."""

    name, doc, parameters = "get_more", "Takes whatever comes.", ()

    def bind(self, args, kwargs):
        return kwargs


WRONG_SKILLS = {
    "are_declared_skills": lambda: [lambda: None],
    "have_names_of_their_own": lambda: [look],
    "say_what_they_do": lambda: [get_less],
    "have_plain_parameters": lambda: [get_many],
    "refuse_what_they_do_not_know": lambda: [Careless()],
}


# -- suites ------------------------------------------------------------------------------------------------------------
def cube(x: float) -> SceneDescription:
    return SceneDescription(
        label="a table",
        bodies=(Body("cube", (Geom("box", (0.04, 0.04, 0.04)),), pose=Pose((x, 0.0, 0.02)), label="cube"),),
    )


class Height(Monitor):
    name = "height"

    def __init__(self) -> None:
        self.highest = 0.0

    def reset(self, world) -> None:
        self.highest = 0.0

    def update(self, world) -> None:
        self.highest = max(self.highest, world.body_pose("cube").position[2])

    def memory(self):
        return {"highest": self.highest}

    def recall(self, memory) -> None:
        self.highest = memory["highest"]


class Lift(Task):
    name = "lift-the-cube"
    instruction = "lift the cube"
    goal = ("the hand holds the cube up",)

    def scene(self, rng):
        return cube(float(rng.uniform(0.4, 0.5)))

    def monitors(self):
        return (Height(),)

    def check(self, world, monitors):
        return Outcome(monitors["height"].highest > 0.1, "the cube is on the table")

    @property
    def reference_solution(self) -> str:
        return "move_to(get_position('cube'))"


class Shouted(Lift):
    name = "Lift The Cube"


class Numeric(Lift):
    goal = ("the cube's joint is at 0.3 rad",)


class Always(Lift):
    def scene(self, rng):
        return cube(0.4)


class Elsewhere(Lift):
    def scene(self, rng):
        return cube(0.4 + 0.1 * random.random())


class Done(Lift):
    def check(self, world, monitors):
        return Outcome(world.body_pose("cube").position[2] >= 0.0, "the cube is there")


class Bare(Lift):
    """Wrong only where the start does not get to."""

    def check(self, world, monitors):
        if monitors["height"].highest > 0.1:
            return True
        return Outcome(False, "the cube is on the table")


class Giant(Lift):
    """40 and no unit thought of."""

    def scene(self, rng):
        body = attrs.evolve(super().scene(rng).bodies[0], geoms=(Geom("box", (40.0, 40.0, 40.0)),))
        return SceneDescription((body,))


class Inverted(Lift):
    """A length below zero."""

    def scene(self, rng):
        body = attrs.evolve(super().scene(rng).bodies[0], geoms=(Geom("box", (0.04, -0.04, 0.04)),))
        return SceneDescription((body,))


class Shared(Lift):
    watching = (Height(),)

    def monitors(self):
        return self.watching


class Unwritten(Lift):
    @property
    def reference_solution(self) -> str:
        return "move_to("


class Unsolved(Lift):
    reference_solution = ""
    unsolved = "nobody has written one yet"


class Unexplained(Unsolved):
    unsolved = ""


class Contradictory(Lift):
    unsolved = "there is none"


WRONG_SUITES = {
    "tasks_have_names_and_instructions": lambda: [Shouted()],
    "scenes_can_be_built": lambda: [Inverted()],
    "goals_say_what_should_be_visible": lambda: [Numeric()],
    "a_scene_depends_on_its_seed_only": lambda: [Always()],
    "a_scene_does_not_draw_from_elsewhere": lambda: [Elsewhere()],
    "nothing_is_done_at_the_start": lambda: [Done()],
    "scenes_are_in_metres": lambda: [Giant()],
    "checks_return_outcomes": lambda: [Bare()],
    "monitors_are_new_and_remember": lambda: [Shared()],
    "reference_solutions_are_code": lambda: [Unwritten()],
}


# -- language backends -------------------------------------------------------------------------------------------------
class Echo(LanguageModel):
    name = "echo"

    def __init__(self) -> None:
        self.is_open = False

    def open(self) -> None:
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def answer(self, request, on_text=None, cancelled=None):
        if not self.is_open:
            raise LanguageModelError(self.name, "it is not open")
        if not request.messages:
            raise LanguageModelError(self.name, "nothing was asked")
        text = self.text(request)
        if on_text is not None:
            on_text(text[:3])
            on_text(text[3:])
        return Answer(text, usage=self.usage(request), model=self.name)

    def text(self, request) -> str:
        return request.messages[-1].text[::-1]

    def usage(self, request) -> Usage:
        return Usage(prompt_tokens=1 + len(request.messages[-1].text))


class Unnamed(Echo):
    name = ""


class Choosy(Echo):
    def text(self, request) -> str:
        return request.messages[-1].text.split()[0]  # IndexError where there is no word


class Unreachable(Echo):
    """Every answer is an error, with a reason: no rule but one sees anything wrong."""

    def text(self, request) -> str:
        raise LanguageModelError(self.name, "connection refused")


class Free(Echo):
    def usage(self, request) -> Usage:
        return Usage()


class Peeks(Echo):
    def text(self, request) -> str:
        return f"{request.phase}: hello"


class Garbles(Echo):
    def answer(self, request, on_text=None, cancelled=None):
        if on_text is not None:
            on_text("something else")
        return super().answer(request)


class Panics(Echo):
    def answer(self, request, on_text=None, cancelled=None):
        if cancelled is not None and cancelled():
            raise RuntimeError("given up")
        return super().answer(request)


class OneAtATime(Echo):
    busy = False

    def __init__(self) -> None:
        super().__init__()
        self.met = threading.Event()

    def answer(self, request, on_text=None, cancelled=None):
        if self.busy:
            self.met.set()
            raise RuntimeError("busy")
        self.busy = True
        self.met.wait(30)
        self.busy = False
        return super().answer(request)


class Chatty(Echo):
    def answer(self, request, on_text=None, cancelled=None):
        return super().answer(request) if request.messages else Answer("What would you like to know?")


class Inventive(Echo):
    def answer(self, request, on_text=None, cancelled=None):
        raise LanguageModelError(self.name, "it is one of those days", cause="mood")


class OpensOnce(Echo):
    opened = False

    def open(self) -> None:
        assert not self.opened, "opened twice"
        self.opened = self.is_open = True


WRONG_MODELS = {
    "has_a_name": Unnamed,
    "answers_or_says_why_not": Choosy,
    "answers_a_question_of_memo": Unreachable,
    "reports_what_a_call_cost": Free,
    "the_phase_is_for_logs_only": Peeks,
    "pieces_add_up_to_the_answer": Garbles,
    "giving_up_early_is_no_accident": Panics,
    "answers_from_two_threads": OneAtATime,
    "closes_twice_and_opens_again": OpensOnce,
    "nothing_asked_is_an_error": Chatty,
    "errors_have_a_cause_that_is_known": Inventive,
}


# -- methods -----------------------------------------------------------------------------------------------------------
class GoesHome(Method):
    """A method that writes no code: it sends the arm home."""

    name = "goes-home"

    def run(self, session):
        session.stop.check("going home")
        session.environment.control.go_home()
        return RunResult("the arm is home", False)


class NoName(GoesHome):
    name = ""


class Resultless(GoesHome):
    def run(self, session):
        return True


class Unstoppable(GoesHome):
    def run(self, session):
        session.environment.link.release()
        session.environment.control.go_home()
        return RunResult("the arm is home", False)


@attrs.define
class Single(GoesHome):
    done: bool = False

    def run(self, session):
        if self.done:
            raise RuntimeError("it ran already")
        self.done = True
        return super().run(session)


WRONG_METHODS = {
    "has_a_name": NoName,
    "ends_with_a_result_or_a_clear_error": Resultless,
    "a_latched_stop_moves_nothing": Unstoppable,
    "keeps_nothing_between_runs": Single,
}

CASES: list[tuple[Any, Any, dict[str, Any]]] = [
    (teacher, Quiet, WRONG_TEACHERS),
    (skills, lambda: [get_luck], WRONG_SKILLS),
    (suite, lambda: [Lift()], WRONG_SUITES),
    (llm, Echo, WRONG_MODELS),
    (method, GoesHome, WRONG_METHODS),
]


def test_a_task_without_a_reference_solution_says_why():
    rule = suite.RULES["reference_solutions_are_code"]
    rule(lambda: [Unsolved()])
    with pytest.raises(AssertionError, match="does not say why"):
        rule(lambda: [Unexplained()])
    with pytest.raises(AssertionError, match="says why there is none"):
        rule(lambda: [Contradictory()])


@pytest.mark.parametrize(("module", "right", "wrong"), CASES, ids=lambda case: getattr(case, "__name__", ""))
def test_every_rule_has_a_wrong_fake(module, right, wrong):
    assert set(wrong) == set(module.RULES)


@pytest.mark.parametrize(
    ("module", "name", "right"),
    [(m, n, r) for m, r, _ in CASES for n in m.RULES],
    ids=lambda c: getattr(c, "__name__", c),
)
def test_a_right_one_keeps_every_rule(module, name, right):
    module.RULES[name](right)


@pytest.mark.parametrize(
    ("module", "name", "wrong"),
    [(m, n, w[n]) for m, _, w in CASES for n in m.RULES],
    ids=lambda c: getattr(c, "__name__", c),
)
def test_a_wrong_one_is_rejected_by_its_rule(module, name, wrong):
    with pytest.raises(Exception) as caught:
        module.RULES[name](wrong)
    assert not isinstance(caught.value, (ImportError, NameError)), caught.value
