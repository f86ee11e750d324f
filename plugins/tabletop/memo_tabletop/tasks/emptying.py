"""Take things out of furniture with a door: empty the fridge, empty the cabinet, place the apple on the table."""

from __future__ import annotations

import math

import attrs
import numpy as np

from memo_core.plugin import Body, Monitor, Outcome, Pose, SceneDescription, Task, WorldState, shelf
from memo_tabletop import success_checks as checks
from memo_tabletop.furniture import STEEL, WALL, WHITE, WOOD, DoorHinge, Handle, cabinet
from memo_tabletop.monitors import Mishaps
from memo_tabletop.objects import BLUE, CRUST, GREEN, YELLOW, apple, block, cameras
from memo_tabletop.reference import solution

BROWN = (0.50, 0.34, 0.20, 1.0)


class TakeOut(Task):
    """Success: everything that was inside stands or lies on the table outside, set down rather than dropped, let go and
    at rest. The door may be open or shut."""

    furniture_name: str
    things: tuple[str, ...]
    table_places: tuple[tuple[float, float], ...]  # where the reference solution puts them

    def furniture(self, rng: np.random.Generator) -> Body:
        raise NotImplementedError

    def thing(self, name: str, place: tuple[float, float, float], yaw: float) -> Body:
        raise NotImplementedError

    def places(self, rng: np.random.Generator) -> list[tuple[float, float, float]]:
        """Where the things' undersides are, in the furniture's frame (m)."""
        raise NotImplementedError

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        furniture = self.furniture(rng)
        yaw = 2 * math.atan2(furniture.pose.orientation[3], furniture.pose.orientation[0])
        things = []
        for name, place in zip(self.things, self.places(rng), strict=True):
            x, y, z = (float(v) for v in furniture.pose.apply(place))
            things.append(self.thing(name, (x, y, z + 0.001), yaw + rng.uniform(-0.1, 0.1)))
        x, y, _ = furniture.pose.position
        return SceneDescription((furniture, *things), cameras((x, y, 0.2)))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(self.things),)

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        mishaps = monitors["mishaps"]
        assert isinstance(mishaps, Mishaps)
        angle = world.joint_position(f"{self.furniture_name}/hinge")
        out = {name: self._outside(world, name) for name in self.things}
        return checks.judge(
            f"on the table, out of the {self.furniture_name}: {', '.join(self.things)}",
            [
                *((out[name], f"the {name} is still in the {self.furniture_name}") for name in self.things),
                *((checks.on_table(world, name), f"the {name} is not on the table") for name in self.things),
                *(("dropped" not in mishaps.befell(name), "not everything was set down") for name in self.things),
                *(condition for name in self.things for condition in checks.let_go(world, name)),
            ],
            {"door_rad": angle, "taken_out": float(sum(out.values()))},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action == "OPEN":
            angle = world.joint_position(f"{self.furniture_name}/hinge")
            clear = self._described().cavities[0].size[1]
            width = checks.passage(angle, clear, clear + 2 * WALL)
            done = width >= checks.HAND_PASSAGE_M
            return Outcome(done, f"the door stands at {math.degrees(angle):.0f} degrees", {"door_rad": angle})
        if action in checks.PICKING:
            return checks.picked(world, self.things, names)
        if action in checks.PLACING and names and names[0] in self.things:
            on = checks.on_table(world, names[0]) and self._outside(world, names[0])
            done = on and checks.released(world, names[0])
            return Outcome(done, f"the {names[0]} is {'' if done else 'not '}on the table")
        return None

    def _described(self) -> Body:
        return self.furniture(np.random.default_rng(0))

    def _outside(self, world: WorldState, name: str) -> bool:
        """Whether its middle is not above the furniture's floor, that is neither in it nor on it."""
        furniture = self._described()
        frame = world.body_pose(self.furniture_name).inverse() * world.body_pose(name)
        low, high = checks.spread(furniture, Pose())
        x, y, _ = frame.position
        return not (low[0] <= x <= high[0] and low[1] <= y <= high[1])

    @property
    def reference_solution(self) -> str:
        name = self.furniture_name
        calls = f'open_door("{name}", math.radians(88))\n'
        for thing, (x, y) in zip(self.things, self.table_places, strict=True):
            calls += f'take_out("{thing}", "{name}", {x}, {y})\n'
        return solution("open_door", "take_out", calls=calls)


class EmptyTheFridge(TakeOut):
    """Milk and juice side by side on a shelf."""

    name = "empty-the-fridge"
    instruction = "empty the fridge"
    goal = (
        "the milk and the juice are on the table",
        "the hand has let go of the milk",
        "the hand has let go of the juice",
    )
    kind = "LH"
    furniture_name = "fridge"
    things = ("milk", "juice")
    table_places = ((0.42, -0.24), (0.40, -0.40))
    size = (0.30, 0.36, 0.50)  # depth, width, height
    shelf_top, shelf_depth = 0.22, 0.16

    def furniture(self, rng: np.random.Generator) -> Body:
        x, y = np.array([0.72, 0.05]) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        hinge = DoorHinge("left", math.radians(115))
        handle = Handle(length=0.20, distance=0.045, inset=0.03, height=0.30)
        fridge = cabinet("fridge", (x, y, 0.0), yaw, self.size, hinge, handle, WHITE, STEEL)
        board = shelf(self.size, WALL, self.shelf_top, self.shelf_depth)
        return attrs.evolve(fridge, geoms=(*fridge.geoms, board))

    def thing(self, name: str, place: tuple[float, float, float], yaw: float) -> Body:
        if name == "milk":
            return block(name, name, place, yaw, (0.045, 0.045, 0.11), 0.25, BLUE)
        return block(name, name, place, yaw, (0.045, 0.045, 0.09), 0.20, YELLOW)

    def places(self, rng: np.random.Generator) -> list[tuple[float, float, float]]:
        x = self.size[0] - WALL - self.shelf_depth + 0.045
        sides = (-0.05, 0.05) if rng.random() < 0.5 else (0.05, -0.05)
        return [(x + rng.uniform(-0.01, 0.01), side + rng.uniform(-0.005, 0.005), self.shelf_top) for side in sides]


class _Cabinet(TakeOut):
    furniture_name = "cabinet"
    size = (0.30, 0.36, 0.34)

    def furniture(self, rng: np.random.Generator) -> Body:
        x, y = np.array([0.70, 0.0]) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        hinge = DoorHinge("left", math.radians(110))
        handle = Handle(length=0.14, distance=0.045, inset=0.03, height=0.20)
        return cabinet("cabinet", (x, y, 0.0), yaw, self.size, hinge, handle, WOOD, BROWN, "wood")


class EmptyTheCabinet(_Cabinet):
    """A tea box and a sugar box on its floor."""

    name = "empty-the-cabinet"
    instruction = "empty the cabinet"
    goal = (
        "the tea box and the sugar box are on the table",
        "the hand has let go of the tea box",
        "the hand has let go of the sugar box",
    )
    kind = "SR"
    split = "held-out"
    things = ("tea box", "sugar box")
    table_places = ((0.42, -0.24), (0.40, -0.40))

    def thing(self, name: str, place: tuple[float, float, float], yaw: float) -> Body:
        if name == "tea box":
            return block(name, name, place, yaw, (0.05, 0.045, 0.08), 0.10, GREEN)
        return block(name, name, place, yaw, (0.05, 0.045, 0.06), 0.20, CRUST)

    def places(self, rng: np.random.Generator) -> list[tuple[float, float, float]]:
        sides = (-0.05, 0.05) if rng.random() < 0.5 else (0.05, -0.05)
        return [(0.12 + rng.uniform(-0.02, 0.02), side + rng.uniform(-0.005, 0.005), WALL) for side in sides]


class PlaceTheAppleOnTheTable(_Cabinet):
    """The apple is round and in the closed cabinet."""

    name = "place-the-apple-on-the-table"
    instruction = "place the apple on the table"
    goal = ("the apple is on the table", "the hand has let go of the apple")
    kind = "LH"
    split = "held-out"
    things = ("apple",)
    table_places = ((0.42, -0.28),)

    def thing(self, name: str, place: tuple[float, float, float], yaw: float) -> Body:
        return apple(name, place, yaw)

    def places(self, rng: np.random.Generator) -> list[tuple[float, float, float]]:
        return [(0.12 + rng.uniform(-0.03, 0.03), rng.uniform(-0.06, 0.06), WALL)]
