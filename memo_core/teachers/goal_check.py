"""Whether a task's goal can be judged by looking: what the simulated teacher would have to see."""

from __future__ import annotations

from collections.abc import Sequence

from memo_core.interfaces.teacher import TaskEpisode
from memo_core.scene.description import SceneDescription
from memo_core.teachers.visible import Seen
from memo_core.teachers.visible_goal import FORMS, holds, read_goal


def unseen_goal(goal: Sequence[str], scene: SceneDescription) -> list[str]:
    """What of a goal the simulated teacher cannot see, a line each; empty where each sentence has a known form and
    names things of the scene."""
    if not goal:
        return ["it has no goal sentences"]
    labels = labels_of(scene)
    found = []
    for sentence in goal:
        condition = read_goal(sentence)
        if condition is None:
            found.append(f"{sentence!r} has none of the {len(FORMS)} known forms")
            continue
        named = (*condition.subjects, *([condition.place] if condition.place else []))
        unknown = [name for name in named if not is_named(name, labels)]
        found += [f"{sentence!r} names {name!r}, which is none of {', '.join(sorted(labels))}" for name in unknown]
    return found


def unmet_goal(episode: TaskEpisode) -> list[str]:
    """Sentences of its goal that the simulated teacher does not see fulfilled at the end of an episode, a line each.
    Those that it cannot read are left out (``unseen_goal``)."""
    seen, found = Seen(episode.before, episode.after, episode.sightings), []
    for sentence in episode.goal:
        condition = read_goal(sentence)
        so = True if condition is None else holds(condition, seen)
        if not so:
            found.append(f"{sentence!r} " + ("cannot be judged" if so is None else "is not fulfilled"))
    return found


def labels_of(scene: SceneDescription) -> set[str]:
    """What things, parts, heaps and cavities of a scene are called, in lower case, and the table."""
    found = {"table"}
    for body, _ in scene.walk():
        found |= {body.label, body.heap, *(part.label for part in body.parts), *(c.label for c in body.cavities)}
    return {label.lower() for label in found if label}


def is_named(name: str, labels: set[str]) -> bool:
    """A label, or a thing told by its place: "the left can", "the lonely object", "the others"."""
    if name in labels or name in ("others", "other objects", "lonely object"):
        return True
    side, _, kind = name.partition(" ")
    return side in ("left", "right") and sum(label.split()[-1] == kind for label in labels) > 1
