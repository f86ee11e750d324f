"""Relations that follow from boxes alone, the same for ground truth and cameras."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from memo_core.plugin import Node, Relation, arrangement, containment, support


def spatial_relations(nodes: Sequence[Node], held: Node | None, table_height: float) -> Iterator[Relation]:
    """What is held, in, on and beside what. ``held``: what the gripper holds; ``table_height``: m, base frame."""
    if held is not None:
        yield Relation(held.id, "held")
    held_ids = {held.id} if held else set()
    inside = containment(nodes)
    on = support(nodes, table_height, held_ids, inside)
    yield from inside
    yield from on
    related = [(r.subject, r.object) for r in [*inside, *on] if r.object]
    yield from arrangement([node for node in nodes if node.id not in held_ids], related)
