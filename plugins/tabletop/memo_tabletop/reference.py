"""Reference solutions: robot code written by hand, used by tests and ``memo tasks verify`` only.

The files in ``solutions/`` are robot code, not modules of this package: the skills they call exist in the sandbox only.
"""

from __future__ import annotations

from importlib import resources


def solution(*names: str, calls: str = "") -> str:
    """The text of these files, one after the other, then the calls."""
    folder = resources.files("memo_tabletop.solutions")
    return "\n\n".join([*(folder.joinpath(f"{name}.py").read_text(encoding="utf-8") for name in names), calls])
