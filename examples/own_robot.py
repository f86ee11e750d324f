"""An arm of one's own: read from a URDF, put into a task's scene, moved.

    python examples/own_robot.py my-arm.urdf

`memo new robot my-arm --urdf my-arm.urdf` makes a plugin of it, which `memo run --set robot.backend=my-arm` then uses.
"""

import argparse
from pathlib import Path

import memo_core as memo
from memo_core.environment import SimulatedEnvironment, find_task
from memo_core.plugin import describe_urdf


def main(urdf: Path) -> float:
    described = describe_urdf(urdf.read_text(encoding="utf-8"), mesh_folder=str(urdf.parent))
    for guess in described.guessed:
        print(f"guessed {guess.what}: {guess.value} ({guess.why})")

    experiment = memo.load()  # simulator and perception: the installed defaults
    task = find_task(experiment.create("suite"), "stack-the-cubes")
    parts = (experiment.create("simulator"), described.robot, experiment.create("perception"))
    with SimulatedEnvironment(task, 0, *parts) as environment:
        cube = environment.look().node("red cube").pose.position
        goal = [cube[0], cube[1], cube[2] + 0.12]  # m, base frame
        environment.control.move_to(goal, [0.0, 1.0, 0.0, 0.0], None, 0.0, 0.5)  # the hand points down
        away = environment.control.tool_pose().position
        off = max(abs(a - g) for a, g in zip(away, goal, strict=True))
        print(f"the hand is above the red cube, off by {1000 * off:.1f} mm")
    return off


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("urdf", type=Path)
    main(options.parse_args().urdf)
