"""Plugins in the source checkout that are not installed, so that an error can say what to install.

A plugin of the checkout declares in its ``pyproject.toml``, under ``[tool.memo]``, what it offers (``offers = ["robot
my-arm"]``, kind and name). Only that file is read; a plugin that is not installed is never imported.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection
from pathlib import Path

import attrs

from memo_core.plugins.installing import folder_of, pip_install


@attrs.frozen
class Uninstalled:
    """A distribution, its folder, and the (kind, name) of the backends that it offers."""

    distribution: str
    folder: Path
    offers: tuple[tuple[str, str], ...]

    @property
    def command(self) -> str:
        """The command that installs it."""
        return pip_install("-e", str(self.folder))


def uninstalled(installed: Collection[str], root: Path | None = None) -> tuple[Uninstalled, ...]:
    """The plugins under ``plugins/`` of the checkout at ``root`` (default: where memo-core was installed from) whose
    distribution is not among those installed. Empty without a checkout; a folder that cannot be read is skipped."""
    root = root or folder_of("memo-core")
    found = []
    for file in sorted(root.glob("plugins/*/pyproject.toml")) if root else ():
        try:
            project = tomllib.loads(file.read_text(encoding="utf-8"))
            name = str(project["project"]["name"])
            offers = tuple(_offer(one) for one in project["tool"]["memo"]["offers"])
        except (OSError, KeyError, TypeError, ValueError, AttributeError):
            continue
        if name not in installed:
            found.append(Uninstalled(name, file.parent, offers))
    return tuple(found)


def _offer(text: str) -> tuple[str, str]:
    kind, name = text.split()
    return kind, name
