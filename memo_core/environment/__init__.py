"""Environments that a policy acts in."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.environment.simulated import SimulatedEnvironment as SimulatedEnvironment, find_task as find_task
    from memo_core.environment.task_environment import generator as generator
    from memo_core.environment.task_verification import run_code as run_code, run_program as run_program

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
