"""Phase 2: habit, then what worked before, then what people said, each ranked; what ranks highest has the last word."""

from __future__ import annotations

import attrs

from memo_llm.offline.editing import apply
from memo_llm.offline.prompt import Entry, Prompt, unreadable
from memo_llm.offline.reading import Edit, read_sentence
from memo_llm.offline.recipe import Habits, Recipe
from memo_llm.offline.rendering import render
from memo_llm.offline.templates import adopt
from memo_llm.offline.vocabulary import Vocabulary


@attrs.frozen
class Code:
    text: str
    not_understood: tuple[str, ...]


def write_code(prompt: Prompt, habits: Habits, vocabulary: Vocabulary) -> Code:
    """Python for the prompt's subtask. Raises ``LanguageModelError`` naming what the prompt lacks."""
    scene = prompt.scene()
    action, objects = prompt.subtask
    subtask = prompt.section("subtask").strip()
    missed: list[str] = []
    recipe = habits.recipe(action, objects)
    if recipe is None:
        missed.append(action)
        kind = "turn" if not habits.kinds else next(iter(habits.kinds))
        recipe = habits.recipe(kind, objects)
        if recipe is None:
            raise unreadable(f"no habit for the verb {action!r}")
    recipe, missed_templates = _adopted(recipe, prompt, scene)
    missed += missed_templates
    known = [node.label for node in scene.nodes] + [*objects, action, *(e.key for e in prompt.entries("corrections"))]
    said = [*prompt.entries("general"), *prompt.entries("corrections")]
    followed: list[str] = []
    # Lists come best first; the best is applied last, corrections after general statements.
    for entry in [*reversed(prompt.entries("general")), *reversed(prompt.entries("corrections"))]:
        edits, unread = _read(entry, vocabulary, known)
        before = recipe
        for edit in edits:
            recipe = apply(recipe, edit, habits.rough)
        if edits and recipe != before:
            followed.append(entry.text)
        missed += unread
    remarks = [f"As told: {text}" for text in reversed(followed)]
    remarks += [f"Not understood: {words}" for words in dict.fromkeys(missed)]
    assert len(said) >= len(followed)
    return Code(render(recipe, subtask, scene, prompt.task, remarks), tuple(dict.fromkeys(missed)))


def _read(entry: Entry, vocabulary: Vocabulary, known: list[str]) -> tuple[list[Edit], list[str]]:
    reading = read_sentence(entry.text, vocabulary, known)
    return list(reading.edits), list(reading.not_understood)


def _adopted(recipe: Recipe, prompt: Prompt, scene) -> tuple[Recipe, list[str]]:
    """The structure of what worked before; of several templates the best ranked one has the last word."""
    missed = []
    for template in reversed(prompt.templates()):
        shaped = adopt(recipe, template, scene, prompt.subtask[1])
        if shaped is None:
            missed.append(f"template [{template.key}]" if template.key else "a template")
        else:
            recipe = shaped
    return recipe, missed
