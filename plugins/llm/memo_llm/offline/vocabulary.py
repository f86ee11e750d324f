"""The closed vocabulary: words, phrases and what each means. The data is ``vocabulary.yaml`` or a file like it."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path
from typing import Any

import attrs
import yaml

from memo_core.errors import InvalidArgument
from memo_llm.offline.composition import Lexicon
from memo_llm.offline.degrees import Degrees, Scale, comparatives, plain_forms
from memo_llm.offline.spelling import number

_UNITS = {"cm": 0.01, "mm": 0.001, "inch": 0.0254, "m": 1.0}


_LACKING = re.compile(
    r"\b(?:still|only|just|too|barely|hardly|almost|nearly|half|missed|lost|forgot|nothing|never|should have|ajar)\b"
)


@attrs.frozen
class Phrase:
    """A group of phrasings that mean one edit. ``opposite`` is the edit that "don't" makes of it, ``general`` a
    statement that holds for other objects too, made when one of its phrasings explains why (``lesson``: that it moves
    so). ``whole``:
    read before a sentence is taken apart. ``value`` is what is meant where no words name it, ``values`` a table that is
    looked into first, ``flip`` says that a fault is named and its opposite meant. ``only``: the kinds of subtask that
    it is about; none: all. ``told``: also where somebody only tells what happened ("your hand
    wasn't on the handle")."""

    edit: str
    patterns: tuple[re.Pattern[str], ...]
    say: str
    general: str = ""
    general_say: str = ""
    opposite: str = ""
    whole: bool = False
    value: str = ""
    values: dict[str, str] = attrs.field(factory=dict, hash=False)
    flip: bool = False
    only: tuple[str, ...] = ()
    told: bool = False
    lesson: bool = False


@attrs.frozen
class Amount:
    """What "3 cm", "a bit" or "much" is: metres, and the factor the same word means for a path's length. ``words`` are
    how a note says it; ``exact`` where a number was said."""

    metres: float
    factor: float
    words: str
    exact: bool


@attrs.frozen(eq=False)
class Vocabulary:
    phrases: tuple[Phrase, ...]
    values: dict[str, str]  # spelling -> value
    amounts: dict[str, tuple[float, float]]
    angles: dict[str, float]  # degrees
    numbers: dict[str, float]
    negations: re.Pattern[str]
    complaints: re.Pattern[str]
    praise: tuple[re.Pattern[str], ...]
    opposites: dict[str, str]
    scopes: tuple[re.Pattern[str], ...]
    fillers: frozenset[str]
    small_talk: frozenset[str]
    degrees: Degrees
    spelled: frozenset[str]  # every word that stands in the vocabulary
    lexicon: Lexicon

    @classmethod
    def load(cls, path: str = "") -> Vocabulary:
        """From a YAML file, or the one that comes with MEMO. Raises ``InvalidArgument`` naming the key."""
        data = read_yaml(path, "vocabulary.yaml", "llm.vocabulary")
        missing = {
            "words",
            "values",
            "amounts",
            "angles",
            "numbers",
            "negations",
            "complaints",
            "praise",
            "opposites",
            "positions",
            "approaches",
            "scopes",
            "scales",
            "fillers",
            "small_talk",
            "phrases",
        } - set(data)
        if missing:
            raise InvalidArgument("llm.vocabulary", f"no key {sorted(missing)[0]!r}", "the keys of vocabulary.yaml")
        composition = read_yaml("", "composition.yaml", "llm.vocabulary")
        numbers = {str(k): float(v) for k, v in data["numbers"].items()}
        amounts = {str(k): (float(v[0]), float(v[1])) for k, v in data["amounts"].items()}
        angles = {str(k): float(v) for k, v in data["angles"].items()}
        spelled = "|".join(sorted(map(re.escape, numbers), key=len, reverse=True))
        number = r"\d+(?:\.\d+)?"  # see memo_llm.offline.spelling
        unit = r"(?:cm|mm|inch|m)"
        rough = "|".join(sorted(map(re.escape, amounts), key=len, reverse=True))
        named = "|".join(sorted(map(re.escape, angles), key=len, reverse=True))
        groups = {
            "amount": rf"(?:(?:by |about |around |some )*(?:{number} ?{unit}\b|(?:{rough})\b))",
            "angle": rf"(?:(?:by |about |around |some )*(?:{number} degrees|(?:{named})\b))",
            "times": rf"(?:once|twice|thrice|(?:{spelled}|\d+|a few|a couple of|several) (?:more )?times)",
        }
        for name, pattern in data["words"].items():
            groups[name] = _fill(f"(?:{pattern})", groups, f"words.{name}")
        phrases = []
        for i, item in enumerate(data["phrases"]):
            where = f"phrases[{i}]"
            if not isinstance(item, dict) or not {"edit", "match", "say"} <= set(item):
                raise InvalidArgument(f"llm.vocabulary: {where}", "edit, match and say are needed")
            patterns = tuple(_compile(_fill(pattern, groups, where), where) for pattern in item["match"])
            phrases.append(
                Phrase(
                    item["edit"],
                    patterns,
                    item["say"],
                    item.get("general", ""),
                    item.get("general_say", ""),
                    item.get("opposite", ""),
                    whole=bool(item.get("whole")),
                    value=item.get("value", ""),
                    values=_table(data, item.get("lookup", ""), where),
                    flip=bool(item.get("flip")),
                    only=tuple(item.get("only", ())),
                    told=bool(item.get("told")),
                    lesson=bool(item.get("lesson")),
                )
            )
        values = {spelling: value for value, spellings in data["values"].items() for spelling in spellings}
        small_talk = frozenset(data["small_talk"].split())
        fillers = frozenset(data["fillers"].split()) | small_talk
        denials = (_any_of(data["negations"]), _any_of(data["complaints"]))
        praise = tuple(_compile(pattern, "praise") for pattern in data["praise"])
        opposites = {**data["opposites"], **{value: key for key, value in data["opposites"].items()}}
        scopes = tuple(_compile(pattern, "scopes") for pattern in data["scopes"])
        degrees = Degrees.of(
            [_scale(item, i) for i, item in enumerate(data["scales"])], f"(?:{groups['amount']}|{groups['angle']})"
        )
        text = " ".join([*_strings([data, composition]), *(form for scale in data["scales"] for form in _forms(scale))])
        in_it = frozenset(word for word in re.findall(r"[a-z']{3,}", text))
        return cls(
            tuple(phrases),
            values,
            amounts,
            angles,
            numbers,
            *denials,
            praise,
            opposites,
            scopes,
            fillers,
            small_talk,
            degrees,
            in_it,
            Lexicon.of(composition, groups),
        )

    def scope(self, text: str) -> tuple[str, str]:
        """What a statement is about: (noun in the singular, beginning of a verb), each "" where it does not say."""
        for pattern in self.scopes:
            match = pattern.search(text.lower().strip())
            if match:
                found = match.groupdict()
                noun = found.get("noun") or ""
                return noun.removesuffix("s") if len(noun) > 3 else noun, found.get("verb") or ""
        return "", ""

    def complaint(self, clause: str) -> bool:
        """Whether a clause says that something is not as it should be."""
        denied = self.complaints.search(clause) or self.negations.search(clause)
        return denied is not None or _LACKING.search(clause) is not None

    def praises(self, text: str) -> bool:
        """Whether words approve of what was done."""
        plain = " ".join(re.sub(r"[^\w' ]", " ", text.lower().replace("’", "'")).split())
        plain = re.sub(r"\bnot (?:even )?(?=a (?:crack|scratch|drop|chip|crumb|fault|hitch)\b)", "without ", plain)
        if any(
            word in plain.split() for word in ("but", "not", "wrong", "except", "however", "didn't", "doesn't")
        ) and not re.search(r"not (?:so |too |at all |half )?bad|no complaints|couldn't", plain):
            return False
        return any(pattern.search(plain) for pattern in self.praise)

    def amount(self, text: str) -> Amount | None:
        """The first amount of length in a text."""
        text = re.sub(
            r"far enough|all the way|(?:other|wrong|opposite|another|same) way|too far"
            r"|\b(?:way|much|far)\b(?! (?:further|farther|more|less|\w+er)\b)",
            "",
            text,
        )
        match = re.search(r"(\d+(?:\.\d+)?) (cm|mm|inch|m)\b", text)
        if match:
            return Amount(float(match.group(1)) * _UNITS[match.group(2)], 1.0, match.group(0), True)
        for words in sorted(self.amounts, key=len, reverse=True):
            if re.search(rf"\b{re.escape(words)}\b", text):
                said = f"a {words}" if words in ("bit", "tad", "smidge", "tiny bit", "tiny tad") else words
                return Amount(*self.amounts[words], said, False)
        return None

    def angle(self, text: str) -> float | None:
        """The first angle in a text, in degrees."""
        match = re.search(r"(\d+(?:\.\d+)?) degrees", text)
        if match:
            return float(match.group(1))
        for words in sorted(self.angles, key=len, reverse=True):
            if re.search(rf"\b{re.escape(words)}\b", text):
                return self.angles[words]
        return None

    def count(self, text: str) -> int:
        """How often: "twice" 2, "three times" 3, "again" 2."""
        if "thrice" in text:
            return 3
        match = re.search(r"(\w+) (?:more )?(?:good |hard |quick |short |little )*(?:times|shakes)", text)
        value = number(match.group(1)) if match else None
        return max(1, int(value)) if value is not None else 2

    def seconds(self, text: str) -> float | None:
        """The first duration in a text, in seconds."""
        match = re.search(r"(\d+(?:\.\d+)?) seconds", text)
        if match:
            return float(match.group(1))
        match = re.search(r"count to (\w+)", text)
        return number(match.group(1)) if match else None


def read_yaml(path: str, name: str, setting: str) -> dict[str, Any]:
    """A mapping from the file at ``path``, or from the file ``name`` that comes with this package."""
    try:
        text = Path(path).read_text("utf-8") if path else resources.files(__package__).joinpath(name).read_text("utf-8")
    except OSError as error:
        raise InvalidArgument(setting, f"{path!r} cannot be read ({error.strerror})", "a YAML file") from None
    try:
        data = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise InvalidArgument(setting, f"{path or name}: {' '.join(str(error).split())}", "YAML") from None
    if not isinstance(data, dict):
        raise InvalidArgument(setting, f"{path or name} holds no mapping", f"the keys of {name}")
    return data


def _scale(item: dict[str, Any], i: int) -> Scale:
    where = f"llm.vocabulary: scales[{i}]"
    unknown = set(item) - {field.name for field in attrs.fields(Scale)}
    if unknown or not {"more", "less", "high", "low"} <= set(item):
        raise InvalidArgument(where, "more, less, high and low are needed; nouns and only may follow")
    more, less = ((edit, value) for edit, _, value in (str(item[end]).partition("=") for end in ("more", "less")))
    return Scale(more, less, *(tuple(item.get(key, ())) for key in ("high", "low", "nouns", "only")))


def _forms(scale: dict[str, Any]) -> list[str]:
    return [form for word in (*scale["high"], *scale["low"]) for form in (*plain_forms(word), *comparatives(word))]


def _strings(data: Any) -> list[str]:
    if isinstance(data, dict):
        return [text for pair in data.items() for part in pair for text in _strings(part)]
    if isinstance(data, list):
        return [text for part in data for text in _strings(part)]
    return [data] if isinstance(data, str) else []


def _table(data: dict[str, Any], name: str, where: str) -> dict[str, str]:
    """Spelling -> value of one of the vocabulary's tables."""
    if not name:
        return {}
    if not isinstance(data.get(name), dict):
        raise InvalidArgument(f"llm.vocabulary: {where}", f"no table named {name!r}", "positions, approaches")
    return {spelling: value for value, spellings in data[name].items() for spelling in spellings}


def _fill(pattern: str, groups: dict[str, str], where: str) -> str:
    def group(match: re.Match[str]) -> str:
        if match.group(1) not in groups:
            raise InvalidArgument(f"llm.vocabulary: {where}", f"no words named {match.group(1)!r}", ", ".join(groups))
        return groups[match.group(1)]

    return re.sub(r"\{([a-z_]+)\}", group, pattern)


def _any_of(words: list[str]) -> re.Pattern[str]:
    return re.compile(r"\b(?:" + "|".join(sorted(map(re.escape, words), key=len, reverse=True)) + r")(?!\w)")


def _compile(pattern: str, where: str) -> re.Pattern[str]:
    try:
        return re.compile(rf"(?<![\w'-])(?:{pattern})(?![\w'-])")
    except re.error as error:
        raise InvalidArgument(f"llm.vocabulary: {where}", f"{error} in {pattern!r}", "a regular expression") from None
