"""Amounts as people write them, in one spelling: "two and a half centimetres" becomes "2.5 cm"."""

from __future__ import annotations

import re

_ONES = {
    word: value
    for value, word in enumerate(
        [
            "zero",
            "one",
            "two",
            "three",
            "four",
            "five",
            "six",
            "seven",
            "eight",
            "nine",
            "ten",
            "eleven",
            "twelve",
            "thirteen",
            "fourteen",
            "fifteen",
            "sixteen",
            "seventeen",
            "eighteen",
            "nineteen",
        ]
    )
}
_TENS = {
    word: 10 * i
    for i, word in enumerate(["twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety"], 2)
}
_SHARES = {"half": 0.5, "quarter": 0.25, "third": 1 / 3}
_BODY = {  # m: what people measure with at hand
    "finger": 0.015,
    "thumb": 0.02,
    "hand": 0.08,
}
_UNITS = {
    r"centimet(?:er|re)s?|centis?|cms?": "cm",
    r"millimet(?:er|re)s?|millis?|mms?": "mm",
    r"inch(?:es)?": "inch",
    r"met(?:er|re)s?": "m",
    r"degrees?|degs?|°": "degrees",
    r"seconds?|secs?": "seconds",
    r"newtons?": "newton",
}
_TENS_WORD = "|".join(_TENS)
_ONES_WORD = "|".join(_ONES)
_BELOW_100 = rf"(?:(?:{_TENS_WORD})(?:[- ](?:{_ONES_WORD}))?|{_ONES_WORD})"
_NUMBER = rf"(?:(?:(?:a|one|two|three) )?hundred(?: and)?(?: {_BELOW_100})?|{_BELOW_100}|\d+(?:[.,]\d+)?)"
_UNIT = "|".join(_UNITS)
_FEW = {"a couple of": 2.0, "couple of": 2.0, "a couple": 2.0, "a few": 3.0, "few": 3.0}
_AMOUNT = re.compile(
    rf"\b(?:(?P<share>half|a quarter|a third|quarter|third|three quarters) (?:of )?(?:an?|one) "
    rf"|(?P<few>{'|'.join(_FEW)}) "
    rf"|(?P<whole>{_NUMBER})(?: and (?P<more>a half|a quarter))?[ -]?"
    rf"|(?P<one>an?) )(?P<unit>{_UNIT})(?![\w])(?! (?:time|pull|push|try|go|attempt|tug|chance)\b)"
    r"(?P<half> and a half)?"
)


_BODY_WIDTHS = re.compile(
    rf"\b(?:(?P<few>{'|'.join(_FEW)}) |(?P<whole>{_NUMBER}) |(?:a |your |the )?)"
    rf"(?P<part>{'|'.join(_BODY)})(?:'?s|s')?[- ](?:widths?|breadths?|wide)\b"
)


def _in_centimetres(match: re.Match[str]) -> str:
    """Widths of fingers and hands: "two fingers' width" is 3 cm."""
    count = _FEW.get(match.group("few") or "") or number(match.group("whole") or "one") or 1.0
    return f"{100 * _BODY[match.group('part')] * count:g} cm"


_TURNS = re.compile(
    rf"\b(?:(?P<share>half|quarter) |(?P<whole>{_NUMBER}) (?P<more>more )?"
    r"(?:full |whole |complete )?(?P<half>half |quarter )?)"
    r"(?:turns?|revolutions?)\b(?= |$|[.,;!])"
)


def _in_degrees(match: re.Match[str]) -> str:
    """Turns that are counted, as an angle: "three more half turns" is 540 more degrees."""
    if match.group("share"):
        return match.group()
    value = (number(match.group("whole")) or 0.0) * 360
    value *= {"half": 0.5, "quarter": 0.25}.get((match.group("half") or "").strip(), 1.0)
    return f"{value:g} degrees" + (" more" if match.group("more") else "")


def in_figures(text: str) -> str:
    """Lower-case text with lengths, angles and times in figures and short units ("3 cm", "90 degrees", "2 seconds")."""
    text = _BODY_WIDTHS.sub(_in_centimetres, text)
    text = re.sub(r"(\d) ?½", r"\1.5", text).replace("½", "half")
    text = re.sub(r"\b(?:a |one )?(half|quarter|third|eighth) (?:of )?a turn\b", r"a \1 turn", text)
    text = _TURNS.sub(_in_degrees, text)
    text = re.sub(rf"\b({_NUMBER}) more (?=(?:{_UNIT})\b)(\S+)", r"\1 \2 more", text)
    text = re.sub(rf"\b(another|an extra|one more) (?=(?:{_UNIT})\b)", r"\1 1 ", text).replace(
        "one more 1 ", "another 1 "
    )
    return _AMOUNT.sub(_figures, text)


def _figures(match: re.Match[str]) -> str:
    unit = next(short for pattern, short in _UNITS.items() if re.fullmatch(pattern, match.group("unit")))
    if match.group("share"):
        value = 0.75 if match.group("share").startswith("three") else _SHARES[match.group("share").split()[-1]]
    elif match.group("few"):
        value = _FEW[match.group("few")]
    elif match.group("whole"):
        value = number(match.group("whole")) or 0.0
        value += {"a half": 0.5, "a quarter": 0.25}.get(match.group("more") or "", 0.0)
    else:
        value = 1.0
    if match.group("half"):
        value += 0.5
    return f"{round(value, 3):g} {unit}"


def number(words: str) -> float | None:
    """The value of a number in figures or words below 400; None where it is none."""
    words = words.strip().replace(",", ".")
    if re.fullmatch(r"\d+(?:\.\d+)?", words):
        return float(words)
    total, seen = 0.0, False
    for word in re.split(r"[ -]", words):
        if word == "hundred":
            total, seen = max(1.0, total) * 100, True
        elif word in _TENS or word in _ONES:
            total, seen = total + _TENS.get(word, _ONES.get(word, 0)), True
        elif word not in ("a", "and"):
            return None
    return total if seen else None
