"""A built world: the multibodies in Bullet, and where everything of the descriptions is found in them."""

from __future__ import annotations

import hashlib
import itertools
from pathlib import Path
from typing import Any

import attrs

from memo_core.plugin import (
    FLOOR_DEPTH,
    Body,
    FingerLinkage,
    Free,
    Geom,
    Hinge,
    InvalidArgument,
    Pose,
    RobotDescription,
    SceneDescription,
    Slide,
    Urdf,
    check_fits,
    check_scene,
    default_table,
    joined_pairs,
    may_touch,
    read_urdf,
    scratch_folder,
)
from memo_sim_pybullet.friction import Frictions, collide, frictions_of
from memo_sim_pybullet.settings import PybulletSettings
from memo_sim_pybullet.stdout_capture import caught_output
from memo_sim_pybullet.urdf_trees import ROBOT, LinkSpec, Tree, body_of, principal, robot_tree, scene_tree, urdf_text

_HARD_S = 0.005  # s: materials up to this time constant are as hard as Bullet makes them
# What a soft thing is pressed with is an arm, not its own weight: with that, a sponge has the stiffness of a feather.
_PRESSED_KG = 0.4


@attrs.frozen(eq=False)
class Place:
    """Where a body or robot link is: Bullet's numbers (link -1: the base), its frame in the link's (or, for a base,
    in that of the centre of mass)."""

    body: int
    link: int
    frame: Pose


@attrs.frozen(eq=False)
class SceneJoint:
    """A hinge or slide: Bullet's numbers, and the spring it has at the start."""

    body: int
    index: int
    spec: Hinge | Slide


@attrs.frozen(eq=False)
class BulletWorld:
    """``places`` maps names (scene bodies, ``robot/LINK``) to where they are; ``names`` is its inverse."""

    robot: RobotDescription
    robot_body: int
    fingerprint: bytes
    places: dict[str, Place]
    names: dict[tuple[int, int], str]
    joints: dict[str, SceneJoint]
    arm: tuple[int, ...]
    fingers: tuple[int, ...]
    linkage: FingerLinkage | None  # of fingers on hinges
    pads: tuple[tuple[int, int], ...]  # (link, the finger joint that moves it)
    tool: Place


def build_world(
    client: Any, scene: SceneDescription, robot: RobotDescription, settings: PybulletSettings
) -> BulletWorld:
    """Build both descriptions in an empty client, robot at home, gripper open. Raises ``InvalidArgument``."""
    import pybullet

    check_scene(scene)
    urdf = read_urdf(robot.urdf, robot.mesh_folder)
    check_fits(urdf, robot)
    client.resetSimulation()
    client.setGravity(0.0, 0.0, -scene.gravity)
    client.setPhysicsEngineParameter(
        fixedTimeStep=settings.timestep,
        numSubSteps=1,
        numSolverIterations=settings.iterations,
        deterministicOverlappingPairs=1,
        enableFileCaching=0,
    )
    bodies = list(scene.bodies)
    if all(body.name != "table" for body, _ in scene.walk()):
        bodies.insert(0, default_table(scene.table_height))
    bodies.insert(0, _floor(scene.table_height - FLOOR_DEPTH))
    frictions = frictions_of(scene)
    trees = [robot_tree(urdf, robot, frictions), *(scene_tree(body, _mesh_volume, frictions) for body in bodies)]
    digest = hashlib.sha256(f"{client.getAPIVersion()} {settings} {scene} {robot.name} {robot.home}".encode())
    places: dict[str, Place] = {}
    names: dict[tuple[int, int], str] = {}
    indices: dict[str, tuple[int, int]] = {}
    with scratch_folder() as folder:
        for number, tree in enumerate(trees):
            text = urdf_text(tree, f"tree{number}")
            digest.update(text.encode())
            file = Path(folder) / f"{number}.urdf"
            file.write_text(text, encoding="utf-8")
            body = _load(client, pybullet, file, tree)
            _index(client, body, tree, frictions, places, names, indices)
    world = BulletWorld(
        robot=robot,
        robot_body=places[ROBOT + urdf.root].body,
        fingerprint=digest.digest()[:16],
        places=places,
        names=names,
        joints={
            body.joint.name: SceneJoint(*indices[body.joint.name], body.joint)
            for body, _ in scene.walk()
            if isinstance(body.joint, (Hinge, Slide))
        },
        arm=tuple(indices[ROBOT + name][1] for name in robot.joint_names),
        fingers=tuple(indices[ROBOT + name][1] for name in robot.gripper.finger_joints),
        linkage=_linkage(robot, urdf),
        pads=_pads(robot, urdf, places, indices),
        tool=places[ROBOT + robot.tool_link],
    )
    _weigh(client, trees, world)
    _keep_apart(client, world, scene, settings, may_touch(urdf, robot))
    _sort_by_friction(client, trees, world)
    _set_up_joints(client, pybullet, world, scene)
    return world


def _floor(height: float) -> Body:
    slab = Geom("box", (12.0, 12.0, 0.2), Pose((0.0, 0.0, -0.1)), (0.80, 0.81, 0.83, 1.0))
    return Body("floor", (slab,), Pose((0.0, 0.0, height)))


def _mesh_volume(file: str) -> float:
    raise InvalidArgument(
        "scene", f"the mesh {file!r} states no mass", "mass=… of the geom: PyBullet does not measure meshes"
    )


def _load(client: Any, pybullet: Any, file: Path, tree: Tree) -> int:
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_SELF_COLLISION
    flags |= pybullet.URDF_USE_SELF_COLLISION_INCLUDE_PARENT | pybullet.URDF_USE_MATERIAL_COLORS_FROM_MTL
    flags |= pybullet.URDF_USE_IMPLICIT_CYLINDER  # the other kind, of 32 flat sides, is 1 mm too large all around
    with caught_output() as said:
        try:
            body = client.loadURDF(str(file), useFixedBase=tree.fixed, flags=flags)
        except pybullet.error as error:
            what = tree.links[0].name
            problem = f"PyBullet cannot build {what!r} ({said() or error})"
            raise InvalidArgument("scene", problem, "a scene that can exist") from error
    centre = Pose(*_pose(*client.getDynamicsInfo(body, -1)[3:5]))
    base = tree.pose * centre
    client.resetBasePositionAndOrientation(body, base.position, _xyzw(base))
    return body


def _index(client: Any, body: int, tree: Tree, frictions: Frictions, places: dict, names: dict, indices: dict) -> None:
    links = {tree.links[0].name: -1}
    for index in range(client.getNumJoints(body)):
        spec = tree.links[int(client.getJointInfo(body, index)[12])]
        links[spec.name] = index
        indices[spec.joint.name] = (body, index)
    damping = tree.body.joint.damping if tree.body is not None and isinstance(tree.body.joint, Free) else 0.0
    for spec in tree.links:
        link = links[spec.name]
        frame = spec.frame.inverse()
        if link < 0:
            frame = Pose(*_pose(*client.getDynamicsInfo(body, -1)[3:5])).inverse() * frame
        places[spec.name] = Place(body, link, frame)
        names[(body, link)] = body_of(spec.name)
        _set_dynamics(client, body, link, spec, frictions, damping)


def _set_dynamics(client: Any, body: int, link: int, spec: LinkSpec, frictions: Frictions, damping: float) -> None:
    material = spec.material
    more: dict[str, float] = {}
    if material.softness_s > _HARD_S and (spec.mass > 0 or not spec.seen):
        stiffness = _PRESSED_KG / material.softness_s**2
        more = {"contactStiffness": stiffness, "contactDamping": 2.0 * _PRESSED_KG / material.softness_s}
    client.changeDynamics(
        body,
        link,
        lateralFriction=frictions.coefficient(material, spec.surface),
        spinningFriction=frictions.torsion(material),
        rollingFriction=frictions.rolling(material),
        restitution=0.0,
        linearDamping=damping,
        angularDamping=damping,
        jointDamping=0.0,
        **more,
    )


def _weigh(client: Any, trees: list[Tree], world: BulletWorld) -> None:
    """Give every link its own inertia."""
    # Bullet's inverse dynamics, used for the robot's weight only, keeps the model of its first call and refuses the
    # armatures set below.
    still = [0.0] * sum(
        client.getJointInfo(world.robot_body, i)[3] > -1 for i in range(client.getNumJoints(world.robot_body))
    )
    client.calculateInverseDynamics(world.robot_body, still, still, still)
    for tree in trees:
        for spec in tree.links:
            place = world.places[spec.name]
            if spec.mass > 0 and not (tree.fixed and place.link < 0):
                client.changeDynamics(place.body, place.link, localInertiaDiagonal=principal(spec)[0])


def _pads(robot: RobotDescription, urdf: Any, places: dict, indices: dict) -> tuple[tuple[int, int], ...]:
    hanging = {joint.child: joint for joint in urdf.joints}
    found = []
    for pad in robot.gripper.pads:
        if robot.gripper.kind == "vacuum":
            found.append((places[ROBOT + pad].link, -1))
            continue
        joint = hanging.get(pad)
        while joint is not None and joint.name not in robot.gripper.finger_joints:
            joint = hanging.get(joint.parent)
        if joint is None:
            problem = f"no finger joint moves {pad!r}"
            raise InvalidArgument(f"robot {robot.name!r}: gripper.pads", problem, "links that the finger joints carry")
        found.append((places[ROBOT + pad].link, indices[ROBOT + joint.name][1]))
    return tuple(found)


def _linkage(robot: RobotDescription, urdf: Urdf) -> FingerLinkage | None:
    if not robot.gripper.finger_joints:
        return None
    linkage = FingerLinkage(urdf, robot.gripper)
    return None if linkage.slides else linkage


def _keep_apart(
    client: Any, world: BulletWorld, scene: SceneDescription, settings: PybulletSettings, touching: set
) -> None:
    """Switch off collisions that the descriptions rule out; Bullet's own rules know nothing of them."""
    pairs = set(joined_pairs(scene))
    pairs |= _rigid_pairs(scene)
    robot = [name for name in world.places if name.startswith(ROBOT)]
    if settings.self_collision:
        pairs |= {(ROBOT + first, ROBOT + second) for first, second in touching}
        pairs |= {(one, other) for one in robot for other in robot if one < other and _both_fixed(world, one, other)}
    else:
        pairs |= {(one, other) for one in robot for other in robot if one < other}
    links: dict[str, list[Place]] = {}
    for name, place in world.places.items():
        links.setdefault(body_of(name), []).append(place)
    pairs |= {(name, name) for name, parts in links.items() if len(parts) > 1}
    for first, second in sorted(pairs):  # in one order: Bullet keeps pairs in the order in which they were told
        for one, other in itertools.product(links[first], links[second]):
            if one != other:
                client.setCollisionFilterPair(one.body, other.body, one.link, other.link, 0)


def _sort_by_friction(client: Any, trees: list[Tree], world: BulletWorld) -> None:
    """Let the copies of smooth surfaces collide with what they are for."""
    links = [spec for tree in trees for spec in tree.links]
    for one, other in itertools.combinations(links, 2):
        if not collide(one.surface, other.surface):
            first, second = world.places[one.name], world.places[other.name]
            client.setCollisionFilterPair(first.body, second.body, first.link, second.link, 0)


def _both_fixed(world: BulletWorld, one: str, other: str) -> bool:
    return world.places[one].link == world.places[other].link


def _rigid_pairs(scene: SceneDescription) -> set[tuple[str, str]]:
    """Pairs of bodies that are rigidly one."""
    group: dict[str, str] = {}
    for body, parent in scene.walk():
        group[body.name] = group[parent.name] if parent is not None and body.joint is None else body.name
    return {(one, other) for one in group for other in group if one < other and group[one] == group[other]}


def _set_up_joints(client: Any, pybullet: Any, world: BulletWorld, scene: SceneDescription) -> None:
    robot = world.robot_body
    for index, angle in zip(world.arm, world.robot.home, strict=True):
        client.resetJointState(robot, index, angle)
    for number, index in enumerate(world.fingers):
        if world.linkage is not None:
            client.resetJointState(robot, index, world.linkage.positions(world.linkage.stroke)[number])
        else:
            client.resetJointState(robot, index, client.getJointInfo(robot, index)[9])
    for index in range(client.getNumJoints(robot)):
        client.setJointMotorControl2(robot, index, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=0.0)
    for joint in world.joints.values():
        spec = joint.spec
        client.resetJointState(joint.body, joint.index, spec.initial)
        client.changeDynamics(joint.body, joint.index, jointDamping=spec.damping)
        # A motor that wants to stand still and is this weak is dry friction.
        client.setJointMotorControl2(
            joint.body, joint.index, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=spec.friction
        )
    first, *others = world.fingers or (None,)
    multipliers = (1.0,) * len(others) if world.linkage is None else world.linkage.multipliers[1:]
    for other, multiplier in zip(others, multipliers, strict=True):
        gear = client.createConstraint(robot, first, robot, other, pybullet.JOINT_GEAR, (0, 1, 0), (0, 0, 0), (0, 0, 0))
        client.changeConstraint(gear, gearRatio=-1.0 / multiplier, erp=0.3, maxForce=10000)


def _pose(position: Any, quaternion: Any) -> tuple[tuple, tuple]:
    x, y, z, w = quaternion
    return tuple(position), (w, x, y, z)


def _xyzw(pose: Pose) -> tuple[float, float, float, float]:
    w, x, y, z = pose.orientation
    return (x, y, z, w)
