"""Meeting the participants of a study before a session: their consent, and what they tell of themselves."""

from __future__ import annotations

from typing import ClassVar, Protocol

import attrs


@attrs.frozen
class Demographics:
    """Answers of a participant about themselves; None where a question was left open."""

    OLDEST: ClassVar[int] = 130  # years, which no age reaches

    age: int | None = None  # years
    gender: str | None = None
    robots: str | None = None
    language_models: str | None = None


class Reception(Protocol):
    """Meets real people before a session: at a terminal, or in a browser."""

    def agrees(self, participant: str, text: str) -> bool:
        """Show a consent text to a participant and wait for the answer.

        Args:
            participant: id of the participant.
            text: the text to agree to.

        Returns:
            Whether the person agreed.

        Raises:
            Stopped: if the session is stopped while the question is open.
        """

    def about(self, participant: str, known: Demographics) -> Demographics:
        """Ask what is not known yet of a participant.

        Args:
            participant: id of the participant.
            known: what is known already.

        Returns:
            ``known`` with what the person answered; each answer is optional.

        Raises:
            Stopped: if the session is stopped while the questions are open.
        """
