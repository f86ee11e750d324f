"""What participants told of themselves: a file apart from the journals, so that it can be left out or deleted."""

from __future__ import annotations

from pathlib import Path

import attrs

from memo_core.errors import InvalidArgument
from memo_core.interfaces.reception import Demographics
from memo_core.runlog.json_lines import append_line, read_lines

FILE = "people.jsonl"


class People:
    """Demographics by participant; of several lines about one person the last counts."""

    def __init__(self, folder: Path) -> None:
        """Raises ``InvalidArgument`` for a damaged file."""
        self._file = folder / FILE
        self._told: dict[str, Demographics] = {}
        for number, line in read_lines(self._file) if self._file.exists() else ():
            try:
                told = {field.name: line[field.name] for field in attrs.fields(Demographics)}
                self._told[line["participant"]] = Demographics(**told)
            except (KeyError, TypeError):
                problem = f"line {number} is damaged"
                raise InvalidArgument(str(self._file), problem, "the file as it was written") from None

    def known(self, participant: str, otherwise: Demographics) -> Demographics:
        """What this person told; before they were asked, ``otherwise``."""
        return self._told.get(participant, otherwise)

    def note(self, participant: str, told: Demographics) -> None:
        """Keep it, on disk when this returns. Nothing is written that is known already."""
        if self._told.get(participant) != told:
            append_line(self._file, {"participant": participant} | attrs.asdict(told))
            self._told[participant] = told

    def all(self) -> dict[str, Demographics]:
        return dict(self._told)
