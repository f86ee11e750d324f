"""Joint limits and springs that a scene's mechanisms change while the simulation runs."""

from __future__ import annotations

from typing import Any

import mujoco

# Limits as stiff as 2 ms allow: what they hold is often light, and MuJoCo's limits give way the more the lighter it is.
LOCK_SOLREF = (0.004, 1.0)
LOCK_SOLIMP = (0.99, 0.999, 0.001, 0.5, 2.0)


class JointLimits:
    """Sets limits and springs of hinge and slide joints by name, in the model itself."""

    def __init__(self, model: Any) -> None:
        self._model = model
        self._ids: dict[str, tuple[int, int]] = {}  # joint -> (id, qpos address)

    def limit(self, joint: str, lower: float, upper: float) -> None:
        """Raises ``KeyError`` for a joint that does not exist."""
        index, _ = self._find(joint)
        self._model.jnt_range[index] = (lower, upper)

    def spring(self, joint: str, stiffness: float, rest: float) -> None:
        """Raises ``KeyError`` for a joint that does not exist."""
        index, address = self._find(joint)
        self._model.jnt_stiffness[index] = stiffness
        self._model.qpos_spring[address] = rest

    def _find(self, joint: str) -> tuple[int, int]:
        found = self._ids.get(joint)
        if found is None:
            index = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_JOINT, joint)
            if index < 0:
                raise KeyError(joint)
            found = self._ids[joint] = (index, int(self._model.jnt_qposadr[index]))
            self._model.jnt_solref[index] = LOCK_SOLREF
            self._model.jnt_solimp[index] = LOCK_SOLIMP
        return found
