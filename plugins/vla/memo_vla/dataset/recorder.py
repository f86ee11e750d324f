"""Recording a simulated arm at a fixed rate while anything moves it: pictures, states and where it was sent.

The last frame says where the one before it led; it has no action, and no picture, of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import attrs
import numpy as np

from memo_core.environment import SimulatedEnvironment
from memo_core.plugin import Array, Pose
from memo_vla.dataset.video import PictureStatistics, Video
from memo_vla.robot_state import RobotState, robot_state


@attrs.frozen(eq=False)
class Frame:
    """One moment of a recording."""

    state: RobotState
    sent: Array  # joint positions (n,), rad, that the arm was sent to
    opening: float  # m, that the fingers were sent to


@attrs.frozen
class Said:
    """Something that was said or known while the arm moved: a row of LeRobot's language columns.

    ``style`` is ``subtask`` (what is being done), ``memory`` (a note that was used) or ``interjection`` (what a person
    said); ``frame`` counts from 0.
    """

    frame: int
    style: str
    content: str
    role: str = "assistant"


@attrs.define(eq=False)
class Recording:
    """One episode: frames at a fixed rate, a video of each camera (all frames but the last), rows of language."""

    rate_hz: float
    frames: list[Frame] = attrs.field(factory=list)
    videos: dict[str, Path] = attrs.field(factory=dict)  # camera -> file, complete when recording has ended
    pictures: dict[str, PictureStatistics] = attrs.field(factory=dict)
    size: tuple[int, int] = (0, 0)  # width and height of pictures
    said: list[Said] = attrs.field(factory=list)

    def __len__(self) -> int:
        return len(self.frames)


class Recorder:
    """Records an open environment. The tick's listener draws pictures, so simulated time stands still meanwhile."""

    def __init__(
        self, world: SimulatedEnvironment, cameras: Sequence[str], height: int, rate_hz: float, folder: Path
    ) -> None:
        """Prepare to record; nothing is written.

        Args:
            world: the open environment.
            cameras: names of the scene's cameras.
            height: of pictures, in pixels; even, since video codecs want it.
            rate_hz: frames for each second of simulated time.
            folder: where videos are written.
        """
        self._world, self._cameras, self._height = world, tuple(cameras), height
        self._period, self._folder = 1.0 / rate_hz, folder
        self._videos: dict[str, Video] = {}
        self._pending: dict[str, np.ndarray] = {}  # pictures of the last frame: of the very last none are kept
        self.recording = Recording(rate_hz)
        link = world.link
        self._lag = np.array(link.servo_lag) / link.control_period if len(link.servo_lag) else np.zeros(1)
        self._sent = link.joint_targets()
        self._next = world.time()

    @contextmanager
    def recording_now(self) -> Iterator[Recording]:
        """Record while the block runs; the videos are complete afterwards, or removed if it raised."""
        simulator = self._world.simulator
        self._add_frame()
        simulator.add_tick_listener(self._tick)
        try:
            yield self.recording
        except BaseException:
            for video in self._videos.values():
                video.discard()
            raise
        finally:
            simulator.remove_tick_listener(self._tick)
        for camera, video in self._videos.items():
            self.recording.videos[camera] = video.close()
            self.recording.pictures[camera] = video.statistics

    def say(self, style: str, content: str, role: str = "assistant") -> None:
        """Add a row of the language columns at the last frame."""
        self.recording.said.append(Said(max(len(self.recording) - 1, 0), style, content, role))

    def _tick(self) -> None:
        # Commands run ahead of where the arm is sent by the servo's lag; this recursion takes the lead back out.
        self._sent = (self._world.link.joint_targets() + self._sent * self._lag) / (1.0 + self._lag)
        if self._world.time() + 1e-9 >= self._next:
            self._add_frame()

    def _add_frame(self) -> None:
        world, link = self._world, self._world.link
        self._next += self._period
        pose: Pose = world.control.tool_pose()
        state = robot_state(link, pose)
        opening = state.width if link.commanded_width is None else link.commanded_width
        for camera, picture in self._pending.items():
            self._video(camera, picture).add(picture)
        self._pending = world.photograph(self._cameras, self._height)
        self.recording.frames.append(Frame(state, self._sent.copy(), opening))

    def _video(self, camera: str, picture: np.ndarray) -> Video:
        if camera not in self._videos:
            self.recording.size = (picture.shape[1], picture.shape[0])
            path = self._folder / f"{camera}.mp4"
            self._videos[camera] = Video(path, self.recording.size, self.recording.rate_hz)
        return self._videos[camera]
