"""Expanding xacro, the macro language that most robot descriptions are written in, to URDF.

The work is done by the optional package ``xacro``. Where ``xacrodoc`` is installed too, ROS packages that a file names
(``$(find NAME)``) are found without ROS: next to the file, in the folders above it, and in further folders.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from memo_core.errors import InvalidArgument


def is_xacro(path: Path, text: str) -> bool:
    """Whether a file is to be expanded: by its name, or by what stands in it."""
    return path.suffix == ".xacro" or "<xacro:" in text


def expand_xacro(path: Path, arguments: Mapping[str, str], folders: Sequence[Path], remedy: str) -> str:
    """URDF text of a xacro file. ``arguments``: its ``<xacro:arg>`` by name; ``folders``: where ROS packages may lie
    besides near the file; ``remedy``: the command that installs xacro. Raises ``InvalidArgument`` where xacro is not
    installed, or does not succeed."""
    try:
        import xacro
    except ModuleNotFoundError:
        plain = path.name.removesuffix(".xacro").removesuffix(".urdf") + ".urdf"
        problem = f"{path} is xacro; expand it first: xacro {path.name} > {plain}"
        right = f"a URDF file, or what memo expands it with: {remedy}"
        raise InvalidArgument("--urdf", problem, right) from None
    document = _expanded(xacro, path, dict(arguments), [path.resolve().parent, *folders], remedy)
    if not document.getElementsByTagName("link"):
        problem = f"{path} expands to a robot without links: it may only define macros, or make nothing by default"
        raise InvalidArgument("--urdf", problem, "the file that calls them, or arguments such as add_gripper:=true")
    return str(document.toxml())


def _expanded(xacro: Any, path: Path, arguments: dict[str, str], folders: Sequence[Path], remedy: str) -> Any:
    """xacro's document, with each ROS package that it misses looked for near."""
    packages = _package_index(path)
    added: set[str] = set()
    while True:
        try:
            return xacro.process_file(str(path), mappings=arguments)
        except Exception as error:  # xacro raises what the evaluated expressions raise
            if packages is None and "ament_index_python" in str(error):
                problem = f"{path} names ROS packages, which xacro alone finds in a sourced ROS workspace only"
                right = f"{remedy}, which looks near the file"
                raise InvalidArgument("--urdf", problem, right) from None
            name = _missing_package(error)
            if name is None:
                raise InvalidArgument("--urdf", f"{path}: xacro says: {_said(error)}", _expected(path)) from None
            found = _package(name, folders)
            if packages is None or found is None or name in added:
                problem = f"{path} needs the ROS package {name!r}, which is not near it"
                right = f"--mesh-folder DIR, the folder of {name!r} or one that holds it"
                raise InvalidArgument("--urdf", problem, right) from None
            packages.update_package_cache({name: str(found)})
            added.add(name)


def _package_index(path: Path) -> Any:
    """xacrodoc's index of ROS packages, or None where only xacro is installed."""
    try:
        from xacrodoc import packages
    except ModuleNotFoundError:
        return None
    packages.reset()
    packages.walk_up_from(path)
    return packages


def _missing_package(error: BaseException | None) -> str | None:
    """The ROS package that was not found, if that is why xacro failed."""
    while error is not None:
        if type(error).__name__ in ("PackageNotFoundError", "ResourceNotFound"):
            return str(error.args[0])
        error = getattr(error, "exc", None) or error.__cause__ or error.__context__
    return None


def _package(name: str, folders: Sequence[Path]) -> Path | None:
    """The folder of a ROS package: called so, or with a ``package.xml`` that says so."""
    for folder in folders:
        for place in (folder, *folder.resolve().parents):
            if (place / name).is_dir():
                return place / name
            for manifest in (place / "package.xml", *place.glob("*/package.xml")):
                if re.search(rf"<name>\s*{re.escape(name)}\s*</name>", _text(manifest)):
                    return manifest.parent
    return None


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _said(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _expected(path: Path) -> str:
    names = dict.fromkeys(re.findall(r'<xacro:arg\s+name="([^"]+)"', _text(path)))
    told = f"; it declares {', '.join(names)}" if names else ""
    return f"arguments that it can be expanded with, as KEY:=VALUE{told}"
