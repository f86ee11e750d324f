"""One camera and the arm, for commands: a real robot, or the simulated one with a board drawn into its pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import attrs
import numpy as np

from memo_core.cli import connected
from memo_core.config import Experiment
from memo_core.environment import SimulatedEnvironment, generator
from memo_core.plugin import Held, InvalidArgument, Kinematics, Link, PerceptionContext, Pose, UnknownName, look_at
from memo_core.runs import environment_of, task_of, tasks_of
from memo_perception.calibration.board import Board, Lens
from memo_perception.calibration.drawn_board import draw_board, facing
from memo_perception.calibration.hand_eye import Mount
from memo_perception.calibration.poses import PoseProposals
from memo_perception.cameras.frames import Frame
from memo_perception.cameras.settings import CamerasSettings
from memo_perception.cameras.sources.source import Source
from memo_perception.cameras.sources.together import source_from

_BEYOND_FINGERS = 0.06  # m from the tool to the middle of a board in the hand
_DISTANCES = (0.2, 0.8)  # m from the hand to a board on the table
_PAPER = 0.0005  # m that a board lies above the table, in simulation


@attrs.frozen(eq=False)
class Rig:
    """An arm and a source of pictures, both open."""

    robot: str
    link: Link
    kinematics: Kinematics
    source: Source
    table_height: float
    world: SimulatedEnvironment | None = None  # of a simulated robot

    def tool(self) -> Pose:
        """The tool's pose in the base frame now, as measured."""
        return self.kinematics.pose(self.link.joint_positions())

    def frame(self, camera: str) -> Frame:
        """A picture of one camera. Raises ``UnknownName``."""
        frames = {frame.name: frame for frame in self.source.capture()}
        if camera not in frames:
            raise UnknownName("camera", camera, tuple(frames))
        return frames[camera]

    def proposals(self, board: Board, mount: Mount) -> PoseProposals:
        """Poses around where the arm stands, turned about the middle of the board."""
        ahead, held = _BEYOND_FINGERS, None
        if mount == "world":
            side = max(board.size)
            held = Held("board", "board", Pose((0.0, 0.0, ahead)), (side, side, 2 * ahead))
        else:
            ahead = self._height_ahead()
        return PoseProposals(
            self.kinematics,
            self.link.joint_targets(),
            (0.0, 0.0, ahead),
            self.table_height,
            self.link.gripper_width(),
            held,
        )

    def _height_ahead(self) -> float:
        """Distance (m) along the tool's axis to the table, within reason."""
        tool = self.tool()
        down = -float(tool.rotation[2, 2])
        ahead = (tool.position[2] - self.table_height) / down if down > 0.3 else _DISTANCES[0]
        return float(np.clip(ahead, *_DISTANCES))

    # -- simulation ----------------------------------------------------------------------------------------------------
    def true_pose(self, camera: str, mount: Mount) -> Pose | None:
        """Where a simulated camera really is: in the base frame, or in the tool frame; None for a real one."""
        if self.world is None:
            return None
        pose = self._camera_now(camera)
        return pose if mount == "world" else self.tool().inverse() * pose

    def with_board(self, camera: str, board: Board, mount: Mount) -> Callable[[], Frame]:
        """Takes pictures with one camera; of a simulated one, with a board drawn where one would be mounted: beyond the
        fingers and facing the camera as the arm stands now, or on the table where the camera now looks."""
        if self.world is None:
            return lambda: self.frame(camera)
        eye = self._camera_now(camera)
        if mount == "world":
            middle = self.tool().apply((0.0, 0.0, _BEYOND_FINGERS))
            in_hand = self.tool().inverse() * facing(middle, eye)
            place = lambda: self.tool() * in_hand
        else:
            lying = self._lying(eye)
            place = lambda: lying

        def capture() -> Frame:
            frame = self.frame(camera)
            seen = self._camera_now(camera).inverse() * place()
            return attrs.evolve(frame, rgb=draw_board(frame.rgb, board, seen, Lens(frame.intrinsics.matrix)))

        return capture

    def _camera_now(self, name: str) -> Pose:
        assert self.world is not None
        cameras = {camera.name: camera for camera in self.world.description.cameras}
        if name not in cameras:
            raise UnknownName("camera", name, tuple(cameras))
        camera = cameras[name]
        if not camera.link:
            return camera.pose
        return self.world.simulator.body_pose(f"robot/{camera.link}") * camera.pose

    def _lying(self, eye: Pose) -> Pose:
        forward = eye.rotation[:, 2]
        if forward[2] > -0.2:
            raise InvalidArgument("--board", "the camera does not look down at the table", "hand")
        far = (self.table_height + _PAPER - eye.position[2]) / forward[2]
        position = np.asarray(eye.position) + far * forward
        return look_at(tuple(position), tuple(position - [0.0, 0.0, 1.0]))


@contextmanager
def rig_of(experiment: Experiment, calibrated: bool = False) -> Iterator[Rig]:
    """The experiment's robot and cameras, opened. A first signal stops the arm. ``calibrated``: frames need poses, so
    that real cameras must have been calibrated. Raises ``BackendUnavailable``, ``InvalidArgument`` for an experiment
    without cameras."""
    simulated = experiment.create("robot_driver").simulated
    source = source_of(experiment, simulated)
    with _simulated(experiment, source) if simulated else _real(experiment, source, calibrated) as rig:
        yield rig


@contextmanager
def _real(experiment: Experiment, source: Source, calibrated: bool) -> Iterator[Rig]:
    source.open()
    try:
        with connected(experiment) as link:
            kinematics = Kinematics(link.description, lambda: link.check_stop("planning a motion"))
            # Nothing has looked at the scene: the lowest that the tool may go counts as the table.
            floor = experiment.section("hardware").safety.workspace[2]
            rig = Rig(link.description.name, link, kinematics, source, floor)
            rng = generator(experiment.seed, "perception")
            source.start(PerceptionContext(rng, link.description, link, rig.tool) if calibrated else None)
            yield rig
    finally:
        source.close()


@contextmanager
def _simulated(experiment: Experiment, source: Source) -> Iterator[Rig]:
    task = task_of(experiment, experiment.task) if experiment.task else tasks_of(experiment)[0]
    source.open()
    try:
        with environment_of(experiment, task, experiment.seed) as world:
            link = world.link
            kinematics = Kinematics(world.robot, lambda: link.check_stop("planning a motion"))
            rig = Rig(world.robot.name, link, kinematics, source, world.description.table_height, world)
            rng = generator(experiment.seed, "perception")
            source.start(PerceptionContext(rng, world.robot, link, rig.tool, world.simulator, world.description))
            yield rig
    finally:
        source.close()


def source_of(experiment: Experiment, simulated: bool) -> Source:
    """The source of the experiment's ``cameras`` backend, unopened; of a simulated robot, its simulator's cameras if it
    has another backend. Raises ``InvalidArgument``."""
    settings = experiment.choice("perception").settings
    if not isinstance(settings, CamerasSettings):
        if not simulated:
            problem = f"'{experiment.choice('perception').backend.name}' has no cameras"
            raise InvalidArgument("perception.backend", problem, "cameras, with perception.source=realsense or another")
        settings = CamerasSettings()
    return source_from(settings)
