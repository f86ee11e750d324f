"""The robot as it moves, for the pages: poses, cameras' pictures, and a beat that says whether both are of this moment.

A simulator is read only in the thread that moves it: after ticks, and at events of the run. It is put back as soon as a
person has said what was wrong; the moment they judged stays in view until they are done with the notes made of it. A
real robot's joints are read in a thread of this module; its cameras' pictures are those of the last look.
"""

from __future__ import annotations

import io
import threading
import time
from typing import Any

import numpy as np

from memo_core.plugin import BackendUnavailable, Event, MemoError, Stage
from memo_web.robot_side.listening import listen
from memo_web.robot_side.pages_process import PagesProcess
from memo_web.robot_side.shapes import Drawn

_FRAME_S = 1 / 20
_BEAT_S = 0.1
_BEHIND_S = 0.3  # by which what was sent may be behind the robot
_HEIGHT = 240  # pixels of a picture
_SHARE = 0.15  # of the time, at most, that a simulator draws pictures
_QUALITY = 80  # of JPEG
_MOVED = 1e-5  # m, or of a quaternion
_GOES_ON = ("Retrieved", "CodeWritten", "SkillStarted", "SubtaskEnded", "RunEnded")  # after notes were made


class Live:
    """Shows one run's robot until ``close``."""

    def __init__(self, stage: Stage, pages: PagesProcess, pictures_hz: float) -> None:
        """Send the shapes, and begin.

        Args:
            stage: the robot and its scene.
            pages: where they are shown.
            pictures_hz: pictures a second of each camera.
        """
        self._stage, self._pages = stage, pages
        self._period = 1.0 / pictures_hz
        self._thread = threading.get_ident()
        self._drawn = Drawn(stage.robot, stage.scene)
        self._cameras = [camera.name for camera in stage.scene.cameras] if stage.scene is not None else []
        self._line = 0
        self._judged = False  # whether the moment that a person judged stays in view
        self._sent = np.zeros((0, 7), np.float32)
        self._ticked = self._framed = self._next_picture = 0.0
        self._closed = threading.Event()
        pages.forget("mesh")
        for number, mesh in enumerate(self._drawn.meshes):
            pages.send("mesh", mesh, keep=f"mesh {number}", number=number)
        shown = {
            "robot": stage.robot.name,
            "real": stage.simulator is None,
            "bodies": self._drawn.bodies,
            "fixed": self._drawn.fixed,
            "cameras": self._cameras,
        }
        pages.send("stage", keep="stage", stage=shown)
        self._unlisten = listen(self._hear)
        self._update()
        if stage.simulator is not None:
            stage.simulator.add_tick_listener(self._tick)
        else:
            threading.Thread(target=self._follow, name="memo-web-joints", daemon=True).start()
        threading.Thread(target=self._beat, name="memo-web-beat", daemon=True).start()

    def close(self) -> None:
        """Stop showing the robot; called in the thread that made this."""
        self._closed.set()
        self._unlisten()
        if self._stage.simulator is not None:
            self._stage.simulator.remove_tick_listener(self._tick)
        self._pages.forget("stage")
        self._pages.forget("mesh")
        self._pages.send("stage", stage=None)

    # -- in the thread that moves the robot ----------------------------------------------------------------------------
    def _tick(self) -> None:
        self._ticked = now = time.monotonic()
        self._judged = False
        if now - self._framed >= _FRAME_S:
            self._frame(now)
        if now >= self._next_picture and self._cameras and not self._stage.link.stopped:
            self._pictures(now)

    def _hear(self, event: Event) -> None:
        name = type(event).__name__
        if name == "SkillStarted":
            self._line = getattr(event, "line", 0)
        elif name in ("SubtaskStarted", "CodeEnded", "CodeWritten"):
            self._line = 0
        if name == "FeedbackGiven":
            self._judged = self._stage.simulator is not None
        elif name in _GOES_ON or (name == "ModelAsked" and getattr(event, "phase", "") != "feedback"):
            self._judged = False
        if threading.get_ident() == self._thread and not self._judged and name not in ("ModelCalled", "SkillStarted"):
            self._update()

    def _update(self) -> None:
        """Show the robot as it is now, at rest, if that is new."""
        before = self._sent
        now = time.monotonic()
        self._frame(now)
        new = before.shape != self._sent.shape or float(np.abs(before - self._sent).max(initial=0.0)) > _MOVED
        if not new:
            return
        if self._stage.simulator is None:
            self._last_look()
        elif self._cameras:
            self._pictures(now)

    def _frame(self, now: float) -> None:
        stage = self._stage
        try:
            poses = self._drawn.poses(stage.link.joint_positions(), stage.link.gripper_width(), stage.simulator)
            at = stage.link.time()
        except MemoError:  # a robot in a fault: what was shown last becomes old, and the page says so
            return
        self._framed, self._sent = now, poses
        self._pages.send("frame", poses.tobytes(), keep="frame", droppable=True, time=at, line=self._line)

    def _pictures(self, now: float) -> None:
        simulator = self._stage.simulator
        assert simulator is not None
        try:
            for name in self._cameras:
                width, height = self._size(name)
                self._send_picture(name, simulator.render(name, width, height))
        except BackendUnavailable as error:
            self._cameras = []
            self._pages.send("no_pictures", keep="no pictures", why=str(error))
            return
        took = time.monotonic() - now
        self._next_picture = now + max(self._period, took / _SHARE)

    def _size(self, camera: str) -> tuple[int, int]:
        assert self._stage.scene is not None
        width, height = next(one.resolution for one in self._stage.scene.cameras if one.name == camera)
        return round(width * _HEIGHT / height), _HEIGHT

    def _last_look(self) -> None:
        for name, picture in self._stage.perception.pictures().items():
            self._send_picture(name, picture, "as the robot last looked")

    def _send_picture(self, name: str, picture: np.ndarray, note: str = "") -> None:
        from PIL import Image

        data = io.BytesIO()
        image = Image.fromarray(picture)
        image.thumbnail((4 * _HEIGHT, _HEIGHT))
        image.save(data, "JPEG", quality=_QUALITY)
        more: dict[str, Any] = {"note": note} if note else {}
        self._pages.send("picture", data.getvalue(), keep=f"picture {name}", droppable=True, camera=name, **more)

    # -- in threads of this module -------------------------------------------------------------------------------------
    def _follow(self) -> None:
        """Read a real robot's joints."""
        while not self._closed.wait(_FRAME_S):
            self._ticked = time.monotonic()
            self._frame(self._ticked)

    def _beat(self) -> None:
        while not self._closed.wait(_BEAT_S):
            current = self._ticked - self._framed <= _BEHIND_S
            self._pages.send("beat", droppable=True, current=current)
