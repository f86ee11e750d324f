"""A kinematic ``Control`` for tests of code without physics: a point hand in free space that carries what it grasps.

It varies with its input: objects are where they were put, a grasp succeeds only where something of fitting width is
between the fingers, positions beyond the reach are refused before anything moves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import attrs

from memo_core.errors import MotionError, Stopped
from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.skills.control import Control, Waypoints

STROKE = 0.08  # m
_GIVES_WAY = 0.03  # m that pressing goes to find something


@attrs.define
class FakeControl(Control):
    """A point hand. ``trail`` are the positions it reached (m), ``commands`` the names of everything that acted.

    ``stop_after`` latches the stop once that many commands were accepted, as a person pressing the button would;
    ``stopped`` reads the latch.
    """

    nodes: tuple[Node, ...] = attrs.field(factory=lambda: tabletop_nodes())
    reach: float = 0.85  # m from the base
    floor: float = 0.0  # m, height below which the hand may not go
    stop_after: int | None = None
    pose: Pose = attrs.field(factory=lambda: Pose((0.4, 0.0, 0.4), (0.0, 1.0, 0.0, 0.0)))
    width: float = STROKE
    held: str | None = None  # id
    trail: list[tuple[float, float, float]] = attrs.field(factory=list)
    commands: list[str] = attrs.field(factory=list)
    on_command: Callable[[str], None] | None = None
    time: float = 0.0  # s
    _seen: tuple[Node, ...] = attrs.field(init=False)
    _felt: tuple[float, ...] = attrs.field(init=False, default=(0.0, 0.0, 0.0))
    _latched: bool = attrs.field(init=False, default=False)

    def __attrs_post_init__(self) -> None:
        self._seen = self.nodes

    # -- the stop ------------------------------------------------------------------------------------------------------
    def stop(self) -> None:
        self._latched = True

    def release(self) -> None:
        self._latched = False

    def stopped(self) -> bool:
        return self._latched

    def _command(self, name: str) -> None:
        if self._latched:
            raise Stopped(name)
        if self.stop_after is not None and len(self.commands) >= self.stop_after:
            self._latched = True
            raise Stopped(name)
        self.commands.append(name)
        if self.on_command is not None:
            self.on_command(name)

    # -- perception ----------------------------------------------------------------------------------------------------
    def scene(self) -> SceneGraph:
        seen = Observation(self.pose, self.width, self.held is not None)
        return SceneGraph(self._seen, self._relations(), seen, self.floor, "table", self.time)

    def look(self) -> SceneGraph:
        self._command("look")
        self._seen = self.nodes
        return self.scene()

    def _relations(self) -> tuple[Relation, ...]:
        held = (Relation(self.held, "held"),) if self.held else ()
        resting = tuple(
            Relation(node.id, "on", "table")
            for node in self._seen
            if node.kind == "object" and node.id != self.held and abs(node.bounds()[0][2] - self.floor) < 0.005
        )
        return held + resting

    # -- the hand ------------------------------------------------------------------------------------------------------
    def tool_pose(self) -> Pose:
        return self.pose

    def gripper_width(self) -> float:
        return self.width

    def holding(self) -> bool:
        return self.held is not None

    def open_gripper(self, width: float | None) -> float:
        self._command("open_gripper")
        self.width = STROKE if width is None else min(width, STROKE)
        if self.held is not None and self.width > self._across(self._node(self.held)):
            self._drop()
        return self.width

    def close_gripper(self, force: float | None) -> float:
        self._command("close_gripper")
        if self.held is None:
            for node in self.nodes:
                if node.kind == "object" and self._between_fingers(node):
                    self.held = node.id
                    break
        self.width = self._across(self._node(self.held)) if self.held else 0.0
        return self.width

    def _node(self, identity: str) -> Node:
        return next(node for node in self.nodes if node.id == identity)

    def _across(self, node: Node) -> float:
        return min(node.size[0], node.size[1])

    def _between_fingers(self, node: Node) -> bool:
        offset = [abs(a - b) for a, b in zip(self.pose.position, node.pose.position, strict=True)]
        inside = all(o <= extent / 2 for o, extent in zip(offset, node.size, strict=True))
        return inside and self._across(node) < self.width

    def _drop(self) -> None:
        fallen = self._node(self.held or "")
        x, y, _ = fallen.pose.position
        self._place(fallen.id, (x, y, self.floor + fallen.size[2] / 2))
        self.held = None

    def _place(self, identity: str, position: tuple[float, float, float]) -> None:
        self.nodes = tuple(
            attrs.evolve(node, pose=Pose(position, node.pose.orientation)) if node.id == identity else node
            for node in self.nodes
        )

    # -- motion --------------------------------------------------------------------------------------------------------
    def move_to(
        self, position: list[float], orientation: list[float] | None, then: Waypoints | None, slack: float, speed: float
    ) -> None:
        self._refuse("move_to", [(position, orientation), *(then or [])])
        self._command("move_to")
        self._go(position, orientation, speed)

    def follow_path(self, path: Waypoints, then: Waypoints | None, slack: float, speed: float) -> None:
        self._refuse("follow_path", [*path, *(then or [])])
        self._command("follow_path")
        for position, orientation in path:
            self._go(position, orientation, speed)

    def go_home(self) -> None:
        self._command("go_home")
        self._go([0.4, 0.0, 0.4], [0.0, 1.0, 0.0, 0.0], 1.0)

    def wait(self, seconds: float) -> None:
        self._command("wait")
        self.time += seconds

    # -- force: everything solid is hard, and only what the hand is pressed on pushes back -----------------------------
    def contact_force(self) -> list[float]:
        return list(self._felt)

    def move_until_contact(self, direction: list[float], distance: float, force: float, speed: float) -> float:
        end = [p + distance * d for p, d in zip(self.pose.position, direction, strict=True)]
        if math.hypot(*end) > self.reach:
            self._refuse("move_until_contact", [(end, None)])
        self._command("move_until_contact")
        free = min(self._free_way(direction), distance)
        self._go([p + free * d for p, d in zip(self.pose.position, direction, strict=True)], None, 2 * speed)
        if free >= distance:
            raise MotionError(
                "move_until_contact", f"nothing was felt within {100 * distance:.1f} cm", cause="no-contact"
            )
        self._felt = tuple(-force * d for d in direction)
        return free

    def press(self, direction: list[float], force: float, seconds: float) -> float:
        self._press("press", direction, force)
        self.time += seconds
        return force

    def press_along(self, skill: str, path: Waypoints, direction: list[float], force: float, speed: float) -> float:
        self._refuse(skill, path)
        self._press(skill, direction, force)
        for position, orientation in path:
            above = [p - _GIVES_WAY * d for p, d in zip(position, direction, strict=True)]
            free = self._free_way(direction, above)
            if free > 2 * _GIVES_WAY:
                raise MotionError(skill, "contact was lost", cause="no-contact")
            self._go([p + free * d for p, d in zip(above, direction, strict=True)], orientation, 2 * speed)
        self._felt = tuple(-force * d for d in direction)
        return force

    def spiral_search(
        self, direction: list[float], radius: float, force: float, depth: float, pitch: float
    ) -> list[float]:
        self._press("spiral_search", direction, force)
        raise MotionError("spiral_search", f"no place was found within {1000 * radius:.1f} mm", cause="no-contact")

    def _press(self, skill: str, direction: list[float], force: float) -> None:
        self._command(skill)
        if (free := self._free_way(direction)) > _GIVES_WAY:
            raise MotionError(skill, f"nothing to press against within {100 * _GIVES_WAY:.0f} cm", cause="no-contact")
        self._go([p + free * d for p, d in zip(self.pose.position, direction, strict=True)], None, 0.1)
        self._felt = tuple(-force * d for d in direction)

    def _free_way(self, direction: list[float], origin: Sequence[float] | None = None) -> float:
        """m from the hand, or a point, along a unit direction to the table or a thing's box."""
        origin = self.pose.position if origin is None else origin
        nearest = math.inf
        if direction[2] < -1e-9:
            nearest = (origin[2] - self.floor) / -direction[2]
        for node in self.nodes:
            if node.kind == "space" or node.id == self.held:
                continue
            turned = node.pose.inverse()
            start = turned.apply(origin).tolist()
            along = (turned.rotation @ direction).tolist()
            enters, leaves = 0.0, math.inf
            for at, step, extent in zip(start, along, node.size, strict=True):
                if abs(step) < 1e-9:
                    enters = math.inf if abs(at) > extent / 2 else enters
                    continue
                bounds = sorted(((-extent / 2 - at) / step, (extent / 2 - at) / step))
                enters, leaves = max(enters, bounds[0]), min(leaves, bounds[1])
            if enters <= leaves:
                nearest = min(nearest, enters)
        return max(nearest, 0.0)

    def _refuse(self, skill: str, path: Waypoints) -> None:
        for position, _ in path:
            shown = "[" + ", ".join(f"{v:.3f}" for v in position) + "]"
            if math.hypot(*position) > self.reach:
                raise MotionError(skill, f"{shown} is {math.hypot(*position):.3f} m away, {self.reach} m at most")
            if position[2] < self.floor:
                raise MotionError(skill, f"{shown} is inside the table", cause="collision")

    def _go(self, position: list[float], orientation: list[float] | None, speed: float) -> None:
        start = self.pose.position
        self._felt = (0.0, 0.0, 0.0)
        self.time += math.dist(start, position) / (0.5 * speed)
        target = (position[0], position[1], position[2])
        self.pose = Pose(target, tuple(orientation) if orientation is not None else self.pose.orientation)
        self.trail.append(target)
        if self.held is not None:
            carried = self._node(self.held).pose.position
            moved = [c + b - a for c, a, b in zip(carried, start, target, strict=True)]
            self._place(self.held, (moved[0], moved[1], moved[2]))


def tabletop_nodes() -> tuple[Node, ...]:
    """Two cubes, a bowl and a cabinet with a door, its handle and its visible inside, on a table at z = 0."""
    return (
        Node("red_cube", "red cube", Pose((0.45, 0.1, 0.025)), (0.05, 0.05, 0.05)),
        Node("blue_cube", "blue cube", Pose.from_yaw((0.5, -0.15, 0.025), 0.3), (0.05, 0.05, 0.05)),
        Node("bowl", "bowl", Pose((0.35, -0.25, 0.03)), (0.16, 0.16, 0.06)),
        Node("cabinet", "cabinet", Pose((0.7, 0.15, 0.15)), (0.2, 0.3, 0.3), kind="fixture"),
        Node("cabinet/door", "cabinet door", Pose((0.595, 0.15, 0.15)), (0.01, 0.3, 0.3), "cabinet", "part"),
        Node("cabinet/handle", "cabinet handle", Pose((0.56, 0.05, 0.15)), (0.02, 0.02, 0.12), "cabinet", "part"),
        Node(
            "cabinet/inside",
            "cabinet inside",
            Pose((0.7, 0.15, 0.15)),
            (0.18, 0.28, 0.28),
            "cabinet",
            "space",
            (-1.0, 0.0, 0.0),
        ),
    )
