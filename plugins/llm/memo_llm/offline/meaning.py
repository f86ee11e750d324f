"""What the parts of a request mean together, for each kind of subtask.

Directions, manners, amounts, places and times are read independently of each other and of the verb they stand with; the
kind of subtask and the verb say what they change. A request of which some part has no meaning here has none.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import attrs

from memo_llm.offline.composition import NEUTRAL, Part
from memo_llm.offline.putting_down import of_opening, of_pose, of_relation, of_release, of_retreat, of_travel
from memo_llm.offline.request import OPPOSITE, Clause, Item, Meant, bare, items_of, way_of

_LED = ("open", "close", "pull", "push", "turn", "pour", "")
_HANDLED = ("pick", "place", "pour")
_GRIPS = frozenset(["hold", "squeeze"])
_STANDS = frozenset(["stand", "go", "put"])
_STOOD_UP = r"\bstand(?:ing)?\b.*\bup\b"
_BEFORE = frozenset(["before_down", "before_release"])
_ONLY = frozenset(["only", "just", "at most", "no more than"])
# Adjectives that tell how something is; they ask for it only with a degree or a verb.
_STATES = re.compile(r"loose|light|soft|tight|hard|firm|strong|quiet|rough|secure")
_FORCED = {"push": "push", "pull": "pull", "turn": "turn", "wipe": "press"}


def meaning(parts: Sequence[Part], kind: str) -> list[Meant] | None:
    """What a clause asks for; [] where it asks for nothing; None where that is not surely known."""
    items = items_of(parts)
    if items is None:
        return None
    back = any(part.said == "back" for part in parts)
    if (
        (back and kind == "pour")
        or parts[0].said == "back"
        or (kind == "close" and any(re.search(r"\b(?:out|open)\b", p.said) for p in parts))
    ):
        return None  # an order to the arm
    verbs = frozenset(name for part in parts if part.kind == "verb" for name in part.classes)
    if any(part.said == "off" for part in parts) and not verbs & {"go", "shift", "put", "bring"}:
        return None  # "off to the left": where it was
    there = {part.kind for part in parts} - NEUTRAL
    above = any(part.kind == "prep" and part.value == "over" for part in parts)
    if "other" in there and not above and "relation" not in there:
        return None
    said = frozenset(there)
    hand = {part.value for part in parts if part.kind == "hand"}
    if kind == "pick" and "open" in verbs and any(part.said == "them" for part in parts):
        hand.add("fingers")  # nothing else is opened there
    if not verbs and {part.kind for part in parts} <= {"lead", "vocative", "very", "hand", "be", "pronoun"}:
        return []
    told = any(part.past for part in parts) or parts[0].said in ("it's", "you're", "that's")
    faulted = any(item.too or item.enough for item in items)
    if told and not faulted:
        return None
    if any(part.said in _ONLY for part in parts) and any(part.kind == "amount" for part in parts):
        return None  # "only 5 cm": how far in all
    denied = any(part.kind == "not" for part in parts)
    bounded = {"when_touch", "before_release", "when_above", "until_still"} & said or any(
        item.part.value == "later" for item in items
    )
    downwards = all(item.part.kind == "dir" and item.part.value == "down" for item in items)
    if denied and kind == "place" and downwards and verbs and verbs <= {"push", "squeeze"}:
        return []  # "no pushing": setting down beside it says how
    if denied and not faulted and not bounded:
        return None  # what not to do does not say what to do
    if above and not denied and not told and (travels := _over(parts, items, verbs, kind)) is not None:
        return travels
    if kind == "place" and "relation" in there:
        return of_relation(parts, items, verbs, denied)
    if "other" in there:
        return None
    stood_up = kind == "place" and verbs <= _STANDS and re.search(_STOOD_UP, _said(parts)) is not None
    if stood_up and not denied and not told and all(item.part.value == "in" for item in items):
        return [Meant("pose", "upright")]
    if not items and not denied and not told and verbs:
        return _of_verbs(verbs, hand, kind, " ".join(part.said for part in parts if part.kind == "verb"))
    readers = (_of_swing, of_opening, of_release, _of_fingers, of_retreat, of_pose, of_travel, _of_lead)
    clause = Clause(items, verbs, said, frozenset(hand), kind)
    for reader in readers:
        found = reader(clause)
        if found is not None:
            return found
    return _of_each(clause)


def _said(parts: Sequence[Part]) -> str:
    return " ".join(part.said for part in parts)


def _over(parts: Sequence[Part], items: list[Item], verbs: frozenset[str], kind: str) -> list[Meant] | None:
    """Over something: on the way there, or where it is put down or poured; None where neither is sure."""
    rest = [item for item in items if item.part.value != "first" and item.part.kind not in _BEFORE]
    up = [item.part.value for item in rest] == ["up"] and not (rest[0].too or rest[0].denied)
    top = any(part.kind == "prep" and " top " in part.said for part in parts)
    goes = verbs & {"go", "bring", "lift", "clear"}
    if kind in ("pick", "place") and goes and (up or (not rest and (top or "other" in {part.kind for part in parts}))):
        return [Meant("travel", "", rest[0].amount if rest else "")]
    done = bool(verbs) or any(part.kind == "be" or part.said.endswith(" be") for part in parts)
    return [Meant("centre")] if not rest and done and kind in ("place", "pour") else None


def _of_verbs(verbs: frozenset[str], hand: set[str], kind: str, lifted: str) -> list[Meant] | None:
    """What a verb asks for by itself; nothing, where the subtask does it anyway."""
    if kind == "place" and "wait" in verbs:
        return [Meant("hold-for")]
    if kind in ("open", "close") and re.match(r"(?:twist|screw|unscrew)", lifted):
        return [Meant("turn-thing", "counterclockwise" if kind == "open" else "clockwise")]
    own = {
        "pick": {"go", "hold", "lift", "bring", "do"},
        "place": {"go", "put", "release", "bring", "lower", "do"},
        "pour": {"tilt", "shake", "do", "hold", "go", "bring"},
        "open": {"pull", "open", "hold", "do"},
        "close": {"push", "close", "do"},
        "turn": {"turn", "do"},
        "push": {"push", "do"},
    }
    if kind == "place" and "open" in verbs and hand:
        return []
    return [] if verbs & own.get(kind, set()) and not hand & {"hand"} - {"hand" if "go" in verbs else ""} else None


def _of_swing(clause: Clause) -> list[Meant] | None:
    """To which side a door swings."""
    if (
        clause.kind != "open"
        or "swing" not in clause.verbs
        or len(clause.items) != 1
        or clause.items[0].part.kind != "dir"
    ):
        return None
    if not any(word in clause.said for word in ("destination",)) and "pull" in clause.verbs:
        return None
    value = way_of(clause.items[0])
    return [Meant("pivot", value)] if value in ("left", "right", "up", "down") and not clause.items[0].amount else None


def _of_fingers(clause: Clause) -> list[Meant] | None:
    """How wide the fingers are opened before they take hold."""
    if clause.kind not in ("pick", "open", "pull", "turn") or not clause.hand or "open" not in clause.verbs:
        return None
    rest = [item for item in clause.items if item.part.kind not in ("before_down", "when")]
    first = any(item.part.kind == "before_down" or item.part.value == "first" for item in clause.items)
    if not rest:
        return [Meant("open-first")] if first else None
    if len(rest) > 1:
        return None
    item = rest[0]
    if item.denied and not item.too and not item.enough:
        return None
    if item.part.kind == "extent" and item.part.value == "all":
        return [Meant("finger-width", "less" if item.too else "wider" if item.enough else "fully")]
    if item.part.kind == "amount":
        return [Meant("finger-width", "less" if item.less or item.too else "wider")]
    return None


def _of_lead(clause: Clause) -> list[Meant] | None:
    """How far something is led, pressed, turned or tipped."""
    if (
        clause.kind not in _LED
        or clause.hand
        or (clause.verbs & {"retreat", "release", "hold", "squeeze"} and not clause.verbs & {"pull", "push", "turn"})
    ):
        return None
    ways = [item for item in clause.items if item.part.kind != "manner"]
    if len(ways) > 1:
        ways = [item for item in ways if not bare(item)]
    beside = [_manner(item, clause, False) for item in clause.items if item.part.kind == "manner"]
    if len(ways) != 1 or any(one is None for one in beside):
        return None
    led = _led(ways[0], clause)
    return None if led is None else [*led, *(one for one in beside if one is not None)]


def _led(item: Item, clause: Clause) -> list[Meant] | None:
    if item.denied and not (item.too or item.enough):
        return None
    if (
        clause.kind == "turn"
        and item.part.kind == "dir"
        and item.part.value in ("left", "right")
        and not clause.verbs & {"push", "pull", "tilt"}
        and not item.amount
    ):
        return [Meant("turn-thing", "clockwise" if way_of(item) == "right" else "counterclockwise")]
    if (
        clause.kind == "push"
        and item.part.kind == "dir"
        and re.match(r"(?:further )?(?:down|in)\b", item.part.said)
        and (item.amount or item.more)
    ):
        return [Meant("farther", amount=item.amount)]
    if item.part.kind == "angle" and clause.kind in ("pour", "turn", "open") and not (item.too or item.denied):
        return [Meant("farther" if item.more else "angle", amount=item.part.said)]
    if item.part.kind == "turning" and clause.kind == "turn" and not (item.too or item.denied):
        return [Meant("turn-thing", item.part.value)]
    if item.part.kind == "extent" and item.part.value == "far":
        return [Meant("less-far" if item.too else "farther")] if item.too or item.enough else None
    if item.part.kind == "extent":
        if item.part.value == "all" and not item.too:
            return [Meant("all-the-way")]
        if item.part.value == "twice":
            return [Meant("farther", amount="much")]
        return [Meant("less-far", "half")] if item.part.value == "half" else None
    if item.part.kind == "amount" and (
        item.more or item.less or clause.verbs & {"push", "pull", "turn", "tilt", "open"}
    ):
        return [Meant("less-far" if item.less or item.too else "farther", amount=item.amount)]
    if item.part.kind == "when" and "stop" in clause.verbs and item.part.value in ("earlier", "later"):
        return [Meant("less-far" if item.part.value == "earlier" else "farther", amount=item.amount)]
    return None


def _of_each(clause: Clause) -> list[Meant] | None:
    """Each part by itself: manners, ways, places to take hold of, sides to come from."""
    held = [item.part.value for item in clause.items if item.part.kind == "hold_at"]
    if held and any(item.part.kind == "dir" for item in clause.items):
        return None  # "further down on the stem"
    if len(held) > 1:
        handles = [item for item in clause.items if item.part.kind != "hold_at" or item.part.value == "handle"]
        clause = attrs.evolve(clause, items=handles)
    found: list[Meant] = []
    last = any(_of_the_end(item, clause) for item in clause.items)
    how = any(item.part.kind == "manner" for item in clause.items)
    came = any(item.part.kind == "side" for item in clause.items)
    centred = any(
        item.part.kind == "centre" and not re.match(r"closer|nearer", item.part.said) for item in clause.items
    )
    for item in clause.items:
        if (how or came) and item.part.kind == "dir" and bare(item):
            continue  # "come down slowly", "come down from the top": how, not where to
        if centred and item.part.kind == "amount" and not re.search(r"\d", item.amount):
            continue  # "a bit more to the middle"
        if _of_the_end(item, clause) or item.part.kind in ("when_above", "while_lift", "before_down", "not"):
            continue
        one = _one(item, clause, last)
        if one is None:
            return None
        found += [one] if one.kind else []
    if last and not any(one.kind == "slow-end" for one in found):
        return None
    return found if found else None


def _of_the_end(item: Item, clause: Clause) -> bool:
    """Whether a part is about the last stretch: "slower at the end", which is no part to hold."""
    manners = any(other.part.kind == "manner" for other in clause.items)
    ends = item.part.kind == "hold_at" and re.match(r"(?:at|to|on|near) the (?:very )?end$", item.part.said) is not None
    return item.part.kind == "last_bit" or (ends and manners and not clause.verbs & _GRIPS)


def _one(item: Item, clause: Clause, last: bool) -> Meant | None:
    if item.part.kind == "manner":
        return _manner(item, clause, last)
    if item.part.kind == "dir":
        return _place(item, clause)
    if item.denied or item.too or last:
        return None
    if item.part.kind == "amount" and "lower" in clause.verbs and clause.kind in _HANDLED and not item.less:
        return Meant("offset", "down", item.amount)
    if item.part.kind == "when_touch" and "lower" in clause.verbs and len(clause.items) > 1:
        return Meant("")
    if (
        item.part.kind == "hold_at"
        and len(clause.said & {"hold_at", "manner", "dir"}) > 1
        and re.match(r"(?:the|its)\b", item.part.said)
    ):
        return Meant("")  # "hold the handle tighter"
    pushed = clause.kind in ("close", "push")
    if item.part.kind == "hold_at" and clause.kind in ("pick", "open", "close", "pull", "turn", "push"):
        return (
            Meant("hold-at", item.part.value)
            if (clause.verbs & {"hold", "squeeze"} or not clause.verbs or (pushed and "push" in clause.verbs))
            and item.part.said.split()[0] != "from"
            else None
        )
    if (
        item.part.kind == "centre"
        and clause.kind in _HANDLED
        and not clause.verbs & {"pull", "push", "wipe", "turn", "shake"}
    ):
        if clause.kind == "pour" and "hold" in clause.verbs:
            return None
        return Meant("centre")
    comes = clause.verbs & {"go", "hold", "put", "lower", "bring"} or not clause.verbs
    if item.part.kind == "side" and clause.kind in ("pick", "place", "open", "close", "push") and comes:
        return Meant("approach", item.part.value)
    return None


def _manner(item: Item, clause: Clause, last: bool) -> Meant | None:
    value = way_of(item)
    if value is None or ("open" in clause.verbs and clause.hand):
        return None
    if (
        not clause.verbs
        and not (item.too or item.more or item.less or item.enough)
        and _STATES.fullmatch(item.part.said)
    ):
        return None
    if clause.verbs & {"release", "retreat", "stop"} and not clause.verbs & {"put", "lower", "hold"}:
        return None
    if value in ("slow", "fast"):
        return Meant("slow-end" if last and value == "slow" else "speed", "slower" if value == "slow" else "faster")
    if last:
        return Meant("slow-end", "slower") if value == "gentle" else None
    grips = bool(clause.verbs & _GRIPS) or (not clause.verbs and clause.kind == "pick") or "fingers" in clause.hand
    moves = clause.verbs & {
        "go",
        "put",
        "lower",
        "bring",
        "shift",
        "swing",
        "open",
        "close",
        "tilt",
        "lift",
        "turn",
        "pull",
        "push",
    }
    if clause.kind == "pick" and grips and not clause.verbs & {"put", "lower"}:
        return Meant("force", "gently" if value == "gentle" else "firmly")
    if clause.kind in ("pick", "place") and value == "gentle" and (moves or clause.kind == "place"):
        return Meant("speed", "slower")
    if clause.kind in ("open", "close", "pull", "turn", "push", "", "pour"):
        if (bool(clause.verbs & {"squeeze"}) and not clause.verbs & {"push", "pull"}) or "fingers" in clause.hand:
            return Meant("force", "gently" if value == "gentle" else "firmly")
        if (
            clause.kind in ("open", "close")
            and "shift" in clause.verbs
            and not clause.verbs & {"push", "pull", "open", "close"}
        ):
            return None  # what slides goes another way than it went
        if value == "gentle" and clause.kind in ("open", "close", "pull", "pour"):
            return Meant("speed", "slower")
        verb = next((word for name, word in _FORCED.items() if name in clause.verbs), "")
        if not verb and clause.kind in ("push", "") and value == "firm":
            verb = "press"
        if verb == "push" and any(word in clause.verbs for word in ("press",)):
            verb = "press"
        if verb and clause.kind != "pour":
            return Meant("force", "gently" if value == "gentle" else "firmly", verb=verb)
    return None


def _place(item: Item, clause: Clause) -> Meant | None:
    value = way_of(item)
    if clause.kind == "place" and item.part.said.startswith("on ") and not (item.amount or item.more or item.too):
        return None  # where it belongs, and not which way from where it was
    if item.part.said.endswith("above it") or (" above " in item.part.said and clause.kind == "pick"):
        return None
    if (
        value is None
        or value not in OPPOSITE
        or clause.kind not in _HANDLED
        or ("thing" in clause.said and clause.kind == "pick" and not clause.verbs)
    ):
        return None
    if (
        clause.verbs & {"pull", "push", "turn", "tilt", "retreat", "release", "stop", "wait", "shake", "wipe"}
    ) and not (clause.verbs & {"go", "shift"}):
        return None
    if bare(item) and "when_above" in clause.said:
        return None
    if bare(item) and clause.verbs & {"put", "lower", "hold", "lift", "stand", "open", "close"}:
        return None  # "put it down", "pick it up": what the subtask does anyway
    if clause.kind == "pick" and "lift" in clause.verbs and not clause.verbs & {"hold"}:
        return Meant("offset", value, item.amount, lifted=True) if value in ("up", "down") else None
    if (
        clause.kind == "pick"
        and clause.verbs & {"lift"}
        and value == "up"
        and any(p in clause.verbs for p in ("hold",))
        and not clause.hand
    ):
        return None
    return Meant("offset", value, item.amount)
