"""What parts mean that are about putting down: when and how to let go, how it lies, how the hand comes and goes."""

from __future__ import annotations

import re
from collections.abc import Sequence

from memo_llm.offline.composition import Part
from memo_llm.offline.request import Clause, Item, Meant, way_of


def of_release(clause: Clause) -> list[Meant] | None:
    """When, where and how to let go of what is put down."""
    if clause.kind != "place":
        return None
    kinds = [item.part.kind for item in clause.items]
    opens = "open" in clause.verbs and ("fingers" in clause.hand or "hand" in clause.hand)
    if "when_touch" in kinds and set(kinds) <= {
        "when_touch",
        "dir",
        "not",
        "when",
        "manner",
        "before_release",
        "extent",
    }:
        if any(item.part.kind == "dir" and item.part.value != "down" for item in clause.items):
            return None
        if clause.verbs & {"release", "lower", "put", "stop", "wait", "keep", "hold", "go", "bring"} or opens:
            slow = [
                Meant("speed", "slower")
                for item in clause.items
                if item.part.kind == "manner" and item.part.value in ("slow", "gentle")
            ]
            fast = any(
                item.part.kind == "manner" and item.part.value not in ("slow", "gentle") for item in clause.items
            )
            return None if fast else [Meant("set-down"), *slow]
    waits = clause.verbs & {"wait", "release", "hold", "keep", "stop"} or opens
    if "until_still" in kinds and set(kinds) <= {"until_still", "before_release", "when"} and waits:
        return [Meant("hold-for")]
    if "when_above" in kinds and set(kinds) <= {"when_above", "before_release", "when"} and waits:
        return [Meant("centre")]
    if "before_release" in kinds:
        rest = [item for item in clause.items if item.part.kind not in ("before_release", "when")]
        if "wait" in clause.verbs and all(item.part.kind == "amount" for item in rest):
            return [Meant("hold-for", amount=rest[0].amount if rest else "")]
        if (clause.verbs & {"lower", "put"} or (rest and "go" in clause.verbs)) and all(
            item.part.kind == "dir" and item.part.value == "down" and not item.amount for item in rest
        ):
            return [Meant("set-down")]
        if "lower" in clause.verbs and [item.part.kind for item in rest] == ["amount"]:
            return [Meant("offset", "down", rest[0].amount)]
        ways = [item for item in rest if item.part.kind == "dir" and not (item.denied or item.too)]
        if len(rest) == len(ways) == 1 and ways[0].part.value in ("left", "right") and clause.verbs & {"go", "shift"}:
            return [Meant("offset", ways[0].part.value, ways[0].amount)]
        return None
    if "release" in clause.verbs and kinds == ["when"] and clause.items[0].part.value == "later":
        return [Meant("set-down")]
    if (
        "release" in clause.verbs
        and kinds == ["dir"]
        and clause.items[0].part.value == "up"
        and (clause.items[0].too or clause.items[0].denied)
    ):
        return [Meant("set-down")]
    return None


def of_opening(clause: Clause) -> list[Meant] | None:
    """How the fingers open to let go."""
    if clause.kind != "place" or not (
        "release" in clause.verbs or ("open" in clause.verbs and (clause.hand or len(clause.items) == 1))
    ):
        return None
    slow = [item for item in clause.items if item.part.kind == "manner" and way_of(item) in ("slow", "gentle")]
    return [Meant("ease-open")] if slow and len(slow) == len(clause.items) else None


def of_retreat(clause: Clause) -> list[Meant] | None:
    """Where the hand goes once it has let go."""
    if clause.kind != "place" or not ("after_release" in clause.said or "retreat" in clause.verbs):
        return None
    ways = [item for item in clause.items if item.part.kind == "dir"]
    rest = [
        item for item in clause.items if item.part.kind not in ("dir", "after_release", "before_go", "when", "manner")
    ]
    manners = [item for item in clause.items if item.part.kind == "manner"]
    if rest or any(way_of(item) != "slow" for item in manners):
        return None
    if [item.part.value for item in ways] == ["up"] and not (ways[0].denied or ways[0].too):
        return [Meant("retreat", "up", ways[0].amount)]
    if not ways and manners:
        return [Meant("retreat", "slowly")]
    return None


def of_pose(clause: Clause) -> list[Meant] | None:
    """How the thing is held or lies in the end."""
    poses = [item for item in clause.items if item.part.kind == "pose"]
    if len(poses) != 1 or clause.hand:
        return None
    goes_in = clause.kind == "place" and bool(clause.verbs & {"go", "put", "belong"})
    rest = [
        item
        for item in clause.items
        if not (goes_in and item.part.kind == "dir" and item.part.value == "in")
        and item.part.kind not in ("pose", "while_lift", "manner", "when_touch", "before_release", "when")
    ]
    pose = poses[0]
    if rest or pose.denied or pose.too:
        return None
    manners = [
        Meant("speed", "slower")
        for item in clause.items
        if item.part.kind == "manner" and way_of(item) in ("slow", "gentle")
    ]
    if len(manners) != len([item for item in clause.items if item.part.kind == "manner"]):
        return None
    level = pose.part.said in (
        "level",
        "horizontal",
        "horizontally",
        "straight",
        "balanced",
        "steady and level",
        "flat",
        "upright",
    )
    if (
        level
        and clause.kind in ("pick", "place")
        and clause.verbs & {"keep", "hold", "bring"}
        and not clause.verbs & {"turn", "flip", "put"}
    ):
        return [Meant("tilt", "upright" if pose.part.value == "upright" else "level"), *manners]
    if (
        clause.kind == "pour"
        and pose.part.value == "upside down"
        and (not clause.verbs or clause.verbs & {"turn", "flip", "tilt", "hold", "shake"})
    ):
        return [Meant("angle", "upside down")]
    if (
        clause.kind == "place"
        and pose.part.value in ("upright", "flat", "upside down")
        and (clause.verbs & {"put", "stand", "turn", "flip", "hold", "go"} or not clause.verbs)
    ):
        if re.search(r"\bover\b", pose.part.said):
            return None  # "flip it over": from how it was
        if pose.part.said in ("straight", "level", "balanced", "steady and level"):
            return None
        return [Meant("pose", pose.part.value), *manners]
    return None


def of_travel(clause: Clause) -> list[Meant] | None:
    """How high the hand goes on the way there."""
    ways = [item for item in clause.items if item.part.kind == "dir"]
    if clause.kind not in ("pick", "place") or (
        [item.part.value for item in ways] != ["up"] and not (not ways and "lift" in clause.verbs)
    ):
        return None
    rest = [item for item in clause.items if item.part.kind not in ("dir", "before_go", "when", "amount")]
    first = "before_go" in clause.said or any(item.part.value == "first" for item in clause.items)
    carried = (clause.kind == "place" and "lift" in clause.verbs) or (
        bool(clause.verbs & {"bring"}) and not clause.verbs & {"go", "shift"} and clause.kind == "place"
    )
    first = first or (("go" in clause.verbs or "lift" in clause.verbs) and bool(clause.hand))
    if rest or not (first or carried) or any(item.denied or (item.too and not item.enough) for item in ways):
        return None
    if clause.kind == "pick" and not clause.hand and "go" not in clause.verbs:
        return None
    amount = next((item.amount for item in clause.items if item.amount), "")
    return [Meant("travel", "", amount)]


def of_relation(parts: Sequence[Part], items: list[Item], verbs: frozenset[str], denied: bool) -> list[Meant] | None:
    """Beside what something is put down."""
    at = [i for i, part in enumerate(parts) if part.kind == "relation"]
    if len(at) != 1 or denied or not (verbs & {"put", "go", "belong", "bring", "shift", "stand"} or not verbs):
        return None
    named = parts[at[0] + 1]
    if named.kind not in ("thing", "other") or any(item.part.kind not in ("relation", "amount") for item in items):
        return None
    noun = re.sub(r"^(?:(?:the|that|this|my|your|its|a|an|those|these) )+", "", named.said)
    amount = next((item.amount for item in items if item.part.kind == "amount"), "")
    if amount and not re.search(r"\d", amount):
        return None
    return [Meant("beside", f"{parts[at[0]].value} the {noun}", amount)]
