"""Phase 1: the next subtask, from the task's verbs, what the scene shows, and what was done so far."""

from __future__ import annotations

import re
from collections import Counter

import attrs

from memo_core.plugin import Node, Prompt, SceneGraph, read_subtask
from memo_offline.planning_remarks import Remark, asked_in, concerns, remarks
from memo_offline.surroundings import descendants, doors, find, last_word, space_of, states

_OPEN = r"open(?: up)?|pull open|swing open|slide open"
_CLOSE = r"close|shut"
_PUT = r"put|place|store|insert|move|bring|set|lay|drop|return|stow"
_PICK = r"pick up|pick|take out|take|grab|grasp|fetch|get|lift|remove|hand over"
_STACK = r"stack|pile(?: up)?|build a tower (?:of|from|with)"
_INTO = r"in|into|inside|inside of|on|onto|on top of|to|at"
_PARTICLES = "on|off|up|down|out|in|away|over|back|open|shut"
_WITH = "with|into|onto|in|on|to|over|from|at|against"
_ALWAYS_THERE = ("table", "floor", "robot", "arm", "hand", "gripper")
_UPWARD = 0.7  # z of the direction of an opening, from which on it faces up
Done = list[tuple[str, tuple[str, ...]]]  # subtasks: action and objects
MOST_LOOKS = 6  # closed things opened in search of something


@attrs.frozen
class Wish:
    """One clause of a task: what to do with what, and where to."""

    verb: str  # open, close, put, pick, stack, away, other
    what: str = ""
    where: str = ""
    relation: str = ""  # in, on
    spoken: str = ""  # the verb as said, for "other"


@attrs.frozen
class Plan:
    answer: str
    not_understood: tuple[str, ...] = ()


def plan(prompt: Prompt) -> Plan:
    """The next subtask or DONE, or in words why there is none: an answer that cannot be used, as a model's may be.
    Raises ``UnreadablePrompt`` for a prompt that lacks a section."""
    scene = prompt.scene()
    done = [read_subtask(line) for line in prompt.bullets("done")]
    wishes, unread = read_task(prompt.task, scene)
    asked_for, missed = remarks(prompt)
    unread = (*unread, *missed)
    wishes += [wish for one in asked_for if not one.before and (wish := _added(one, wishes, scene))]
    # A door opened on the way is not one to open again: what is wished for is met one after the other.
    for wish in wishes:
        step = _next(wish, scene, done)
        if step:
            first = _before(step, asked_for, scene, done)
            return Plan(_usable(first or step, scene), unread)
    if unread and not wishes:
        return Plan("I do not know what to do for that task; say it with a verb and the name of a thing", unread)
    return Plan("DONE", unread)


def _before(
    step: str,
    asked_for: list[Remark],
    scene: SceneGraph,
    done: Done,
) -> str:
    """The step that somebody wants done before ``step``; "" where there is none, or it is done."""
    _, objects = read_subtask(step)
    for one in asked_for:
        wish = _wish(one.clause, []) if one.before else None
        if wish is None or find(scene, wish.what) is None:
            continue
        if not one.trusted and not concerns(wish.what, objects, scene):
            continue
        first = _next(wish, scene, done)
        if first and first != step and read_subtask(first) not in done:
            return first
    return ""


def wish_in(words: str, scene: SceneGraph) -> bool:
    """Whether a remark asks for a step of its own: another thing first, or something that was left out."""
    for one in asked_in(words):
        clause = one.clause.removeprefix("forgotten: ")
        wish = _wish(clause, []) if clause == one.clause else Wish("put", re.sub(r"^(?:the|a|an|my|your) ", "", clause))
        if wish is not None and wish.what and find(scene, wish.what) is not None:
            return True
    return False


def _added(one: Remark, wishes: list[Wish], scene: SceneGraph) -> Wish | None:
    """What was left out: a step of its own, or another thing to do the same with."""
    if not one.trusted:
        return None  # what one task lacked, another may not want
    kind, _, thing = one.clause.partition(": ")
    if kind != "forgotten":
        wish = _wish(one.clause, wishes)
    else:
        label = re.sub(r"^(?:the|a|an|my|your) ", "", thing)
        wish = attrs.evolve(wishes[-1], what=label) if wishes else None
    return wish if wish is not None and find(scene, wish.what) is not None else None


def _usable(step: str, scene: SceneGraph) -> str:
    """The step, where all that it names is to be seen; else words that say what is not."""
    action, objects = read_subtask(step)
    unseen = [name for name in objects if name not in _ALWAYS_THERE and find(scene, name) is None]
    if not unseen:
        return step
    seen = ", ".join(node.label for node in scene.nodes if node.kind in ("object", "fixture"))
    return f"I would {action} {unseen[0]!r}, and see nothing called that; there are {seen}"


def read_task(task: str, scene: SceneGraph) -> tuple[list[Wish], tuple[str, ...]]:
    """The clauses of a task, and those that are not understood."""
    text = " ".join(re.sub(r"[^\w\s,;.'-]", " ", task.lower()).split()).strip(" .")
    wishes: list[Wish] = []
    unread: list[str] = []
    for clause in re.split(r"[,;.]|\band then\b|\bthen\b|\band\b(?= (?:\w+ )?(?:the|it|them|all)\b)", text):
        clause = re.sub(
            r"^(?:please|now|first|and|next|could you|can you|you should|i want you to) ", "", clause.strip()
        )
        clause = re.sub(r"^(?:please|and) ", "", clause)
        if not clause:
            continue
        wish = _wish(clause, wishes)
        if wish is None:
            unread.append(clause)
        else:
            wishes.append(wish)
    return wishes, tuple(unread)


def _wish(clause: str, before: list[Wish]) -> Wish | None:
    last = before[-1].what if before else ""

    def thing(words: str) -> str:
        words = re.sub(r"^(?:the|a|an|all|all the|both|both the|every|some|your) ", "", words.strip())
        words = re.sub(r"^(?:the|of the) ", "", words)
        return last if words in ("it", "them", "that") else words

    for pattern, verb in (
        (rf"(?:{_STACK}) (?P<what>.+?)(?: (?:on top of|onto|on) (?:each other|one another|(?P<where>.+)))?", "stack"),
        (
            rf"(?:(?:{_PUT}|tidy|clear|pack) (?P<what>.+?) away|(?:{_PUT}|tidy|clear|pack) away (?P<what2>.+?))"
            rf"(?: (?:in|into|inside|to) (?P<where>.+))?",
            "away",
        ),
        (rf"(?:{_PUT}) (?P<what>.+?) (?P<relation>{_INTO}) (?P<where>.+)", "put"),
        (rf"(?:{_PICK}) (?P<what>.+?)(?: up)?(?: (?:out of|from|off) (?P<where>.+))?", "pick"),
        (rf"(?:{_OPEN}) (?P<what>.+)", "open"),
        (rf"(?:{_CLOSE}) (?P<what>.+)", "close"),
    ):
        match = re.fullmatch(pattern, clause)
        if match:
            groups = match.groupdict()
            relation = groups.get("relation") or ""
            kind = "in" if relation.startswith("in") else "on" if relation.startswith("on") else ""
            what = groups.get("what") or groups.get("what2") or ""
            return Wish(verb, thing(what), thing(groups.get("where") or ""), kind, clause.split(" ")[0])
    match = re.fullmatch(
        rf"(?P<verb>[a-z]+(?: (?:{_PARTICLES}))?)(?: (?P<what>.+?))?(?: (?:{_WITH}) (?P<where>.+))?", clause
    )
    if match and match.group("what"):
        return Wish("other", thing(match.group("what")), thing(match.group("where") or ""), "", match.group("verb"))
    return None


def _next(wish: Wish, scene: SceneGraph, done: Done) -> str:
    if wish.verb == "open":
        return _open_step(wish.what, scene, "closed")
    if wish.verb == "close":
        return _close_step(wish.what, scene)
    if wish.verb == "pick":
        return _pick_step(wish, scene, done)
    if wish.verb == "put":
        return _put_step(wish.what, wish.where, wish.relation, scene, done)
    if wish.verb == "away":
        return _away_step(wish, scene, done)
    if wish.verb == "stack":
        return _stack_step(wish, scene, done)
    named = [node.label for name in (wish.what, wish.where) if name and (node := find(scene, name)) is not None]
    step = _call(wish.spoken, *(named or [wish.what]))
    return "" if read_subtask(step) in done else step


# -- one wish at a time -----------------------------------------------------------------------------------------------


def _open_step(what: str, scene: SceneGraph, unless: str) -> str:
    node = find(scene, what)
    if node is None:
        return _search(scene, []) or _call("OPEN", what)
    told = states(scene)
    movers = doors(scene, node)
    if movers and all(told.get(m.id, "closed") == "open" for m in movers):
        return ""
    return _call("OPEN", _openable_name(scene, movers[0] if movers else node, node))


def _close_step(what: str, scene: SceneGraph) -> str:
    node = find(scene, what)
    if node is None:
        return _call("CLOSE", what)
    told = states(scene)
    movers = [m for m in doors(scene, node) if told.get(m.id) == "open"]
    return _call("CLOSE", _openable_name(scene, movers[0], node)) if movers else ""


def _pick_step(wish: Wish, scene: SceneGraph, done: Done) -> str:
    node = find(scene, wish.what)
    if node is None:
        return _search(scene, done, wish.where) or _call("PICK_UP", wish.what)
    return "" if _held(scene) is node else _fetch(node, scene)


def _put_step(what: str, where: str, relation: str, scene: SceneGraph, done: Done) -> str:
    thing, place = find(scene, what), find(scene, where)
    if thing is None:
        shut_in = place is not None and _shut_in(what, place, scene, done)
        return "" if shut_in else _search(scene, done) or _call("PICK_UP", what)
    if place is not None and _is_at(thing, place, relation, scene):
        return ""
    if place is not None and relation != "on" and (step := _open_up(place, scene)):
        free = _put_down(scene)
        return free or step
    if _held(scene) is thing:
        return _call("PLACE", thing.label, place.label if place else where or "table")
    return _put_down(scene) or _fetch(thing, scene)


def _away_step(wish: Wish, scene: SceneGraph, done: Done) -> str:
    """Into something that opens, which is shut again afterwards."""
    thing = find(scene, wish.what)
    stores = _openable(scene)
    named = find(scene, wish.where) if wish.where else None
    if named is not None:
        family = {named.id, *(n.id for n in descendants(scene, named))}
        stores = [n for n in stores if n.id in family] or stores
    if thing is None:
        placed = [objects for action, objects in done if action == "place" and objects[:1] == (wish.what,)]
        return "" if placed else _search(scene, done) or _call("PICK_UP", wish.what)
    home = next((s for s in stores if _is_at(thing, s, "in", scene)), None)
    if home is not None:
        return "" if states(scene).get(home.id) == "closed" else _call("CLOSE", home.label)
    placed = [
        objects
        for action, objects in done
        if action == "place" and objects and objects[0].lower() == thing.label.lower()
    ]
    if not stores:
        return ""
    opened = [s for s in stores if states(scene).get(s.id) == "open"]
    store = (opened or stores)[0]
    name = _openable_name(scene, store, store)
    if placed and _held(scene) is not thing and store not in opened:
        return ""  # it went in, and what is shut shows nothing
    if store not in opened:
        return _put_down(scene) or _call("OPEN", name)
    if _held(scene) is thing:
        return _call("PLACE", thing.label, name)
    return _put_down(scene) or _fetch(thing, scene)


def _stack_step(wish: Wish, scene: SceneGraph, done: Done) -> str:
    if wish.where:
        return _put_step(wish.what, wish.where, "on", scene, done)
    noun = last_word(wish.what)
    blocks = [n for n in scene.nodes if n.kind == "object" and last_word(n.label) in (noun, noun.removesuffix("s"))]
    on = {r.subject: r.object for r in scene.relations if r.predicate == "on"}
    held = _held(scene)
    # The largest lies lowest; of equal ones the order of the table decides.
    order = sorted(blocks, key=lambda n: -round(n.size[0] * n.size[1], 4))
    tower = _tower(order, on)
    for upper in order:
        if upper.id in tower:
            continue
        top = tower[-1]
        if held is upper:
            return _call("PLACE", upper.label, next(n.label for n in blocks if n.id == top))
        return _put_down(scene) or _fetch(upper, scene)
    return ""


def _tower(blocks: list[Node], on: dict[str, str | None]) -> list[str]:
    """Ids of the highest tower that stands, from the bottom."""
    best: list[str] = [blocks[0].id] if blocks else []
    for block in blocks:
        tower = [block.id]
        while above := next((b.id for b in blocks if on.get(b.id) == tower[-1] and b.id not in tower), None):
            tower.append(above)
        if on.get(block.id) not in {b.id for b in blocks} and len(tower) > len(best):
            best = tower
    return best


# -- pieces -----------------------------------------------------------------------------------------------------------


def _fetch(thing: Node, scene: SceneGraph) -> str:
    return _call("PICK_UP", thing.label)


def _put_down(scene: SceneGraph) -> str:
    """The subtask to do first when the hand holds something else."""
    held = _held(scene)
    return _call("PLACE", held.label, "table") if held is not None else ""


def _search(scene: SceneGraph, done: Done, hint: str = "") -> str:
    """Search for an unseen object in something closed: first the container that was named, then any."""
    told = states(scene)
    tried = Counter(objects[0].lower() for action, objects in done if action == "open" and objects)
    closed = [n for n in _openable(scene) if told.get(n.id) == "closed"]
    named = find(scene, hint) if hint else None
    family = {n.id for n in ([named, *descendants(scene, named)] if named is not None else [])}
    closed.sort(key=lambda n: n.id not in family)
    for node in closed:
        name = _openable_name(scene, node, node)
        if tried[name.lower()] < 2 and sum(tried.values()) < MOST_LOOKS:
            return _call("OPEN", name)
    return ""


def _open_up(place: Node, scene: SceneGraph) -> str:
    """OPEN(...) if the place is shut."""
    told = states(scene)
    if place.kind == "space":
        return ""
    shut = [d for d in doors(scene, place) if told.get(d.id) == "closed"]
    return _call("OPEN", _openable_name(scene, shut[0], place)) if shut else ""


def _openable(scene: SceneGraph) -> list[Node]:
    told = states(scene)
    return [n for n in scene.nodes if n.id in told]


def _openable_name(scene: SceneGraph, door: Node, asked: Node) -> str:
    """People open the thing, not its door; but what slides out may have a name of its own."""
    owner = next((n for n in scene.nodes if n.id == door.part_of), None)
    if owner is not None and (
        owner.label.lower() in door.label.lower() or last_word(door.label) in ("door", "lid", "flap")
    ):
        return owner.label
    return door.label


def _held(scene: SceneGraph) -> Node | None:
    held = next((r.subject for r in scene.relations if r.predicate == "held"), None)
    node = next((n for n in scene.nodes if n.id == held), None)
    return node if node is not None and node.kind == "object" else None


def _is_at(thing: Node, place: Node, relation: str, scene: SceneGraph) -> bool:
    family = {place.id, *(n.id for n in descendants(scene, place))}
    if place.part_of and place.kind == "space":
        family.add(place.part_of)
    inside = space_of(scene, place)
    if relation != "on":
        wanted: tuple[str, ...] = ("in",) if inside is not None else ("in", "on")
    elif inside is not None and inside.opening is not None and inside.opening[2] > _UPWARD:
        wanted = ("in", "on")  # what lies on a rimmed tray is seen in it
    else:
        wanted = ("on",)
    return any(r.subject == thing.id and r.predicate in wanted and r.object in family for r in scene.relations)


def _shut_in(what: str, place: Node, scene: SceneGraph, done: Done) -> bool:
    """Whether what is not to be seen was last placed into something that is closed now."""
    closed = any(states(scene).get(door.id) == "closed" for door in doors(scene, place))
    named = f" {what.lower()}"
    placed = [objects for action, objects in done if action == "place" and f" {objects[0].lower()}".endswith(named)]
    return closed and bool(placed) and find(scene, placed[-1][-1]) is place


def _call(action: str, *objects: str) -> str:
    return f"{action.upper().replace(' ', '_')}({', '.join(objects)})"
