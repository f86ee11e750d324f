"""Phase 3: a person's words as short notes. What the keywords say is said again plainly; the rest is asked back, and
kept in the person's own words where the answer is no clearer."""

from __future__ import annotations

import json
import re

import attrs

from memo_core.plugin import PLANNING, Prompt, SceneGraph, UnreadablePrompt
from memo_offline.editing import axis_of, length_of, metres, reach
from memo_offline.phrases import Amount, load
from memo_offline.planning import wish_in
from memo_offline.reading import UNKNOWN, Edit, Reading, read
from memo_offline.recipe import Recipe
from memo_offline.writing import FOLLOWED, NOT_FOLLOWED, NOT_UNDERSTOOD, plain_recipe

_ASKED = re.compile(r"\A(.*)\n\(asked back: .*?\)\n(.*)\Z", re.S)
_OPENERS = re.compile(
    r"^(?:(?:no|yes|well|hm+|hey|ok(?:ay)?|please|but|so|you (?:have to|must|should|need to))[, ]+)+", re.I
)
_GRIP = re.compile(r"\b(?:hand|fingers?|gripper|handle)\b")


@attrs.frozen
class NotesAnswer:
    """The notes as JSON, and the words of which none were made."""

    text: str
    not_understood: tuple[str, ...] = ()


def note(prompt: Prompt) -> NotesAnswer:
    """Corrections and general statements, or what would have to be asked. Raises ``UnreadablePrompt`` naming what the
    prompt lacks."""
    words = prompt.quoted("what the person said")
    asked = _ASKED.search(words)
    said = " ".join((asked.group(2) if asked else words).split())
    scene = prompt.scene()
    if (planned := _of_plans(said, prompt, scene)) is not None:
        return planned
    plain, _ = plain_recipe(prompt)
    reading = read(said, scene.nodes)
    if reading.edits:
        edits = [_from_plain(edit, prompt, plain, scene) for edit in reading.edits]
        return _notes(edits, reading, _unread(said, scene))
    if reading.praise:
        return _asking(said, "that was praise, and nothing is noted of praise. What should be different, if anything?")
    if asked and len(said.split()) > 2 and "?" not in said:
        return _answer(corrections=[plainly(said)], missed=(said,))
    if reading.doubt == UNKNOWN:
        known = f"Known are: {load().offers(plain.kind)} (all: docs/offline-backend.md)"
        return _asking(said, f"{UNKNOWN}. {known}. What should be different?")
    return _asking(said, reading.doubt)


def plainly(sentence: str) -> str:
    """A person's sentence as a note."""
    text = _OPENERS.sub("", " ".join(sentence.split()).strip(" .!?,"))
    text = re.sub(r"[\[(]\s*-?\d[^\])]*[\])]", "there", text)  # coordinates hold only for one scene
    return (text[:1].upper() + text[1:])[:380] + "."


def _of_plans(said: str, prompt: Prompt, scene: SceneGraph) -> NotesAnswer | None:
    """A note for plans, in the person's words, where they ask for a step; None where they do not."""
    planning = prompt.subtask[0] == PLANNING
    if '"plan"' not in prompt.section("answer") or "?" in said:
        return None
    if planning or (wish_in(said, scene) and not _GRIP.search(said.lower())):
        return _answer(plan=[plainly(said)])
    return None


def _unread(said: str, scene: SceneGraph) -> tuple[str, ...]:
    """The sentences beside understood ones in which there is no keyword."""
    sentences = [one for one in re.split(r"(?<=[.!?])\s+", said) if len(one.split()) > 2]
    return tuple(one for one in sentences if not (found := read(one, scene.nodes)).edits and not found.praise)


def _notes(edits: list[Edit], reading: Reading, unread: tuple[str, ...]) -> NotesAnswer:
    notes = [edit.note for edit in edits]
    general = [edit.phrase.general for edit in edits if edit.phrase.general and edit.explained]
    kept = [plainly(one) for one in unread]
    return (
        _answer(kept, notes + general, missed=unread)
        if reading.everywhere
        else _answer(notes + kept, general, missed=unread)
    )


def _asking(said: str, question: str) -> NotesAnswer:
    return _answer(unclear=question, missed=(said,))


def _answer(
    corrections: list[str] | None = None,
    general: list[str] | None = None,
    plan: list[str] | None = None,
    unclear: str = "",
    missed: tuple[str, ...] = (),
) -> NotesAnswer:
    lists = {"corrections": corrections or [], "general": general or []} | ({"plan": plan} if plan else {})
    found: dict[str, object] = {name: list(dict.fromkeys(notes)) for name, notes in lists.items()}
    return NotesAnswer(json.dumps(found | {"unclear": unclear}, ensure_ascii=False), missed)


def _from_plain(edit: Edit, prompt: Prompt, plain: Recipe, scene: SceneGraph) -> Edit:
    """An edit that is relative to the attempt as one that is measured from the plain way: "lower" said of code that
    went 2 cm lower already is 4 cm lower."""
    try:
        code = prompt.code("code")
    except UnreadablePrompt:  # it was said of something else than code
        return edit
    told = [one for line in _comments(code) for one in read(line, scene.nodes).edits]
    if edit.phrase.matter == "reach":
        return _further_from_plain(edit, code, plain)
    if (axis := axis_of(edit)) is None:
        return edit
    before = sum(
        found[1] * metres(one, 0.02) for one in told if (found := axis_of(one)) is not None and found[0] == axis[0]
    )
    if not before:
        return edit
    total = before + axis[1] * metres(edit, 0.02)
    matter = edit.phrase.matter
    phrase = next(
        one
        for one in load().all
        if one.matter == matter and (found := axis_of(Edit(one))) is not None and found[1] * total >= 0
    )
    centimetres = f"{abs(total) * 100:.1f}".removesuffix(".0")
    return Edit(phrase, Amount(f"{centimetres} cm", "cm", abs(total)))


def _comments(code: str) -> list[str]:
    """The notes that code says it follows."""
    lines: list[str] = []
    for line in code.splitlines():
        if not line.startswith("# "):
            if lines:
                break
            continue
        if line.startswith((f"# {NOT_FOLLOWED}", f"# {NOT_UNDERSTOOD}")):
            break
        if line.startswith(f"# {FOLLOWED}"):
            lines.append(line[2 + len(FOLLOWED) :])
        elif lines:
            lines[-1] += f" {line[2:]}"
    return lines


def _further_from_plain(edit: Edit, code: str, plain: Recipe) -> Edit:
    constant = re.search(r"^(ANGLE|TURN|DISTANCE|PUSH) = (-?[\d.]+)", code, re.M)
    if constant is None:
        return edit
    lengths = {"ANGLE": plain.angle, "TURN": plain.turn, "DISTANCE": plain.distance, "PUSH": plain.push}
    usual, went = abs(lengths[constant.group(1)]), abs(float(constant.group(2)))
    if not usual or abs(went - usual) < 0.01 * usual:
        return edit
    shaped = attrs.evolve(plain, shape="arc" if constant.group(1) == "ANGLE" else "straight")
    factor = reach(edit, shaped, went / usual) if length_of(shaped) else went / usual
    percent = round(100 * (factor - 1))
    phrase = load().named("further" if percent >= 0 else "less far")
    return Edit(phrase, Amount(f"{abs(percent)} percent", "percent", float(abs(percent))))
