"""What participants agree to before they teach, and what they are asked about themselves."""

from __future__ import annotations

import hashlib
from importlib import resources
from pathlib import Path

import attrs

from memo_core.errors import InvalidArgument
from memo_core.interfaces.reception import Demographics
from memo_core.study.settings import Participant

SAMPLE_MARK = "NOT FOR REAL PEOPLE"
MUST_SAY = {"language model": "provider", "how to withdraw": "withdraw"}


@attrs.frozen
class Consent:
    """A text, and the digest by which the journal knows which one somebody agreed to."""

    text: str
    sample: bool

    @property
    def digest(self) -> str:
        return hashlib.sha256(self.text.encode()).hexdigest()[:16]


def read_consent(file: str) -> Consent:
    """The text of ``study.consent``, or the shipped sample. Raises ``InvalidArgument`` for a file that cannot be read
    or does not say what it must."""
    if not file:
        text = resources.files("memo_core.study").joinpath("consent_sample.txt").read_text(encoding="utf-8")
        return Consent(text, sample=True)
    try:
        text = Path(file).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidArgument("study.consent", f"{file} cannot be read ({error})", "a text file") from None
    for what, word in MUST_SAY.items():
        if word not in text.lower():
            raise InvalidArgument("study.consent", f"{file} does not say {what}: no word {word!r}", "a text that does")
    return Consent(text, sample=SAMPLE_MARK in text)


def check_for_people(consent: Consent, people: list[str]) -> None:
    """Raises ``InvalidArgument`` where real people would be shown the sample."""
    if people and consent.sample:
        problem = f"the sample is no text for real people ({', '.join(people)})"
        raise InvalidArgument("study.consent", problem, "a file with your own text")


def demographics_of(participant: Participant) -> Demographics:
    """What the experiment file says."""
    return Demographics(participant.age, participant.gender, participant.robots, participant.language_models)
