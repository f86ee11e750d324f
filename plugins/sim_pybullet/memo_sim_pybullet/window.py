"""A window for people with a display: a second Bullet, with a screen, that shows where everything is in the first.

It moves nothing in the simulation and takes no part in it; one may look from all sides and drag in it as one likes.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator
from typing import Any

from memo_core.plugin import BackendUnavailable, RobotDescription, SceneDescription, vantage_of
from memo_sim_pybullet.settings import PybulletSettings
from memo_sim_pybullet.stdout_capture import Diversion, caught_output
from memo_sim_pybullet.world import build_world

_PERIOD = 1 / 30  # s, simulated, between two pictures
_REMEDY = "run without --view, or where there is a display"


class Window:
    """Shows the world of ``client``. Raises ``BackendUnavailable`` where there is no display."""

    def __init__(
        self, client: Any, scene: SceneDescription, robot: RobotDescription, settings: PybulletSettings
    ) -> None:
        import pybullet
        from pybullet_utils.bullet_client import BulletClient

        self._client = client
        self._seen = -_PERIOD
        with _display():
            self._diversion = Diversion()  # the window's own thread prints as long as it lives
            try:
                with caught_output(1, 2):
                    self._window = BulletClient(pybullet.GUI)
            except pybullet.error as error:
                self._diversion.end()
                raise BackendUnavailable("viewer", "pybullet", str(error), _REMEDY) from error
        self._gone = pybullet.error
        show = self._window.configureDebugVisualizer
        show(pybullet.COV_ENABLE_GUI, 0)
        show(pybullet.COV_ENABLE_RENDERING, 0)
        build_world(self._window, scene, robot, settings)
        at = vantage_of(scene)
        # Bullet's yaw is 0 for a look along y.
        self._window.resetDebugVisualizerCamera(at.distance, at.azimuth - 90, at.elevation, at.target)
        show(pybullet.COV_ENABLE_RENDERING, 1)
        self._joints = {
            body: [joint for joint in range(client.getNumJoints(body)) if client.getJointInfo(body, joint)[3] > -1]
            for body in (client.getBodyUniqueId(number) for number in range(client.getNumBodies()))
        }
        self._shown: dict[int, tuple[Any, list[list[float]]]] = {}
        self.show(0.0)

    def show(self, time: float) -> bool:
        """Show the world as it is at this simulated time (s), not more often than people see. False when the window was
        closed."""
        if abs(time - self._seen) < _PERIOD:
            return True
        self._seen = time
        try:
            for body, joints in self._joints.items():
                # Every call waits for the window's thread: only what moved, and all joints at once.
                base = self._client.getBasePositionAndOrientation(body)
                angles = [[state[0]] for state in self._client.getJointStates(body, joints)] if joints else []
                if self._shown.get(body) == (base, angles):
                    continue
                self._shown[body] = (base, angles)
                self._window.resetBasePositionAndOrientation(body, *base)
                if joints:
                    self._window.resetJointStatesMultiDof(body, joints, angles)
        except self._gone:
            return False
        return True

    def close(self) -> None:
        with caught_output(1, 2), contextlib.suppress(self._gone):  # gone: its user closed it
            self._window.disconnect()
        self._diversion.end()


def check_display() -> None:
    """Raises ``BackendUnavailable`` where there is no display."""
    with _display():
        pass


@contextlib.contextmanager
def _display() -> Iterator[None]:
    """A connection to the display, until the window has one of its own. Bullet ends the whole process where no
    display answers, so it is asked before; and a server whose last client leaves starts anew and answers nobody for a
    moment, so the connection is kept."""
    if not sys.platform.startswith("linux"):
        yield
        return
    name = os.environ.get("DISPLAY", "")
    if not name:
        raise BackendUnavailable("viewer", "pybullet", "there is no display (DISPLAY is not set)", _REMEDY)
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError as error:
        raise BackendUnavailable("viewer", "pybullet", str(error), "install libX11 (Debian: libx11-6)") from error
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XCloseDisplay.argtypes = (ctypes.c_void_p,)
    display = x11.XOpenDisplay(None)
    if not display:
        raise BackendUnavailable("viewer", "pybullet", f"the display {name!r} does not answer", _REMEDY)
    try:
        yield
    finally:
        x11.XCloseDisplay(display)
