"""Ids of environments: ``open-the-fridge`` is ``memo/OpenTheFridge-v0``."""

from __future__ import annotations

import math

import gymnasium

import memo_core
from memo_gymnasium.environment import STEP_S


def env_id(task: str) -> str:
    """The id of a task's environment."""
    return f"memo/{''.join(word.capitalize() for word in task.split('-'))}-v0"


def register_tasks() -> tuple[str, ...]:
    """Register an environment for each task of each installed suite whose scenes any simulator builds.

    Returns:
        The ids. Of two tasks with one name the first suite's is registered, by the suites' names; ``suite=…`` makes the
        other.
    """
    ids: dict[str, None] = {}
    registry = memo_core.registry()
    for suite in registry.backends("suite"):
        if suite.own_world:
            continue
        for task in suite.factory(suite.config()):
            name = env_id(task.name)
            if name in ids:
                continue
            ids[name] = None
            if name not in gymnasium.registry:
                gymnasium.register(
                    id=name,
                    entry_point="memo_gymnasium.environment:TaskEnv",
                    max_episode_steps=math.ceil(task.time_limit / STEP_S),
                    kwargs={"task": task.name, "suite": suite.name},
                )
    return tuple(ids)
