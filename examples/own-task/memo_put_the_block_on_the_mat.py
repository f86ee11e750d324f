"""A task for MEMO: put the block on the mat."""

import numpy as np

from memo_core.plugin import Backend, Outcome, Task, hookimpl
from memo_core.scene import Body, Camera, Free, Geom, Pose, SceneDescription, look_at

SOLUTION = """
block, mat = get_position("block"), get_bounds("mat")
move_to([block[0], block[1], block[2] + 0.12], top_orientation())
move_straight(block)
close_gripper()
middle = [(low + high) / 2 for low, high in zip(mat[0], mat[1])]
height = mat[1][2] + get_size("block")[2] / 2 + 0.003
move_to([middle[0], middle[1], height + 0.12], top_orientation())
move_straight([middle[0], middle[1], height])
open_gripper()
move_straight([middle[0], middle[1], height + 0.12])
"""


class PutTheBlockOnTheMat(Task):
    """Success: the block lies on the mat, its middle within 5 cm of the mat's, and the robot has let it go."""

    name = "put-the-block-on-the-mat"
    instruction = "put the block on the mat"
    goal = ("the block is on the mat", "the hand has let go of the block")  # what a person wants to see at the end
    reference_solution = SOLUTION  # robot code that proves that it can be done; only `memo tasks verify` runs it

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = rng.uniform([0.40, -0.25], [0.55, -0.10])  # metres, in the robot's base frame; the table's top is z = 0
        mat = Geom("box", (0.16, 0.16, 0.004), colour=(0.2, 0.5, 0.4, 1.0))
        block = Geom("box", (0.04, 0.04, 0.04), colour=(0.8, 0.3, 0.2, 1.0), mass=0.1)
        bodies = (
            Body("mat", (mat,), Pose((0.50, 0.15, 0.002)), label="mat", fixture=True),
            Body("block", (block,), Pose((float(x), float(y), 0.02)), Free(), label="block"),
        )
        return SceneDescription(bodies, (Camera("front", look_at((1.2, -0.6, 0.6), (0.45, 0.0, 0.1))),))

    def check(self, world, monitors) -> Outcome:
        block, mat = np.array(world.body_pose("block").position), np.array(world.body_pose("mat").position)
        away = float(np.linalg.norm((block - mat)[:2]))
        touching = {name for contact in world.contacts("block") for name in (contact.first, contact.second)}
        if "mat" not in touching or away > 0.05:
            return Outcome(False, f"the block is {100 * away:.0f} cm from the mat's middle", {"away_m": away})
        if any(name.startswith("robot/") for name in touching):
            return Outcome(False, "the robot still touches the block", {"away_m": away})
        return Outcome(True, "the block lies on the mat", {"away_m": away})


@hookimpl
def memo_task_suites():
    task = PutTheBlockOnTheMat()
    return [Backend("suite", task.name, task.instruction, lambda settings: (task,))]
