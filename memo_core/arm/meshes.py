"""Reading mesh files of any format that URDFs name (.stl, .obj, .dae, …), as Pinocchio's collision checks read them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.scene.pose import Array

_POINTER = b"version https://git-lfs"


def mesh_vertices(file: str, scale: Sequence[float], where: str) -> Array:
    """Vertices of a mesh file in the mesh's own frame.

    Args:
        file: path of the mesh, in any format that coal reads (.stl, .obj, .dae, …).
        scale: factors (x, y, z) from the file's units to m.
        where: the link, for error messages.

    Returns:
        Scaled vertices of shape (k, 3), m.

    Raises:
        InvalidArgument: if the file cannot be opened or is not a readable mesh.
    """
    import coal

    try:
        mesh = coal.MeshLoader().load(file, np.array(scale, dtype=float))
    except (ValueError, RuntimeError) as error:
        raise _unreadable(file, where, error) from None
    return np.array(mesh.vertices())


def _unreadable(file: str, where: str, error: Exception) -> InvalidArgument:
    try:
        with Path(file).open("rb") as stream:
            start = stream.read(len(_POINTER))
    except OSError as why:
        return InvalidArgument(where, f"mesh {file!r} cannot be opened ({why.strerror})", "the path of a mesh")
    if start == _POINTER:
        problem = f"mesh {file!r} is a pointer of git-lfs, not the mesh itself"
        return InvalidArgument(where, problem, "the file: git lfs pull in its repository")
    *_, reason = (line for line in str(error).splitlines() if line.strip() and not line.startswith("Hint"))
    return InvalidArgument(where, f"mesh {file!r} cannot be read ({reason.strip()})", "a whole .stl, .obj or .dae file")
