"""Phase 3: a person's words as short notes. What is surely understood is said again plainly; the rest is asked."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable

import attrs

from memo_core.interfaces.llm import LanguageModelError
from memo_core.policy.plan_feedback import PLANNING
from memo_core.scene.graph import SceneGraph
from memo_llm.offline.answers import settled_words, wished
from memo_llm.offline.editing import apply
from memo_llm.offline.hearing import hear
from memo_llm.offline.imagination import Imagination
from memo_llm.offline.learnt import Learnt
from memo_llm.offline.prompt import LONGEST_READ, Prompt, read_subtask
from memo_llm.offline.reading import read_sentence
from memo_llm.offline.recipe import Habits
from memo_llm.offline.relative import LENGTHS, PLACES, Attempted, attempted, taken_apart
from memo_llm.offline.remark import Heard
from memo_llm.offline.rendering import render
from memo_llm.offline.typos import in_full
from memo_llm.offline.vocabulary import Vocabulary
from memo_llm.offline.wording import said_plainly, sentence_plainly

ENGLISH = 0.5  # share of known words below which a remark counts as in another language
TOO_LONG = (
    f"the offline reader reads at most {LONGEST_READ} characters at a time. What should be different, in fewer words?"
)
OTHER_LANGUAGE = (
    "the offline reader knows English only, and most of these words are unknown to it. A real language model reads "
    "other languages (llm.backend=litellm, docs/language-models.md). What should be different, in English?"
)
_EVERYWHERE = re.compile(r"\b(always|never|every time|whenever|in general|generally|anything|any \w+|all \w+s)\b")
# Words that look back at what was done before, and the verbs that say at what.
_LOOKS_BACK = re.compile(
    r"\b(?:should|could|ought to|must)(?: not|n't)? ?(?:have|'ve|of)\b|\bearlier\b|\bwhen you (?:\w+ed|took|held)\b"
)
_DONE_BEFORE = {
    "open": r"\bopen\w*\b|\bpulled\b|\bswung\b",
    "close": r"\bclosed?\b|\bshut\b",
    "pick": r"\b(?:pick|grip|grab|grasp|held|took|taken|lift)\w*\b",
}


@attrs.frozen
class NotesAnswer:
    text: str  # JSON
    not_understood: tuple[str, ...]
    unclear: str = ""  # what has to be asked


def note(prompt: Prompt, habits: Habits, vocabulary: Vocabulary, imagination: Imagination) -> NotesAnswer:
    """Corrections and general statements, or what would have to be asked. Raises ``LanguageModelError`` naming what the
    prompt lacks."""
    said, answered = settled_words(prompt.quoted("what the person said"))
    if len(said[0]) > LONGEST_READ:
        return _asking(said[0][:LONGEST_READ], TOO_LONG)
    known = _share_of_english(said[0], vocabulary)
    if known < ENGLISH:
        return _asking(said[0], OTHER_LANGUAGE)
    answers = [_note(words, answered, prompt, habits, vocabulary, imagination) for words in said]
    answer = next((answer for answer in answers if not answer.unclear), answers[0])
    return _asking(said[0], OTHER_LANGUAGE) if answer.unclear and known == ENGLISH else answer


def _asking(words: str, question: str) -> NotesAnswer:
    answer: dict[str, object] = {"corrections": [], "general": [], "unclear": question}
    return NotesAnswer(json.dumps(answer, ensure_ascii=False), (words,), question)


def _share_of_english(words: str, vocabulary: Vocabulary) -> float:
    """The share of a remark's words that the classifier has seen; 1 if it has no words."""
    tokens = re.findall(r"[^\W\d_]+(?:'[^\W\d_]+)?", in_full(words.lower(), vocabulary.spelled))
    return sum(token in Learnt.load().rows for token in tokens) / len(tokens) if tokens else 1.0


def _note(
    words: str, answered: bool, prompt: Prompt, habits: Habits, vocabulary: Vocabulary, imagination: Imagination
) -> NotesAnswer:
    """Of one way to take what the person said. ``answered``: whether it answers a question."""
    scene = prompt.scene()
    elsewhere = _elsewhere(words, prompt, scene, habits, vocabulary)
    if elsewhere is not None:
        return elsewhere
    heard = hear(words, prompt, scene, habits, vocabulary)
    action, objects = prompt.subtask
    if action == PLANNING and not Learnt.load().asked_for(words, objects, heard.kind).asks_for_nothing:
        heard = attrs.evolve(heard, about_plans=True, also_moves=False)
    plans = _plans(words, heard, prompt, vocabulary)
    if plans and not heard.also_moves:
        return _answer(heard, plan=plans)
    if heard.question and answered and (kept := wished(heard, vocabulary)):
        return _answer(heard, kept)
    if heard.question:
        # The words themselves are kept by whoever asked.
        return _answer(heard, unclear=heard.question)
    attempt = _attempt(heard, prompt, scene, imagination)
    lost = _lost(heard, attempt, scene, habits.rough, vocabulary)
    if lost and heard.likewise is not None:
        heard = heard.likewise
        lost = _lost(heard, attempt, scene, habits.rough, vocabulary)
    if lost:
        return _answer(heard, unclear=f"how would one do that here: {lost} You said: {' '.join(words.split())[:200]}")
    if unlike := _contradicted(heard, attempt):
        return _answer(heard, unclear=f"{unlike} You said: {' '.join(words.split())[:200]}")
    corrections: list[str] = []
    general: list[str] = []
    for sentence, reading in zip(heard.sentences, heard.readings, strict=True):
        notes = [
            said
            for edit in reading.edits
            if edit in heard.edits and (said := said_plainly(edit, heard.recipe, attempt))
        ]
        if not notes and not reading.edits and len(sentence.split()) > 2 and not vocabulary.praises(sentence):
            notes = [sentence_plainly(sentence)]
        everywhere = _EVERYWHERE.search(sentence.lower()) and reading.edits
        (general if everywhere else corrections).extend(notes)
        general += [edit.phrase.general for edit in reading.edits if edit.phrase is not None and edit.phrase.general]
    if general and not corrections and not _EVERYWHERE.search(words.lower()):
        corrections = list(general)
    return _answer(heard, corrections, general, plans)


def _contradicted(heard: Heard, attempt: Attempted) -> str:
    """What to ask where words do not go with what the attempt did: further, to an angle that is no further than it
    went. "" else."""
    said = [edit for reading in heard.readings for edit in reading.edits]
    if heard.recipe is None or not any(edit.kind == "farther" and edit.degrees is None for edit in said):
        return ""
    went = attempt.degrees if attempt.degrees is not None else heard.recipe.turn or heard.recipe.angle
    for edit in heard.edits:
        if edit.kind == "angle" and edit.degrees is not None and edit.degrees <= abs(went):
            return f"how far: it went {abs(went):.0f} degrees, and {edit.degrees:g} degrees is no further."
    return ""


def _lost(heard: Heard, attempt: Attempted, scene: SceneGraph, rough: dict[str, float], vocabulary: Vocabulary) -> str:
    """The first note that would be followed otherwise than it was meant, once it is read again; "" if there is none."""
    if heard.recipe is None:
        return ""
    for edit in heard.edits:
        text = said_plainly(edit, heard.recipe, attempt)
        seen = [node.label for node in scene.nodes]
        again = read_sentence(taken_apart(text)[0], vocabulary, seen, heard.recipe.read_as)
        followed = heard.recipe
        for one in again.edits:
            followed = apply(followed, one, rough)
        if text and followed != apply(heard.recipe, edit, rough):
            return text
    return ""


def _answer(
    heard: Heard,
    corrections: Iterable[str] = (),
    general: Iterable[str] = (),
    plan: Iterable[str] = (),
    unclear: str = "",
) -> NotesAnswer:
    lists = {"corrections": corrections, "general": general, **({"plan": plan} if plan else {})}
    answer: dict[str, object] = {name: list(dict.fromkeys(notes)) for name, notes in lists.items()}
    return NotesAnswer(json.dumps(answer | {"unclear": unclear}, ensure_ascii=False), heard.not_understood, unclear)


def _elsewhere(
    words: str, prompt: Prompt, scene: SceneGraph, habits: Habits, vocabulary: Vocabulary
) -> NotesAnswer | None:
    """Notes about another subtask of this run, where the words look back at it ("you should have opened it further",
    said while placing) and are surely understood of it; None where they do not, or are not."""
    plain = words.lower().replace("’", "'")
    here = habits.recipe(*prompt.subtask)
    listed = prompt.bullets("subtasks of this run") if "subtasks of this run" in prompt.sections else []
    if _LOOKS_BACK.search(plain) is None:
        return None
    for other in reversed(listed):
        recipe = habits.recipe(*read_subtask(other))
        verbs = _DONE_BEFORE.get(recipe.kind) if recipe is not None else None
        if verbs is None or (here is not None and recipe is not None and recipe.kind == here.kind):
            continue
        if re.search(verbs, plain) is None:
            continue
        there = attrs.evolve(prompt, sections=prompt.sections | {"subtask": other})
        heard = hear(words, there, scene, habits, vocabulary)
        notes = [{"subtask": other, "note": said} for edit in heard.edits if (said := said_plainly(edit, None, None))]
        if notes and not heard.question:
            answer = {"corrections": [], "general": [], "elsewhere": notes, "unclear": ""}
            return NotesAnswer(json.dumps(answer, ensure_ascii=False), heard.not_understood)
    return None


def _says_nothing(sentence: str, vocabulary: Vocabulary) -> bool:
    """Whether it is one word of small talk: "Sorry!"."""
    words = re.findall(r"[a-z']+", sentence.lower())
    return len(words) < 2 and set(words) <= vocabulary.small_talk | {"no", "nope", "yes", "stop"}


def _plans(words: str, heard: Heard, prompt: Prompt, vocabulary: Vocabulary) -> list[str]:
    """Notes for whoever plans, in the person's words, where the prompt asks for such notes."""
    if not (heard.about_plans and '"plan"' in prompt.section("answer")):
        return []
    sentences = [one for one in re.split(r"(?<=[.!?])\s+|\n+", words.strip()) if one.strip()]
    said = [
        one for one in sentences if len(one.split()) > 3 or not (one.endswith("?") or _says_nothing(one, vocabulary))
    ]
    notes = [sentence_plainly(sentence) for sentence in said]
    objects = prompt.subtask[1]
    named = f"The {objects[0].lower()}" if objects else "It"
    goes = r" (?=(?:goes|belongs|should|has to|needs|must|lives)\b)"
    # "You forgot the lid! That goes on the jar" is about the lid.
    notes = [re.sub(rf"^(?:It|That|This){goes}", f"{named} ", notes[0]), *notes[1:]] if notes else []
    return [note if named[4:] in note.lower() else re.sub(f"^It{goes}", f"{named} ", note) for note in notes]


def _attempt(heard: Heard, prompt: Prompt, scene: SceneGraph, imagination: Imagination) -> Attempted:
    """What the attempt did, where a remark is relative to that."""
    if heard.recipe is None or not any(edit.kind in (*PLACES, *LENGTHS, "set-down") for edit in heard.edits):
        return Attempted()
    try:
        code = prompt.code("code")
    except LanguageModelError:  # it was said of something else than code
        return Attempted()
    habit = render(heard.recipe, prompt.section("subtask"), scene, prompt.task, [])
    return attempted(code, habit, heard.recipe, scene, imagination)
