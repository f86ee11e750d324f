"""``memo bench trial`` says of each moment what the policy's thread was at."""

from __future__ import annotations

import sys
import threading
import time

import pytest
from memo_benchmarks.trial import POLICY_THREAD, Sampler, bench_trial, place_of

from memo_core.runs.run_errors import Halted


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


@pytest.mark.sim
def test_trials_that_could_not_be_carried_out_are_not_measured():
    nowhere = ("llm.backend=litellm", "llm.model=openai/x", "llm.api_base=http://127.0.0.1:9/v1", "run.retries=0")
    with pytest.raises(Halted):
        bench_trial(None, nowhere, ("pick-the-left-can",), 1)
