"""The state machine that runs a scene's mechanisms, the same one in every simulator.

``Mechanisms`` reads the simulation through ``Reader`` and changes it only by limiting a joint's range and by changing a
joint's spring (``Joints``). It is updated once per control tick. Its state is JSON and belongs to every checkpoint.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Protocol

from memo_core.errors import InvalidArgument
from memo_core.scene.description import SceneDescription
from memo_core.scene.mechanism_checks import check_mechanisms
from memo_core.scene.mechanisms import Above, AllOf, Below, Condition, Lasting, Lock, Locked, Pressed, Spring, Times

_TIME_SLACK = 1e-9  # s; sums of time steps are not exact


# -- what a simulator gives -------------------------------------------------------------------------------------------


class Reader(Protocol):
    """Read access to the simulation: time (s), positions of joints (rad or m), and the force (N) with which the robot
    presses on a body. ``memo_core.interfaces.simulator.WorldState`` provides all of it.
    """

    @property
    def time(self) -> float: ...

    def joint_position(self, joint: str) -> float: ...

    def pressing(self, body: str) -> float: ...


class Joints(Protocol):
    """Required methods of a simulator. Both settings hold until changed and take effect with the next physics step."""

    def limit_joint(self, joint: str, lower: float, upper: float) -> None:
        """Keep the joint between these limits (rad or m; equal limits hold it), as firmly as its own range."""

    def spring_joint(self, joint: str, stiffness: float, rest: float) -> None:
        """Pull the joint to ``rest`` (rad or m) with this stiffness (Nm/rad or N/m) instead of any spring it had."""


# -- the state machine ------------------------------------------------------------------------------------------------


class Mechanisms:
    """State machine of a scene's mechanisms. Create it when the scene has been built, and call ``update`` after the
    last physics step of every control tick, before the tick's listeners.

    Args:
        scene: scene with the mechanisms and the joints, bodies and locks that they name.
        world: read access to the simulation that was built from the scene.
        joints: write access to its joints; their limits and springs are set at once, and on every change.

    Raises:
        InvalidArgument: if a mechanism names a joint, body or lock that the scene does not have, or its numbers are
            inconsistent.
    """

    def __init__(self, scene: SceneDescription, world: Reader, joints: Joints) -> None:
        self._joints = joints
        described = check_mechanisms(scene)
        self._pressing: dict[str, float] = {}
        self._at = world.joint_position
        self._world = world
        self._locks = tuple(_Bolt(lock, self._watch) for lock in scene.mechanisms if isinstance(lock, Lock))
        self._bolts = {bolt.lock.name: bolt for bolt in self._locks}
        self._springs = tuple(_Coil(one, self._watch) for one in scene.mechanisms if isinstance(one, Spring))
        held = dict.fromkeys(bolt.lock.joint for bolt in self._locks)
        sprung = dict.fromkeys(coil.spring.joint for coil in self._springs)
        self._held = {joint: described[joint].range for joint in held}
        self._sprung = {joint: (described[joint].stiffness, described[joint].rest) for joint in sprung}
        if scene.mechanisms:
            self._set_all()

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._locks or self._springs)

    @property
    def engaged(self) -> dict[str, bool]:
        """Lock name -> whether it is engaged now."""
        return {bolt.lock.name: bolt.engaged for bolt in self._locks}

    def update(self) -> None:
        """Evaluate the conditions and set or release locks and springs. Must be called once per control tick."""
        self._pressing.clear()
        changed: set[str] = set()
        for bolt in self._locks:
            if bolt.turn(self._at):
                changed.add(bolt.lock.joint)
        for joint in changed:
            self._limit(joint)
        changed.clear()
        for coil in self._springs:
            if coil.turn():
                changed.add(coil.spring.joint)
        for joint in changed:
            self._pull(joint)

    def memory(self) -> dict[str, Any]:
        """Its state as JSON values for ``recall``."""
        return {"locks": [b.memory() for b in self._locks], "springs": [c.memory() for c in self._springs]}

    def recall(self, memory: dict[str, Any]) -> None:
        """Restore a state, and set the joints accordingly.

        Args:
            memory: result of ``memory`` for the same scene.

        Raises:
            InvalidArgument: if it is the memory of other mechanisms.
        """
        try:
            for bolt, kept in zip(self._locks, memory["locks"], strict=True):
                bolt.recall(kept)
            for coil, kept in zip(self._springs, memory["springs"], strict=True):
                coil.recall(kept)
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise InvalidArgument(
                "mechanisms' memory", f"is not of this scene ({error})", "what memory() gave for the same scene"
            ) from None
        self._set_all()

    def _set_all(self) -> None:
        for joint in self._held:
            self._limit(joint)
        for joint in self._sprung:
            self._pull(joint)

    def _limit(self, joint: str) -> None:
        lower, upper = self._held[joint]
        for bolt in self._locks:
            if bolt.engaged and bolt.lock.joint == joint:
                low, high = bolt.lock.holds
                # Where two engaged locks contradict each other the later one in the description wins.
                lower, upper = (low, high) if low > upper or high < lower else (max(lower, low), min(upper, high))
        self._joints.limit_joint(joint, lower, upper)

    def _pull(self, joint: str) -> None:
        stiffness, rest = self._sprung[joint]
        for coil in self._springs:
            if coil.acts and coil.spring.joint == joint:
                stiffness, rest = coil.spring.stiffness, coil.spring.rest
        self._joints.spring_joint(joint, stiffness, rest)

    def _watch(self, condition: Condition) -> _Watch:
        if isinstance(condition, Above):
            return _Threshold(self._at, condition.joint, condition.value, condition.slack, 1.0)
        if isinstance(condition, Below):
            return _Threshold(self._at, condition.joint, condition.value, condition.slack, -1.0)
        if isinstance(condition, Pressed):
            return _Force(self._pressing_on, condition)
        if isinstance(condition, Locked):
            return _Engaged(self._bolts_now, condition.lock)
        if isinstance(condition, Lasting):
            return _Timer(self._watch(condition.condition), condition.seconds, self._world)
        if isinstance(condition, Times):
            return _Counter(self._watch(condition.condition), condition, self._world)
        return _Group([self._watch(one) for one in condition.conditions], all if isinstance(condition, AllOf) else any)

    def _bolts_now(self, name: str) -> bool:
        return self._bolts[name].engaged

    def _pressing_on(self, body: str) -> float:
        """N, of the robot's link that presses hardest. Contact queries are expensive: cached per body and tick."""
        if body not in self._pressing:
            self._pressing[body] = self._world.pressing(body)
        return self._pressing[body]


class _Bolt:
    """The state of a lock."""

    def __init__(self, lock: Lock, watch: Callable[[Condition], _Watch]) -> None:
        self.lock = lock
        self.engaged = lock.engaged
        self._until = None if lock.until is None else watch(lock.until)
        self._again = None if lock.again is None else watch(lock.again)

    def turn(self, at: Callable[[str], float]) -> bool:
        """Evaluate the condition that is relevant now. Returns whether the lock was set or released."""
        watch = self._until if self.engaged else self._again
        if watch is None or not watch.now():
            return False
        low, high = self.lock.holds
        if not self.engaged and not low <= at(self.lock.joint) <= high:
            return False
        self.engaged = not self.engaged
        watch.forget()
        other = self._until if self.engaged else self._again
        if other is not None:
            other.forget()
        return True

    def memory(self) -> list[Any]:
        return [self.engaged, *(None if watch is None else watch.memory() for watch in (self._until, self._again))]

    def recall(self, memory: list[Any]) -> None:
        self.engaged = bool(memory[0])
        for watch, kept in zip((self._until, self._again), memory[1:], strict=True):
            if watch is not None:
                watch.recall(kept)


class _Coil:
    """The state of a switched spring."""

    def __init__(self, spring: Spring, watch: Callable[[Condition], _Watch]) -> None:
        self.spring = spring
        self.acts = False
        self._when = watch(spring.when)

    def turn(self) -> bool:
        acts, self.acts = self.acts, self._when.now()
        return acts != self.acts

    def memory(self) -> list[Any]:
        return [self.acts, self._when.memory()]

    def recall(self, memory: list[Any]) -> None:
        acts, kept = memory
        self.acts = bool(acts)
        self._when.recall(kept)


class _Watch(ABC):
    """A condition being monitored. ``now`` is evaluated at most once per tick, and every tick while the condition is
    relevant."""

    @abstractmethod
    def now(self) -> bool: ...

    def forget(self) -> None:
        """Reset."""

    def memory(self) -> Any:
        return None

    def recall(self, memory: Any) -> None:
        """Restore the result of ``memory``."""


class _Threshold(_Watch):
    def __init__(self, at: Callable[[str], float], joint: str, value: float, slack: float, sign: float) -> None:
        self._at, self._joint, self._sign = at, joint, sign
        self._set, self._reset = sign * value, sign * value - slack
        self._holds = False

    def now(self) -> bool:
        self._holds = self._sign * self._at(self._joint) > (self._reset if self._holds else self._set)
        return self._holds

    def forget(self) -> None:
        self._holds = False

    def memory(self) -> bool:
        return self._holds

    def recall(self, memory: Any) -> None:
        self._holds = bool(memory)


class _Force(_Watch):
    def __init__(self, pressing: Callable[[str], float], condition: Pressed) -> None:
        self._pressing, self._body, self._force = pressing, condition.body, condition.force

    def now(self) -> bool:
        return self._pressing(self._body) >= self._force


class _Engaged(_Watch):
    def __init__(self, engaged: Callable[[str], bool], lock: str) -> None:
        self._engaged, self._lock = engaged, lock

    def now(self) -> bool:
        return self._engaged(self._lock)


class _Timer(_Watch):
    def __init__(self, inner: _Watch, seconds: float, world: Reader) -> None:
        self._inner, self._seconds, self._world = inner, seconds, world
        self._since: float | None = None

    def now(self) -> bool:
        if not self._inner.now():
            self._since = None
            return False
        time = self._world.time
        if self._since is None:
            self._since = time
        return time - self._since >= self._seconds - _TIME_SLACK

    def forget(self) -> None:
        self._since = None
        self._inner.forget()

    def memory(self) -> list[Any]:
        return [self._since, self._inner.memory()]

    def recall(self, memory: Any) -> None:
        since, kept = memory
        self._since = None if since is None else float(since)
        self._inner.recall(kept)


class _Counter(_Watch):
    def __init__(self, inner: _Watch, condition: Times, world: Reader) -> None:
        self._inner, self._count, self._within, self._world = inner, condition.count, condition.within, world
        self._before: bool | None = None
        self._seen: list[float] = []  # when it became true, the last so many times
        self._done = False

    def now(self) -> bool:
        holds = self._inner.now()
        if holds and self._before is False:
            time = self._world.time
            self._seen = [*self._seen, time][-self._count :]
            enough = len(self._seen) == self._count
            self._done = self._done or (enough and time - self._seen[0] <= self._within + _TIME_SLACK)
        self._before = holds
        return self._done

    def forget(self) -> None:
        self._before, self._seen, self._done = None, [], False
        self._inner.forget()

    def memory(self) -> list[Any]:
        return [self._before, self._seen, self._done, self._inner.memory()]

    def recall(self, memory: Any) -> None:
        before, seen, done, kept = memory
        self._before, self._done = None if before is None else bool(before), bool(done)
        self._seen = [float(time) for time in seen]
        self._inner.recall(kept)


class _Group(_Watch):
    def __init__(self, inner: list[_Watch], combine: Callable[[list[bool]], bool]) -> None:
        self._inner, self._combine = inner, combine

    def now(self) -> bool:
        # All of them, also where one decides: each must be asked every tick.
        return self._combine([watch.now() for watch in self._inner])

    def forget(self) -> None:
        for watch in self._inner:
            watch.forget()

    def memory(self) -> list[Any]:
        return [watch.memory() for watch in self._inner]

    def recall(self, memory: Any) -> None:
        for watch, kept in zip(self._inner, memory, strict=True):
            watch.recall(kept)
