"""What a person could name in a scene description: labelled bodies, their parts and their insides."""

from __future__ import annotations

from collections.abc import Iterator

import attrs

from memo_core.plugin import Body, Cavity, Free, InvalidArgument, Pose, SceneDescription, appearance
from memo_perception.ground_truth_boxes import body_box, loose_pieces


@attrs.frozen(eq=False)
class Thing:
    """One thing that may be visible, posed in the frame of the body that carries it."""

    id: str
    label: str
    kind: str
    body: Body
    pose: Pose
    size: tuple[float, float, float]
    part_of: str | None
    cavity: Cavity | None = None
    droppable: str | None = None  # id of the free object it belongs to
    lineage: tuple[str, ...] = ()  # names of its body and that body's ancestors
    door: str | None = None  # of a cavity: name of the body that closes it
    pieces: tuple[str, ...] = ()  # bodies without a name of their own that belong to it and move: its box is theirs too
    attributes: tuple[str, ...] = ()  # what it looks like, in words


def labelled_things(scene: SceneDescription) -> Iterator[Thing]:
    """All of them, whole things before their parts. Raises ``InvalidArgument`` for a label on nothing, or an id used
    twice."""
    taken = {body.name for body, _ in scene.walk()}
    movers = {joint: body.name for body, _ in scene.walk() if (joint := getattr(body.joint, "name", None))}
    owners: dict[str, tuple[str | None, str | None]] = {}  # body -> (nearest labelled node, free object it belongs to)
    lineages: dict[str, tuple[str, ...]] = {}
    for body, parent in scene.walk():
        owner, loose = owners[parent.name] if parent is not None else (None, None)
        lineage = lineages[body.name] = (body.name, *(lineages[parent.name] if parent is not None else ()))
        if body.label and not body.fixture and (owner is None or isinstance(body.joint, Free)):
            loose = body.name
        if body.label:
            yield attrs.evolve(_body_thing(body, owner, loose), lineage=lineage)
            owner = body.name
        owners[body.name] = (owner, loose)
        for part in body.parts:
            id = _unique(part.id, body, taken)
            seen = Thing(id, part.label, "part", body, part.pose, part.size, owner, None, loose, lineage)
            yield attrs.evolve(seen, attributes=appearance(body, part))
        for cavity in body.cavities:
            id = _unique(cavity.id, body, taken)
            door = movers.get(cavity.door or "")
            yield Thing(id, cavity.label, "space", body, cavity.pose, cavity.size, owner, cavity, loose, lineage, door)


def _body_thing(body: Body, owner: str | None, loose: str | None) -> Thing:
    box = body_box(body)
    if box is None:
        raise InvalidArgument(f"scene body {body.name!r}", "a label but no geoms: it cannot be seen", "geoms")
    independent = owner is None or isinstance(body.joint, Free)
    kind = "fixture" if independent and body.fixture else "object" if independent else "part"
    part_of = None if independent else owner
    pieces, looks = loose_pieces(body), appearance(body)
    return Thing(body.name, body.label, kind, body, *box, part_of, None, loose, pieces=pieces, attributes=looks)


def _unique(id: str, body: Body, taken: set[str]) -> str:
    if id in taken:
        id = f"{body.name}/{id}"
    if id in taken:
        raise InvalidArgument(f"scene body {body.name!r}", f"two things have the id {id!r}", "unique ids")
    taken.add(id)
    return id
