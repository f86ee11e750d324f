"""Phase 3: a person's words as short notes. What is surely understood is said again plainly; the rest is asked."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence

import attrs

from memo_core.interfaces.llm import LanguageModelError
from memo_core.scene.graph import SceneGraph
from memo_llm.offline.agreement import opposed, wanted
from memo_llm.offline.clauses import is_request
from memo_llm.offline.editing import apply
from memo_llm.offline.edits import GENTLE, Edit, Reading
from memo_llm.offline.gist import asks_for_nothing, gist_of
from memo_llm.offline.imagination import Imagination
from memo_llm.offline.prompt import Prompt, read_subtask
from memo_llm.offline.questions import OF_DOORS, what_is_missing, which_is_meant
from memo_llm.offline.reading import clauses, read_sentence
from memo_llm.offline.recipe import Habits, Recipe
from memo_llm.offline.relative import LENGTHS, PLACES, Attempted, attempted, taken_apart
from memo_llm.offline.rendering import render
from memo_llm.offline.surroundings import Surroundings, find, space_of
from memo_llm.offline.vocabulary import Vocabulary
from memo_llm.offline.wording import ONLY_WAY, said_plainly, sentence_plainly

_EVERYWHERE = re.compile(r"\b(always|never|every time|whenever|in general|generally|anything|any \w+|all \w+s)\b")
# Edits that say how something is to be: following one changes nothing where it is so already.
_STATES = frozenset(
    [
        "straight",
        "arc",
        "hold-at",
        "approach",
        "release",
        "hold-on",
        "open-first",
        "close-first",
        "centre",
        "stiff-hand",
        "fingers",
        "look",
        "tilt",
        "turn-hand",
        "back-off",
        "finger-width",
        "turn-thing",
        "way",
        "line-up",
        "over-place",
        "strokes",
    ]
)
_AMOUNT_ALONE = re.compile(
    r"[.!] (?P<amount>(?:(?:about|around|roughly|maybe|say|just|like|by|only) )*"
    r"(?:an?|one|two|three|four|five|six|eight|ten|half an?|a couple of|a few|\d+) "
    r"(?:cm|mm|(?:centi|milli)met(?:er|re)s?|inch(?:es)?)(?: or so)?)(?=[.!]|$)",
    re.I,
)
# How sure of a gist one must be to follow it: where the rules read the same with doubts; something else with doubts;
# nothing, or surely something else. Then: where a remark is short or unclear, or is kept for the plan though rules read
# a motion; to ask whether words are for the plan; where the rules read surely a part of it, or more than it.
_AGREED, _DESPITE_DOUBTS, _SURE, _CERTAIN, _WORTH_ASKING, _SURE_OF_PARTS = 0.4, 0.6, 0.5, 0.85, 0.5, 0.7
_OF_PLANS = "corrections: stays empty here"  # of a prompt about a remark on a plan
_FLAT = 0.03  # m: what is no higher is something to put things on
_FEW = 5  # words of which a gist says little
_SHORT = 9  # words of a remark that the rules may read alone
_UNNAMED = frozenset(  # edits that no gist is about
    [
        "between",
        "pivot",
        "clear-first",
        "close-first",
        "open-first",
        "back-off-before",
        "settle-grip",
        "beside",
        "ease",
        "look",
    ]
)
_PLACED = frozenset(["hold-at", "centre", "offset", "approach", "beside"])
_WAS_THERE = re.compile(
    r"(?:please )?don't (?:stick|put) your fingers?\b|"
    r"(?:you(?:'ve|'re| were| are)?|it(?:'s| was)|that(?:'s| was))(?: \w+){0,3} too (?:close|near|far|high|low)\b"
)
_ASIDE = "does it slide out towards the robot, or to which side? You said: {}"
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


@attrs.frozen
class Heard:
    """What was made of a person's words. ``question``: what has to be asked before anything follows from them."""

    recipe: Recipe | None  # the plain way to do what was spoken of; None for a verb that is not known
    sentences: tuple[str, ...]
    readings: tuple[Reading, ...]
    edits: tuple[Edit, ...]
    question: str
    about_plans: bool = False  # whether it surely is about what is to be done, and not only how
    also_moves: bool = False  # whether it is about the motion as well

    @property
    def kind(self) -> str:
        return "" if self.recipe is None else self.recipe.kind

    @property
    def not_understood(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(part for reading in self.readings for part in reading.not_understood))


def hear(words: str, prompt: Prompt, scene: SceneGraph, habits: Habits, vocabulary: Vocabulary) -> Heard:
    """What a person means who said ``words`` of the prompt's subtask: what the rules read where the gist says the same
    or cannot be told of few words, the gist where that is sure, and else a question."""
    heard = _read(words, prompt, scene, habits, vocabulary)
    special = any(edit.kind in _UNNAMED for edit in heard.edits)
    if special and not heard.question:
        return heard
    objects, kind = prompt.subtask[1], heard.kind
    quoted, short = " ".join(words.split())[:200], len(words.split()) <= _SHORT
    screwed, slides = not _swings(scene, heard.recipe), _slides_out(scene, heard.recipe)
    gist = gist_of(words, objects, kind, vocabulary, screwed, slides, beside=_goes_beside(scene, objects))
    if gist is not None and gist.about_plans and not gist.text:
        return _about_plans(heard, gist.probability, quoted)
    if gist is not None and _beside_another(words, _others(scene, objects)):
        gist = None
    meant = _read(gist.text, prompt, scene, habits, vocabulary) if gist is not None else None
    if gist is None or meant is None or meant.question:
        return heard if heard.question or short or _measured(heard) else _asked(heard, heard.edits, quoted)
    meant = attrs.evolve(meant, about_plans=gist.about_plans, also_moves=gist.about_plans)
    read, told = wanted(heard.edits), wanted(meant.edits)
    if heard.question:
        unclear = len(words.split()) < _FEW or opposed(heard.edits, heard.edits, vocabulary)
        least = _AGREED if read == told else _CERTAIN if unclear else _DESPITE_DOUBTS if read else _SURE
        if special:
            return meant if gist.probability >= _CERTAIN else heard
        return meant if gist.probability >= least else _asked(heard, meant.edits, quoted)
    if read & told or _swung(heard, meant):
        return heard if short or read == told or gist.probability < _SURE_OF_PARTS else meant
    if gist.probability >= (_CERTAIN if short else _SURE) and not opposed(heard.edits, meant.edits, vocabulary):
        return meant
    return heard if short else _asked(heard, meant.edits if gist.probability >= _SURE else heard.edits, quoted)


def _about_plans(heard: Heard, probability: float, quoted: str) -> Heard:
    """Of words whose gist is that the plan is to be another one."""
    if heard.question:
        return attrs.evolve(heard, about_plans=probability >= (_CERTAIN if heard.edits else _SURE))
    if probability >= _CERTAIN:
        return attrs.evolve(heard, about_plans=True)
    asked = f"is something else to be done, or {_suggestion(heard.edits, quoted)}"
    return attrs.evolve(heard, question=asked if probability >= _WORTH_ASKING else "")


def _beside_another(words: str, others: Iterable[str]) -> bool:
    """Whether a distance to another thing is spoken of, which no direction of the hand is."""
    named = "|".join(map(re.escape, others)) or "(?!)"
    near = r"\b(?:away|apart|clear|further|farther|closer|nearer) (?:from|of|to) (?:the |that |my )?"
    return re.search(rf"{near}(?:{named})\b", words.lower()) is not None


def _measured(heard: Heard) -> bool:
    """Whether how far is said in figures."""
    return any(edit.amount is not None and edit.amount.exact for edit in heard.edits)


def _swung(heard: Heard, meant: Heard) -> bool:
    """Whether the arc that was read says more than the way of the gist: "it folds down"."""
    return any(edit.kind in OF_DOORS for edit in heard.edits) and all(edit.kind == "way" for edit in meant.edits)


def _asked(heard: Heard, edits: Iterable[Edit], quoted: str) -> Heard:
    return attrs.evolve(heard, question=_suggestion(edits, quoted))


def _suggestion(edits: Iterable[Edit], quoted: str) -> str:
    said = " ".join(dict.fromkeys(said for edit in edits if (said := said_plainly(edit, None, None))))
    return f"is this what you mean: {said} You said: {quoted}"


def _read(words: str, prompt: Prompt, scene: SceneGraph, habits: Habits, vocabulary: Vocabulary) -> Heard:
    """What the rules read."""
    action, objects = prompt.subtask
    known = [*(node.label for node in scene.nodes), *objects, action]
    recipe = habits.recipe(action, objects)
    kind = recipe.read_as if recipe is not None else ""
    joined = _AMOUNT_ALONE.sub(r", \g<amount>", words.strip())  # "to the left. Like a centimetre."
    sentences = tuple(one for one in re.split(r"(?<=[.!?])\s+|\n+", joined) if one.strip())
    others = _others(scene, objects)
    readings: tuple[Reading, ...] = ()
    for sentence in sentences:
        asked = any(one.edits for one in readings)
        readings += (read_sentence(sentence, vocabulary, known, kind, others, asked),)
    readings = tuple(_without_repeats(one, [other for other in readings if other is not one]) for one in readings)
    edits = _settled([edit for reading in readings for edit in reading.edits], kind)
    if kind in ("", "push"):  # nothing is gripped: what is to be firm or gentle is the pressing
        edits = [_pressing(edit) for edit in edits]
        readings = tuple(attrs.evolve(one, edits=tuple(_pressing(edit) for edit in one.edits)) for one in readings)
    if kind in ("open", "close") and recipe is not None:
        edits = _settled(_screwed(edits, scene, recipe, vocabulary), kind)
        readings = tuple(
            attrs.evolve(one, edits=tuple(_screwed(list(one.edits), scene, recipe, vocabulary))) for one in readings
        )
    done = recipe or habits.recipe("push", objects)  # what is done for a verb that is not known
    aside = recipe is not None and recipe.kind == "open" and _slides_aside(words, edits, scene, recipe.thing)
    effective = done is not None and _effective(edits, done, habits, prompt, scene)
    ambiguous = (
        _ASIDE.format(" ".join(words.split())[:200])
        if aside
        else which_is_meant(words, edits, recipe, vocabulary, _swings(scene, recipe))
    )
    question = ambiguous or what_is_missing(words, readings, edits, recipe, effective, vocabulary)
    return Heard(recipe, sentences, readings, tuple(edits), question)


def _without_repeats(reading: Reading, others: Iterable[Reading]) -> Reading:
    """Without doubts about what another sentence makes clear: words that were understood there ("upright! Keep it
    upright"), and where it was, if the other one says where it should be ("too close to the top. Take it lower")."""
    edits = [edit for one in others for edit in one.edits]
    said = {word for edit in edits for word in edit.said.split()}
    placed = any(edit.kind in _PLACED for edit in edits)
    unsure = [part for part in reading.unsure if not (set(part.split()) <= said or (placed and _WAS_THERE.match(part)))]
    return attrs.evolve(reading, unsure=tuple(unsure))


def _swings(scene: SceneGraph, recipe: Recipe | None) -> bool:
    """Whether a thing may have a door: it has one, or a handle, or stands fixed; yes, where it is not to be seen."""
    around = None if recipe is None else Surroundings.of(scene, recipe.thing, None)
    if around is None or around.thing is None:
        return True
    return around.door is not None or around.handle is not None or around.thing.kind != "object"


def _screwed(edits: list[Edit], scene: SceneGraph, recipe: Recipe, vocabulary: Vocabulary) -> list[Edit]:
    """Edits of what has no door: to turn that is to screw it."""
    if _swings(scene, recipe):
        return edits
    phrase = next(p for p in vocabulary.phrases if p.edit == "turn-thing" and not (p.value or p.lesson))
    way = "counterclockwise" if recipe.kind == "open" else "clockwise"
    return [
        attrs.evolve(edit, kind="turn-thing", value=way, phrase=phrase)
        if edit.kind == "angle" or (edit.kind == "arc" and re.search(r"\b(?:turn|twist|rotat|screw|spin)", edit.said))
        else edit
        for edit in edits
    ]


def _slides_out(scene: SceneGraph, recipe: Recipe | None) -> bool:
    """Whether a thing has its handle in the middle, as what slides out has."""
    around = None if recipe is None else Surroundings.of(scene, recipe.thing, None)
    return around is not None and around.handle is not None and not _handle_near_an_edge(around)


def _goes_beside(scene: SceneGraph, objects: Sequence[str]) -> bool:
    """Whether the place of a subtask is a thing that one puts something beside: loose, upright and not hollow."""
    place = find(scene, objects[1]) if len(objects) > 1 else None
    loose = place is not None and place.kind == "object" and space_of(scene, place) is None
    return loose and place is not None and place.size[2] > _FLAT


def _handle_near_an_edge(around: Surroundings) -> bool:
    panel = around.door or around.thing
    if panel is None or around.handle is None or around.handle is panel:
        return False
    off = [abs(a - b) for a, b in zip(around.handle.pose.position, panel.pose.position, strict=True)]
    return any(distance > 0.3 * size for distance, size in zip(off[1:], panel.size[1:], strict=True))


def _slides_aside(words: str, edits: list[Edit], scene: SceneGraph, thing: str) -> bool:
    """Whether "it slides" was said, and no more, of what has its handle near an edge, as doors have: those slide to a
    side, what has it in the middle comes out."""
    if not any(edit.kind == "straight" and re.search(r"\bslides?$", edit.said.strip()) for edit in edits):
        return False
    if re.search(r"\b(?:out|straight|towards?|line|in and|pull\w*)\b", words.lower()):
        return False
    return _handle_near_an_edge(Surroundings.of(scene, thing, None))


def _pressing(edit: Edit) -> Edit:
    grips = re.search(r"\b(?:grip|hold|squeez|grab|grasp|finger)", edit.said)
    return attrs.evolve(edit, verb="press") if edit.kind == "force" and not (edit.verb or grips) else edit


def _others(scene: SceneGraph, objects: Iterable[str]) -> list[str]:
    """Words for what is to be seen and neither is nor belongs to one of the objects."""
    names = [name.lower() for name in objects]
    names += [relation.subject.lower() for relation in scene.relations if relation.predicate == "held"]
    own = {word for name in names for word in name.split()}
    for node in scene.nodes:
        family = {node.label.lower(), (node.part_of or "").lower()}
        if family & set(names) or any(name and set(name.split()) < set(node.label.lower().split()) for name in names):
            own |= {word for label in family for word in label.split()}
    words = {word for node in scene.nodes for word in node.label.lower().split()}
    return sorted(words - own)


def note(prompt: Prompt, habits: Habits, vocabulary: Vocabulary, imagination: Imagination) -> NotesAnswer:
    """Corrections and general statements, or what would have to be asked. Raises ``LanguageModelError`` naming what the
    prompt lacks."""
    said, answered = _settled_words(prompt.quoted("what the person said"))
    answers = [_note(words, answered, prompt, habits, vocabulary, imagination) for words in said]
    return next((answer for answer in answers if not answer.unclear), answers[0])


def _note(
    words: str, answered: bool, prompt: Prompt, habits: Habits, vocabulary: Vocabulary, imagination: Imagination
) -> NotesAnswer:
    """Of one way to take what the person said. ``answered``: whether it answers a question."""
    scene = prompt.scene()
    elsewhere = _elsewhere(words, prompt, scene, habits, vocabulary)
    if elsewhere is not None:
        return elsewhere
    heard = hear(words, prompt, scene, habits, vocabulary)
    if _OF_PLANS in prompt.section("answer") and not asks_for_nothing(words, prompt.subtask[1], heard.kind):
        heard = attrs.evolve(heard, about_plans=True, also_moves=False)
    plans = _plans(words, heard, prompt)
    if plans and not heard.also_moves:
        return _answer(heard, plan=plans)
    if heard.question and answered and (wished := _wished(heard, vocabulary)):
        return _answer(heard, wished)
    if heard.question:
        # The words themselves are kept by whoever asked.
        return _answer(heard, unclear=heard.question)
    attempt = _attempt(heard, prompt, scene, imagination)
    if lost := _lost(heard, attempt, scene, habits.rough, vocabulary):
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


def _plans(words: str, heard: Heard, prompt: Prompt) -> list[str]:
    """Notes for whoever plans, in the person's words, where the prompt asks for such notes."""
    if not (heard.about_plans and '"plan"' in prompt.section("answer")):
        return []
    sentences = [one for one in re.split(r"(?<=[.!?])\s+|\n+", words.strip()) if one.strip()]
    said = [one for one in sentences if len(one.split()) > 3 or (len(one.split()) > 1 and not one.endswith("?"))]
    notes = [sentence_plainly(sentence) for sentence in said]
    objects = prompt.subtask[1]
    named = f"The {objects[0].lower()}" if objects else "It"
    goes = r" (?=(?:goes|belongs|should|has to|needs|must|lives)\b)"
    # "You forgot the lid! That goes on the jar" is about the lid.
    notes = [re.sub(rf"^(?:It|That|This){goes}", f"{named} ", notes[0]), *notes[1:]] if notes else []
    return [note if named[4:] in note.lower() else re.sub(f"^It{goes}", f"{named} ", note) for note in notes]


_ASKED = re.compile(r"\n\(asked back: (?P<question>.*?)\)\n(?P<answer>[^\n]*(?:\n(?!\(asked back).*)*)\Z", re.S)
_MEANT = re.compile(r"is this what you mean: (?P<understood>.*?) (?:It is not clear|You said:)")
_YES = re.compile(
    r"(?:yes|yep|yeah|y|ok|okay|sure|right|correct|exactly|that's (?:it|right)|please|do|i do|it is|that too|[, .!])+",
    re.I,
)
_YES_AND = re.compile(
    r"(?:(?:yes|yep|yeah|sure|exactly|right|correct|ok|okay|that's (?:it|right))[,.!]+\s*|yes )+", re.I
)
_BUT = re.compile(r"(?:but|only|except|though|however|no|not|don't|unless|if)\b", re.I)  # a yes with a reservation
_YES_OR_NO = re.compile(
    r"(?:yes|yep|yeah|no|nope|nah|sort of|not really|none of (?:that|those|them|these))[,.!;]+\s*(?:but )?", re.I
)
# What an answer is about, said before it: "Where you let go. Put it down further in."
_ASPECT = re.compile(
    r"(?:i mean )?(?:it's |just )?(?:where|which way|how (?:far|hard|fast|much)|the way|when)\b(?: [\w']+){0,5}[.!] "
    r"(?=\w)|i mean ",
    re.I,
)
_NO_ANSWER = re.compile(
    r"\b(?:never ?mind|forget (?:it|that)|(?:don't|do not) (?:know|care)|no idea|not sure|whatever|nothing|"
    r"(?:don't|do not) understand|(?:already|just) (?:told|said))\b|\?\s*$"
)


def _settled_words(words: str) -> tuple[list[str], bool]:
    """What somebody said in the end, the first that is understood counts, and whether it answers a question. An answer
    stands for what it was asked about, and "yes" for what the question took it to mean, whatever else is said with
    it."""
    asked = _ASKED.search(words)
    if asked is None:
        return [words], False
    answer = asked.group("answer").strip()
    meant = _MEANT.search(asked.group("question"))
    if meant is None:
        return [_without_echo(answer)], True
    understood = meant.group("understood")
    if _YES.fullmatch(answer):
        return [understood], True
    if (yes := _YES_AND.match(answer)) is None:
        return [_without_echo(answer)], True
    rest = answer[yes.end() :]
    both = f"{understood} {rest[:1].upper()}{rest[1:]}"
    return [both] if _BUT.match(rest) else [both, understood], True


def _without_echo(answer: str) -> str:
    """Without "yes" or "no", and without what the question offered."""
    for echo in (_YES_OR_NO, _ASPECT):
        if (found := echo.match(answer)) is not None:
            answer = answer[found.end() :] or answer
    return answer[:1].upper() + answer[1:]


def _wished(heard: Heard, vocabulary: Vocabulary) -> list[str]:
    """The sentences of an answer of which nothing was read, where they are a request all the same: who was asked
    already, and asks for it again, is not asked a second time. Nothing follows from them here."""
    words = " ".join(heard.sentences)
    if any(reading.edits for reading in heard.readings) or _NO_ANSWER.search(words.lower()):
        return []
    said = [one for one in heard.sentences if len(one.split()) > 3 and not vocabulary.praises(one)]
    wishes = any(is_request(clause) and vocabulary.lexicon.asks(clause) for one in said for clause in clauses(one))
    return [sentence_plainly(one) for one in said] if wishes else []


def _settled(edits: list[Edit], kind: str) -> list[Edit]:
    """Without what another edit of the same remark says better: "further, to 90 degrees" is 90 degrees."""
    reversal = next((edit for edit in edits if edit.kind == "reverse"), None)
    edits = [edit for edit in edits if edit.kind != "reverse" or edit is reversal]  # said twice, meant once
    called = {edit.kind for edit in edits if edit.kind in ("force", "speed") and not _exclaimed(edit)}
    edits = [  # "easy! Hold it lightly"
        edit for edit in edits if not (_exclaimed(edit) and called and edit.kind not in called)
    ]
    kinds = {edit.kind for edit in edits}
    if "all-the-way" in kinds:
        edits = [edit for edit in edits if edit.kind != "farther" or edit.amount or edit.degrees]
    if kind == "place" and kinds == {"release"}:
        return []  # what it does anyway: where or when is not said
    if any(edit.kind == "extent" or (edit.kind == "angle" and edit.degrees is not None) for edit in edits):
        edits = [edit for edit in edits if edit.kind not in LENGTHS]
    if any(edit.kind in ("pivot", "turn-thing") and edit.value and not edit.negated for edit in edits):
        # the edge, or the way, says which way round
        edits = [edit for edit in edits if edit.kind != "reverse"]
    measured = {(edit.kind, edit.value) for edit in edits if edit.amount is not None and edit.amount.exact}
    edits = [
        edit
        for edit in edits
        if (edit.kind, edit.value) not in measured or (edit.amount is not None and edit.amount.exact)
    ]
    if kind in ("open", "close", "pull") and "way" in kinds:  # "pull it out towards you" is one way
        edits = [edit for edit in edits if edit.kind != "offset" or edit.value not in ("towards", "away")]
    forced = {edit.value in GENTLE for edit in edits if edit.kind == "force" and edit.verb}
    edits = [  # "you press so hard: lighter!" is about pressing, twice
        edit for edit in edits if edit.kind != "force" or edit.verb or (edit.value in GENTLE) not in forced
    ]
    if kind == "turn" and len(kinds) > 1:  # what is turned in place is led nowhere
        edits = [edit for edit in edits if edit.kind not in OF_DOORS]
    if any(edit.kind == "centre" and re.search(r"\bwait\b", edit.said) for edit in edits):
        # "too early! Wait until you are over it": where it is let go
        edits = [edit for edit in edits if edit.kind != "set-down" or not re.search(r"too (?:early|soon)", edit.said)]
    if "travel" in kinds:  # "up, across, then down"
        edits = [edit for edit in edits if edit.kind != "offset" or not ONLY_WAY.fullmatch(edit.said.strip())]
    if "set-down" in kinds:  # "reach right down and set it on the bottom"
        edits = [edit for edit in edits if edit.kind != "offset" or edit.value != "down" or edit.amount is not None]
    if "shake" in kinds:  # to shake harder is not to grip harder
        edits = [edit for edit in edits if edit.kind != "force" or re.search(r"grip|hold|squeez", edit.said)]
    if len(kinds) > 1:  # "push harder at the end"
        edits = [edit for edit in edits if edit.kind != "hold-at" or edit.said.strip() != "at the end"]
    if "press-turn" in kinds:
        edits = [edit for edit in edits if edit.kind != "first-in"]
    if kind == "pick" and any(edit.kind == "hold-at" and edit.value != "handle" for edit in edits):
        # "higher up, near the rim": the part says where
        edits = [edit for edit in edits if edit.kind != "offset" or edit.amount or edit.value not in ("up", "down")]
    if "hold-for" in kinds and kind == "push":  # "hold it at the bottom for a second"
        edits = [edit for edit in edits if edit.kind != "hold-at"]
    if any(edit.kind == "hold-for" and edit.seconds is not None for edit in edits):
        edits = [edit for edit in edits if edit.kind != "hold-for" or edit.seconds is not None]
    if "fingers" in kinds:  # how they lie in the end; a turn said beside it is the way there
        edits = [edit for edit in edits if edit.kind != "turn-hand"]
    return edits


def _exclaimed(edit: Edit) -> bool:
    """Whether an edit was read from a mere call for care."""
    return re.fullmatch(r"(?:go )?easy(?: now| there)?|gently|careful", edit.said.strip()) is not None


def _effective(edits: list[Edit], recipe: Recipe, habits: Habits, prompt: Prompt, scene: SceneGraph) -> bool:
    """Whether the hand will do anything differently, or says how it does it already."""
    changed = recipe
    for edit in edits:
        changed = apply(changed, edit, habits.rough)
    if any(edit.kind in _STATES and not _idle(edit) for edit in edits):
        return True
    subtask = prompt.section("subtask")
    return render(changed, subtask, scene, prompt.task, []) != render(recipe, subtask, scene, prompt.task, [])


def _idle(edit: Edit) -> bool:
    """Whether nothing follows from an edit: "not from the left" does not say from where."""
    return edit.negated and edit.kind in ("hold-at", "release", "hold-on", "fingers", "centre", "approach")


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
