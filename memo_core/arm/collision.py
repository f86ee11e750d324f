"""Collisions of the arm and a held object with the arm itself and the scene as last observed (coal, Pinocchio). The
world is known only as the boxes of the scene graph. A fixture with a visible inside is its box minus that inside, open
towards its opening; a closed one is solid. Perception is inexact, so surfaces that are meant to touch may overlap by
stated tolerances, and the arm may always leave a start configuration that already touches something.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import attrs
import numpy as np

from memo_core.arm.forward_kinematics import tool_link_frame
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.meshes import mesh_vertices
from memo_core.robot.description import RobotDescription
from memo_core.robot.finger_linkage import FingerLinkage
from memo_core.robot.urdf.reading import Urdf, link_poses, read_urdf
from memo_core.scene.graph import Node, SceneGraph
from memo_core.scene.pose import Array, Pose

Mode = Literal["clear", "free", "contact"]

# How near a part of the robot may come to a perceived surface (m; negative: how far it may reach into it).
# "clear" is what a free motion should keep: a door that stands open is dragged along by a finger that grazes its edge.
_MARGINS: dict[Mode, dict[str, float]] = {
    "clear": {"arm": 0.015, "hand": 0.008, "finger": 0.008, "held": 0.0},
    "free": {"arm": 0.005, "hand": -0.004, "finger": -0.005, "held": -0.012},
    "contact": {"arm": 0.0, "hand": -0.010, "held": -0.020},
}
_START_RELIEF = 0.004  # m deeper than at the start
_THIN = 0.002  # m; thinner slabs are dropped
_FLAT = 1e-5  # m that a mesh's corners are off one plane (root of the sum of squares)
_TABLE = "table"


@attrs.frozen
class Obstacle:
    """A solid box in the base frame (m). ``node`` is the scene node's id, ``label`` its name in messages."""

    node: str
    label: str
    pose: Pose
    size: tuple[float, float, float]


@attrs.frozen
class Held:
    """A box fixed to the tool: ``offset`` is its pose in the tool frame."""

    node: str
    label: str
    offset: Pose
    size: tuple[float, float, float]


@attrs.frozen
class Hit:
    """Two things that would touch; ``robot`` is a link or "what is held", ``other`` a label or another link."""

    robot: str
    other: str
    own: bool  # the robot touches itself
    node: str = ""  # id of the scene node that would be touched

    def __str__(self) -> str:
        return (
            f"the robot touches itself: {self.robot} and {self.other}"
            if self.own
            else f"{self.robot} touches the {self.other}"
        )


def obstacles_of(
    scene: SceneGraph, moved: Mapping[str, Pose] | None = None, absent: Iterable[str] = ()
) -> list[Obstacle]:
    """Solid boxes of a scene graph, and the table as a slab.

    A node with a visible inside becomes the walls around it; heaps and nodes without volume are left out.

    Args:
        scene: the scene as last observed, poses in the base frame.
        moved: newer poses (base frame) by node id, for objects moved since that observation.
        absent: ids of nodes to leave out, such as a held object.

    Returns:
        Boxes in the base frame, the table last.
    """
    moved = moved or {}
    left_out = set(absent)
    spaces: dict[str, list[Node]] = {}
    for node in scene.nodes:
        if node.kind == "space" and node.part_of is not None:
            spaces.setdefault(node.part_of, []).append(node)
    found = []
    for node in scene.nodes:
        if node.kind in ("space", "heap") or node.id in left_out or min(node.size) <= 0:
            continue
        pose = moved.get(node.id, node.pose)
        if node.id in spaces:
            found += _hollow(node, pose, spaces[node.id])
        else:
            found.append(Obstacle(node.id, node.label, pose, node.size))
    thickness = 0.1
    centre = (0.5, 0.0, scene.table_height - thickness / 2)
    found.append(Obstacle(_TABLE, _TABLE, Pose(centre), (3.0, 3.0, thickness)))
    return found


def _hollow(node: Node, pose: Pose, spaces: Sequence[Node]) -> list[Obstacle]:
    """The node's box at ``pose`` minus its insides, each extended through its open side beyond the box."""
    half = np.asarray(node.size) / 2
    boxes = [(-half, half)]
    for space in spaces:
        local = node.pose.inverse() * space.pose
        extent = np.abs(local.rotation) @ np.asarray(space.size) / 2
        low, high = np.asarray(local.position) - extent, np.asarray(local.position) + extent
        if space.opening is not None:
            direction = node.pose.rotation.T @ np.asarray(space.opening)
            axis = int(np.argmax(np.abs(direction)))
            if direction[axis] > 0:
                high[axis] = half[axis] + 1.0
            else:
                low[axis] = -half[axis] - 1.0
        boxes = [piece for box in boxes for piece in _subtract(box, low, high)]
    return [
        Obstacle(node.id, node.label, pose * Pose(tuple((low + high) / 2)), (size[0], size[1], size[2]))
        for low, high in boxes
        if (size := [float(v) for v in high - low]) and min(size) > _THIN
    ]


def _subtract(box: tuple[Array, Array], low: Array, high: Array) -> list[tuple[Array, Array]]:
    """An axis-aligned box minus another: up to six boxes."""
    rest_low, rest_high = box[0].copy(), box[1].copy()
    if np.any(low >= rest_high) or np.any(high <= rest_low):
        return [box]
    pieces = []
    for axis in range(3):
        if low[axis] > rest_low[axis]:
            piece = (rest_low.copy(), rest_high.copy())
            piece[1][axis] = low[axis]
            pieces.append(piece)
            rest_low[axis] = low[axis]
        if high[axis] < rest_high[axis]:
            piece = (rest_low.copy(), rest_high.copy())
            piece[0][axis] = high[axis]
            pieces.append(piece)
            rest_high[axis] = high[axis]
    return pieces


def _check_meshes(urdf: Urdf) -> None:
    """Raise ``InvalidArgument`` naming the first collision mesh that cannot be read."""
    for link in urdf.links.values():
        for shape in link.collisions:
            if shape.mesh is not None:
                mesh_vertices(shape.mesh, shape.size, f"URDF link {link.name!r}")


def _convex(geometry: Any) -> Any:
    """A mesh as its convex hull, which is what the simulators collide, too. coal knows no negative margins for
    meshes."""
    import coal

    return convex_hull(np.asarray(geometry.vertices())) if isinstance(geometry, coal.BVHModelBase) else geometry


def convex_hull(points: Array) -> Any:
    """coal's convex hull of points (k, 3). It crashes on points in one plane, so that those get ``_THIN`` m of
    thickness."""
    import coal

    _, extents, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    for axis, extent in zip(axes, extents, strict=True):
        if extent < _FLAT:
            points = np.concatenate([points - axis * _THIN / 2, points + axis * _THIN / 2])
    corners = coal.StdVec_Vec3s()
    corners.extend(list(points))
    return coal.Convex.convexHull(corners, True, "Qt")


class RobotShape:
    """The robot's collision shapes, read once; ``checker`` combines them with a scene."""

    def __init__(self, description: RobotDescription, kinematics: Kinematics) -> None:
        """Read the collision shapes of a robot's URDF; meshes are replaced by their convex hulls.

        Args:
            description: the arm and its gripper.
            kinematics: kinematics of the same robot.

        Raises:
            InvalidArgument: if a collision mesh cannot be read, or the fingers cannot be coupled.
        """
        import pinocchio as pin

        self.description = description
        self.kinematics = kinematics
        model = kinematics.model
        urdf = read_urdf(description.urdf, description.mesh_folder)
        try:
            geometry = pin.buildGeomFromUrdfString(model, kinematics.urdf, pin.GeometryType.COLLISION)
        except ValueError:
            _check_meshes(urdf)
            raise
        for shape in geometry.geometryObjects:
            shape.geometry = _convex(shape.geometry)
        self.geometry = geometry
        self.data = model.createData()
        self.links = [model.frames[o.parentFrame].name for o in geometry.geometryObjects]
        self.arm_index = np.array([model.joints[i].idx_q for i in kinematics.joint_ids])
        gripper = description.gripper
        finger_ids = [model.getJointId(name) for name in gripper.finger_joints if model.existJointName(name)]
        self.finger_index = np.array([model.joints[i].idx_q for i in finger_ids], dtype=int)
        self._linkage = FingerLinkage(urdf, gripper) if gripper.finger_joints else None
        last = kinematics.joint_ids[-1]
        hand_links = {urdf.joint(name).parent for name in gripper.finger_joints}
        self.roles: list[str] = []
        for number, shape in enumerate(geometry.geometryObjects):
            link = self.links[number]
            if shape.parentJoint in finger_ids or link in gripper.pads:
                self.roles.append("finger")
            elif link in hand_links or (not hand_links and link == description.tool_link):
                self.roles.append("hand")
            elif shape.parentJoint == 0:
                self.roles.append("base")
            else:
                self.roles.append("arm")
        self.last_joint = last
        self.tool_in_last = self._tool_in_last()
        self.touching_at_home: tuple[tuple[str, str], ...] = ()  # links whose contact does not count for that reason
        self.self_pairs = self._self_pairs()

    def pad_span(self) -> tuple[float, float] | None:
        """Range of the pads' shapes along the tool's z axis (m, from the tool centre), or None without pads."""
        description, corners = self.description, self.corners()
        urdf = read_urdf(description.urdf, description.mesh_folder)
        shut: dict[str, float] = {}
        if self._linkage is not None:
            shut = self._linkage.positions_at(self._linkage.driver(0.0))
        poses = link_poses(urdf, shut)
        tool = (poses[description.tool_link] * description.tool_offset).inverse()
        pads = [pad for pad in description.gripper.pads if pad in corners]
        depths = [(tool * poses[pad]).apply(corners[pad])[:, 2] for pad in pads]
        return (float(np.min(depths)), float(np.max(depths))) if depths else None

    def corners(self) -> dict[str, Array]:
        """Link -> corners (k, 3) of its collision shapes' boxes, in the link's frame, m."""
        found: dict[str, list[Array]] = {}
        for link, shape in zip(self.links, self.geometry.geometryObjects, strict=True):
            shape.geometry.computeLocalAABB()
            box = shape.geometry.aabb_local
            ends = np.array([box.min_, box.max_])
            points = np.array([[ends[i >> axis & 1, axis] for axis in range(3)] for i in range(8)])
            frame = self.kinematics.model.frames[shape.parentFrame].placement.inverse() * shape.placement
            found.setdefault(link, []).append(points @ frame.rotation.T + frame.translation)
        return {link: np.concatenate(points) for link, points in found.items()}

    def configuration(self, joints: Array, width: float) -> Array:
        """Pinocchio's configuration vector.

        Args:
            joints: arm joint positions (n,), rad (m for a slide).
            width: opening of the gripper (m).

        Returns:
            Configuration of arm and finger joints, shape (model.nq,).
        """
        import pinocchio as pin

        q = pin.neutral(self.kinematics.model)
        q[self.arm_index] = joints
        if self._linkage is not None:
            q[self.finger_index] = self._linkage.positions(width)
        return q

    def _tool_in_last(self) -> Pose:
        """The tool frame in the frame of the last arm joint."""
        frame = tool_link_frame(self.kinematics.model, self.description)
        return Pose.from_matrix(np.asarray(frame.placement.homogeneous)) * self.description.tool_offset

    def _self_pairs(self) -> list[tuple[int, int]]:
        """Pairs of shapes whose contact counts as a collision: not on one link or on neighbours, not allowed, and not
        touching at home."""
        import pinocchio as pin

        model = self.kinematics.model
        allowed = {frozenset(pair) for pair in self.description.allowed_contacts}
        shapes = self.geometry.geometryObjects
        fingers = {i for i, role in enumerate(self.roles) if role == "finger"}
        hands = {i for i, role in enumerate(self.roles) if role == "hand"}
        pairs = []
        for a in range(len(shapes)):
            for b in range(a + 1, len(shapes)):
                first, second = shapes[a].parentJoint, shapes[b].parentJoint
                if first == second or first == model.parents[second] or second == model.parents[first]:
                    continue
                if frozenset((self.links[a], self.links[b])) in allowed or {a, b} <= fingers | hands:
                    continue
                pairs.append((a, b))
        probe = self.geometry.copy()
        probe.removeAllCollisionPairs()
        for a, b in pairs:
            probe.addCollisionPair(pin.CollisionPair(a, b))
        data = pin.GeometryData(probe)
        home = self.configuration(self.kinematics.home, self.description.gripper.stroke)
        pin.computeCollisions(model, self.data, probe, data, home, False)
        free = [not result.isCollision() for result in data.collisionResults]
        touching = {(self.links[a], self.links[b]) for (a, b), apart in zip(pairs, free, strict=True) if not apart}
        self.touching_at_home = tuple(sorted(touching))
        return [pair for pair, apart in zip(pairs, free, strict=True) if apart]

    def checker(
        self,
        obstacles: Sequence[Obstacle],
        width: float,
        held: Held | None = None,
        carried: Iterable[str] = (),
        touched: Iterable[str] = (),
    ) -> Checker:
        """Make a collision checker for one scene.

        Args:
            obstacles: solid boxes in the base frame (``obstacles_of``).
            width: opening of the gripper (m).
            held: object between the fingers; None: none.
            carried: ids of scene nodes that move with the hand, such as a door that it holds.
            touched: ids of scene nodes that the fingers and a held object may touch in any mode.

        Returns:
            The checker.
        """
        return Checker(self, obstacles, width, held, frozenset(carried), frozenset(touched))


class Checker:
    """Checks configurations for contacts, for one scene, one opening of the fingers and one held object."""

    def __init__(
        self,
        shape: RobotShape,
        obstacles: Sequence[Obstacle],
        width: float,
        held: Held | None,
        carried: frozenset[str],
        touched: frozenset[str],
    ) -> None:
        """Combine the robot's shapes with a scene; the arguments are those of ``RobotShape.checker``."""
        import coal
        import pinocchio as pin

        self._shape = shape
        self._model = shape.kinematics.model
        self._data = shape.data
        self._q = shape.configuration(shape.kinematics.home, width)
        geometry = shape.geometry.copy()
        geometry.removeAllCollisionPairs()
        names = list(shape.links)
        roles = list(shape.roles)
        robot = range(len(names))
        if held is not None:
            offset = shape.tool_in_last * held.offset
            number = geometry.addGeometryObject(
                pin.GeometryObject("held", shape.last_joint, pin.SE3(offset.matrix), coal.Box(*held.size))
            )
            names.append(f"the held {held.label}")
            roles.append("held")
            robot = range(number + 1)
        self._carried: list[tuple[int, Array]] = []
        self._nodes: dict[int, str] = {}
        pairs: list[tuple[int, int]] = list(shape.self_pairs)
        kinds: list[tuple[str, bool, bool]] = [("self", False, False)] * len(pairs)
        if held is not None:
            for i in robot:
                if roles[i] in ("arm", "base"):
                    pairs.append((i, len(names) - 1))
                    kinds.append(("self", False, False))
        for count, obstacle in enumerate(obstacles):
            number = geometry.addGeometryObject(
                pin.GeometryObject(f"obstacle{count}", 0, pin.SE3(obstacle.pose.matrix), coal.Box(*obstacle.size))
            )
            names.append(obstacle.label)
            self._nodes[number] = obstacle.node
            moving = obstacle.node in carried
            if moving:
                self._carried.append((number, obstacle.pose.matrix))
            for i in robot:
                if roles[i] == "base" or (moving and roles[i] != "arm"):
                    continue
                if obstacle.node in touched and roles[i] in ("finger", "held"):
                    continue
                pairs.append((i, number))
                kinds.append((roles[i], True, moving))
        for a, b in pairs:
            geometry.addCollisionPair(pin.CollisionPair(a, b))
        self._geometry = geometry
        self._names = names
        self._roles = roles
        self._pairs = pairs
        self._kinds = kinds
        self._results = {mode: self._geometry_data(mode) for mode in _MARGINS}
        self._compute = pin.computeCollisions

    def _geometry_data(self, mode: Mode) -> Any:
        import pinocchio as pin

        data = pin.GeometryData(self._geometry)
        margins = _MARGINS[mode]
        for number, (role, scene, _) in enumerate(self._kinds):
            if not scene:
                data.collisionRequests[number].security_margin = 0.0
            elif role in margins:
                data.collisionRequests[number].security_margin = margins[role]
            else:
                data.deactivateCollisionPair(number)
        return data

    def leave(self, joints: Array) -> None:
        """Allow leaving a configuration.

        Pairs that touch there may penetrate slightly deeper, everywhere and in every mode.

        Args:
            joints: arm joint positions (n,), rad (m for a slide).
        """
        self._relieve(joints, *self._results)

    def near(self, joints: Array) -> None:
        """Allow a motion with clearance to end at a configuration.

        Pairs that are close there may be as close everywhere.

        Args:
            joints: arm joint positions (n,), rad (m for a slide).
        """
        self._relieve(joints, "clear")

    def _relieve(self, joints: Array, *modes: Mode) -> None:
        import pinocchio as pin

        for data in (self._results[mode] for mode in modes):
            self._q[self._shape.arm_index] = joints
            self._compute(self._model, self._data, self._geometry, data, self._q, False)
            for number, result in enumerate(data.collisionResults):
                if result.isCollision() and data.activeCollisionPairs[number]:
                    distance = pin.computeDistance(self._geometry, data, number).min_distance
                    request = data.collisionRequests[number]
                    request.security_margin = min(request.security_margin, distance - _START_RELIEF)

    def carry(self, motion: Array) -> None:
        """Move the carried objects.

        Args:
            motion: rigid motion from their observed poses, base frame, homogeneous matrix (4, 4).
        """
        import pinocchio as pin

        for number, matrix in self._carried:
            self._geometry.geometryObjects[number].placement = pin.SE3(motion @ matrix)

    @property
    def carries(self) -> bool:
        return bool(self._carried)

    def collides(self, joints: Array, mode: Mode) -> bool:
        """Whether a configuration has a contact.

        Args:
            joints: arm joint positions (n,), rad (m for a slide).
            mode: margins to apply; ``clear`` keeps a distance, ``free`` allows for the tolerance of perception,
                ``contact`` lets the fingers touch.

        Returns:
            True if any pair of shapes is nearer than its margin allows.
        """
        self._shape.kinematics.poll()
        self._q[self._shape.arm_index] = joints
        return self._compute(self._model, self._data, self._geometry, self._results[mode], self._q, True)

    def hit(self, joints: Array, mode: Mode) -> Hit | None:
        """The deepest contact of a configuration; slower than ``collides``.

        Args:
            joints: arm joint positions (n,), rad (m for a slide).
            mode: as in ``collides``.

        Returns:
            The contact, or None if there is none.
        """
        import pinocchio as pin

        self._shape.kinematics.poll()
        data = self._results[mode]
        self._q[self._shape.arm_index] = joints
        if not self._compute(self._model, self._data, self._geometry, data, self._q, False):
            return None
        found: list[tuple[float, int]] = []
        for number, result in enumerate(data.collisionResults):
            if data.activeCollisionPairs[number] and result.isCollision():
                found.append((pin.computeDistance(self._geometry, data, number).min_distance, number))
        _, number = min(found)
        first, second = self._pairs[number]
        own = not self._kinds[number][1]
        return Hit(
            self._named(first), self._named(second) if own else self._names[second], own, self._nodes.get(second, "")
        )

    def _named(self, number: int) -> str:
        role = self._roles[number] if number < len(self._roles) else ""
        named = {"finger": "a finger", "hand": "the hand", "held": self._names[number]}
        return named.get(role, f"the arm ({self._names[number]})")
