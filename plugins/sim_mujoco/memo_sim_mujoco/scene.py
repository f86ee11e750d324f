"""Building a scene description as an MjSpec: bodies, joints, materials, latches, cameras, light, floor and table."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Any

import mujoco

from memo_core.plugin import (
    FLOOR_DEPTH,
    Body,
    Free,
    Geom,
    Hinge,
    InvalidArgument,
    Latch,
    Material,
    Pose,
    SceneDescription,
    check_scene,
    check_size,
    default_table,
    joined_pairs,
    masses,
    mesh_vertices,
)
from memo_sim_mujoco.settings import MujocoSettings

PREFIX = "robot/"  # of the names of robot links and joints
MESH_FILES = (".stl", ".obj", ".msh")
SOLIMP = (0.95, 0.99, 0.001, 0.5, 2.0)
# Dry friction on a small inertia creeps with MuJoCo's defaults; these hold still.
FRICTION_SOLREF = (0.004, 1.0)
FRICTION_SOLIMP = (0.999, 0.999, 0.001, 0.5, 2.0)
LIMIT_SOLREF = (0.01, 1.0)
# Collision bits: scene bodies touch scene and robot, robot links touch the scene and (if wanted) each other.
SCENE_BITS = (1, 3)
# OpenCV's camera looks along +z with y down, MuJoCo's along -z with y up.
_FROM_OPENCV = Pose((0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0))

_SHAPES = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "mesh": mujoco.mjtGeom.mjGEOM_MESH,
}


def add_scene(spec: mujoco.MjSpec, scene: SceneDescription) -> None:
    """Add all bodies, joints, latches and cameras. Raises ``InvalidArgument`` naming the body that is wrong."""
    check_scene(scene)
    spec.option.gravity = (0.0, 0.0, -scene.gravity)
    if all(body.name != "table" for body, _ in scene.walk()):
        _add_body(spec, spec.worldbody, default_table(scene.table_height))
    for body in scene.bodies:
        _add_body(spec, spec.worldbody, body)
    for first, second in joined_pairs(scene):
        spec.add_exclude(bodyname1=first, bodyname2=second)
    for number, latch in enumerate(scene.latches):
        _add_latch(spec, number, latch)
    for camera in scene.cameras:
        pose = camera.pose * _FROM_OPENCV
        carrier = spec.body(f"{PREFIX}{camera.link}") if camera.link else spec.worldbody
        if carrier is None:
            raise InvalidArgument(f"scene camera {camera.name!r}", f"no robot link {camera.link!r}", "a link's name")
        carrier.add_camera(
            name=camera.name,
            pos=pose.position,
            quat=pose.orientation,
            fovy=math.degrees(camera.field_of_view),
            resolution=camera.resolution,
        )


def surface(material: Material) -> dict[str, Any]:
    """Contact parameters of a material. Where two meet, MuJoCo takes the larger friction and dimension; the softer one
    decides how soft the contact is."""
    return {
        "friction": (material.friction, material.torsional, material.rolling),
        "condim": material.contact_dimensions,
        "solref": (material.softness_s, 1.0),
        "solimp": SOLIMP,
        "solmix": (material.softness_s / 0.005) ** 2,
    }


def add_shape(spec: mujoco.MjSpec, parent: Any, geom: Geom, where: str, **more: Any) -> None:
    """Add one primitive or mesh to an MjSpec body; ``more`` are MjsGeom attributes."""
    check_size(geom, where)
    size = [*geom.size, 0.0, 0.0, 0.0][:3]
    if geom.shape == "box":
        size = [extent / 2 for extent in size]
    elif geom.shape in ("cylinder", "capsule"):
        size[1] /= 2
    elif geom.shape == "mesh":
        more["meshname"] = add_mesh(spec, geom.mesh, (geom.size[0],) * 3, where)
    parent.add_geom(
        type=_SHAPES[geom.shape],
        size=size,
        pos=geom.pose.position,
        quat=geom.pose.orientation,
        rgba=geom.colour,
        **more,
    )


def add_mesh(spec: mujoco.MjSpec, file: str | None, scale: tuple[float, ...], where: str) -> str:
    """The name of a mesh of an MjSpec, which is added unless it is there. MuJoCo collides the convex hull."""
    if file is None or not Path(file).is_file():
        raise InvalidArgument(where, f"mesh {file!r} cannot be read", "an existing .stl or .obj file")
    name = f"{file}*{scale}"
    if all(mesh.name != name for mesh in spec.meshes):
        if Path(file).suffix.lower() in MESH_FILES:
            spec.add_mesh(name=name, file=str(Path(file).resolve()), scale=scale)
        else:
            spec.add_mesh(name=name, uservert=mesh_vertices(file, scale, where).ravel().tolist())
    return name


def _add_body(spec: mujoco.MjSpec, parent: Any, body: Body) -> None:
    where = f"scene body {body.name!r}"
    added = parent.add_body(name=body.name, pos=body.pose.position, quat=body.pose.orientation)
    _add_joint(added, body)
    for geom, mass in zip(body.geoms, masses(body, mesh_volume), strict=True):
        contype, conaffinity = SCENE_BITS if geom.collides else (0, 0)
        add_shape(
            spec, added, geom, where, mass=mass, contype=contype, conaffinity=conaffinity, **surface(geom.material)
        )
    for child in body.bodies:
        _add_body(spec, added, child)


def _add_joint(added: Any, body: Body) -> None:
    joint = body.joint
    if joint is None:
        return
    if isinstance(joint, Free):
        added.add_joint(name=f"{body.name}/free", type=mujoco.mjtJoint.mjJNT_FREE)
        return
    hinge = isinstance(joint, Hinge)
    added.add_joint(
        name=joint.name,
        type=mujoco.mjtJoint.mjJNT_HINGE if hinge else mujoco.mjtJoint.mjJNT_SLIDE,
        axis=joint.axis,
        pos=joint.anchor if isinstance(joint, Hinge) else (0.0, 0.0, 0.0),
        range=joint.range,
        limited=True,
        stiffness=(joint.stiffness, 0.0, 0.0),
        springref=joint.rest,
        damping=(joint.damping, 0.0, 0.0),
        frictionloss=joint.friction,
        armature=joint.armature,
        solref_friction=FRICTION_SOLREF,
        solimp_friction=FRICTION_SOLIMP,
        solref_limit=LIMIT_SOLREF,
    )


def _add_latch(spec: mujoco.MjSpec, number: int, latch: Latch) -> None:
    """A weak position servo on the joint; the simulator switches it off where the catch does not reach."""
    stiffness = 4.0 * latch.effort / latch.width
    spec.add_actuator(
        name=f"latch/{number}",
        target=latch.joint,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        gainprm=[stiffness] + [0.0] * 9,
        biasprm=[0.0, -stiffness, -0.02 * stiffness] + [0.0] * 7,
        forcelimited=True,
        forcerange=(-latch.effort, latch.effort),
    )


@functools.lru_cache(maxsize=256)
def mesh_volume(file: str) -> float:
    """The volume that a mesh file encloses (m3)."""
    probe = mujoco.MjSpec()
    name = add_mesh(probe, file, (1.0, 1.0, 1.0), f"mesh {file!r}")
    probe.worldbody.add_body().add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, density=1.0)
    return float(probe.compile().body_mass[1])


def add_look(spec: mujoco.MjSpec, scene: SceneDescription, settings: MujocoSettings) -> None:
    """Sky, light and floor. The floor is solid: objects pushed off the table land on it."""
    spec.visual.headlight.ambient = (0.40, 0.40, 0.42)
    spec.visual.headlight.diffuse = (0.26, 0.26, 0.26)
    spec.visual.headlight.specular = (0.1, 0.1, 0.1)
    spec.visual.map.znear = 0.02
    spec.visual.map.zfar = 30.0
    spec.visual.quality.shadowsize = 2048
    spec.visual.quality.offsamples = settings.smoothing
    # Round things of few facets take half the time to draw in software and look the same at video size.
    spec.visual.quality.numslices = 20
    spec.visual.quality.numstacks = 10
    spec.stat.extent = 1.0
    spec.stat.center = (0.4, 0.0, scene.table_height + 0.3)
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.92, 0.94, 0.97),
        rgb2=(0.62, 0.68, 0.76),
        width=64,
        height=64,
    )
    for position, direction, diffuse in (
        ((0.2, -1.5, 2.5), (0.1, 0.6, -1.0), 0.38),
        ((1.5, 1.5, 2.0), (-0.5, -0.6, -0.8), 0.18),
    ):
        spec.worldbody.add_light(
            pos=position,
            dir=direction,
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            castshadow=settings.shadows,
            diffuse=(diffuse,) * 3,
            specular=(0.15, 0.15, 0.15),
        )
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(6.0, 6.0, 0.1),
        pos=(0.0, 0.0, scene.table_height - FLOOR_DEPTH),
        rgba=(0.80, 0.81, 0.83, 1.0),
        contype=SCENE_BITS[0],
        conaffinity=SCENE_BITS[1],
        **surface(Material()),
    )
