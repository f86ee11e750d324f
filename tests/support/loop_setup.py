"""A loop on a fake environment with a real sandbox and a real book, for the tests of the method."""

from __future__ import annotations

import json
from collections.abc import Callable

from memo_core.events import Event
from memo_core.interfaces.teacher import Episode, Verdict
from memo_core.policy.loop import Loop
from memo_core.policy.methods import METHODS
from memo_core.policy.person import Person
from memo_core.policy.results import RunResult
from memo_core.policy.run_context import Session
from memo_core.policy.settings import RunSettings, TeachingSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.sandbox import Sandbox
from memo_core.skillbook.book import Skillbook
from memo_core.testing.fake_environment import FakeEnvironment
from memo_core.testing.fake_llm import ScriptedModel

BESIDE = "```python\np = get_position('red cube')\nmove_to([p[0], p[1] + 0.1, p[2]])\nclose_gripper()\n```"
GRASP = "```python\nopen_gripper()\nmove_to(get_position('red cube'), top_orientation())\nclose_gripper()\n```"
NOTES = json.dumps({"corrections": ["Move over the middle of the object before closing."], "general": []})
TEMPLATE = """```python
def pick(name):
    '''Picks up what is named.'''
    move_to(get_position(name))
    close_gripper()
```"""
SAID = "  no — über dem Würfel, not beside it\n"


QUESTIONS = {
    "judge_task": "watches",
    "judge_plan": "judges_plans",
    "read_back": "reads_back",
    "permit": "permits",
    "put_back": "puts_back",
    "confirm": "confirms",
    "time_is_up": "has_limited_time",
}


class ScriptedPerson(Person):
    """Ana, who answers the questions for which a function is given."""

    who = "ana"

    def __init__(self, **answers: Callable) -> None:
        for question, answer in answers.items():
            setattr(self, question, answer)
            setattr(self, QUESTIONS.get(question, "watches"), True)


class Bench:
    """A loop on a fake environment with a real sandbox and a real book, and everything that was observed."""

    def __init__(
        self,
        sandbox: Sandbox,
        book: Skillbook | None,
        script,
        verdicts,
        method="memo",
        environment=None,
        session=None,
        teaching=None,
        **settings,
    ):
        self.environment = environment or FakeEnvironment()
        self.llm = script if isinstance(script, ScriptedModel) else ScriptedModel(script)
        self.book = book
        self.events: list[Event] = []
        self.episodes: list[Episode] = []
        self.stop = StopSwitch()
        self._verdicts = list(verdicts) if verdicts is not None else None
        extras = dict(session or {})
        given = {name: extras.pop(name) for name in QUESTIONS if name in extras}
        asked = {name: answer for name, answer in given.items() if answer is not None}
        person = ScriptedPerson(**({"judge": self._judge} if verdicts is not None else {}), **asked)
        self.session = Session(
            run="run-1",
            environment=self.environment,
            llm=self.llm,
            skills=sandbox.skills,
            sandbox=sandbox,
            settings=RunSettings(**settings),
            stop=self.stop,
            emit=self.events.append,
            book=book,
            person=person,
            # One plan a subtask, as most scripts have it: planning anew has tests of its own.
            teaching=TeachingSettings(**({"replan": False} | (teaching or {}))),
            **extras,
        )
        self.loop = Loop(self.session, METHODS[method])

    def _judge(self, episode: Episode, interrupted: bool) -> Verdict:
        self.episodes.append(episode)
        verdict = self._verdicts.pop(0) if self._verdicts else Verdict("silent")
        return verdict(episode) if callable(verdict) else verdict

    def run(self) -> RunResult:
        with self.stop.waking(self.environment.link.stop):
            return self.loop.run()

    def of(self, kind):
        return [event for event in self.events if isinstance(event, kind)]


YES, NO = Verdict("approve"), Verdict("correct", SAID)
