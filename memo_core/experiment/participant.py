"""A simulated participant: an eyewitness with a voice. It misjudges at a stated rate and speaks everyday language."""

from __future__ import annotations

import json
from importlib import resources

import attrs
import numpy as np
import yaml

from memo_core.experiment.eyewitness import impression
from memo_core.interfaces.teacher import Episode, Teacher, Verdict

# Causes to be mended before a trick of the thing itself can matter.
NOT_YET_AT_IT = ("never-near", "nothing-moved", "untouched-handle", "closed-beside")


@attrs.frozen
class ParticipantSettings:
    """Settings of the simulated participant."""

    who: str = attrs.field(default="simulated-1", metadata={"help": "name under which the words are kept"})
    seed: int = attrs.field(default=0, metadata={"help": "seed of the choice of phrases and of misjudgements"})
    misjudges: float = attrs.field(
        default=0.05,
        validator=[attrs.validators.ge(0.0), attrs.validators.le(1.0)],
        metadata={
            "help": "share of subtasks judged wrongly: approved though it failed, or found fault with though fine"
        },
    )
    knows: str = attrs.field(
        default="",
        metadata={
            "help": "what this person knows about the thing, in one sentence: said when what the hand did at it failed"
        },
    )
    patience: int = attrs.field(default=6, metadata={"help": "corrections of one subtask before giving up (silent)"})


class SimulatedParticipant(Teacher):
    """Judges what could be seen and says what seemed wrong, in one of several phrasings a cause."""

    def __init__(self, settings: ParticipantSettings) -> None:
        self.settings = settings
        self.who = settings.who
        self._rng = np.random.default_rng(settings.seed)
        self._phrases: dict[str, list[str]] = {}

    def open(self) -> None:
        text = resources.files("memo_core.experiment").joinpath("phrases.yaml").read_text(encoding="utf-8")
        self._phrases = yaml.safe_load(text)

    def state(self) -> str:
        return json.dumps(self._rng.bit_generator.state)

    def restore(self, state: str) -> None:
        self._rng.bit_generator.state = json.loads(state)

    def judge(self, episode: Episode) -> Verdict:
        if episode.attempt > self.settings.patience:
            return Verdict("silent")
        seen = impression(episode)
        mistaken = self._rng.random() < self.settings.misjudges
        if not seen.sure:
            return Verdict("silent")
        if seen.fine != mistaken:
            return Verdict("approve")
        if self.settings.knows and not mistaken and seen.cause not in NOT_YET_AT_IT:
            return Verdict("correct", self.settings.knows)
        return Verdict("correct", self._say("unclear" if mistaken else seen.cause, seen.blanks))

    def _say(self, cause: str, blanks: dict[str, str]) -> str:
        phrases = self._phrases[cause]
        return phrases[int(self._rng.integers(len(phrases)))].format(**blanks)
