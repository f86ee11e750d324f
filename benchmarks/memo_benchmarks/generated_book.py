"""Large books for measurements: keys, texts and popularity as in a laboratory's book, drawn from a seed.

People teach some subtasks far more often than others: the number of entries under a key is log-normal (σ = 1), so that
of 5 000 keys the largest has some forty times the median. Texts name parts, ways and amounts; hardly any occurs twice.
"""

from __future__ import annotations

import itertools
import random
import re
import zlib
from collections.abc import Callable, Iterator, Sequence

import attrs
import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.interfaces.embedder import Embedder
from memo_core.skillbook import exchange
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.writing.bulk_adding import Lesson

_THINGS = """
microwave; oven; fridge; freezer; dishwasher; washing machine; cupboard; cabinet; drawer; wardrobe; safe; locker;
toolbox; bread bin; jewellery box; lunch box; bottle; jar; can; carton; thermos; teapot; kettle; pan; pot; bowl;
cup; mug; glass; plate; tray; basket; bucket; bin; sponge; towel; cloth; brush; broom; knife; fork; spoon; ladle;
spatula; whisk; grater; peeler; scissors; stapler; pen; marker; notebook; book; folder; envelope; parcel; box;
crate; red cube; green cube; blue cube; wooden block; ball; toy car; doll; puzzle piece; lamp; fan; heater; radio;
toaster; blender; mixer; coffee machine; rice cooker; scale; timer; remote control; phone; charger; plug; socket;
switch; button; lever; knob; dial; faucet; valve; hose; pump; wrench; screwdriver; hammer; drill; bolt; nut;
screw; pipe; cable; battery; apple; orange; banana; tomato; potato; onion; carrot; egg; cheese; bread; sandwich;
cake; pizza; cereal; rice; pasta; soup; salad; pepper mill; salt shaker
"""
_PLACES = """
table; shelf; counter; sink; stove; tray; cupboard; drawer; fridge; oven; microwave; bin; basket; box; rack;
cabinet; windowsill; toolbox; plate; bowl
"""
_VERBS = (
    "open;close;pick;push;pull;wipe;rotate;lift;lower;turn on;turn off;press;shake;hold;release;unscrew;tilt;slide;fold"
)
_PLACING = "place;insert;stack;pour;hang;remove"
_PARTS = """
handle; rim; edge; left side; right side; top; bottom; front; back; corner; middle; hinge; lid; base; neck;
upper half; lower half; flap; label; seam; bar; grip; spout; knob
"""
_DOING = "Hold;Grip;Touch;Approach;Grasp;Take;Press against;Reach for;Follow;Support;Keep clear of;Let go of"
_WAYS = """
from above; from the side; from the front; from below; more slowly; with less force; with a firmer grip;
along an arc; straight towards you; at a slant; with the fingers half open; with the hand level;
with the wrist turned; in one smooth motion; in small steps
"""
_AFTER = """
and stop when it gives way; and wait until it is still; then back off a little; before you move the arm;
and keep the hand level; so that it cannot slip; or it tips over; and look again afterwards; then turn the wrist;
and do not let go early; until you feel it touch; and leave room for the fingers
"""
_AMOUNTS = """
a few millimetres; about a centimetre; two centimetres; a hand's width; a quarter turn; half a turn; ten degrees;
30 degrees
"""
_EVERYWHERE = "Whenever something;As a rule, if anything;In this kitchen, when a thing;With all objects: if one"
_STATES = """
is hot; is full; stands near the edge; is made of glass; slips; is heavy; is out of reach; blocks the way; sticks;
wobbles; rolls away; is upside down; is wet; is soft; is behind another
"""
_WHO = [f"person {number}" for number in range(40)]
_SIGMA = 1.0
_A_LESSON = 4  # corrections of one piece of feedback, at most


def _of(text: str) -> list[str]:
    return [" ".join(item.split()) for item in text.split(";")]


@attrs.frozen
class BookSize:
    """How large a generated book is."""

    entries: int = attrs.field()
    keys: int = attrs.field()
    general: float = 0.005  # share of the entries that are general statements
    templates: float = 0.6  # share of the keys that have a template
    seed: int = 0

    @entries.validator
    def _enough(self, attribute: attrs.Attribute[int], value: int) -> None:
        if value < 3 * self.keys:
            raise InvalidArgument("entries", f"{value} is not right for {self.keys} keys", f"{3 * self.keys} or more")

    @keys.validator
    def _possible(self, attribute: attrs.Attribute[int], value: int) -> None:
        if not 2 <= value <= len(_all_keys()):
            raise InvalidArgument("keys", f"{value} is not right", f"2 to {len(_all_keys())}")


def _all_keys() -> list[Key]:
    things, places = _of(_THINGS), _of(_PLACES)
    single = [Key(verb, (thing,)) for verb, thing in itertools.product(_of(_VERBS), things)]
    placed = [
        Key(verb, (thing, place))
        for verb, thing, place in itertools.product(_of(_PLACING), things, places)
        if thing != place
    ]
    return single + placed


def keys_of(size: BookSize) -> list[Key]:
    """The keys of a book, in no order."""
    return random.Random(size.seed).sample(_all_keys(), size.keys)


def lessons_of(size: BookSize) -> Iterator[Lesson]:
    """What fills a book of a size, in the order in which it was taught. Exactly ``size.entries`` entries."""
    keys, draw = keys_of(size), random.Random(f"{size.seed} lessons")
    everywhere = round(size.entries * size.general)
    templates = round(len(keys) * size.templates)
    counts = _counts(size.entries - everywhere - templates, len(keys), draw)
    turns = [n for n, count in enumerate(counts) for _ in range(-(-count // _A_LESSON))]
    draw.shuffle(turns)
    left, statements = list(counts), everywhere
    for number, turn in enumerate(turns):
        key, said = keys[turn], min(_A_LESSON, left[turn])
        left[turn] -= said
        due = statements - round(everywhere * (1 - (number + 1) / len(turns)))
        statements -= due
        yield Lesson(
            words="no, not like that",
            who=draw.choice(_WHO),
            key=key,
            corrections=tuple(_correction(key, draw) for _ in range(said)),
            general=tuple(_statement(draw) for _ in range(due)),
            template=_template(key, draw) if left[turn] == 0 and turn < templates else "",
            scene="laboratory",
        )


def _counts(total: int, keys: int, draw: random.Random) -> list[int]:
    """Log-normal shares of ``total``, one or more each."""
    weights = [draw.lognormvariate(0.0, _SIGMA) for _ in range(keys)]
    spare = total - keys
    counts = [1 + int(spare * weight / sum(weights)) for weight in weights]
    for n in range(total - sum(counts)):
        counts[n % keys] += 1
    return counts


def _correction(key: Key, draw: random.Random) -> str:
    doing, part, way, after, amount = (draw.choice(items) for items in _PIECES)
    return f"{doing} the {part} of the {draw.choice(key.objects)} {way}, {amount} further, {after}."


def _statement(draw: random.Random) -> str:
    doing, part, way, after, amount = (draw.choice(items) for items in _PIECES)
    opening, state = draw.choice(_of(_EVERYWHERE)), draw.choice(_of(_STATES))
    return f"{opening} {state}, {doing.lower()} its {part} {way}, {amount} further, {after}."


def _template(key: Key, draw: random.Random) -> str:
    name = "_".join([*key.action.split(), *key.objects[0].split()])
    return (
        f"def {name}(name, distance=0.1):\n"
        f'    """{_correction(key, draw)}"""\n'
        "    move_to(get_position(name))\n    close_gripper()\n    move_straight([-distance, 0.0, 0.0])\n"
    )


_PIECES = (_of(_DOING), _of(_PARTS), _of(_WAYS), _of(_AFTER), _of(_AMOUNTS))


def fill(book: Skillbook, size: BookSize, progress: Callable[[float], None] = lambda share: None) -> int:
    """Store a book of a size in transactions of a thousand lessons. Returns the number of entries."""
    stored = 0
    for batch in _batches(lessons_of(size), 1000):
        stored += exchange.add_many(book, batch)
        progress(stored / size.entries)
    return stored


def _batches(lessons: Iterator[Lesson], size: int) -> Iterator[list[Lesson]]:
    while batch := list(itertools.islice(lessons, size)):
        yield batch


DIMENSION = 384


class WordVectors(Embedder):
    """A text is the sum of fixed random vectors of its words, made a unit vector."""

    name = f"random-words-{DIMENSION}"
    dimension = DIMENSION

    def __init__(self) -> None:
        self._words: dict[str, np.ndarray] = {}

    def open(self) -> None: ...

    def close(self) -> None: ...

    def embed(self, texts: Sequence[str]) -> np.ndarray:
        made = np.stack(
            [sum((self._word(w) for w in re.findall(r"\w+", text.lower())), self._word("")) for text in texts]
        )
        return (made / np.linalg.norm(made, axis=1, keepdims=True)).astype(np.float32)

    def _word(self, word: str) -> np.ndarray:
        found = self._words.get(word)
        if found is None:
            found = np.random.default_rng(zlib.crc32(word.encode())).standard_normal(DIMENSION).astype(np.float32)
            self._words[word] = found
        return found
