"""The result of ``memo demo``: its runs, and whether the lesson transferred as expected."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import attrs

from memo_core.interfaces.backend import Demo
from memo_core.runs.run import RunReport


@attrs.frozen
class Chapter:
    """One of the runs."""

    name: str  # as in the JSON: empty_book, after_feedback, transfer_empty_book, transfer, or as in ``Demo.runs``
    folder: str
    title: str
    expected: bool  # the success that the story needs


CHAPTERS = (
    Chapter("empty_book", "1-no-memory", "Without any memory", False),
    Chapter("after_feedback", "2-taught", "With somebody who says what was wrong", True),
    Chapter("transfer_empty_book", "3-transfer-empty-book", "Another task, with an empty book", False),
    Chapter("transfer", "4-transfer", "The same, with the book of the lesson", True),
)


def chapters_of(demo: Demo) -> tuple[Chapter, ...]:
    """The runs of a demo in their order."""
    told = enumerate(demo.runs, start=1)
    return tuple(Chapter(run.name, f"{n}-{run.name}", run.title, run.expected) for n, run in told) or CHAPTERS


@attrs.frozen(eq=False)
class DemoReport:
    """The outcome of the demo, expected or not."""

    seed: int
    folder: Path
    demo: Demo
    runs: dict[str, RunReport]
    wall_s: float
    page: Path | None = None

    @property
    def told(self) -> bool:
        """Whether the outcome was as expected: fails, is taught, succeeds, transfers."""
        return not self.interrupted and all(self.runs[c.name].success == c.expected for c in self.chapters)

    @property
    def chapters(self) -> tuple[Chapter, ...]:
        return chapters_of(self.demo)

    @property
    def interrupted(self) -> bool:
        return len(self.runs) < len(self.chapters) or any(run.ended_by_person for run in self.runs.values())

    def why(self) -> dict[str, str]:
        """A sentence for each run: the success check's reason, and how the run ended."""
        return {name: run.why for name, run in self.runs.items()}

    @property
    def unjudged(self) -> tuple[str, ...]:
        """The runs whose success check was never called because they could not take place."""
        return tuple(name for name, run in self.runs.items() if run.outcome is None)

    def summary(self) -> dict[str, Any]:
        outcomes: dict[str, Any] = {
            c.name: self.runs[c.name].success if c.name in self.runs else None for c in self.chapters
        }
        return outcomes | {
            "wall_s": round(self.wall_s, 2),
            "seed": self.seed,
            "told": self.told,
            "interrupted": self.interrupted,
            "taught_task": self.demo.taught,
            "transfer_task": self.demo.transfer,
            "reasons": self.why(),
            "run_folder": str(self.folder),
            "report": None if self.page is None else str(self.page),
        }
