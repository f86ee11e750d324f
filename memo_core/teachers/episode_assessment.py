"""Assessing a subtask from what a person in the room saw: whether it looked done, and otherwise what they would say was
wrong. It uses only scene graphs over time: visible poses, boxes, relations and the hand. It has no access to joint
parameters, success checks, reference solutions or code (a test checks the imports).
"""

from __future__ import annotations

import re

import attrs
import numpy as np

from memo_core.interfaces.teacher import Episode, Proposal
from memo_core.scene.graph import Node
from memo_core.scene.pose import Array
from memo_core.teachers import visible
from memo_core.teachers.impression import Impression
from memo_core.teachers.opening_assessment import assess_opening
from memo_core.teachers.visible import Seen
from memo_core.teachers.visible_goal import Condition, failing, holds, read_goal

OPENING = {"OPEN", "UNLOCK", "PULL", "PULL_OPEN", "PULL_OUT", "SLIDE", "LIFT_LID"}
CLOSING = {"CLOSE", "SHUT", "PUSH_SHUT", "PUSH_IN", "SCREW_ON", "SCREW"}
PICKING = {"PICK_UP", "PICK", "GRASP", "TAKE", "GRAB", "LIFT", "HOLD"}
TAKING_OUT = {"TAKE_OUT", "REMOVE", "TAKE_OFF", "LIFT_OFF", "UNSCREW", "TAKE_AWAY"}
PLACING = {"PLACE", "PUT", "INSERT", "STACK", "PUT_DOWN", "PUT_IN", "PUT_ON", "SET_DOWN", "DROP", "LAY", "THROW_AWAY"}
MOVING = {"MOVE", "BRING", "CARRY", "MOVE_TO", "MOVE_NEXT_TO"}
TURNING = {"TURN_ON", "SWITCH_ON", "TURN", "ROTATE", "TWIST", "START", "TURN_KNOB", "TURN_OFF"}
PRESSING = {"PRESS", "PUSH", "PUSH_DOWN", "PRESS_DOWN", "PRESS_BUTTON", "LOWER", "HOLD_BUTTON", "HOLD_DOWN"}
POURING = {
    "POUR",
    "POUR_INTO",
    "EMPTY",
    "TIP",
    "TILT",
    "SEASON",
    "SHAKE",
    "SPRINKLE",
    "SALT",
    "PEPPER",
    "SUGAR",
    "DUST",
}
WIPING = {"WIPE", "CLEAN", "SCRUB", "WASH"}
LETTING_GO = {"LET_GO", "RELEASE"}
# Whatever names the whole task is judged by its goal.
WHOLE = {"SET", "SET_TABLE", "CLEAR", "CLEAR_TABLE", "CLEAN_UP", "TIDY", "TIDY_UP", "HEAT", "COOK", "MAKE", "TOAST"}
WHOLE |= {"PUT_AWAY", "PREPARE", "SERVE", "ARRANGE"}

CONTROLS = ("knob", "lever", "dial", "switch", "tap", "handle", "button")
# Causes that name a motion that was seen; what the robot says aloud does not change them.
MOTION_CAUSES = {"straight-on-swing", "wrong-way-round", "not-far-enough", "arc-on-slide", "slide-not-far-enough"}

_REFUSED = re.compile(
    r"out of the arm's reach|joints beyond their limits|cannot be reached|no free way|cannot get past"
)
_OFFERED = re.compile(r"reachable with the hand turned by \d+ degrees, (pointing .*?)(?:$|[;.\n])")
_STEEPER = re.compile(r"and (\d+) degrees (down|up)")
_HIDDEN = re.compile(r"unknown object '([^']*)'")
_TOO_HARD = re.compile(r"N were felt, more than")

UNSURE = Impression(False, "unclear", sure=False)
FINE = Impression(True)


def impression(episode: Episode) -> Impression:
    """Assess the subtask from what was seen from its start to its end and from what the robot said aloud."""
    action, names = spoken_subtask(episode.subtask)
    seen = Seen(episode.before, episode.after, episode.sightings)
    blanks = {"object": names[0] if names else "it", "place": names[1] if len(names) > 1 else "place"}
    blanks |= {"amount": "a bit", "side": "over"}
    found = _assess(action, names, episode, seen)
    if not found.fine and found.cause not in MOTION_CAUSES:
        found = _heard(episode.spoken_error, names, seen) or found
    return attrs.evolve(found, blanks=blanks | found.blanks)


def spoken_subtask(subtask: str) -> tuple[str, list[str]]:
    """("PICK_UP", ["food"]) of ``Pick up(food)``."""
    match = re.fullmatch(r"\s*([^()]+?)\s*\(([^()]*)\)\s*", subtask)
    if match is None:
        return re.sub(r"[\s-]+", "_", subtask.strip().upper()), []
    action = re.sub(r"[\s-]+", "_", match.group(1).upper())
    return action, [name.strip() for name in match.group(2).split(",") if name.strip()]


def _assess(action: str, names: list[str], episode: Episode, seen: Seen) -> Impression:
    name = names[0] if names else ""
    if action in POURING and _grains_of(name, seen):
        return _poured(names, episode, seen)
    if action in WHOLE or (action in POURING | WIPING and not _single(name, seen)):
        return goal_impression(episode.goal, seen)
    if not names:
        return UNSURE
    if action in OPENING:
        return assess_opening(seen, name) if visible.movers(seen.before, name) else _uncapped(name, seen)
    if action in CLOSING:
        return _closed(name, seen) if visible.movers(seen.after, name) else _capped(name, seen)
    if action in PICKING:
        return _picked(name, seen)
    if action in TAKING_OUT:
        return _taken(names, seen)
    if action in PLACING:
        return _placed(names, episode, seen)
    if action in MOVING:
        return _moved(names, episode, seen)
    if action in TURNING:
        return _operated(name, seen, ("turned", "lowered", "pressed"), "not-turned")
    if action in PRESSING:
        return _operated(name, seen, ("pressed", "lowered", "turned"), "not-pressed")
    if action in WIPING:
        return _wiped(names, seen)
    if action in POURING:
        return goal_impression(episode.goal, seen)
    if action in LETTING_GO:
        return FINE if holds(_said("let-go", name), seen) else Impression(False, "still-held")
    return UNSURE


def goal_impression(goal: tuple[str, ...], seen: Seen) -> Impression:
    """Assess the whole task by its goal: the first condition that is visibly not met. Not sure without a goal, or if a
    condition cannot be judged by looking."""
    conditions = [(sentence, read_goal(sentence)) for sentence in goal]
    told = [(condition, holds(condition, seen) if condition else None) for _, condition in conditions]
    for condition, so in told:
        if condition is not None and so is False:
            return unmet(condition, seen)
    if not told or any(so is None for _, so in told):
        return UNSURE
    return FINE


def plan_impression(proposal: Proposal) -> Impression:
    """Whether a planned subtask reaches into something that is visibly closed; fine if that cannot be seen."""
    action, names = spoken_subtask(proposal.subtask)
    seen = Seen(proposal.scene, proposal.scene)
    if action in PICKING | TAKING_OUT and names and not seen.ids(names[0]):
        hidden = _behind_a_door(names[0], seen)
        return FINE if hidden is None else hidden
    if action not in PLACING or len(names) < 2:
        return FINE
    doors = visible.movers(proposal.scene, names[1])
    if not doors or any(visible.door_state(proposal.scene, door.id) != "closed" for door in doors):
        return FINE
    return Impression(False, "closed-place", {"object": names[0], "place": doors[0].label}, about_plan=True)


# What somebody says of a condition that is not met; of most, that it is not.
_UNMET = {
    "let-go": "still-held",
    "wide-open": "goal-open",
    "off": "cap-still-on",
    "screwed": "cap-not-turned",
    "wiped": "not-wiped",
}


def unmet(condition: Condition, seen: Seen) -> Impression:
    """A condition of the goal that is visibly not met, as a cause with everyday names."""
    blanks = {"object": failing(condition, seen), "place": condition.place or "place"}
    if condition.form == "wiped":
        blanks = {"object": condition.place, "place": blanks["object"]}
    return Impression(False, _UNMET.get(condition.form, f"goal-{condition.form}"), blanks)


def _said(form: str, *names: str) -> Condition:
    return Condition("", form, names[:1], names[1] if len(names) > 1 else "")


def _single(name: str, seen: Seen) -> Node | None:
    return seen.node(name) if name else None


def _heard(spoken: str, names: list[str], seen: Seen) -> Impression | None:
    """A person's answer to a robot that says aloud what went wrong: the alternative it suggests, or another one."""
    hidden = _HIDDEN.search(spoken)
    if hidden is not None and not seen.ids(hidden.group(1)):
        return _behind_a_door(hidden.group(1), seen)
    if _TOO_HARD.search(spoken):
        return Impression(False, "too-hard")
    if not _REFUSED.search(spoken):
        return None
    offered = _OFFERED.search(spoken)
    if offered is None:
        return Impression(False, "refused")
    steeper = _STEEPER.search(offered.group(1))
    if steeper is not None:
        return Impression(False, "refused-tilt", {"amount": f"{steeper.group(1)} degrees", "side": steeper.group(2)})
    way = {"pointing down": "the top", "pointing up": "below"}.get(offered.group(1).strip(), "the side")
    return Impression(False, "refused-from", {"side": way})


def _behind_a_door(thing: str, seen: Seen) -> Impression | None:
    """For an object that nobody can see: a closed container in which it may be."""
    for relation in seen.after.relations:
        node = visible.by_id(seen.after, relation.subject)
        if relation.predicate == "closed" and node is not None:
            return Impression(False, "out-of-sight", {"object": thing, "place": node.label}, about_plan=True)
    return None


# -- picking, placing, moving -----------------------------------------------------------------------------------------


def _picked(name: str, seen: Seen) -> Impression:
    ids = seen.ids(name)
    before = seen.first(ids[0]) if len(ids) == 1 else None
    if before is None:
        return _behind_a_door(name, seen) or Impression(False, "never-near")
    if any(r.predicate == "held" and r.subject == before.id for r in seen.after.relations):
        return FINE
    hand = seen.hand_path()
    gaps = [visible.distance_to_box(before, point) for point in hand]
    if not gaps or min(gaps) > 0.1:
        return Impression(False, "nothing-moved" if visible.path_length(hand) < 0.05 else "never-near")
    heights = [node.pose.position[2] for s in seen.sightings if (node := visible.by_id(s.scene, before.id)) is not None]
    if max(heights, default=0.0) > before.pose.position[2] + 0.03:
        return Impression(False, "lost-on-lift")
    offset = np.asarray(before.pose.position) - hand[int(np.argmin(gaps))]
    return Impression(False, "closed-beside", _towards(offset))


def _taken(names: list[str], seen: Seen) -> Impression:
    """Whether an object was taken out of or off something: it is held, or elsewhere."""
    found = _picked(names[0], seen)
    node = seen.node(names[0])
    if found.fine or node is None:
        return found
    if node.label.lower().endswith(("cap", "lid")):
        return _uncapped(names[0], seen)
    began = next((scene for scene in seen.scenes() if visible.by_id(scene, node.id) is not None), seen.before)
    was_in = visible.relation(began, "in", node.id)
    if was_in and visible.by_id(seen.after, node.id) is not None:
        return FINE if visible.relation(seen.after, "in", node.id) != was_in else found
    return found


def _placed(names: list[str], episode: Episode, seen: Seen) -> Impression:
    thing = seen.node(names[0])
    if thing is None:
        return _behind_a_door(names[0], seen) or UNSURE
    if holds(_said("held", names[0]), seen):
        return Impression(False, "still-held")
    if len(names) < 2:
        return (
            FINE if any(r.subject == thing.id and r.predicate in ("on", "in") for r in seen.after.relations) else UNSURE
        )
    if _as_the_goal_wants(thing, episode, seen):
        return FINE
    place = names[1]
    if place.lower().removeprefix("the ") == "table":
        on = holds(_said("on", names[0], "table"), seen)
        return UNSURE if on is None else FINE if on else Impression(False, "landed-beside", _towards(-np.eye(3)[2]))
    target = seen.node(place)
    if target is None:
        return UNSURE
    there = (holds(_said("in", names[0], place), seen), holds(_said("on", names[0], place), seen))
    if there[0]:
        return FINE
    spaces = [n for n in seen.after.nodes if n.kind == "space" and n.id in visible.owned(seen.after, target.id)]
    if there[1]:
        return Impression(False, "dropped-short") if spaces else FINE
    shut = [m for m in visible.movers(seen.after, target.label) if visible.door_state(seen.after, m.id) == "closed"]
    was_shut = {m.id for m in visible.movers(seen.before, target.label)} & {m.id for m in shut}
    if was_shut and visible.by_id(seen.after, thing.id) is not None:
        return Impression(False, "closed-place", {"place": shut[0].label}, about_plan=True)
    if None in there and visible.by_id(seen.after, thing.id) is None:
        return UNSURE
    offset = np.asarray(target.pose.position) - np.asarray(thing.pose.position)
    return Impression(False, "dropped-short" if spaces else "landed-beside", _towards(offset))


def _moved(names: list[str], episode: Episode, seen: Seen) -> Impression:
    thing = seen.node(names[0])
    if thing is None or len(names) < 2:
        return UNSURE
    if holds(_said("next-to", *names[:2]), seen) and not holds(_said("held", names[0]), seen):
        return FINE
    placed = _placed(names, episode, seen)
    return attrs.evolve(placed, cause="not-beside") if placed.cause == "landed-beside" else placed


def _as_the_goal_wants(thing: Node, episode: Episode, seen: Seen) -> bool:
    """Whether all conditions of the goal on this object's position ("left of the plate") hold."""
    where = ("in", "on", "left-of", "right-of", "next-to")
    about = [
        condition
        for sentence in episode.goal
        if (condition := read_goal(sentence)) is not None
        and condition.form in where
        and any(thing.id in seen.ids(name) for name in condition.subjects)
    ]
    if not about:
        return False
    return all(holds(attrs.evolve(condition, subjects=(thing.label,)), seen) for condition in about)


# -- knobs, buttons, caps, sponges, grains ----------------------------------------------------------------------------


def _operated(name: str, seen: Seen, forms: tuple[str, ...], cause: str) -> Impression:
    """Assess operating a knob, lever or button, or an object that has one."""
    node = seen.node(name)
    if node is None:
        return UNSURE
    if node.label.lower().endswith("cap"):
        return _uncapped(name, seen)
    parts = [n for n in seen.before.nodes if n.id in visible.owned(seen.before, node.id)] or [node]
    controls = [n for n in parts if n.label.lower().endswith(CONTROLS) and not n.label.lower().endswith("handle")]
    if not controls:
        moved = visible.movers(seen.before, name)
        return _closed(name, seen) if moved and cause == "not-pressed" else UNSURE
    for control in controls:
        own = ("pressed",) if control.label.lower().endswith("button") else tuple(f for f in forms if f != "pressed")
        if any(holds(_said(form, control.label), seen) for form in own):
            return FINE
    hand = seen.hand_path()
    gaps = [visible.distance_to_box(control, point) for control in controls for point in hand]
    blanks = {"object": controls[0].label}
    if not gaps or min(gaps) > 0.08:
        still = visible.path_length(hand) < 0.05
        return Impression(False, "nothing-moved" if still else "never-near", blanks)
    return Impression(False, cause, blanks)


def _closed(name: str, seen: Seen) -> Impression:
    return FINE if holds(_said("closed", name), seen) else Impression(False, "not-closed")


def _cap(name: str, seen: Seen) -> tuple[str, str] | None:
    """Labels of a cap and of the object that it closes, by the name of either."""
    node = seen.node(name)
    if node is None:
        return None
    caps = [n for n in seen.before.nodes if n.label.lower().endswith(("cap", "lid"))]
    if node.id in {n.id for n in caps}:
        owner = visible.by_id(seen.before, node.part_of or "")
        bottles = [owner] if owner is not None else [n for n in seen.before.nodes if n.kind == "fixture"]
        return (node.label, bottles[0].label) if len(bottles) == 1 else None
    own = [n for n in caps if n.part_of == node.id] or caps
    return (own[0].label, node.label) if len(own) == 1 else None


def _uncapped(name: str, seen: Seen) -> Impression:
    cap = _cap(name, seen)
    if cap is None:
        return UNSURE
    off = holds(_said("off", *cap), seen)
    if off is None:
        return UNSURE
    return FINE if off else Impression(False, "cap-still-on", {"object": cap[0], "place": cap[1]})


def _capped(name: str, seen: Seen) -> Impression:
    cap = _cap(name, seen)
    if cap is None:
        return UNSURE
    blanks = {"object": cap[0], "place": cap[1]}
    if not holds(_said("on", *cap), seen):
        return Impression(False, "cap-not-on", blanks)
    turned = holds(_said("screwed", *cap), seen)
    return UNSURE if turned is None else FINE if turned else Impression(False, "cap-not-turned", blanks)


def _wiped(names: list[str], seen: Seen) -> Impression:
    tools = [n.label for n in seen.before.nodes if n.label.lower().endswith(("sponge", "cloth", "rag", "towel"))]
    tool = names[1] if len(names) > 1 else tools[0] if len(tools) == 1 else ""
    if seen.node(tool) is None:
        return UNSURE
    done = holds(_said("wiped", tool, names[0]), seen)
    blanks = {"object": names[0], "place": tool}
    return UNSURE if done is None else FINE if done else Impression(False, "not-wiped", blanks)


def _grains_of(name: str, seen: Seen) -> list[str]:
    """The grains of a can or shaker, as far as anybody saw them: they were in it at first or came out later."""
    if not name or seen.node(name) is None:
        return []
    heaps = {n.id: n.label for scene in seen.scenes() for n in scene.nodes if n.kind == "heap"}
    ids = seen.ids(name)
    return [
        label
        for id, label in heaps.items()
        if visible.relation(seen.before, "in", id) in ids or visible.by_id(seen.before, id) is None
    ]


def _poured(names: list[str], episode: Episode, seen: Seen) -> Impression:
    grains = _grains_of(names[0], seen)
    wanted = [c for s in episode.goal if (c := read_goal(s)) is not None and c.form in ("in", "on")]
    target = names[1] if len(names) > 1 else next((c.place for c in wanted if c.subjects[0] in grains), "")
    if not target:
        return UNSURE
    blanks = {"object": grains[0], "place": target}
    if any(holds(_said(form, grains[0], target), seen) for form in ("in", "on")):
        return FINE
    scene = seen.last_scene_with(seen.ids(grains[0])[0])
    inside = scene is not None and visible.relation(scene, "in", seen.ids(grains[0])[0]) in seen.ids(names[0])
    return Impression(False, "nothing-came-out" if inside else "poured-beside", blanks)


def _towards(offset: Array) -> dict[str, str]:
    """The direction a person would say, as the robot sees it, and a rough amount."""
    words = (("forward", "back"), ("left", "right"), ("higher", "lower"))
    axis = int(np.argmax(np.abs(offset)))
    centimetres = max(1, round(abs(float(offset[axis])) * 100))
    amount = "a bit" if centimetres <= 1 else f"{centimetres} cm"
    return {"side": words[axis][0 if offset[axis] > 0 else 1], "amount": amount}
