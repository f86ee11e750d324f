"""Checking that a scene's mechanisms can work: every name exists, and limits and numbers are consistent."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from memo_core.errors import InvalidArgument
from memo_core.scene.description import Hinge, SceneDescription, Slide
from memo_core.scene.mechanisms import Above, AllOf, AnyOf, Below, Condition, Lasting, Lock, Locked, Pressed, Times


def check_mechanisms(scene: SceneDescription) -> dict[str, Hinge | Slide]:
    """The scene's hinge and slide joints by name. Raises ``InvalidArgument`` for the first mechanism that cannot work,
    naming it and what is expected."""
    joints = {body.joint.name: body.joint for body, _ in scene.walk() if isinstance(body.joint, (Hinge, Slide))}
    bodies = tuple(body.name for body, _ in scene.walk())
    locks = [one.name for one in scene.mechanisms if isinstance(one, Lock)]
    for name in locks:
        if locks.count(name) > 1:
            raise InvalidArgument("scene", f"two locks are called {name!r}", "unique names")
    for one in scene.mechanisms:
        where = f"lock {one.name!r}" if isinstance(one, Lock) else f"spring on {one.joint!r}"
        _known(where, "joint", one.joint, tuple(joints))
        if isinstance(one, Lock):
            _check_holds(where, one, joints[one.joint])
        elif one.stiffness < 0:
            raise InvalidArgument(where, f"has a stiffness of {one.stiffness}", "0 or more")
        roots = (one.until, one.again) if isinstance(one, Lock) else (one.when,)
        for root in roots:
            for condition in _walk(root):
                _check_condition(where, condition, tuple(joints), bodies, tuple(locks))
    return joints


def _check_holds(where: str, lock: Lock, joint: Hinge | Slide) -> None:
    low, high = lock.holds
    if not joint.range[0] <= low <= high <= joint.range[1]:
        raise InvalidArgument(where, f"holds {lock.holds}", f"(lower, upper) within the joint's range {joint.range}")
    if lock.engaged and not low <= joint.initial <= high:
        raise InvalidArgument(where, f"holds {lock.holds}, but its joint starts at {joint.initial}", "a start it holds")


def _check_condition(
    where: str, condition: Condition, joints: Sequence[str], bodies: Sequence[str], locks: Sequence[str]
) -> None:
    what = type(condition).__name__
    if isinstance(condition, (Above, Below)):
        _known(where, "joint", condition.joint, joints)
        if condition.slack < 0:
            raise InvalidArgument(where, f"{what} has a slack of {condition.slack}", "0 or more")
    elif isinstance(condition, Pressed):
        _known(where, "body", condition.body, bodies)
        if condition.force <= 0:
            raise InvalidArgument(where, f"{what} waits for {condition.force} N", "more than 0")
    elif isinstance(condition, Locked):
        _known(where, "lock", condition.lock, locks)
    elif isinstance(condition, Lasting):
        if condition.seconds <= 0:
            raise InvalidArgument(where, f"{what} waits for {condition.seconds} s", "more than 0")
    elif isinstance(condition, Times):
        if condition.count < 1:
            raise InvalidArgument(where, f"{what} waits for {condition.count} times", "1 or more")
        if condition.within <= 0:
            raise InvalidArgument(where, f"{what} gives {condition.within} s for it", "more than 0")
    elif not condition.conditions:
        raise InvalidArgument(where, f"{what} has no conditions", "at least one")


def _walk(condition: Condition | None) -> Iterator[Condition]:
    if condition is None:
        return
    yield condition
    if isinstance(condition, (Lasting, Times)):
        yield from _walk(condition.condition)
    elif isinstance(condition, (AllOf, AnyOf)):
        for one in condition.conditions:
            yield from _walk(one)


def _known(where: str, kind: str, name: str, known: Sequence[str]) -> None:
    if name not in known:
        raise InvalidArgument(where, f"there is no {kind} {name!r}", f"one of {', '.join(sorted(known)) or 'none'}")
