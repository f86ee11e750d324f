"""The Franka Hand as a gripper driver, over franky. Its calls block, so they run in a separate thread. ``move`` into an
object would stall for a minute, and ``stop`` is unreliable. Therefore the fingers close with ``grasp``, with a
tolerance as wide as the stroke, and a call that exceeds its deadline is reported instead of waited for.
"""

from __future__ import annotations

import queue
import threading
import time
from typing import Any

from memo_core.plugin import (
    BackendUnavailable,
    Flag,
    GripperDescription,
    GripperDriver,
    Health,
    check_gripper_command,
    install,
)
from memo_franka.faults import fault_of_error
from memo_franka.settings import HandSettings

_POLL_S = 0.02  # between two states that are read while nothing is commanded
_AGAIN_S = 0.1  # after which a motion that goes on is told to stop again
_CLOSED = 0.001  # m


class FrankaHand(GripperDriver):
    """One Hand. A thread starts its motions and waits for them; the newest command counts."""

    def __init__(self, settings: HandSettings) -> None:
        self._settings = settings
        self._gripper = GripperDescription()
        self._hand: Any = None
        self._wanted: queue.SimpleQueue[tuple[float, float] | None] = queue.SimpleQueue()
        self._threads: list[threading.Thread] = []
        self._closing = threading.Event()
        self._stopping = Flag()
        self._counting = threading.Lock()  # of the next three and what is wanted
        self._motion = 0  # number of the newest that was begun
        self._obsolete = 0  # the newest that is to end
        self._asked = 0.0  # when the newest that has not ended was commanded; 0 where there is none
        self._beginning = threading.Lock()  # no motion begins while a stop is sent
        self._moving = False  # whether one is not answered yet
        self._width, self._grasped = 0.0, False
        self._problem = "it is not open"

    def open(self, gripper: GripperDescription) -> None:
        franky = import_franky()
        self._gripper = gripper
        try:
            self._hand = franky.Gripper(self._settings.address)
            state = self._hand.state
        except Exception as error:
            self._hand = None
            raise fault_of_error(self._settings.address, error) from error
        self._width, self._grasped = state.width, state.is_grasped
        if state.max_width < gripper.stroke - 0.005:
            self._hand = None
            problem = f"the Hand at {self._settings.address} opens {state.max_width:.3f} m: it was never homed"
            remedy = f"home it in Desk; the description says {gripper.stroke:.3f} m"
            raise BackendUnavailable("gripper_driver", "franka-hand", problem, remedy)
        self._problem, self._asked = "", 0.0
        self._closing.clear()
        self._stopping.clear()
        self._threads = [
            threading.Thread(target=one, name=one.__name__, daemon=True) for one in (self._work, self._watch)
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        if self._hand is None:
            return
        working, watching = self._threads
        self._wanted.put(None)
        working.join(1.0)
        if working.is_alive():  # the client library would wait for blocked fingers for ever, at full load
            self._stopping.set()
            working.join(1.0)  # one whose Hand does not even answer a stop is left behind
        self._closing.set()
        watching.join(1.0)
        self._hand, self._problem = None, "it is not open"

    def health(self) -> Health:
        if not self._problem and self._asked and time.monotonic() - self._asked > self._settings.deadline_s:
            late = f"the Hand did not end its motion within {self._settings.deadline_s:g} s; free its fingers, home it"
            return Health(False, late)
        return Health(not self._problem, self._problem, {"width": self._width})

    def move(self, width: float, force: float) -> None:
        check_gripper_command(self._gripper, width, force)
        if self._hand is None:
            raise BackendUnavailable("gripper_driver", "franka-hand", "it is not open", "open()")
        self._stopping.clear()
        with self._counting:
            self._obsolete = self._motion  # the watching thread ends it: a Hand may take long to answer a stop
            self._asked = time.monotonic()
            self._wanted.put((width, force))

    def stop(self) -> None:
        self._stopping.set()  # only a flag: this may be called by a signal handler; the watching thread sends it

    def width(self) -> float:
        return self._width

    def holding(self) -> bool:
        return self._grasped and self._width > _CLOSED

    # -- in threads of their own ---------------------------------------------------------------------------------------
    def _work(self) -> None:
        """Start the newest requested motion and wait for its end."""
        while (wanted := self._wanted.get()) is not None:
            with self._counting:
                while not self._wanted.empty():
                    newer = self._wanted.get()
                    if newer is None:
                        return
                    wanted = newer
                self._motion += 1
                asked = self._asked
            with self._beginning:
                self._moving = not self._stopping.is_set()
            if self._moving:
                self._perform(*wanted)
            with self._counting:
                if self._asked == asked:
                    self._asked = 0.0

    def _perform(self, width: float, force: float) -> None:
        """Move, and wait until the Hand has told the end."""
        try:
            arrived = self._arrives(width, force)
            problem = "" if arrived else f"the Hand did not reach {width:.3f} m; free its fingers, home it"
        except Exception as error:
            if type(error).__name__ != "CommandException":
                problem = str(fault_of_error(self._settings.address, error))
            elif "aborted" in str(error):
                problem = ""  # by a stop
            else:
                problem = f"the Hand could not carry out a command ({error}); free its fingers, home it"
        self._moving = False
        if self._obsolete < self._motion and not self._stopping.is_set():
            self._problem = problem

    def _arrives(self, width: float, force: float) -> bool:
        """Whether the fingers get where they should. A grasp that holds nothing is no fault."""
        speed = self._gripper.speed
        if width >= self._width - _CLOSED:
            return bool(self._hand.move(width, speed))
        stroke = self._gripper.stroke
        self._hand.grasp(width, speed, force, epsilon_inner=stroke, epsilon_outer=stroke)
        return True

    def _watch(self) -> None:
        """Store the latest state, and end motions that are obsolete or to be stopped."""
        sent = 0.0
        while not self._closing.wait(_POLL_S):
            if self._stopping.is_set():
                self._obsolete = self._motion
            with self._beginning:
                if self._moving and self._motion <= self._obsolete and time.monotonic() - sent > _AGAIN_S:
                    sent = time.monotonic()
                    self._stop_motion()
            try:
                state = self._hand.state
            except Exception as error:
                self._problem = str(fault_of_error(self._settings.address, error))
                return
            self._width, self._grasped = state.width, state.is_grasped

    def _stop_motion(self) -> None:
        try:
            self._hand.stop()
        except Exception as error:
            if type(error).__name__ != "CommandException":
                self._problem = str(fault_of_error(self._settings.address, error))


def import_franky() -> Any:
    """The client library. Raises ``BackendUnavailable`` with the command that installs it."""
    try:
        import franky
    except ImportError as error:
        problem = f"franky cannot be imported: {error}"
        raise BackendUnavailable("robot_driver", "franka", problem, install("memo-franka[hardware]")) from error
    return franky
