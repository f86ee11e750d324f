"""An inventory from a scene description: what stands on the table, without where. In a simulation it takes the place of
the list that a person would write."""

from __future__ import annotations

from memo_core.plugin import SceneDescription
from memo_perception.cameras.inventory import Item, Kind
from memo_perception.heaps import heaps
from memo_perception.labelled_things import Thing, labelled_things


def items_of(scene: SceneDescription) -> tuple[Item, ...]:
    """One line for each labelled thing, part, inside and heap."""
    things = list(labelled_things(scene))
    labels = {thing.id: thing.label for thing in things}
    items = [_item(thing, labels) for thing in things]
    items += [Item(heap.label, "heap", colours=heap.attributes[:1]) for heap in heaps(scene)]
    return tuple(items)


def _item(thing: Thing, labels: dict[str, str]) -> Item:
    kind: Kind = thing.kind  # type: ignore[assignment]
    owner = labels.get(thing.part_of or "", "")
    made_of = thing.body.made_of
    colours = tuple(word for word in thing.attributes if word != made_of)[:2]
    return Item(thing.label, kind, owner, colours, thing.size)
