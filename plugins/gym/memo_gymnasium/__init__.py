"""MEMO's tasks as Gymnasium environments: importing this module registers one for each task of each installed suite.

import gymnasium
import memo_gymnasium

env = gymnasium.make("memo/OpenTheFridge-v0")
"""

from memo_gymnasium.environment import TaskEnv
from memo_gymnasium.registration import env_id, register_tasks

__all__ = ["TaskEnv", "env_id", "register_tasks"]

register_tasks()
