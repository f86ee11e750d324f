"""Robot code that is part of the suite as text: reference solutions and plain attempts."""

from __future__ import annotations

from importlib import resources

from memo_tabletop.reference import solution


def quirk_code(*names: str, using: tuple[str, ...] = (), calls: str = "") -> str:
    """Files of this suite's ``solutions/`` after those of the tabletop suite in ``using``, then the calls."""
    folder = resources.files("memo_tabletop.quirks.solutions")
    own = [folder.joinpath(f"{name}.py").read_text(encoding="utf-8") for name in names]
    return "\n\n".join([*([solution(*using)] if using else []), *own, calls])
