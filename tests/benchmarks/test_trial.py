"""``memo bench trial`` says of each moment what the policy's thread was at."""

from __future__ import annotations

import sys
import threading
import time

from memo_benchmarks.trial import POLICY_THREAD, Sampler, place_of


def framed(file: str, function):
    """``function`` as if it stood in another file."""
    made: dict = {}
    exec(compile("def call(function):\n    return function()", file, "exec"), made)
    return lambda: made["call"](function)


def test_the_innermost_function_of_ours_counts():
    def here():
        return place_of(sys._getframe())

    stepping = framed("/x/memo_sim_mujoco/simulation.py", here)
    assert framed("/x/memo_core/arm/control.py", stepping)() == "physics"
    assert (
        framed("/x/memo_sim_mujoco/simulation.py", framed("/x/memo_core/arm/motion.py", here))()
        == "planning and control"
    )
    assert framed("/x/memo_core/policy/loop.py", framed("/lib/json.py", here))() == "the loop"
    assert framed("/lib/json.py", lambda: place_of(None))() == "elsewhere"


def test_shares_are_of_the_policy_s_thread_and_of_the_time_without_one():
    with Sampler() as sampler:
        planning = framed("/x/memo_core/arm/motion.py", lambda: time.sleep(0.3))
        thread = threading.Thread(target=planning, name=POLICY_THREAD)
        thread.start()
        thread.join()
        time.sleep(0.3)
    assert set(sampler.shares) == {"planning and control", "start and end"}
    assert abs(sum(sampler.shares.values()) - 1) < 0.01
