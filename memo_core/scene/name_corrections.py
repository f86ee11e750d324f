"""What people say of names: "that is not a cup", "that is not a cup, it is a salt shaker", "the tin is actually a can".

A correction holds for the thing that it was said of, and in other scenes for what is called the same and looks alike:
about as large, and of the same main colour.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import attrs

from memo_core.scene.graph import Node, SceneGraph
from memo_core.text.reading_limits import too_long

UNKNOWN = "unknown thing"  # what a thing is called of which people only said what it is not
_UNSURE = 0.3  # most confidence in it
_SIZE = (0.01, 0.25)  # m, and share, by which the extents of things that look alike may differ
_LONGEST = 4  # words of a name
_LONGEST_CLAUSE = 200  # characters of one that is about a name: the patterns below take the square of its length
_ABOUT_ELSE = "…"  # in place of a longer clause

_THING = (
    r"(?:it|that|this|that one|this one|the thing in (?:the|your) hand|"
    r"(?:what you call )?(?:the |an? )?(?P<subject>[a-z][a-z0-9' -]*?))"
)
_IS_NOT = re.compile(
    rf"{_THING}(?:(?:'s| is) not|(?: is|')n't| isnt) (?P<article>an?|the|any|called) (?P<label>[a-z][a-z0-9' -]*)"
)
_IS = re.compile(
    rf"{_THING}(?:'s| is)(?P<sure> actually| really| in fact)?(?: called)? (?:an?|some|the) "
    r"(?P<instead>[a-z][a-z' -]*?)(?P<again> after all)?"
)
_RATHER = re.compile(r"(?:rather |call it )?(?:an?|some|the) (?P<instead>[a-z][a-z' -]*)")
_NOT = re.compile(r"not an? (?P<label>[a-z][a-z0-9' -]*)")
_CLAUSES = re.compile(r"\s*(?:[,;:.!?–—]+|\s-+\s|\bbut\b)\s*")
_FILLERS = re.compile(r"^(?:(?:no|but|hey|well|and|so|sorry|nope|look|actually|really|rather)\b\s*)+")


@attrs.frozen
class NameCorrection:
    """``label``: what the thing was called; ``instead``: what it is, empty if they did not say. ``id`` is its node's
    id in this run; empty: the correction is from another run and holds for what looks alike."""

    said: str  # verbatim
    who: str
    label: str
    instead: str = ""
    id: str = ""
    kind: str = "object"
    size: tuple[float, ...] = ()  # m, full extents, descending
    colour: str = ""  # main colour, in a word

    def elsewhere(self) -> NameCorrection:
        """The same for other scenes, where ids and the numbers of labels mean something else."""
        return attrs.evolve(self, id="", label=plain_label(self.label))

    def is_about(self, node: Node) -> bool:
        """Whether the correction applies to a node, named as perception names it."""
        if self.id:
            return self.id == node.id and plain_label(node.label) == plain_label(self.label)
        if plain_label(node.label) != self.label or node.kind != self.kind:
            return False
        if self.colour and node.attributes and self.colour not in node.attributes[:2]:
            return False
        near, share = _SIZE
        return all(
            abs(a - b) <= near + share * max(a, b) for a, b in zip(self.size, sorted(node.size)[::-1], strict=False)
        )


def read_name_corrections(
    words: str, scene: SceneGraph, who: str, about: Sequence[str] = ()
) -> tuple[NameCorrection, ...]:
    """What somebody's words say of the names in a scene; most words say nothing of them. ``about``: the labels of the
    things that they were said of, which "that" refers to; otherwise it is the only thing with the name."""
    found: dict[str, NameCorrection] = {}
    for node, instead in _said(words, scene, about)[0]:
        colour = node.attributes[0] if node.attributes else ""
        size = tuple(sorted(node.size)[::-1])
        found[node.id] = NameCorrection(words, who, node.label, instead, node.id, node.kind, size, colour)
    return tuple(found.values())


def says_only_names(words: str, scene: SceneGraph, about: Sequence[str] = ()) -> bool:
    """Whether the words say what things are called or not, and nothing else."""
    found, others = _said(words, scene, about)
    return bool(found) and not others


def corrected(graph: SceneGraph, corrections: Iterable[NameCorrection]) -> SceneGraph:
    """Scene graph with people's name corrections applied; node ids stay.

    Labels of parts follow: if a "cup" becomes a "mug", its "cup handle" becomes the "mug handle".

    Args:
        graph: scene graph as perception named it.
        corrections: corrections, oldest first; a later one sees the labels that earlier ones gave.

    Returns:
        The corrected graph, or ``graph`` itself if nothing changes. A node whose name was only denied is called
        ``UNKNOWN``, with a confidence of at most 0.3; a label that is taken is numbered.
    """
    nodes = list(graph.nodes)
    for one in corrections:
        for place, node in enumerate(nodes):
            if not one.is_about(node):
                continue
            name = one.instead or UNKNOWN
            label = _unused(name, {other.label for other in nodes if other is not node})
            sure = node.confidence if one.instead else min(node.confidence, _UNSURE)
            nodes[place] = attrs.evolve(node, label=label, confidence=sure)
            before = node.label + " "
            if one.instead:
                owned = _owned(nodes, node.id)
                for i, part in enumerate(nodes):
                    if part.id in owned and part.label.startswith(before):
                        nodes[i] = attrs.evolve(part, label=f"{label} {part.label[len(before) :]}")
    return attrs.evolve(graph, nodes=tuple(nodes)) if nodes != list(graph.nodes) else graph


def plain_label(label: str) -> str:
    """The label without the number that tells it from others."""
    word, _, number = label.rpartition(" ")
    return word if word and number.isdigit() else label


def _owned(nodes: Sequence[Node], id: str) -> set[str]:
    owned = {id}
    while more := {node.id for node in nodes if node.part_of in owned} - owned:
        owned |= more
    return owned - {id}


def _unused(name: str, labels: set[str]) -> str:
    label, number = name, 2
    while label in labels:
        label, number = f"{name} {number}", number + 1
    return label


def _said(words: str, scene: SceneGraph, about: Sequence[str]) -> tuple[list[tuple[Node, str]], int]:
    """The things whose names are corrected, each with the name that it is given or none, and the number of clauses that
    say something else. Words that are too long are not read."""
    if too_long(words):
        return [], 1
    text = " ".join(words.lower().replace("\u2019", "'").split())
    clauses = [clause for clause in (_FILLERS.sub("", one) for one in _CLAUSES.split(text)) if clause]
    clauses = [clause if len(clause) <= _LONGEST_CLAUSE else _ABOUT_ELSE for clause in clauses]
    about = [name.lower() for name in about]
    found: list[tuple[Node, str]] = []
    others, place = 0, 0
    while place < len(clauses):
        clause, after = clauses[place], clauses[place + 1] if place + 1 < len(clauses) else ""
        place += 1
        if said := _IS_NOT.fullmatch(clause):
            rather = _IS.fullmatch(after) or _RATHER.fullmatch(after)
            instead = _name(rather["instead"]) if rather else ""
            node = _meant(said["subject"], said["label"], instead, said["article"] == "the", scene, about)
            place += bool(instead)
        elif said := _IS.fullmatch(clause):
            denied = _NOT.fullmatch(after)
            instead = _name(said["instead"]) if denied or said["sure"] or said["again"] else ""
            label = denied["label"] if denied else ""
            node = _meant(said["subject"], label, instead, False, scene, about) if instead else None
            place += bool(denied)
        else:
            node = None
        if node is None:
            others += 1
        else:
            found.append((node, instead))
    # "That isn't a door! Just draw it out." tells how it moves, not what it is.
    labels = {plain_label(node.label.lower()) for node in scene.nodes}
    return [one for one in found if not others or (one[1] and one[1] not in labels)], others


def _meant(
    subject: str | None, label: str, instead: str, definite: bool, scene: SceneGraph, about: Sequence[str]
) -> Node | None:
    """The node whose name is corrected; None where the words are about something else than a name."""
    if label and not _name(label):
        return None  # "that is not a good idea"
    subject, label = _name(subject), _name(label)
    labels = {node.label.lower() for node in scene.nodes}
    if definite and (not instead or instead in labels):
        return None  # "that is not the cup": another one is meant, or another thing altogether
    if subject and label and plain_label(subject) != plain_label(label):
        return None  # "the bowl is not a cup": it was not called one
    wanted = label or subject
    if wanted:
        named = [node for node in scene.nodes if plain_label(node.label.lower()) == plain_label(wanted)]
        exact = [node for node in named if node.label.lower() in (label, subject) and plain_label(wanted) != wanted]
        named = exact or named
    else:
        named = [node for node in scene.nodes if node.label.lower() in about[:1]]
    chosen = [node for node in named if node.label.lower() in about] or named
    chosen = [node for node in chosen if node.kind != "space" and node.label.lower() != instead]
    return chosen[0] if len(chosen) == 1 else None


def _name(text: str | None) -> str:
    """A name as it is used for a label; empty for what is none."""
    words = (text or "").strip(" '-").split()
    if not words or len(words) > _LONGEST or words[-1] in _NO_NAMES or words[0] in _NO_NAMES:
        return ""
    return " ".join(words)


_NO_NAMES = frozenset(
    ("one", "thing", "way", "problem", "place", "time", "point", "idea", "good", "bad", "right", "wrong", "other", "it")
    + ("that", "this", "bit", "lot", "too", "very", "so", "mess", "mistake", "disaster", "shame", "joke", "which")
    + ("little", "far", "much", "close", "slow", "fast")
)  # fmt: skip
