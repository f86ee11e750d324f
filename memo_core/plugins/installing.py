"""Commands that install what is missing, and distributions of which files are missing though they are installed.

Versions come from what is installed or from what an installed plugin asks for, never from this file.
"""

from __future__ import annotations

import functools
import importlib.metadata
import json
import re
import shlex
import shutil
import sys
import tomllib
from importlib import resources
from importlib.metadata import Distribution, PackageNotFoundError
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import attrs

from memo_core.plugins.entry_points import installed

_NAME = re.compile(r"\s*([A-Za-z0-9][A-Za-z0-9._-]*)\s*(\[[^]]*\])?([^;]*)")
_IMPORTABLE = (".py", ".so", ".pyd")


EXTRAS = {  # of memo-core, with their use and their modules
    "arm": ("moving a robot", ("pinocchio", "coal", "ruckig", "scipy")),
    "video": ("writing videos", ("imageio_ffmpeg", "PIL")),
}


@attrs.frozen
class Damage:
    """Files of an installed distribution that are gone; ``remedy`` is the command that brings them back."""

    distribution: str
    files: tuple[str, ...]
    remedy: str

    def __str__(self) -> str:
        return f"{len(self.files)} files of {self.distribution}, which is installed (such as {self.files[0]})"


def pip_install(*arguments: str) -> str:
    """The shell command that installs ``arguments`` into the environment that runs MEMO, activated or not."""
    pip = shutil.which("pip")
    ours = pip is not None and Path(pip).parent == Path(sys.executable).parent
    start = ["pip"] if ours else [sys.executable, "-m", "pip"]
    return shlex.join([*start, "install", *arguments])


def install(wanted: str, module: str = "") -> str:
    """Shell command that installs what is missing.

    Args:
        wanted: a distribution, or an extra of one, such as ``memo-perception[local]``.
        module: the module of it that cannot be imported.

    Returns:
        The command: from the folder that it was installed from; from MEMO's release if it is MEMO's; anew if it is
        installed and the module is not there; else in the version that an installed plugin asks for. ``install NAME``
        if none is known.
    """
    name, extra, _ = _parts(wanted)
    if (folder := folder_of(name)) is not None:
        return install_folder(folder, extra)
    if name in released() and (extra or not _with_requirements(name)):
        return install_released(name, extra)
    if _with_requirements(name) and not extra:
        return reinstall(name, module)
    requirement = _requirement(name)
    return pip_install(requirement) if requirement else f"install {wanted}"


def needed(module: str) -> str:
    """Say what needs a module that cannot be imported, and the command that installs it.

    Args:
        module: name of the module, such as ``pinocchio``.

    Returns:
        The sentence; empty for a module that neither the core nor one of ``EXTRAS`` brings.
    """
    for extra, (use, modules) in EXTRAS.items():
        if module in modules:
            return f"{use} needs the Python module {module} ({install(f'memo-core[{extra}]')})"
    required = importlib.metadata.requires("memo-core") or ()
    if _normal(module) in {_normal(_parts(text)[0]) for text in required if "extra ==" not in text}:
        return f"memo-core needs the Python module {module} ({install('memo-core')})"
    return ""


def install_folder(folder: Path, extra: str = "") -> str:
    """The command that installs a distribution from its source folder, and in the checkout with its pinned versions.

    Args:
        folder: where its ``pyproject.toml`` lies.
        extra: an extra of it in brackets, or nothing.
    """
    checkout = folder_of("memo-core")
    constraints = checkout / "constraints.txt" if checkout and folder.is_relative_to(checkout) else None
    pinned = ["--constraint", str(constraints)] if constraints and constraints.is_file() else []
    return pip_install("-e", f"{folder}{extra}", *pinned)


def install_released(distribution: str, extra: str = "") -> str:
    """The command that installs a distribution of MEMO, in the version of the core, from the folder of its release.

    Args:
        distribution: its name.
        extra: an extra of it in brackets, or nothing.
    """
    version = importlib.metadata.version("memo-core")
    folder = f"memo-{version}"
    constraints = f"{folder}/constraints.txt"
    return pip_install("--find-links", folder, "--constraint", constraints, f"{distribution}{extra}=={version}")


@functools.cache
def released() -> dict[str, list[str]]:
    """Read from ``offers.toml``, written by ``python tools/tables.py``, the backends (by kind and name) and commands of
    each plugin of MEMO, such as ``robot panda default``, ``command web``. The core is there too, with nothing."""
    text = resources.files(__package__).joinpath("offers.toml").read_text(encoding="utf-8")
    return {"memo-core": [], **tomllib.loads(text)}


def reinstall(distribution: str, module: str) -> str:
    """Shell command that writes all files of an installed distribution anew.

    Required distributions with files in the same module are reinstalled with it: reinstalling one alone would remove
    files of the others.

    Args:
        distribution: name of the distribution.
        module: top-level package that the distributions share.

    Returns:
        The command; that of ``install`` if the distribution is not installed.
    """
    sharing = [one for one in _with_requirements(distribution) if one.name == distribution or _files(one, module)]
    pinned = sorted(f"{one.name}=={one.version}" for one in sharing)
    return pip_install("--force-reinstall", "--no-deps", *pinned) if pinned else install(distribution)


@functools.cache
def damage(distribution: str, module: str) -> Damage | None:
    """The first distribution with importable files in ``module`` of which some are gone: ``distribution`` or one that
    it requires. When a wheel is divided into several, the upgrade removes files of the new ones with those of the old.
    None where all are there, or nothing is recorded of them. Tests are left out: people remove them to save space."""
    for one in _with_requirements(distribution):
        gone = tuple(
            file for file in _files(one, module) if "test" not in file and not Path(str(one.locate_file(file))).exists()
        )
        if gone:
            return Damage(f"{one.name} {one.version}", gone, reinstall(distribution, module))
    return None


def folder_of(distribution: str) -> Path | None:
    """The source folder that the installer recorded, for an editable or a regular install; None for a wheel's."""
    try:
        noted = importlib.metadata.distribution(distribution).read_text("direct_url.json")
        url = urlsplit(json.loads(noted or "{}").get("url", ""))
    except (PackageNotFoundError, ValueError, AttributeError):
        return None
    path = Path(url2pathname(url.path))
    return path if url.scheme == "file" and path.is_dir() else None


def _with_requirements(distribution: str) -> list[Distribution]:
    """A distribution and those it requires without an extra, as far as they are installed."""
    try:
        found = importlib.metadata.distribution(distribution)
    except (PackageNotFoundError, ValueError):
        return []
    required = []
    for text in found.requires or ():
        if "extra ==" not in text:
            try:
                required.append(importlib.metadata.distribution(_parts(text)[0]))
            except (PackageNotFoundError, ValueError):
                continue
    return [found, *required]


def _files(distribution: Distribution, module: str) -> tuple[str, ...]:
    """The importable files in ``module`` that a distribution's RECORD lists."""
    recorded = (line.partition(",")[0].strip('"') for line in (distribution.read_text("RECORD") or "").splitlines())
    return tuple(file for file in recorded if file.startswith(f"{module}/") and file.endswith(_IMPORTABLE))


def _requirement(name: str) -> str:
    """The requirement of an installed plugin on a distribution, such as ``numpy>=2``; empty if none does."""
    for point in installed("memo")[0]:
        for text in (point.dist.requires or ()) if point.dist is not None else ():
            required, extra, versions = _parts(text)
            if _normal(required) == _normal(name):
                return f"{required}{extra}{versions.strip()}"
    return ""


def _parts(requirement: str) -> tuple[str, str, str]:
    """Name, extra in brackets, and versions of a requirement."""
    found = _NAME.match(requirement)
    return (found.group(1), found.group(2) or "", found.group(3)) if found else (requirement, "", "")


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
