"""A stop that is pressed in a signal handler, which may have interrupted a press."""

from __future__ import annotations

import sys
import threading

import pytest

from memo_core.errors import Stopped
from memo_core.process.stop_switch import Leaving, StopSwitch, abandonable
from memo_core.testing.ideal_link import IdealLink
from tests.support.arms import six_joint_arm


def interrupted_everywhere(press, again) -> None:
    """Call ``press``, and ``again`` before each line that it runs, as signal handlers may."""
    inside = False

    def trace(frame, event, argument):
        nonlocal inside
        if not inside:
            inside = True
            again()
            inside = False
        return trace

    sys.settrace(trace)
    try:
        press()
    finally:
        sys.settrace(None)


def ends(work) -> bool:
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(5)
    return not thread.is_alive()


def test_a_press_may_interrupt_a_press():
    stop = StopSwitch()
    assert ends(lambda: interrupted_everywhere(stop.press, stop.press))
    assert stop.pressed


@pytest.mark.parametrize("run", [abandonable, None], ids=["abandonable", "leaving"])
def test_a_press_may_interrupt_a_press_that_wakes_what_waits(run):
    stop, begun, go_on = StopSwitch(), threading.Event(), threading.Event()

    def work() -> None:
        begun.set()
        go_on.wait(10)

    def wait() -> None:
        with pytest.raises(Stopped):
            if run is abandonable:
                abandonable(stop, "work", work, lambda late: None)
            else:
                Leaving(stop).do("work", work)

    waiting = threading.Thread(target=wait, daemon=True)
    waiting.start()
    begun.wait(5)
    assert ends(lambda: interrupted_everywhere(stop.press, stop.press))
    waiting.join(5)
    go_on.set()
    assert not waiting.is_alive()


def test_a_links_stop_may_interrupt_itself():
    link = IdealLink(six_joint_arm())
    assert ends(lambda: interrupted_everywhere(link.stop, link.stop))
    assert link.stopped
