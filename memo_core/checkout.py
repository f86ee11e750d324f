"""Plugins in the source checkout that are not installed, so that an error can say what to install.

A plugin of the checkout declares in its ``pyproject.toml``, under ``[tool.memo]``, what it offers (``offers = ["robot
my-arm"]``, kind and name). Only that file is read; a plugin that is not installed is never imported.
"""

from __future__ import annotations

import importlib.metadata
import json
import shlex
import tomllib
from collections.abc import Collection
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import attrs


@attrs.frozen
class Uninstalled:
    """A distribution, its folder, and the (kind, name) of the backends that it offers."""

    distribution: str
    folder: Path
    offers: tuple[tuple[str, str], ...]

    @property
    def command(self) -> str:
        """The command that installs it."""
        return f"pip install -e {shlex.quote(str(self.folder))}"


def uninstalled(installed: Collection[str], root: Path | None = None) -> tuple[Uninstalled, ...]:
    """The plugins under ``plugins/`` of the checkout at ``root`` (default: where memo-core was installed from) whose
    distribution is not among those installed. Empty without a checkout; a folder that cannot be read is skipped."""
    root = root or _checkout()
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


def _checkout() -> Path | None:
    """The source folder that the installer recorded, for an editable or a regular install."""
    try:
        noted = importlib.metadata.distribution("memo-core").read_text("direct_url.json")
        url = urlsplit(json.loads(noted or "{}").get("url", ""))
    except (importlib.metadata.PackageNotFoundError, ValueError, AttributeError):
        return None
    return Path(url2pathname(url.path)) if url.scheme == "file" else None
