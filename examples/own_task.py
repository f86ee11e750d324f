"""A task of one's own without installing anything: its scene, its check, robot code that does it, and doing nothing.

    python examples/own_task.py

`memo new task NAME` makes a plugin of one (examples/own-task), which `memo run` and every other command then know.
"""

import sys
from pathlib import Path

import memo_core as memo
from memo_core.environment import SimulatedEnvironment, run_code
from memo_core.plugin import BUILTIN_SKILLS, skill_library
from memo_core.sandbox import Sandbox

sys.path.insert(0, str(Path(__file__).parent / "own-task"))
from memo_put_the_block_on_the_mat import PutTheBlockOnTheMat


def main(seed: int = 0) -> tuple[bool, bool]:
    experiment, task = memo.load(), PutTheBlockOnTheMat()
    parts = (experiment.create(kind) for kind in ("simulator", "robot", "perception"))
    with SimulatedEnvironment(task, seed, *parts) as environment, Sandbox(skill_library(BUILTIN_SKILLS)) as sandbox:
        start = environment.checkpoint()
        environment.settle(task.settle)
        nothing = environment.check()
        print("doing nothing:", nothing.reason)
        environment.restore(start)
        run_code(environment, task.reference_solution, sandbox)  # as a run does, then lets things come to rest
        solved = environment.check()
        print("the reference solution:", solved.reason)
    return nothing.success, solved.success


if __name__ == "__main__":
    main()
