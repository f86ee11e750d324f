"""Modules that plugins of version 0.1 import under their former names; importing one warns with the new name."""

import importlib
import sys

TYPE_CHECKING = False  # importing typing would take longer than everything else here
if TYPE_CHECKING:
    from collections.abc import Sequence
    from importlib.machinery import ModuleSpec
    from types import ModuleType

MOVED = {
    "memo_core.hooks": "memo_core.plugins.hooks",
    "memo_core.installing": "memo_core.plugins.installing",
    "memo_core.parsing": "memo_core.text.parsing",
    "memo_core.policy.session": "memo_core.policy.run_context",
    "memo_core.redaction": "memo_core.text.redaction",
    "memo_core.robot.urdf_checks": "memo_core.robot.urdf.checks",
    "memo_core.robot.urdf_text": "memo_core.robot.urdf.text",
    "memo_core.temporary_folders": "memo_core.process.temporary_folders",
}


class MovedModules:
    """A finder for ``sys.meta_path``, asked after all others: the former name is the module itself."""

    def find_spec(self, name: str, path: "Sequence[str] | None" = None, target: object = None) -> "ModuleSpec | None":
        if name not in MOVED:
            return None
        from importlib.util import spec_from_loader

        return spec_from_loader(name, self)  # type: ignore[arg-type]

    def create_module(self, spec: "ModuleSpec") -> "ModuleType":
        import warnings

        new = MOVED[spec.name]
        note = f"{spec.name} is now {new}; plugins import such names from memo_core.plugin"
        warnings.warn(note, FutureWarning, stacklevel=2)
        module = importlib.import_module(new)
        self._spec = module.__spec__
        return module

    def exec_module(self, module: "ModuleType") -> None:
        module.__spec__ = self._spec  # the import system has replaced it


def install() -> None:
    """Let the former names be found. Idempotent."""
    if not any(isinstance(finder, MovedModules) for finder in sys.meta_path):
        sys.meta_path.append(MovedModules())
