"""Keys: the action and the objects, roles kept, under which an entry is stored. ``PLACE(red cube, cabinet)`` moves the
red cube to the cabinet: the last of several objects is the destination, the others are moved."""

from __future__ import annotations

import re
import unicodedata

import attrs

from memo_core.errors import MemoError

_WORDS_ARTICLES = "a an the my your his her its our their this that these those some"
_WORDS_PREPOSITIONS = "in into inside on onto to at from over under near by with using of"
_ARTICLES = frozenset(_WORDS_ARTICLES.split())
_PREPOSITIONS = frozenset(_WORDS_PREPOSITIONS.split())
_MAX_OBJECTS = 6
_MAX_LENGTH = 80
_MAX_TEXT = 2_000  # characters of a key in any spelling; Unicode's normalisation may take the square of their number


@attrs.define(auto_exc=True, eq=False)
class NotAKey(MemoError):
    """A text that does not name an action with its objects."""

    text: str
    problem: str

    exit_code = 2

    def __str__(self) -> str:
        shown = self.text if len(self.text) <= 100 else self.text[:97] + "..."
        return f"{shown!r} is no subtask: {self.problem}; expected ACTION(object) or ACTION(object, place)"


@attrs.frozen(order=True, cache_hash=True)
class Key:
    """An action and its objects in normal spelling: lower case, single spaces, no articles.

    ``str(key)`` is the subtask as it is planned and shown, e.g. ``TURN_ON(lamp)``; ``Key.parse`` reads it back.
    """

    action: str  # "turn on"
    objects: tuple[str, ...]  # ("red cube", "cabinet"): what is moved, then where to

    @classmethod
    def parse(cls, text: str) -> Key:
        """Read a subtask.

        Args:
            text: such as ``OPEN(microwave)``, ``place(the cube, cabinet)`` or ``Pick up (cup)``.

        Returns:
            The key in normal spelling.

        Raises:
            NotAKey: if the text is not a subtask.
        """
        stripped = text.strip(" `*.;\t\r\n")
        opening = stripped.find("(")
        if opening < 0 or not stripped.endswith(")"):
            raise NotAKey(text, "it has no objects in brackets")
        inner = stripped[opening + 1 : -1]
        if "(" in inner or ")" in inner:
            raise NotAKey(text, "brackets within brackets")
        return cls.make(stripped[:opening], *inner.split(","), source=text)

    @classmethod
    def make(cls, action: str, *objects: str, source: str | None = None) -> Key:
        """A key from an action and its objects in any spelling.

        Args:
            action: one to four words.
            objects: at least one; the last of several is the destination.
            source: text to show in the error; None: one made from action and objects.

        Returns:
            The key in normal spelling.

        Raises:
            NotAKey: if the action or an object is missing, malformed or too long, or there are too many objects.
        """
        text = source if source is not None else f"{action}({', '.join(objects)})"
        if len(text) > _MAX_TEXT:
            raise NotAKey(text, f"it is longer than {_MAX_TEXT} characters")
        verb = _words(action)
        if not verb:
            raise NotAKey(text, "it names no action")
        if not re.fullmatch(r"[^\W\d_][^\W_]*( [^\W_]+){0,3}", verb):
            raise NotAKey(text, f"{verb!r} is no action of one to four words")
        names = [_object(name, first=i == 0) for i, name in enumerate(objects)]
        if not names or not all(names):
            raise NotAKey(text, "an object is missing")
        if len(names) > _MAX_OBJECTS or any(len(name) > _MAX_LENGTH for name in [verb, *names]):
            raise NotAKey(text, f"more than {_MAX_OBJECTS} objects or a name longer than {_MAX_LENGTH} characters")
        return cls(verb, tuple(names))

    @property
    def moved(self) -> tuple[str, ...]:
        """The objects that are acted on or moved: all but the last of several."""
        return self.objects if len(self.objects) == 1 else self.objects[:-1]

    @property
    def destination(self) -> str | None:
        """The destination: the last of several objects."""
        return self.objects[-1] if len(self.objects) > 1 else None

    def __str__(self) -> str:
        return f"{self.action.upper().replace(' ', '_')}({', '.join(self.objects)})"


def as_text(key: Key) -> str:
    """The words of a key, as entries' texts are compared with them."""
    return " ".join((key.action, *key.objects))


def _words(text: str) -> str:
    plain = unicodedata.normalize("NFKC", text).casefold()
    plain = re.sub(r"[_/\s]+", " ", plain)
    plain = re.sub(r"[^\w\s'-]", "", plain)
    return " ".join(word.strip("'-") for word in plain.split() if word.strip("'-"))


def _object(text: str, first: bool) -> str:
    words = _words(text).split()
    passed_over = _ARTICLES if first else _ARTICLES | _PREPOSITIONS
    begins = next((place for place, word in enumerate(words) if word not in passed_over), len(words) - 1)
    return " ".join(words[begins:])
