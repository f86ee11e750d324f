"""Reading mesh files of any format that URDFs name (.stl, .obj, .dae, …), as Pinocchio's collision checks read them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.scene.pose import Array

_POINTER = b"version https://git-lfs"


def mesh_vertices(file: str, scale: Sequence[float], where: str) -> Array:
    """Vertices (k, 3) of a mesh, m. Raises ``InvalidArgument``, ``where`` naming the link, for what is no mesh."""
    import coal

    try:
        mesh = coal.MeshLoader().load(file, np.array(scale, dtype=float))
    except (ValueError, RuntimeError) as error:
        raise _unreadable(file, where, error) from None
    return np.array(mesh.vertices())


def _unreadable(file: str, where: str, error: Exception) -> InvalidArgument:
    with Path(file).open("rb") as stream:
        start = stream.read(len(_POINTER))
    if start == _POINTER:
        problem = f"mesh {file!r} is a pointer of git-lfs, not the mesh itself"
        return InvalidArgument(where, problem, "the file: git lfs pull in its repository")
    *_, reason = (line for line in str(error).splitlines() if line.strip() and not line.startswith("Hint"))
    return InvalidArgument(where, f"mesh {file!r} cannot be read ({reason.strip()})", "a whole .stl, .obj or .dae file")
