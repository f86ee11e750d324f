"""All sections that an experiment file may have: those of a run, and those of studies and evaluations."""

from __future__ import annotations

from memo_core.evaluation.settings import BooksSettings, EvaluationSettings
from memo_core.runs.sections import SECTIONS
from memo_core.study.settings import StudySettings

ALL_SECTIONS: dict[str, type] = SECTIONS | {
    "study": StudySettings,
    "books": BooksSettings,
    "evaluation": EvaluationSettings,
}
