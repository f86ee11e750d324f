"""A policy of one's own on MEMO's tasks, through Gymnasium: it stacks the cubes with Cartesian targets at 20 Hz.

    python examples/gym_policy.py --seed 0

A learnt policy goes where ``Stacker`` is: an observation in, an action out.
"""

import argparse
import math
from collections.abc import Iterator

import gymnasium
import memo_gymnasium  # noqa: F401  (registers memo/…)
import numpy as np

OPEN, CLOSED, FORCE = 0.08, 0.0, 40.0  # m, m, N


def pointing_down(quaternion: np.ndarray) -> np.ndarray:
    """The rotation vector (rad) of a hand that points down, its fingers along the sides of a box turned so."""
    w, x, y, z = quaternion
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    yaw = (yaw + math.pi / 4) % (math.pi / 2) - math.pi / 4
    return math.pi * np.array([math.cos(yaw / 2), math.sin(yaw / 2), 0.0])


class Stacker:
    """Puts one thing on the other, from waypoint to waypoint, by what it saw when the way began."""

    def __init__(self, labels: tuple[str, ...], tower: tuple[str, ...]) -> None:
        """``labels``: what the rows of the observed nodes are called; ``tower``: what is stacked, from below."""
        self._tower = [labels.index(name) for name in tower]
        self._way = self._waypoints()
        self._waypoint: tuple[np.ndarray, np.ndarray, float, int] | None = None
        self._steps = 0

    def act(self, observation: dict[str, np.ndarray]) -> np.ndarray:
        self._nodes = observation["nodes"]
        self._waypoint = self._waypoint or next(self._way)
        place, turn, width, patience = self._waypoint
        self._steps += 1
        arrived = np.linalg.norm(observation["hand"][:3] - place) < 0.004 and self._steps > patience
        if arrived or self._steps > 100:
            self._waypoint, self._steps = next(self._way, self._waypoint), 0
        return np.array([*place, *turn, width, FORCE], np.float32)

    def _waypoints(self) -> Iterator[tuple[np.ndarray, np.ndarray, float, int]]:
        """Where the hand goes (m), how it is turned (rad), how wide it opens (m), and how many steps it stays."""
        for lower, upper in zip(self._tower, self._tower[1:], strict=False):
            cube = self._nodes[upper].copy()
            turn = pointing_down(cube[3:7])
            for height, width, patience in ((0.12, OPEN, 5), (0.0, OPEN, 10), (0.0, CLOSED, 20), (0.2, CLOSED, 5)):
                yield cube[:3] + [0.0, 0.0, height], turn, width, patience
            base = self._nodes[lower].copy()
            top = base[:3] + [0.0, 0.0, (base[9] + cube[9]) / 2]
            turn = pointing_down(base[3:7])
            for height, width, patience in ((0.12, CLOSED, 5), (0.003, CLOSED, 10), (0.003, OPEN, 20), (0.15, OPEN, 5)):
                yield top + [0.0, 0.0, height], turn, width, patience


def episode(seed: int, steps: int = 1500) -> tuple[bool, str]:
    """Whether the cubes are stacked in the scene of a seed, and what the task's check says."""
    environment = gymnasium.make("memo/StackTheCubes-v0", action="cartesian")
    observation, info = environment.reset(seed=seed)
    policy = Stacker(info["labels"], ("blue cube", "green cube", "red cube"))
    done = False
    for _ in range(steps):
        observation, _, done, too_long, info = environment.step(policy.act(observation))
        if done or too_long:
            break
    environment.close()
    return done, info["reason"]


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seed", type=int, default=0)
    done, reason = episode(options.parse_args().seed)
    print("done" if done else "not done", f"({reason})")
