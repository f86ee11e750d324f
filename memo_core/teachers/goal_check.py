"""Whether a task's goal can be judged by looking: what the simulated teacher would have to see."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence

from memo_core.interfaces.teacher import TaskEpisode
from memo_core.scene.description import SceneDescription
from memo_core.scene.graph import SceneGraph
from memo_core.teachers.visible import Seen
from memo_core.teachers.visible_goal import FORMS, Condition, holds, read_goal


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
            found.append(f"{sentence!r} has none of the {len(FORMS)} known forms{_meant(sentence)}")
            continue
        named = (*condition.subjects, *([condition.place] if condition.place else []))
        unknown = [name for name in named if not is_named(name, labels)]
        found += [f"{sentence!r} names {name!r}, which is none of {', '.join(sorted(labels))}" for name in unknown]
    return found


def unmet_goal(episode: TaskEpisode) -> list[str]:
    """Sentences of its goal that the simulated teacher, or a planner by the scene's relations, does not see fulfilled
    at the end of an episode, a line each. Those that it cannot read are left out (``unseen_goal``)."""
    seen, found = Seen(episode.before, episode.after, episode.sightings), []
    for sentence in episode.goal:
        condition = read_goal(sentence)
        so = True if condition is None else holds(condition, seen)
        if not so:
            found.append(f"{sentence!r} " + ("cannot be judged" if so is None else "is not fulfilled"))
        elif condition is not None and (reported := _reported_elsewhere(condition, seen)):
            found.append(f"{sentence!r} is fulfilled, but planners read {reported!r}")
    return found


def met_at_start(goal: Sequence[str], scene: SceneGraph) -> bool:
    """Whether the simulated teacher sees a whole goal fulfilled before anything has moved."""
    seen, conditions = Seen(scene, scene), [read_goal(sentence) for sentence in goal]
    return bool(goal) and all(condition is not None and holds(condition, seen) for condition in conditions)


def _reported_elsewhere(condition: Condition, seen: Seen) -> str:
    """The scene's sentence that a thing is in or on something else than the goal says; empty if there is none."""
    if condition.form not in ("in", "on"):
        return ""
    things = {id for name in condition.subjects for id in seen.ids(name)}
    places = {"table"} if condition.place == "table" else set(seen.ids(condition.place))
    places |= {node.id for node in seen.after.nodes if node.part_of in places}
    told = zip(seen.after.relations, seen.after.sentences(), strict=True)
    about = [(r, said) for r, said in told if r.subject in things and r.predicate in ("in", "on")]
    right = {r.subject for r, _ in about if r.object in places}
    return next((said for r, said in about if r.subject not in right), "")


def _meant(sentence: str) -> str:
    """Suggestion of the sentence of a known form that differs in one word, spelt alike."""
    words, known = sentence.lower().rstrip(".").split(), re.findall(r"[a-z]+", " ".join(form for _, form in FORMS))
    for place, word in enumerate(words):
        for other in difflib.get_close_matches(word, known, n=3, cutoff=0.5):
            meant = " ".join([*words[:place], other, *words[place + 1 :]])
            if read_goal(meant) is not None:
                return f"; did you mean {meant!r}?"
    return ""


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
