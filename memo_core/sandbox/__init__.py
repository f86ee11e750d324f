"""Running code that a model wrote."""

from memo_core.sandbox.execution import Execution
from memo_core.sandbox.limits import Limits
from memo_core.sandbox.sandbox import Sandbox
from memo_core.sandbox.subset import Finding
from memo_core.sandbox.workspace import Workspace

__all__ = ["Execution", "Finding", "Limits", "Sandbox", "Workspace"]
