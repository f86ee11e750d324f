"""A compiled world: the model, its data, and the indices of everything in the descriptions."""

from __future__ import annotations

import hashlib
from typing import Any

import attrs
import mujoco
import numpy as np

from memo_core.plugin import (
    FingerLinkage,
    Free,
    Hinge,
    InvalidArgument,
    RobotDescription,
    SceneDescription,
    Slide,
    read_urdf,
)
from memo_sim_mujoco.robot import FINGER_SERVO, add_pad_contacts, add_robot
from memo_sim_mujoco.scene import PREFIX, add_look, add_scene
from memo_sim_mujoco.settings import MujocoSettings

DENSE_UP_TO = 60  # degrees of freedom


@attrs.frozen(eq=False)
class Latched:
    """Where one latch acts: it holds while the joint is within ``width`` of ``position``."""

    actuator: int
    qpos: int
    position: float
    width: float
    gain: float
    bias: tuple[float, float]


@attrs.frozen(eq=False)
class MujocoWorld:
    """``body_ids`` maps names (scene bodies, ``robot/LINK``) to MuJoCo's; ``body_names`` is its inverse by id."""

    model: Any
    data: Any
    robot: RobotDescription
    fingerprint: bytes
    body_ids: dict[str, int]
    body_names: tuple[str, ...]
    joint_qpos: dict[str, int]
    joint_dof: dict[str, int]
    free_qpos: dict[str, tuple[int, int]]  # body -> (qpos address, dof address)
    arm_qpos: np.ndarray
    arm_dof: np.ndarray
    finger_qpos: np.ndarray
    finger_servo: int  # -1 without a gripper
    linkage: FingerLinkage | None  # of fingers on hinges
    pad_bodies: tuple[tuple[int, int], ...]  # (body id, id of the joint it slides on)
    robot_bodies: frozenset[int]
    tool_body: int
    latches: tuple[Latched, ...]


def build_world(scene: SceneDescription, robot: RobotDescription, settings: MujocoSettings) -> MujocoWorld:
    """Compile both descriptions and put the robot at home, gripper open. Raises ``InvalidArgument``."""
    spec = mujoco.MjSpec()
    spec.modelname = robot.name
    spec.compiler.degree = False
    _set_options(spec, settings)
    add_look(spec, scene, settings)
    add_robot(spec, robot, settings.self_collision)
    add_scene(spec, scene)
    add_pad_contacts(spec, robot.gripper)
    try:
        model = spec.compile()
        # Dense is faster in small scenes; with 25 grains sparse is four to six times faster. 4.0.0's sparse Newton is
        # said to have a wrong Hessian: a test compares what the two find in a heap of grains that is knocked over.
        if settings.jacobian == "auto" and model.nv > DENSE_UP_TO:
            spec.option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
            model = spec.compile()
    except ValueError as error:
        raise InvalidArgument("scene", f"MuJoCo cannot build it ({error})", "a scene that can exist") from error
    _damp_free_bodies(model, scene)
    data = mujoco.MjData(model)
    world = _index(model, data, scene, robot)
    _start(world, scene)
    return world


def _set_options(spec: Any, settings: MujocoSettings) -> None:
    option = spec.option
    option.timestep = settings.timestep
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = settings.impratio
    option.iterations = settings.iterations
    option.tolerance = settings.tolerance
    option.solver = {
        "newton": mujoco.mjtSolver.mjSOL_NEWTON,
        "cg": mujoco.mjtSolver.mjSOL_CG,
        "pgs": mujoco.mjtSolver.mjSOL_PGS,
    }[settings.solver]
    option.jacobian = {
        "auto": mujoco.mjtJacobian.mjJAC_DENSE,
        "dense": mujoco.mjtJacobian.mjJAC_DENSE,
        "sparse": mujoco.mjtJacobian.mjJAC_SPARSE,
    }[settings.jacobian]
    # A diverged simulation must be an error, not a silent start from the beginning.
    option.disableflags = int(option.disableflags) | int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def _damp_free_bodies(model: Any, scene: SceneDescription) -> None:
    for body, _ in scene.walk():
        if isinstance(body.joint, Free) and body.joint.damping > 0:
            index = model.body(body.name).id
            dof = int(model.body_dofadr[index])
            model.dof_damping[dof : dof + 3] = body.joint.damping * model.body_mass[index]
            model.dof_damping[dof + 3 : dof + 6] = body.joint.damping * model.body_inertia[index].max()


def _index(model: Any, data: Any, scene: SceneDescription, robot: RobotDescription) -> MujocoWorld:
    names = tuple("floor" if index == 0 else model.body(index).name for index in range(model.nbody))
    joint_qpos, joint_dof, free = {}, {}, {}
    for body, _ in scene.walk():
        if isinstance(body.joint, (Hinge, Slide)):
            joint = model.joint(body.joint.name)
            joint_qpos[body.joint.name] = int(joint.qposadr[0])
            joint_dof[body.joint.name] = int(joint.dofadr[0])
        elif isinstance(body.joint, Free):
            joint = model.joint(f"{body.name}/free")
            free[body.name] = (int(joint.qposadr[0]), int(joint.dofadr[0]))
    arm = [model.joint(PREFIX + name) for name in robot.joint_names]
    fingers = [model.joint(PREFIX + name) for name in robot.gripper.finger_joints]
    slides = {int(model.jnt_bodyid[joint.id]): joint.id for joint in fingers}
    ids = {name: index for index, name in enumerate(names)}
    cup = robot.gripper.kind == "vacuum"
    pads = tuple((ids[PREFIX + pad], -1 if cup else _slide_of(model, robot, pad, slides)) for pad in robot.gripper.pads)
    servo = model.actuator(FINGER_SERVO).id if fingers or cup else -1
    linkage = FingerLinkage(read_urdf(robot.urdf, robot.mesh_folder), robot.gripper) if fingers else None
    return MujocoWorld(
        model=model,
        data=data,
        robot=robot,
        fingerprint=_fingerprint(model, scene),
        body_ids=ids,
        body_names=names,
        joint_qpos=joint_qpos,
        joint_dof=joint_dof,
        free_qpos=free,
        arm_qpos=np.array([joint.qposadr[0] for joint in arm], dtype=np.intp),
        arm_dof=np.array([joint.dofadr[0] for joint in arm], dtype=np.intp),
        finger_qpos=np.array([joint.qposadr[0] for joint in fingers], dtype=np.intp),
        finger_servo=servo,
        linkage=None if linkage is None or linkage.slides else linkage,
        pad_bodies=pads,
        robot_bodies=frozenset(index for index, name in enumerate(names) if name.startswith(PREFIX)),
        tool_body=ids[PREFIX + robot.tool_link],
        latches=tuple(_latched(model, number, latch, joint_qpos) for number, latch in enumerate(scene.latches)),
    )


def _slide_of(model: Any, robot: RobotDescription, pad: str, slides: dict[int, int]) -> int:
    """The joint that moves a pad: its own link's, or that of the link it is fixed to."""
    body = model.body(PREFIX + pad).id
    while body and body not in slides:
        body = int(model.body_parentid[body])
    if not body:
        problem = f"no finger joint moves {pad!r}"
        raise InvalidArgument(f"robot {robot.name!r}: gripper.pads", problem, "links that the finger joints carry")
    return slides[body]


def _latched(model: Any, number: int, latch: Any, joint_qpos: dict[str, int]) -> Latched:
    actuator = model.actuator(f"latch/{number}").id
    bias = model.actuator_biasprm[actuator]
    gain = float(model.actuator_gainprm[actuator, 0])
    return Latched(
        actuator, joint_qpos[latch.joint], latch.position, latch.width, gain, (float(bias[1]), float(bias[2]))
    )


def _fingerprint(model: Any, scene: SceneDescription) -> bytes:
    """Identifies everything the physics depends on: checkpoints of another model or engine are not continued.

    Numbers count to nine decimals, since the compiled model's last digits differ from one processor to another."""
    digest = hashlib.sha256(f"{mujoco.__version__} {scene.mechanisms} {model.opt}".encode())
    for name in dir(model):
        values = getattr(model, name, None)
        if isinstance(values, np.ndarray):
            floats = np.issubdtype(values.dtype, np.floating)
            digest.update(f"{name} {values.shape}".encode())
            digest.update((np.round(values.astype(float), 9) + 0.0 if floats else values).tobytes())
    return digest.digest()[:16]


def _start(world: MujocoWorld, scene: SceneDescription) -> None:
    data = world.data
    data.qpos[world.arm_qpos] = world.robot.home
    data.ctrl[: len(world.arm_qpos)] = world.robot.home
    if world.linkage is not None:
        data.qpos[world.finger_qpos] = world.linkage.positions(world.linkage.stroke)
        data.ctrl[world.finger_servo] = data.qpos[world.finger_qpos[0]]
    elif len(world.finger_qpos):
        for address, name in zip(world.finger_qpos, world.robot.gripper.finger_joints, strict=True):
            data.qpos[address] = world.model.joint(PREFIX + name).range[1]
        data.ctrl[world.finger_servo] = data.qpos[world.finger_qpos].sum()
    for body, _ in scene.walk():
        if isinstance(body.joint, (Hinge, Slide)):
            data.qpos[world.joint_qpos[body.joint.name]] = body.joint.initial
    for latch in world.latches:
        data.ctrl[latch.actuator] = latch.position
