"""MEMO's own plugins that are not installed, so that an error can say what to install.

A plugin declares in its ``pyproject.toml``, under ``[tool.memo]``, what it offers (``offers = ["robot my-arm"]``, kind
and name, then ``default`` where the backend is declared as that), and its commands as entry points. In a checkout these
files are read; an installation from wheels has them in ``offers.toml``, which ``python tools/tables.py`` writes. A
plugin that is not installed is never imported.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import MemoError
from memo_core.plugins.installing import folder_of, install_folder, install_released, released

COMMAND = "command"


@attrs.frozen
class Uninstalled:
    """A distribution, the (kind, name) of the backends and commands that it offers, the kinds of which one is a
    default, and its folder in the checkout."""

    distribution: str
    offers: tuple[tuple[str, str], ...]
    defaults: frozenset[str]
    folder: Path | None = None

    @property
    def command(self) -> str:
        """The command that installs it."""
        return install_folder(self.folder) if self.folder else install_released(self.distribution)


@attrs.define(auto_exc=True, eq=False)
class CommandNotInstalled(MemoError):
    """A command of a plugin that is not installed."""

    name: str
    offered: Uninstalled

    exit_code = 2

    def __str__(self) -> str:
        return f"the command {self.name!r} is of {self.offered.distribution}, not installed ({self.offered.command})"


def uninstalled(installed: Collection[str], root: Path | None = None) -> tuple[Uninstalled, ...]:
    """The plugins of MEMO that offer backends and are not installed.

    Args:
        installed: names of the installed distributions.
        root: the checkout; None: where memo-core was installed from, or ``offers.toml`` if that is no checkout.

    Returns:
        The plugins, by folder or name. A folder that cannot be read is skipped.
    """
    return tuple(
        one
        for one in _offered(root)
        if one.distribution not in installed and any(kind != COMMAND for kind, _ in one.offers)
    )


def offering_command(name: str) -> Uninstalled | None:
    """The plugin of MEMO that offers a command, installed or not; None if there is none."""
    return next((one for one in _offered() if (COMMAND, name) in one.offers), None)


def offers_of(project: dict[str, Any]) -> tuple[str, ...]:
    """List what a ``pyproject.toml`` offers: backends and commands, such as ``robot panda default``.

    Raises:
        KeyError, TypeError, AttributeError: if it declares nothing, or in another form.
    """
    commands = project["project"].get("entry-points", {}).get("memo.commands", {})
    backends = project.get("tool", {}).get("memo", {}).get("offers", [])
    return (*(str(one) for one in backends), *(f"{COMMAND} {name}" for name in commands))


def _offered(root: Path | None = None) -> list[Uninstalled]:
    root = root or folder_of("memo-core")
    files = [*sorted(root.glob("plugins/*/pyproject.toml")), *root.glob("benchmarks/pyproject.toml")] if root else []
    if not files:
        return [_plugin(name, offers) for name, offers in released().items()]
    found = []
    for file in files:
        try:
            project = tomllib.loads(file.read_text(encoding="utf-8"))
            found.append(_plugin(str(project["project"]["name"]), offers_of(project), file.parent))
        except (OSError, KeyError, TypeError, ValueError, AttributeError):
            continue
    return found


def _plugin(distribution: str, offers: Collection[str], folder: Path | None = None) -> Uninstalled:
    stated = [one.split() for one in offers]
    defaults = frozenset(kind for kind, _, *more in stated if more == ["default"])
    return Uninstalled(distribution, tuple((kind, name) for kind, name, *_ in stated), defaults, folder)
