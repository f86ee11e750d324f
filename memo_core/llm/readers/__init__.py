"""Parsing a model's answers, with one reader per phase. Readers tolerate fences, prose and bullets around the answer
and are strict about the answer itself. ``Unreadable`` states precisely what was wrong, so that the question can be
asked again."""

from memo_core.llm.readers.code import read_code
from memo_core.llm.readers.json_objects import json_objects
from memo_core.llm.readers.notes import Notes, read_notes
from memo_core.llm.readers.plan import read_plan
from memo_core.llm.readers.template import read_template
from memo_core.llm.readers.unreadable import Unreadable

__all__ = ["Notes", "Unreadable", "json_objects", "read_code", "read_notes", "read_plan", "read_template"]
