"""The loop of the method: plan, retrieve, write code, execute, take feedback, keep what worked."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.policy.method_interface import Method as Method
    from memo_core.policy.plan_feedback import PLANNING as PLANNING
    from memo_core.policy.results import RunResult as RunResult, SubtaskResult as SubtaskResult
    from memo_core.policy.run_context import Session as Session

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
