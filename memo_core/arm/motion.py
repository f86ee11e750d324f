"""Planning a motion before anything moves: arm configurations, obstacles, timing; or the reason why it is
impossible."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice, product

import attrs
import numpy as np

from memo_core.arm.cartesian_path import CartesianPath, lagging, turned_about_x, turns_between
from memo_core.arm.collision import Checker, Held, Hit, Mode, Obstacle, RobotShape
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.motion_errors import MotionErrors
from memo_core.arm.redundancy_resolution import Blocked, BranchSearch, Motion, tilt_choices
from memo_core.arm.rrt_connect import densified, plan_free
from memo_core.arm.trajectory import Speed, Trajectory, time_path
from memo_core.errors import MotionError
from memo_core.robot.description import RobotDescription
from memo_core.scene.graph import Node
from memo_core.scene.pose import Array, Pose

_STARTS = 4  # configurations of a goal that are tried before a motion is given up
_CLEAR_TRIES = 5  # routes searched with full clearance before it may shrink to the error of perception
_RETREATS = (0.09, 0.15, 0.04)  # m back along the approach, to clear what the fingers enclose
_ROUTE_SECONDS = (
    4.0  # CPU time of this thread: a last resort; node counts end the search first, which keeps it reproducible
)
_LAGS = (0.35, 0.7)  # share of a door's turning by which the hand may stay behind it
_GENTLE = 0.25  # s over which a motion under force changes its speed: a jerk is felt as a force
_MEETS = 0.025  # m from a thing's box at which the fingertips meet it


@attrs.frozen(eq=False)
class PlanningScene:
    """What collision checks need: solid boxes, the fingers' opening (m), the held object, ids of what moves with it."""

    obstacles: Sequence[Obstacle]
    width: float
    held: Held | None = None
    carried: frozenset[str] = frozenset()
    bars: tuple[Node, ...] = ()  # parts that the hand could take hold of and turn about
    movable: dict[str, frozenset[str]] = attrs.field(factory=dict)  # node id -> ids of what moves when it is pushed


@attrs.frozen(eq=False)
class Plan:
    """A motion ready to be run, the pose it ends at, and the rigid motion (4, 4) of what the hand carries along."""

    trajectory: Trajectory
    goal: Pose
    carried: Array


class MotionPlanner:
    """Plans for one robot. Deterministic: the same question has the same answer. ``poll`` as in ``Kinematics``."""

    def __init__(self, description: RobotDescription, period: float, poll: Callable[[], None] = lambda: None) -> None:
        for library in ("coal", "ruckig", "scipy.interpolate"):
            importlib.import_module(library)  # now: importing during a motion or a stop would delay it
        self.description = description
        self.period = period
        self.kinematics = Kinematics(description, poll)
        self._shape = RobotShape(description, self.kinematics)
        self._errors = MotionErrors(description, self.kinematics)

    # -- free motion -------------------------------------------------------------------------------------------------
    def move(
        self,
        skill: str,
        start: Array,
        goal: Pose,
        then: Sequence[Pose],
        slack: float,
        speed: float,
        world: PlanningScene,
        table: float,
    ) -> Plan:
        """Free motion from joints (n,) to a pose from which ``then`` can be followed. Raises ``MotionError``."""
        self._errors.check_workspace(skill, [goal, *then], table)
        checker = self._checker(world, start)
        failure: tuple[Blocked, CartesianPath] | None = None
        for path, tilts in self._options([goal, *then], _grasp([goal, *then], world), slack, None):
            ahead, pushed = checker, frozenset[str]()
            for _ in range(3):
                found = self._start_of(path, tilts, ahead, checker, start, speed, world)
                if isinstance(found, Plan):
                    return found
                # Only the later path touches it: it will be pushed aside then, as in ``follow``.
                more = self._pushed(found, path, world) - pushed if found.s > 0 else frozenset()
                if not more:
                    break
                pushed |= more
                left = [one for one in world.obstacles if one.node not in pushed]
                ahead = self._checker(attrs.evolve(world, obstacles=left), start)
            assert isinstance(found, Blocked)
            failure = _further(failure, (found, path))
        assert failure is not None
        raise self._errors.error(skill, failure[0], failure[1], 0.0, start, slack)

    def _start_of(
        self,
        path: CartesianPath,
        tilts: Array,
        ahead: Checker,
        checker: Checker,
        start: Array,
        speed: float,
        world: PlanningScene,
    ) -> Plan | Blocked:
        """Plan to the path's first pose in a configuration from which the rest can be followed. ``ahead`` checks
        collisions along the rest, ``checker`` on the way to its beginning."""
        search = BranchSearch(self.kinematics, path, ahead, None, 0.0, "free", start)
        goals: list[Array] = []
        blocked = search.prepare(tilts)
        while blocked is None and len(goals) < _STARTS:
            found = search.best()
            if isinstance(found, Blocked):
                blocked = found
                break
            goals.append(found.joints[:, 0])
            search.exclude(found.joints[:, 0])
            plan = self._clear_route(checker, start, goals[-1:], speed, world, nodes=0)
            if plan is not None:
                return plan
        if goals:
            plan = self._route(checker, start, goals, speed, world)
            if plan is not None:
                return plan
            blocked = Blocked(0.0, "collision", self._obstructing(checker, start, goals[0]))
        assert blocked is not None
        return blocked

    def _options(
        self, poses: Sequence[Pose], grasp: int | None, slack: float, tilt: float | None
    ) -> Iterable[tuple[CartesianPath, Array]]:
        """Paths and tilts to try in turn, from exactly the requested ones to less and less constrained ones."""
        path = CartesianPath(poses)
        choices = tilt_choices(slack, tilt)
        yield from ((path, tilts) for tilts in choices)
        if grasp is None or slack < 1e-3:
            return
        for share in _LAGS:
            behind = lagging(poses, grasp, share, slack)
            if max(a.distance(b)[1] for a, b in zip(behind, poses, strict=True)) > 0.1:
                yield CartesianPath(behind), choices[-1]

    def home(self, skill: str, start: Array, speed: float, world: PlanningScene) -> Plan:
        """Free motion to the home posture. Raises ``MotionError``."""
        checker = self._checker(world, start)
        home = self.kinematics.home
        if (hit := checker.hit(home, "free")) is not None:
            raise MotionError(
                skill, f"the home posture is blocked: {hit}", cause="self-collision" if hit.own else "collision"
            )
        plan = self._route(checker, start, [home], speed, world)
        if plan is None:
            hit = self._obstructing(checker, start, home)
            raise MotionError(
                skill, f"no way home was found{f': on the straight way {hit}' if hit else ''}", cause="collision"
            )
        return plan

    def _route(
        self,
        checker: Checker,
        start: Array,
        goals: Sequence[Array],
        speed: float,
        world: PlanningScene,
    ) -> Plan | None:
        """A plan that keeps clear of everything where there is one, else one whose every sample is free; where the
        start is enclosed, a short straight retreat comes first."""
        if (plan := self._clear_route(checker, start, goals, speed, world, nodes=600)) is not None:
            return plan

        def free(joints: Array) -> bool:
            return not checker.collides(joints, "free")

        joints = plan_free(self.kinematics, free, start, goals, nodes=300)
        if joints is not None and (plan := self._free_plan(checker, joints, speed, world)) is not None:
            return plan
        # Where fingers are around something, only a straight line leads out of there or in: no sampling finds it.
        outs = [None, *islice(self._retreats(checker, start, "contact"), 2)]
        ins = [None, *(line for goal in goals[:2] for line in islice(self._retreats(checker, goal, "free"), 2))]
        patience = time.thread_time() + _ROUTE_SECONDS
        for nodes, seed, few in ((300, 0, 3), (1500, 1, 2)):
            for out, into in product(outs[:few], ins[:few]):
                if time.thread_time() > patience:
                    return None
                begin = start if out is None else out[:, -1]
                ends = goals if into is None else [into[:, -1]]
                joints = plan_free(self.kinematics, free, begin, ends, nodes=nodes, seed=seed)
                if joints is None:
                    continue
                plan = self._free_plan(checker, joints, speed, world, out, None if into is None else into[:, ::-1])
                if plan is not None:
                    return plan
        return None

    def _clear_route(
        self, checker: Checker, start: Array, goals: Sequence[Array], speed: float, world: PlanningScene, nodes: int
    ) -> Plan | None:
        """A plan that keeps its distance from everything but what the start and the goals are near to."""
        for goal in goals:
            checker.near(goal)
        for seed in range(_CLEAR_TRIES if nodes else 1):
            joints = plan_free(
                self.kinematics, lambda one: not checker.collides(one, "clear"), start, goals, nodes=nodes, seed=seed
            )
            if joints is None:
                return None
            # Timing rounds a way off a little; where that grazes something, another way will do.
            if (plan := self._free_plan(checker, joints, speed, world, mode="clear")) is not None:
                return plan
        return None

    def _retreats(self, checker: Checker, start: Array, mode: Mode) -> Iterator[Array]:
        """Short straight ways (n, M) back along the approach, or up, to where the arm is free."""
        pose = self.kinematics.pose(start)
        for distance in _RETREATS:
            for direction in (-pose.rotation[:, 2], np.array([0.0, 0.0, 1.0])):
                back = Pose(tuple(np.asarray(pose.position) + distance * direction), pose.orientation)
                joints = self._line(CartesianPath([pose, back]), start)
                if joints is None or checker.collides(joints[:, -1], "free"):
                    continue
                if not any(checker.collides(one, mode) for one in joints.T[1:]):
                    yield joints

    def _line(self, path: CartesianPath, start: Array) -> Array | None:
        """Joints (n, M) along a short path from a configuration (n,), or None where they do not go on."""
        s = np.unique(np.concatenate([path.grid(0.01), path.knots]))
        rotation, position = path.at(s)
        joints = np.empty((self.kinematics.count, len(s)))
        joints[:, 0] = start
        for i in range(1, len(s)):
            at = slice(i, i + 1)
            found = self.kinematics.solve(joints[:, i - 1 : i], rotation[:, :, at], position[:, at], 8, 0.002)
            if not found.solved[0]:
                return None
            joints[:, i] = found.joints[:, 0]
        return joints

    def _free_plan(
        self,
        checker: Checker,
        joints: Array,
        speed: float,
        world: PlanningScene,
        out: Array | None = None,
        into: Array | None = None,
        mode: Mode = "free",
    ) -> Plan | None:
        """The joint path timed, with a straight way out before it and into the goal after it; None where a sample of it
        touches something (a corner that was cut, or a graze between two checked configurations)."""
        holding = world.held is not None
        limits = Speed(0.7 * speed, (0.5 if holding else 0.9) * speed, (1.5 if holding else 2.5) * speed)
        dense, corners = densified(joints)
        for stops in ((), corners):
            targets = time_path(self.kinematics, dense, limits, self.period, stops=stops).targets
            if not any(checker.collides(row, mode) for row in targets):
                pieces = [targets]
                if out is not None:
                    pieces.insert(0, time_path(self.kinematics, out, limits, self.period).targets)
                if into is not None:
                    pieces.append(time_path(self.kinematics, into, limits, self.period).targets)
                trajectory = Trajectory(np.ascontiguousarray(np.concatenate(pieces)), self.period)
                return Plan(trajectory, self.kinematics.pose(trajectory.targets[-1]), np.eye(4))
            if not corners:
                break
        return None

    def _obstructing(self, checker: Checker, start: Array, goal: Array) -> Hit | None:
        """What stands in the straight joint line to a goal."""
        for part in np.linspace(0.0, 1.0, 30):
            if (hit := checker.hit(start + (goal - start) * part, "free")) is not None:
                return hit
        return None

    # -- following ---------------------------------------------------------------------------------------------------
    def follow(
        self,
        skill: str,
        start: Array,
        poses: Sequence[Pose],
        then: Sequence[Pose],
        slack: float,
        speed: float,
        world: PlanningScene,
        table: float,
        oriented: bool,
    ) -> Plan:
        """Straight pieces through ``poses``, from joints (n,), in configurations from which ``then`` can be followed.
        ``oriented``: the first pose has an orientation of its own. Raises ``MotionError``."""
        self._errors.check_workspace(skill, [*poses, *then], table)
        here = self.kinematics.pose(start)
        tilt = 0.0
        if oriented and slack > 1e-3:
            a, b, c = turns_between(poses[0], here)
            if abs(c) < 0.1 and abs(b) <= slack + 0.02 and abs(a) < 1.0:
                tilt = b
                here = Pose(here.position, turned_about_x(poses[0], a).orientation)
        whole = [here, *poses, *then]
        grasp = 0 if world.carried else _grasp(whole, world)
        checker = self._checker(world, start)
        pushed: frozenset[str] = frozenset()
        failure: tuple[Blocked, CartesianPath] | None = None
        for path, tilts in self._options(whole, grasp, slack, tilt):
            for _ in range(3):
                search = BranchSearch(
                    self.kinematics, path, checker, start, tilt, "contact", start, bool(world.carried)
                )
                found = search.prepare(tilts) or search.best()
                if isinstance(found, Motion):
                    return self._follow_plan(found, path, len(poses), speed)
                more = self._pushed(found, path, world) - pushed
                if not more:
                    break
                # What the fingers touch first is pushed ahead of the hand and is no obstacle to it.
                pushed |= more
                obstacles = [one for one in world.obstacles if one.node not in pushed]
                checker = self._checker(attrs.evolve(world, obstacles=obstacles), start)
            assert isinstance(found, Blocked)
            failure = _further(failure, (found, path))
        assert failure is not None
        end = CartesianPath([here, *poses]).length
        error = self._errors.error(skill, failure[0], failure[1], end, start, slack)
        if failure[0].s > 0 and self._goes_otherwise(failure[1], slack, checker, start):
            error.problem += "; from another arm posture it can: give this path as then= to the motions before it"
        raise error

    def _goes_otherwise(self, path: CartesianPath, slack: float, checker: Checker, start: Array) -> bool:
        """Whether the path could be followed if the arm were in another posture at its start."""
        search = BranchSearch(self.kinematics, path, checker, None, 0.0, "contact", start)
        blocked = search.prepare(tilt_choices(slack, None)[-1])
        return blocked is None and isinstance(search.best(), Motion)

    def _follow_plan(self, motion: Motion, path: CartesianPath, count: int, speed: float) -> Plan:
        """``count``: how many of the path's poses after the start are to be run."""
        end = path.parameter(count)
        kept = motion.s <= end + 1e-9
        limits = Speed(0.6 * speed, 0.3 * speed, 1.2 * speed)
        trajectory = time_path(self.kinematics, motion.joints[:, kept], limits, self.period)
        carried = path.pose(end).matrix @ np.linalg.inv(path.pose(0.0).matrix)
        return Plan(trajectory, self.kinematics.pose(motion.joints[:, kept][:, -1]), carried)

    def _pushed(self, blocked: Blocked, path: CartesianPath, world: PlanningScene) -> frozenset[str]:
        """What moves ahead of the hand if the collision is one with a movable thing that the fingertips meet first."""
        if blocked.hit is None or blocked.hit.own or blocked.hit.node not in world.movable:
            return frozenset()
        group = world.movable[blocked.hit.node]
        _, points = path.at(path.grid(0.02)[path.grid(0.02) <= blocked.s + 0.03])
        for obstacle in world.obstacles:
            if obstacle.node in group:
                outside = np.abs(obstacle.pose.inverse().apply(points.T)) - np.asarray(obstacle.size) / 2
                if np.linalg.norm(np.maximum(outside, 0.0), axis=1).min() < _MEETS:
                    return group
        return frozenset()

    # -- under force -------------------------------------------------------------------------------------------------
    def guarded(
        self, skill: str, start: Array, poses: Sequence[Pose], linear: float, world: PlanningScene, table: float | None
    ) -> Plan:
        """Straight pieces through ``poses`` at ``linear`` m/s, from joints (n,), for a motion that ends or gives way
        where it feels something: only the arm itself is in its way. ``table`` (m) as in ``follow``, None where the
        path may lead into what is to be touched. Raises ``MotionError``."""
        floor = -np.inf if table is None else table
        self._errors.check_workspace(skill, poses, floor)
        path = CartesianPath([self.kinematics.pose(start), *poses])
        alone = attrs.evolve(world, obstacles=())
        joints = self._line(path, start)
        checker = self._checker(alone, start)
        if joints is None or any(checker.collides(one, "contact") for one in joints.T[1:]):
            plan = self.follow(skill, start, poses, (), 0.0, 1.0, alone, floor, False)
            joints = np.column_stack([start, plan.trajectory.targets.T])
        trajectory = time_path(
            self.kinematics, joints, Speed(0.6, linear, max(0.3, 6 * linear)), self.period, smooth=_GENTLE
        )
        carried = path.pose(path.length).matrix @ np.linalg.inv(path.pose(0.0).matrix)
        return Plan(trajectory, self.kinematics.pose(trajectory.targets[-1]), carried)

    def check_shifted(self, skill: str, targets: Array, shift: Array) -> None:
        """Raises ``MotionError`` unless the first and last of the targets (T, n) can be reached shifted by (3,) m."""
        ends = targets[[0, -1]].T
        rotation, position = self.kinematics.forward(ends)
        found = self.kinematics.solve(ends, rotation, position + shift[:, None])
        if not found.solved.all():
            where = "start" if not found.solved[0] else "end"
            far = f"{100 * np.linalg.norm(shift):.0f} cm further along the direction"
            raise MotionError(
                skill, f"the arm cannot give way there: {far} from the path's {where} is out of its reach"
            )

    def joint_line(self, start: Array, goal: Array) -> Trajectory:
        """A slow straight joint motion without collision checks, to where the arm already is."""
        return time_path(
            self.kinematics, densified(np.column_stack([start, goal]))[0], Speed(0.3, 0.3, 1.0), self.period
        )

    def _checker(self, world: PlanningScene, start: Array) -> Checker:
        checker = self._shape.checker(world.obstacles, world.width, world.held, world.carried)
        checker.leave(start)
        return checker


def _grasp(poses: Sequence[Pose], world: PlanningScene) -> int | None:
    """The first of the poses at which the fingers would close on a bar across it."""
    for number, pose in enumerate(poses):
        for bar in world.bars:
            local = np.abs(bar.pose.inverse().apply(np.asarray(pose.position))) - np.asarray(bar.size) / 2
            along = bar.pose.rotation[:, int(np.argmax(bar.size))]
            if np.all(local < _MEETS) and abs(along @ pose.rotation[:, 0]) > 0.8:
                return number
    return None


def _further(
    first: tuple[Blocked, CartesianPath] | None, second: tuple[Blocked, CartesianPath]
) -> tuple[Blocked, CartesianPath]:
    """The failure that came furthest along its path, which is the most informative."""
    return second if first is None or second[0].s > first[0].s + 1e-6 else first
