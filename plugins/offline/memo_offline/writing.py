"""Phase 2: start from the habit, then apply templates, then corrections, each ranked; the highest-ranked one is applied
last."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import attrs

from memo_core.plugin import Node, Prompt, PromptEntry, SceneGraph, read_subtask
from memo_offline.editing import apply
from memo_offline.imagination import Imagination
from memo_offline.reading import read
from memo_offline.recipe import Recipe, habits
from memo_offline.rendering import render
from memo_offline.surroundings import descendants, find
from memo_offline.templates import adopt

FOLLOWED = "As told: "  # begins a comment that holds a note which the code follows
NOT_FOLLOWED = "Cannot follow: "  # begins one with a note that is understood and changes nothing in this code
NOT_UNDERSTOOD = "Not understood: "


@attrs.frozen
class Code:
    """Python, and the notes and templates that it makes nothing of."""

    text: str
    not_understood: tuple[str, ...]


def write_code(prompt: Prompt, imagination: Imagination) -> Code:
    """Python for the prompt's subtask. Instead of what failed, the same without what was taught of other
    things; where that was tried too, the same code again says that there is no other idea. Raises
    ``UnreadablePrompt`` naming what the prompt lacks."""
    tried = prompt.tried()
    code = _code(prompt, imagination)
    if code.text.strip() in tried:
        other = _code(prompt, imagination, of_this_alone=True)
        if other.text.strip() not in tried:
            return other
    return code


def plain_recipe(prompt: Prompt, failed: int = 0) -> tuple[Recipe, bool]:
    """The habit for the prompt's subtask, and whether its verb is known: touching what is named is the least that an
    unknown one may mean."""
    action, objects = prompt.subtask
    recipe = habits().recipe(action, objects, failed)
    if recipe is not None:
        return recipe, True
    pushed = habits().recipe("push", objects)
    assert pushed is not None
    return pushed, False


def _code(prompt: Prompt, imagination: Imagination, of_this_alone: bool = False) -> Code:
    scene = prompt.scene()
    plain, known = plain_recipe(prompt, prompt.attempts())
    missed = [] if known else [prompt.subtask[0]]
    templates, corrections = prompt.templates(), prompt.entries("corrections")
    if of_this_alone:
        templates = [one for one in templates if _of_this(one, plain, scene)]
        corrections = [one for one in corrections if _of_this(one, plain, scene)]
    recipe = plain
    for template in reversed([one for one in templates if _alike(one, prompt)]):
        shaped = adopt(recipe, template, scene, prompt.subtask[1], imagination)
        missed += [f"the template of {template.key}"] if shaped is None else []
        recipe = shaped or recipe
    just = [note for one in prompt.corrected() for note in one.notes]  # newest first
    corrections = [one for one in corrections if not one.hint or _alike(one, prompt)]
    entries = [*just, *corrections, *prompt.entries("general")]
    missed += [entry.text for entry in reversed(entries) if not read(entry.text, scene.nodes).edits]
    not_understood = tuple(dict.fromkeys(missed))

    def written(recipe: Recipe, remarks: Sequence[str] = ()) -> str:
        return render(recipe, prompt.section("subtask"), scene, prompt.task, list(remarks))

    recipe, followed, ignored = _follow(entries, recipe, plain, scene, written)
    # Nothing here counts the attempts: code that is the same again must read the same, for that says "no other idea".
    remarks = [f"{FOLLOWED}{text}" for text in followed]
    remarks += [f"{NOT_FOLLOWED}{text}" for text in ignored]
    remarks += [f"{NOT_UNDERSTOOD}{words}" for words in not_understood]
    return Code(written(recipe, remarks), not_understood)


def _follow(
    entries: Sequence[PromptEntry], first: Recipe, plain: Recipe, scene: SceneGraph, written: Callable[[Recipe], str]
) -> tuple[Recipe, list[str], list[str]]:
    """The recipe with the edits of all entries, the texts of the entries that its code follows, and the texts that
    change nothing in the code; best first."""
    changed: dict[str, bool] = {}  # text of an entry that changed the recipe: whether the code changed with it
    recipe = first
    for text, before, after in _applied(entries, first, plain, scene):
        seen = changed.pop(text, False)
        changed[text] = seen or written(after) != written(before)
        recipe = after
    for text in [text for text, seen in changed.items() if not seen]:
        # It may have prepared what another one made use of: an angle, and then an arc.
        left = [after for *_, after in _applied([one for one in entries if one.text != text], first, plain, scene)]
        without = left[-1] if left else first
        changed[text] = written(without) != written(recipe)
    best_first = list(reversed(changed))
    return recipe, [text for text in best_first if changed[text]], [text for text in best_first if not changed[text]]


def _applied(
    entries: Sequence[PromptEntry], recipe: Recipe, plain: Recipe, scene: SceneGraph
) -> Iterator[tuple[str, Recipe, Recipe]]:
    """Each edit that changes the recipe: the text of its entry, the recipe before and after. Entries come best first:
    the best is applied last, and corrections after general statements."""
    for entry in reversed(entries):
        for edit in read(entry.text, scene.nodes).edits:
            if edit.phrase.matter == "sense" and not _of_this(entry, plain, scene):
                continue  # the other way round is one only beside the attempt it was said of
            before, recipe = recipe, apply(recipe, edit, plain)
            if recipe != before:
                yield entry.text, before, recipe


def _of_this(entry: PromptEntry, recipe: Recipe, scene: SceneGraph) -> bool:
    """Whether a note was made of this subtask's thing, of what it is part of or has as a part, or of nothing in
    particular."""
    objects = read_subtask(entry.key)[1] if "(" in entry.key else ()
    if not objects or objects[0].lower() == recipe.thing.lower():
        return True
    node = find(scene, objects[0])
    return node is not None and any(node.id == other.id for other in _family(recipe, scene))


def _family(recipe: Recipe, scene: SceneGraph) -> list[Node]:
    """The subtask's thing, its parts and what it is part of; nothing where the scene does not show it."""
    thing = find(scene, recipe.thing)
    if thing is None:
        return []
    return [thing, *descendants(scene, thing), *(node for node in scene.nodes if node.id == thing.part_of)]


def _alike(entry: PromptEntry, prompt: Prompt) -> bool:
    """Whether an entry was made at something that is done in the same steps, or done to the same things; yes, where
    that cannot be told."""
    if "(" not in entry.key:
        return True
    (action, objects), (other, others) = prompt.subtask, read_subtask(entry.key)
    mine, its = habits().recipe(action, objects), habits().recipe(other, others)
    return mine is None or its is None or mine.steps == its.steps or set(objects) == set(others)
