"""Phase 2: start from the habit, then apply templates, then corrections, each ranked; the highest-ranked one is applied
last."""

from __future__ import annotations

import re

import attrs

from memo_core.scene.graph import Node, SceneGraph
from memo_core.skillbook.action_relations import default_actions
from memo_core.skillbook.keys import Key
from memo_core.skillbook.scene_context import SubtaskContext
from memo_core.skillbook.shared_terms import Terms
from memo_llm.offline.editing import apply
from memo_llm.offline.edits import Edit
from memo_llm.offline.hearing import hear
from memo_llm.offline.imagination import Imagination
from memo_llm.offline.prompt import Corrected, Entry, Prompt, read_subtask, unreadable
from memo_llm.offline.reading import read_sentence
from memo_llm.offline.recipe import Habits, Recipe
from memo_llm.offline.relative import LENGTHS, PLACES, attempted, based, measured_from, not_outdated, taken_apart
from memo_llm.offline.rendering import render
from memo_llm.offline.surroundings import descendants, find
from memo_llm.offline.templates import adopt
from memo_llm.offline.vocabulary import Vocabulary

_ACTIONS = default_actions()
TERMS = Terms(_ACTIONS)


@attrs.frozen
class Code:
    text: str
    not_understood: tuple[str, ...]


def write_code(prompt: Prompt, habits: Habits, vocabulary: Vocabulary, imagination: Imagination) -> Code:
    """Python for the prompt's subtask. Instead of what was tried in vain, the same without what was taught of other
    things; where that was tried too, the same code again says that there is no other idea. Raises
    ``LanguageModelError`` naming what the prompt lacks."""
    tried = prompt.tried()
    code = _code(prompt, habits, vocabulary, imagination)
    if code.text.strip() in tried:
        other = _code(prompt, habits, vocabulary, imagination, of_this_alone=True)
        if other.text.strip() not in tried:
            return other
    return code


def _code(
    prompt: Prompt, habits: Habits, vocabulary: Vocabulary, imagination: Imagination, of_this_alone: bool = False
) -> Code:
    scene = prompt.scene()
    action, objects = prompt.subtask
    missed: list[str] = []
    failed = prompt.attempts()
    recipe = habits.recipe(action, objects, failed)
    if recipe is None:
        # Touching what is named is the least that somebody may mean; that the verb is unknown is said.
        missed.append(action)
        recipe = habits.recipe("push", objects)
        if recipe is None:
            raise unreadable(f"no habit for the verb {action!r}, nor for 'push'")
    templates, corrections = prompt.templates(), prompt.entries("corrections")
    if of_this_alone:
        templates = [one for one in templates if _of_this(one, recipe, scene)]
        corrections = [one for one in corrections if _of_this(one, recipe, scene)]
    recipe = _adopted(recipe, templates, prompt, scene, habits, missed, imagination)
    # What is only a hint and speaks of nothing here is left for when the plain way has failed.
    corrections = [
        one
        for one in corrections
        if not one.hint or _applies(one, prompt, habits) or (failed and _can_be_followed(one, recipe, scene))
    ]
    known = [node.label for node in scene.nodes] + [*objects, action, *(entry.key for entry in corrections)]
    told: list[tuple[str, Edit]] = []
    # Lists come best first: the best is applied last, and corrections after general statements.
    for entry in [*reversed(prompt.entries("general")), *reversed(corrections)]:
        told += _told(entry, known, recipe, scene, vocabulary, missed)
    for one in reversed(prompt.corrected()):
        told += _just_said(one, known, recipe, prompt, scene, habits, vocabulary, missed, imagination)
    followed: list[str] = []
    counts = not_outdated([edit for _, edit in told], habits.rough)
    for text, edit in told:
        if not any(edit is one for one in counts):
            continue
        before, recipe = recipe, apply(recipe, edit, habits.rough)
        if recipe != before and text not in followed:
            followed.append(text)
    not_understood = tuple(dict.fromkeys(missed))
    # Nothing here counts the attempts: code that is the same again must read the same, for that says "no other idea".
    remarks = [f"As told: {text}" for text in reversed(followed)]
    remarks += [f"Not understood: {words}" for words in not_understood]
    return Code(render(recipe, prompt.section("subtask"), scene, prompt.task, remarks), not_understood)


def _told(
    entry: Entry, known: list[str], recipe: Recipe, scene: SceneGraph, vocabulary: Vocabulary, missed: list[str]
) -> list[tuple[str, Edit]]:
    """A note's edits, each with the note, where it is about this subtask."""
    if not _concerns(entry.text, recipe, scene, vocabulary):
        return []
    said, relative_to = taken_apart(entry.text)
    reading = read_sentence(said, vocabulary, known, recipe.read_as)
    missed += reading.not_understood
    edits = based(reading.edits, relative_to)
    if not _of_this(entry, recipe, scene):
        # "The other way round" is a way only beside the attempt it was said of; another thing's is not known here.
        edits = tuple(edit for edit in edits if edit.kind != "reverse")
    return [(entry.text, edit) for edit in edits]


def _of_this(entry: Entry, recipe: Recipe, scene: SceneGraph) -> bool:
    """Whether a note was made of this subtask's thing, of what it is part of or has as a part, or of nothing in
    particular."""
    objects = read_subtask(entry.key)[1] if "(" in entry.key else ()
    if not objects or objects[0].lower() == recipe.thing.lower():
        return True
    node = find(scene, objects[0])
    return node is not None and any(node.id == other.id for other in _family(recipe, scene))


def _just_said(
    one: Corrected,
    known: list[str],
    recipe: Recipe,
    prompt: Prompt,
    scene: SceneGraph,
    habits: Habits,
    vocabulary: Vocabulary,
    missed: list[str],
    imagination: Imagination,
) -> list[tuple[str, Edit]]:
    """What follows from a correction of this run: from its notes, and where none were made from the words, if they are
    surely understood. What is relative is relative to that attempt's code."""
    if one.notes:
        told = [pair for note in reversed(one.notes) for pair in _told(note, known, recipe, scene, vocabulary, missed)]
    else:
        heard = hear(one.words, prompt, scene, habits, vocabulary)
        if heard.question:
            missed.append(one.words)
            return []
        told = [(one.words, edit) for edit in heard.edits]
    relative = any(edit.kind in (*PLACES, *LENGTHS) for _, edit in told)
    plain = habits.recipe(*prompt.subtask)
    if not (relative and one.code and plain is not None):
        return told
    habit = render(plain, prompt.section("subtask"), scene, prompt.task, [])
    attempt = attempted(one.code, habit, plain, scene, imagination)
    return [(text, edit) for text, one_edit in told for edit in measured_from([one_edit], plain, attempt)]


def _concerns(text: str, recipe: Recipe, scene: SceneGraph, vocabulary: Vocabulary) -> bool:
    """Whether a statement that says whom it is about is about this subtask's thing, or its kind of action."""
    noun, verb = vocabulary.scope(text)
    if verb and not recipe.kind.startswith(verb[:4]):
        return False
    if not noun:
        return True
    labels = [recipe.thing, *(node.label for node in _family(recipe, scene))]
    return any(noun == word.removesuffix("s") for label in labels for word in label.lower().split())


def _family(recipe: Recipe, scene: SceneGraph) -> list[Node]:
    """The subtask's thing, its parts and what it is part of; nothing where the scene does not show it."""
    thing = find(scene, recipe.thing)
    if thing is None:
        return []
    return [thing, *descendants(scene, thing), *(node for node in scene.nodes if node.id == thing.part_of)]


def _applies(hint: Entry, prompt: Prompt, habits: Habits) -> bool:
    """Whether a note that is only a hint is about something like this subtask, or speaks of what this is about: the
    action, the things, the first one's parts that the scene shows and how such parts are worked."""
    action, objects = prompt.subtask
    words = {word for name in (action, *objects) for word in name.lower().split() if len(word) > 2}
    if _like(hint, prompt, habits) or words & set(re.findall(r"\w+", hint.text.lower())):
        return True
    subtask = Key.make(action, *objects[:1])  # where a thing is put, no part is worked
    return TERMS.overlap(TERMS.of_subtask(subtask, SubtaskContext.of(subtask, prompt.scene())), hint.text) > 0


def _can_be_followed(hint: Entry, recipe: Recipe, scene: SceneGraph) -> bool:
    """Whether a subtask's thing has one of the parts that a note speaks of, or the note speaks of none."""
    named = _ACTIONS.parts.keys() & set(re.findall(r"\w+", hint.text.lower()))
    here = {
        word
        for label in (recipe.thing, *(node.label for node in _family(recipe, scene)))
        for word in label.lower().split()
    }
    return not named or bool(named & here)


def _like(entry: Entry, prompt: Prompt, habits: Habits) -> bool:
    """Whether an entry was made at something that is done in the same steps, or done to the same things; yes, where
    that cannot be told."""
    if "(" not in entry.key:
        return True
    (action, objects), (other, others) = prompt.subtask, read_subtask(entry.key)
    mine, its = habits.recipe(action, objects), habits.recipe(other, others)
    return mine is None or its is None or mine.steps == its.steps or set(objects) == set(others)


def _adopted(
    recipe: Recipe,
    templates: list[Entry],
    prompt: Prompt,
    scene: SceneGraph,
    habits: Habits,
    missed: list[str],
    imagination: Imagination,
) -> Recipe:
    """The structure of what worked before at something like this; of several templates the best ranked one has the
    last word."""
    for template in reversed([one for one in templates if _like(one, prompt, habits)]):
        shaped = adopt(recipe, template, scene, prompt.subtask[1], imagination)
        if shaped is None:
            missed.append(f"the template of {template.key}" if template.key else "a template")
        else:
            recipe = shaped
    return recipe
