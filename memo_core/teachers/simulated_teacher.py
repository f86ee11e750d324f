"""A simulated teacher: a person in the room who judges what can be seen and speaks everyday language.

They know the instruction and what should be visible at the end (``Task.goal``), see poses, relations and the hand over
time, and hear what the robot says aloud. They misjudge at a stated rate. What they cannot see they do not claim.
"""

from __future__ import annotations

import json
import re
import zlib
from importlib import resources

import attrs
import numpy as np
import yaml

from memo_core.errors import InvalidArgument
from memo_core.interfaces.teacher import Episode, Proposal, TaskEpisode, Teacher, Verdict
from memo_core.teachers.episode_assessment import goal_impression, impression, plan_impression
from memo_core.teachers.impression import Impression
from memo_core.teachers.visible import Seen
from memo_core.text.parsing import parse_json

# Causes to be mended before a trick of the thing itself can matter.
NOT_YET_AT_IT = ("never-near", "nothing-moved", "untouched-handle", "closed-beside", "out-of-sight", "closed-place")


@attrs.frozen
class SimulatedTeacherSettings:
    """Settings of the simulated teacher."""

    who: str = attrs.field(default="simulated-1", metadata={"help": "name under which the words are kept"})
    seed: int = attrs.field(default=0, metadata={"help": "seed of the choice of phrases and of misjudgements"})
    misjudges: float = attrs.field(
        default=0.05,
        validator=[attrs.validators.ge(0.0), attrs.validators.le(1.0)],
        metadata={
            "help": "share of subtasks judged wrongly: approved although it failed, or corrected although it succeeded"
        },
    )
    knows: str = attrs.field(
        default="",
        metadata={
            "help": "what this person knows about the thing, in one sentence: said when what the hand did at it failed"
        },
    )
    attention: float = attrs.field(
        default=1.0,
        validator=[attrs.validators.ge(0.0), attrs.validators.le(1.0)],
        metadata={"help": "share of the attempts that are watched; of the others nothing is said"},
    )
    wrong: float = attrs.field(
        default=0.0,
        validator=[attrs.validators.ge(0.0), attrs.validators.le(1.0)],
        metadata={"help": "share of the corrections that name a fault which was not the one"},
    )
    useless: float = attrs.field(
        default=0.0,
        validator=[attrs.validators.ge(0.0), attrs.validators.le(1.0)],
        metadata={"help": "share of the corrections from which nothing can be learnt ('no, that was wrong')"},
    )
    precision: float = attrs.field(
        default=1.0,
        validator=[attrs.validators.ge(0.0), attrs.validators.le(1.0)],
        metadata={"help": "share of the corrections that give an amount where one was seen; the others say 'a bit'"},
    )
    phrasings: int = attrs.field(
        default=0,
        validator=attrs.validators.ge(0),
        metadata={"help": "phrasings a fault that are in this person's vocabulary, drawn from `who`; 0: all"},
    )
    manner: str = attrs.field(
        default="{}", metadata={"help": "how this person puts things; {} stands for the remark: 'hm, {} please'"}
    )
    patience: int = attrs.field(
        default=6, metadata={"help": "corrections of one subtask, or of the whole task, before giving up (silent)"}
    )


class SimulatedTeacher(Teacher):
    """Judges what could be seen and says what seemed wrong, in one of several phrasings a cause. Notes are accepted as
    they are read back: whether a note says what was meant is not a thing to see."""

    simulated = True

    def __init__(self, settings: SimulatedTeacherSettings) -> None:
        if "{}" not in settings.manner:
            raise InvalidArgument(
                "teacher.manner", f"{settings.manner!r} has no place for the remark", "a text with {}"
            )
        self.settings = settings
        self.who = settings.who
        self._rng = np.random.default_rng(settings.seed)
        self._phrases: dict[str, list[str]] = {}
        self._tasks_corrected = 0
        self._objected: set[str] = set()

    def open(self) -> None:
        text = resources.files("memo_core.teachers").joinpath("phrases.yaml").read_text(encoding="utf-8")
        self._phrases = yaml.safe_load(text)

    def state(self) -> str:
        return json.dumps(
            {
                "rng": self._rng.bit_generator.state,
                "tasks_corrected": self._tasks_corrected,
                "objected": sorted(self._objected),
            }
        )

    def restore(self, state: str) -> None:
        kept = parse_json(state)
        self._rng.bit_generator.state = kept["rng"]
        self._tasks_corrected, self._objected = kept["tasks_corrected"], set(kept["objected"])

    def judge(self, episode: Episode) -> Verdict:
        if episode.attempt > self.settings.patience:
            return Verdict("silent")
        return self._verdict(impression(episode))

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        if self._tasks_corrected >= self.settings.patience:
            return Verdict("silent")
        seen = goal_impression(episode.goal, Seen(episode.before, episode.after, episode.sightings))
        verdict = self._verdict(seen)
        self._tasks_corrected += verdict.kind == "correct"
        return verdict

    def judge_plan(self, proposal: Proposal) -> Verdict:
        """Objects, once a subtask, to reaching into what is visibly closed."""
        seen = plan_impression(proposal)
        if seen.fine or proposal.subtask in self._objected:
            return Verdict("silent")
        self._objected.add(proposal.subtask)
        return Verdict("correct", self._say(seen.cause, seen.blanks), about_plan=True)

    def _verdict(self, seen: Impression) -> Verdict:
        mistaken = self._rng.random() < self.settings.misjudges
        if not seen.sure or not self._drawn(self.settings.attention):
            return Verdict("silent")
        if seen.fine != mistaken:
            return Verdict("approve")
        if mistaken or self._drawn(self.settings.useless):
            return Verdict("correct", self._say("unclear", seen.blanks), seen.about_plan)
        if self._drawn(self.settings.wrong):
            return Verdict("correct", self._say(self._another(seen.cause), seen.blanks), seen.about_plan)
        if self.settings.knows and seen.cause not in NOT_YET_AT_IT:
            return Verdict("correct", self._put(self.settings.knows))
        return Verdict("correct", self._say(seen.cause, seen.blanks), seen.about_plan)

    def _drawn(self, share: float) -> bool:
        """Whether a random draw falls within a share; shares of 0 and 1 draw nothing, so that they do not affect other
        draws."""
        return share >= 1.0 or (share > 0.0 and self._rng.random() < share)

    def _another(self, cause: str) -> str:
        """A fault that was not the one, of those that say something."""
        others = sorted(set(self._phrases) - {cause, "unclear"})
        return others[int(self._rng.integers(len(others)))]

    def _say(self, cause: str, blanks: dict[str, str]) -> str:
        phrases = self._vocabulary(cause)
        filled = {"object": "it", "place": "place", "side": "over", "amount": "a bit"} | blanks
        if not self._drawn(self.settings.precision):
            filled["amount"] = "a bit"
        remark = phrases[int(self._rng.integers(len(phrases)))].format(**filled)
        return self._put(re.sub(r"\bthe it\b", "it", remark))

    def _vocabulary(self, cause: str) -> list[str]:
        """This person's phrasings of a fault: always the same, whatever else was drawn."""
        phrases, count = self._phrases[cause], self.settings.phrasings
        if not count or count >= len(phrases):
            return phrases
        own = np.random.default_rng(zlib.crc32(f"{self.who} {cause}".encode()))
        return [phrases[index] for index in sorted(own.choice(len(phrases), count, replace=False))]

    def _put(self, remark: str) -> str:
        return self.settings.manner.replace("{}", remark)
