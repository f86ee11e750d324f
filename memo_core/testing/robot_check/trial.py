"""What a described robot does in a simulator: evidence for the dynamic rules and for the robot's page.

Every piece of evidence is taken once, when it is first asked for. Deterministic for one simulator and version.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable

import attrs
import numpy as np

from memo_core.arm.collision import Hit, RobotShape, obstacles_of
from memo_core.arm.control import ArmControl
from memo_core.arm.ik_seeds import seeds_of
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.simulated_link import SimulatorLink
from memo_core.errors import MemoError
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.interfaces.simulator import Simulator
from memo_core.interfaces.task import Task
from memo_core.robot.description import RobotDescription
from memo_core.robot.urdf.reading import Units, Urdf, read_urdf
from memo_core.scene.description import Body, Camera, Free, Geom, SceneDescription
from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Array, Pose, look_at, quaternion_from_rotation

_SWING = 0.25  # rad (a slide: m) out and back
_HOLD, _REST = 1.0, 0.6  # s
_CUBE = 0.04  # m
_GRIPPED = 0.7  # share of the stroke that a smaller gripper's cube has
_SEEDS = 24  # near starts a pose
PARTS_HELD = ("handle", "knob", "lever", "cap", "lid", "button")


@attrs.frozen(eq=False)
class Held:
    """One second at home without a new target."""

    drift: Array  # rad each joint is away from home at the end, shape (n,)
    ripple: Array  # rad/s, largest speed of each joint in the last 0.3 s
    touching: tuple[tuple[str, str], ...]  # contacts of the robot at the start
    problem: str = ""  # what the simulator said instead


@attrs.frozen(eq=False)
class Tracked:
    """One joint out and back: times (s) and angles (rad), all of shape (T,)."""

    joint: str
    time: Array
    wanted: Array
    reached: Array
    amplitude: float
    problem: str = ""

    @property
    def error(self) -> float:
        """rad, largest on the way."""
        return float(np.abs(self.reached - self.wanted).max()) if len(self.time) else math.inf

    @property
    def ripple(self) -> float:
        """rad/s, largest speed in the last 0.3 s, when it should rest."""
        period = float(self.time[1] - self.time[0])
        last = self.reached[-round(0.3 / period) :]
        return float(np.abs(np.diff(last)).max() / period)


@attrs.frozen
class Grasp:
    """How a cube was picked up; ``step`` is where it failed, empty when it was lifted and held."""

    step: str = ""
    why: str = ""
    width: float = 0.0  # m between the fingers when closed
    size: float = 0.0  # m, of the cube


@attrs.frozen
class TaskReach:
    """Of one task: what is grasped in it, and what of that no hand pose reaches."""

    task: str
    grasped: int
    unreached: tuple[str, ...]


class RobotTrial:
    """Tries one robot. ``make_simulator`` returns a new, unopened simulator."""

    def __init__(
        self, robot: RobotDescription, make_simulator: Callable[[], Simulator], tasks: Iterable[Task] = ()
    ) -> None:
        self.robot = robot
        self._make = make_simulator
        self._tasks = tuple(tasks)

    @functools.cached_property
    def kinematics(self) -> Kinematics:
        return Kinematics(self.robot)

    @functools.cached_property
    def urdf(self) -> Urdf:
        return read_urdf(self.robot.urdf, self.robot.mesh_folder)

    @property
    def units(self) -> tuple[Units, ...]:
        """By joint: a slide's numbers are in other units than a turning joint's."""
        return tuple(self.urdf.joint(name).units for name in self.robot.joint_names)

    @functools.cached_property
    def shape(self) -> RobotShape:
        return RobotShape(self.robot, self.kinematics)

    @functools.cached_property
    def inertias(self) -> Array:
        """kg m2 that each joint moves at home, its armature included, shape (n,)."""
        import pinocchio as pin

        model = self.kinematics.model
        mass = np.asarray(pin.crba(model, model.createData(), self.shape.configuration(self.kinematics.home, 0.0)))
        places = [model.joints[number].idx_v for number in self.kinematics.joint_ids]
        return np.array([mass[i, i] + joint.armature for i, joint in zip(places, self.robot.joints, strict=True)])

    @functools.cached_property
    def weight_torques(self) -> Array:
        """Nm (a slide: N) with which each joint holds the arm's weight at home, shape (n,)."""
        import pinocchio as pin

        model = self.kinematics.model
        configuration = self.shape.configuration(self.kinematics.home, 0.0)
        torques = np.abs(pin.computeGeneralizedGravity(model, model.createData(), configuration))
        return np.array([torques[model.joints[number].idx_v] for number in self.kinematics.joint_ids])

    @functools.cached_property
    def compliance(self) -> Array:
        """m that the hand gives way per N straight down at home, by joint, shape (n,)."""
        down = self.kinematics.jacobian(self.kinematics.home)[2]
        return np.array([lever**2 / joint.kp for lever, joint in zip(down, self.robot.joints, strict=True)])

    @functools.cached_property
    def home_hit(self) -> Hit | None:
        """What the robot would touch at home: the empty table, or itself."""
        scene = SceneGraph((), (), Observation(Pose(), 0.0, False), 0.0)
        width = self.robot.gripper.stroke
        return self.shape.checker(obstacles_of(scene), width).hit(self.kinematics.home, "free")

    # -- in the simulator --------------------------------------------------------------------------------------------
    @functools.cached_property
    def held(self) -> Held:
        n = self.kinematics.count
        try:
            with self._make() as simulator:
                simulator.build(_scene(), self.robot)
                touching = tuple(
                    (one.first.removeprefix("robot/"), one.second.removeprefix("robot/"))
                    for one in simulator.contacts()
                    if one.first.startswith("robot/") or one.second.startswith("robot/")
                )
                speeds = []
                for _ in range(round(_HOLD / simulator.control_period)):
                    simulator.tick()
                    speeds.append(np.abs(simulator.joint_velocities()))
                drift = simulator.joint_positions() - self.kinematics.home
                last = round(0.3 / simulator.control_period)
                return Held(drift, np.max(speeds[-last:], axis=0), touching)
        except MemoError as error:
            return Held(np.full(n, np.inf), np.full(n, np.inf), (), str(error))

    @functools.cached_property
    def tracked(self) -> tuple[Tracked, ...]:
        """Every joint for itself, commanded as motions are: ahead by the servo's lag."""
        found = []
        with self._make() as simulator:
            simulator.build(_scene(), self.robot)
            start = simulator.checkpoint()
            for number in range(self.kinematics.count):
                simulator.restore(start)
                found.append(self._swing(simulator, number))
        return tuple(found)

    def _swing(self, simulator: Simulator, number: int) -> Tracked:
        joint, home, period = self.robot.joints[number], self.kinematics.home, simulator.control_period
        up, down = joint.upper - home[number], home[number] - joint.lower
        amplitude = min(_SWING, 0.9 * max(up, down)) * (1.0 if up >= min(_SWING, down) else -1.0)
        if self._blocked(number, amplitude) and min(up, down) > abs(amplitude):
            amplitude = -amplitude
        size = abs(amplitude)
        # A minimum-jerk swing peaks at 1.875 A/T and 5.77 A/T^2; half of what the joint may do.
        least = max(1.875 * size / (0.5 * joint.velocity), math.sqrt(5.77 * size / (0.5 * joint.acceleration)))
        ticks = round(max(least, 0.5) / period)
        s = np.arange(1, ticks + 1) / ticks
        out = 10 * s**3 - 15 * s**4 + 6 * s**5
        wanted = amplitude * np.concatenate([out, 1.0 - out, np.zeros(round(_REST / period))])
        speed = np.gradient(wanted, period)
        reached = []
        problem = ""
        try:
            for angle, rate in zip(wanted, speed, strict=True):
                targets = home.copy()
                targets[number] += angle + joint.kv / joint.kp * rate
                simulator.command_joints(targets)
                simulator.tick()
                reached.append(simulator.joint_positions()[number] - home[number])
        except MemoError as error:
            problem = str(error)
        count = len(reached)
        time: Array = period * np.arange(1, count + 1, dtype=float)
        return Tracked(joint.name, time, wanted[:count], np.array(reached), size, problem)

    def _blocked(self, number: int, turn: float) -> bool:
        """Whether the arm touches the table or itself when one joint turns from home."""
        scene = SceneGraph((), (), Observation(Pose(), 0.0, False), 0.0)
        checker = self.shape.checker(obstacles_of(scene), self.robot.gripper.stroke)
        joints = self.kinematics.home.copy()
        joints[number] += turn
        return checker.collides(joints, "free")

    @functools.cached_property
    def grasp(self) -> Grasp:
        """A cube on the table, picked up from above with the arm's own skills."""
        size = min(_CUBE, _GRIPPED * self.robot.gripper.stroke)
        gripper = self.robot.gripper
        cup = gripper.kind == "vacuum"
        if cup:
            size = _CUBE
        # A cup goes down onto the cube, fingers around it.
        height = size - 0.0005 if cup else max(size / 2, gripper.fingertip_reach + 0.004)
        spot = self._spot(height)
        if spot is None:
            return Grasp(
                "reach", f"no place on the table {100 * height:.0f} cm up is reached with the hand down", 0, size
            )
        x, y, orientation = spot
        with self._make() as simulator:
            simulator.build(_scene(_cube(size, x, y, orientation)), self.robot)
            link = SimulatorLink(simulator, self.robot)
            control = ArmControl(self.robot, link, _SeesTheCube(simulator, size))
            step, width = "reach", 0.0
            try:
                above = ([x, y, height + 0.10], list(orientation))
                at = ([x, y, height], list(orientation))
                control.open_gripper(None)
                control.move_to(*above, then=[at], slack=0.0, speed=1.0)
                control.look()
                control.follow_path([at], None, 0.0, 0.5)
                step = "close"
                width = control.close_gripper(None)
                if not control.holding():
                    why = f"the fingers closed to {1000 * width:.0f} mm and hold nothing"
                    why = "the cup holds nothing" if cup else why
                    return Grasp(step, why, width, size)
                step = "lift"
                control.follow_path([above], None, 0.0, 0.5)
                control.wait(1.0)
            except MemoError as error:
                return Grasp(step, str(error), width, size)
            lifted = simulator.body_pose("cube").position[2] - size / 2
            if lifted < 0.05 or not control.holding():
                return Grasp(step, f"the cube slipped out; it is {100 * lifted:.0f} cm up", width, size)
        return Grasp("", "", width, size)

    def _spot(self, height: float) -> tuple[float, float, tuple[float, float, float, float]] | None:
        """x, y and an orientation with the hand down, nearest to half of the reach."""
        reach = self.robot.reach
        for share in (0.5, 0.6, 0.42, 0.7, 0.35):
            for side in (0.0, 0.5, -0.5):
                x, y = share * reach * math.cos(side), share * reach * math.sin(side)
                for yaw in (0.0, math.pi / 2, math.pi / 4, -math.pi / 4):
                    pose = Pose((x, y, height), _down(yaw))
                    if self._reached([pose])[0] and self._reached([Pose((x, y, height + 0.1), _down(yaw))])[0]:
                        return x, y, pose.orientation
        return None

    # -- reach -------------------------------------------------------------------------------------------------------
    def _reached(self, poses: list[Pose]) -> np.ndarray:
        """Which poses have an arm configuration within the limits, bool (K,); collisions are not looked at."""
        kinematics = self.kinematics
        rotation = np.stack([pose.rotation for pose in poses], axis=2)
        position = np.array([pose.position for pose in poses]).T
        seeds, which = seeds_of(kinematics).near(rotation, position, _SEEDS)
        found = kinematics.solve(seeds, rotation[:, :, which], position[:, which], 20)
        reached = np.zeros(len(poses), dtype=bool)
        reached[which[found.solved]] = True
        return reached

    @functools.cached_property
    def reach_map(self) -> tuple[Array, Array, Array]:
        """x (X,), y (Y,) in m, and the share (Y, X) of eight hand poses reached 5 and 25 cm above the table: down in
        four turns, and forward, left, right and half down."""
        reach = self.robot.reach
        xs, ys = np.linspace(0.15, reach, 8), np.linspace(-0.75 * reach, 0.75 * reach, 9)
        turned = [*(_down(yaw) for yaw in (0.0, math.pi / 4, math.pi / 2, -math.pi / 4)), *_level()]
        poses = [
            Pose((float(x), float(y), 0.05 if number < 4 else 0.25), orientation)
            for y in ys
            for x in xs
            for number, orientation in enumerate(turned)
        ]
        reached = self._reached(poses).reshape(len(ys), len(xs), len(turned))
        return xs, ys, reached.mean(axis=2)

    @functools.cached_property
    def task_reach(self) -> tuple[TaskReach, ...]:
        """By task, seed 0: everything loose and every handle, reached from above or from the front."""
        found = []
        for task in self._tasks:
            scene = task.scene(np.random.default_rng(0))
            wanted = list(_grasps(scene))
            missed = [name for name, poses in wanted if not self._reached(poses).any()]
            found.append(TaskReach(task.name, len(wanted), tuple(missed)))
        return tuple(found)

    # -- pictures ----------------------------------------------------------------------------------------------------
    def pictures(self) -> dict[str, np.ndarray]:
        """The robot at home from three sides, RGB. Raises ``BackendUnavailable`` where nothing renders."""
        reach = self.robot.reach
        at = (0.35 * reach, 0.0, 0.35 * reach)
        eyes = {
            "from the front left": (1.6 * reach, 1.3 * reach, 1.1 * reach),
            "from the left": (0.4 * reach, 2.0 * reach, 0.5 * reach),
            "the hand": None,
        }
        hand = self.kinematics.pose(self.kinematics.home)
        close = np.array(hand.position) + 0.35 * hand.rotation[:, 0] + 0.15 * hand.rotation[:, 1]
        cameras = tuple(
            Camera(name, look_at(tuple(close), hand.position) if eye is None else look_at(eye, at), 0.8, (480, 400))
            for name, eye in eyes.items()
        )
        with self._make() as simulator:
            simulator.build(attrs.evolve(_scene(), cameras=cameras), self.robot)
            return {name: simulator.render(name) for name in eyes}


class _SeesTheCube(Perception):
    """Sees the cube where it is."""

    def __init__(self, simulator: Simulator, size: float) -> None:
        self._simulator, self._size = simulator, (size, size, size)

    def start(self, context: PerceptionContext) -> None: ...

    def look(self) -> SceneGraph:
        node = Node("cube", "cube", self._simulator.body_pose("cube"), self._size, kind="object")
        return SceneGraph((node,), (), Observation(Pose(), 0.0, False), 0.0)


def _scene(*bodies: Body) -> SceneDescription:
    return SceneDescription(bodies=bodies)


def _cube(size: float, x: float, y: float, orientation: tuple[float, float, float, float]) -> Body:
    turned = Pose((0.0, 0.0, 0.0), orientation).rotation[:, 0]
    pose = Pose.from_yaw((x, y, size / 2), math.atan2(turned[1], turned[0]))
    geom = Geom("box", (size,) * 3, colour=(0.8, 0.3, 0.2, 1.0))
    return Body("cube", (geom,), pose, Free(), mass=0.1, label="cube")


def _down(yaw: float) -> tuple[float, float, float, float]:
    """The hand pointing down, its x axis turned by ``yaw`` from straight ahead."""
    return (0.0, math.cos(yaw / 2), math.sin(yaw / 2), 0.0)


def _level() -> list[tuple[float, float, float, float]]:
    """The hand pointing forward, left and right, and forward and down, its fingers closing sideways."""
    found = []
    for z in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.7071, 0.0, -0.7071)):
        forward = np.array(z) / np.linalg.norm(z)
        y = np.cross((0.0, 0.0, 1.0), forward)
        y /= np.linalg.norm(y)
        found.append(quaternion_from_rotation(np.column_stack([np.cross(y, forward), y, forward])))
    return found


def _grasps(scene: SceneDescription) -> Iterable[tuple[str, list[Pose]]]:
    """What people would take hold of in a scene, with hand poses any of which will do."""
    places: dict[str, Pose] = {}
    for body, parent in scene.walk():
        places[body.name] = body.pose if parent is None else places[parent.name] * body.pose
        if isinstance(body.joint, Free) and body.label:
            yield body.label, _around(places[body.name])
        for part in body.parts:
            if any(word in part.label for word in PARTS_HELD):
                yield part.label, _around(places[body.name] * part.pose)


def _around(pose: Pose) -> list[Pose]:
    x_axis = pose.rotation[:, 0]
    yaw = math.atan2(x_axis[1], x_axis[0])
    above = [_down(yaw + turn) for turn in (0.0, math.pi / 2, -math.pi / 2, math.pi)]
    return [Pose(pose.position, orientation) for orientation in (*above, *_level())]
