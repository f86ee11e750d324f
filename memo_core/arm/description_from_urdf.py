"""A first description of a robot from its URDF: what stands in it is read, everything else is guessed and told.

``memo new robot --urdf FILE`` writes what this returns as a plugin's source. Guesses are starting values: ``memo
plugins check`` says what is wrong with them.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

import attrs
import numpy as np

from memo_core.arm.collision import RobotShape
from memo_core.arm.finger_zero import NEARLY_SHUT, counted_from_shut, finger_slides, fixed_to
from memo_core.arm.home_and_gains import Guess, with_contact_force, with_gains, with_home, with_reach
from memo_core.arm.inertias import with_guessed_masses, with_possible_inertias
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.errors import InvalidArgument
from memo_core.robot.arm_and_fingers import arm_and_fingers, without_gripper
from memo_core.robot.description import GripperDescription, JointDescription, RobotDescription
from memo_core.robot.finger_linkage import FingerLinkage
from memo_core.robot.hand_mount import mount_rpy
from memo_core.robot.parallel_hand import ParallelHand, with_parallel_hand
from memo_core.robot.urdf.reading import Urdf, UrdfJoint, link_poses, read_urdf
from memo_core.robot.urdf.text import numbers, with_fixed
from memo_core.robot.urdf.units import check_units
from memo_core.scene.pose import Array, Pose, quaternion_from_rotation

_FLANGE_NAMES = re.compile(
    r"^(.*_)?(tool(0|_link|_flange)?|flange(_link)?|eef?(_link)?|end_effector(_link)?|attachment.*|hand)$",
    re.IGNORECASE,
)
_TURN = 2 * math.pi  # rad a continuous joint is planned within, either way
_SPEED, _EFFORT = 2.0, 50.0  # rad/s, Nm where the URDF says nothing
_SLIDE_SPEED, _SLIDE_EFFORT = 0.25, 500.0  # m/s, N
_PLAIN_HAND = "or --plain-hand (plain_hand=True): a plain parallel hand in its place"
_OVERLAP = 0.01  # m that a hand may reach into the last link: frames and flanges are not exact
_TIP = 0.01  # m that the fingertips are taken to extend beyond the tool centre


@attrs.frozen
class Described:
    """``robot`` with, line by line, what was read from the URDF, and what was guessed. ``turned``: rad about z by which
    the base is to be turned, since the arm works to another side than the tasks' +x."""

    robot: RobotDescription
    read: tuple[str, ...]
    guessed: tuple[Guess, ...]
    turned: float = 0.0

    def source(self) -> str:
        """Python source of ``RobotDescription(…)``, guesses marked by a comment. Its names: the description classes,
        ``Pose``, and ``URDF`` and ``MESH_FOLDER`` for the URDF's text and the folder of its meshes."""
        return _source(self.robot, {guess.what: guess.why for guess in self.guessed})


def describe_urdf(
    text: str,
    name: str | None = None,
    mesh_folder: str | None = None,
    plain_hand: bool = False,
    total_mass: float | None = None,
) -> Described:
    """Describe an arm with a parallel gripper, or a bare arm, which then gets ``ParallelHand``.

    Args:
        text: the URDF's XML text.
        name: name of the robot; None: the URDF's.
        mesh_folder: folder below which mesh files are looked up; None: paths are used as they stand.
        plain_hand: replace the URDF's gripper by ``ParallelHand``.
        total_mass: mass of the URDF's links together, kg, where it states no or not all masses; None: they are as
            stated.

    Returns:
        The description, the facts taken from the URDF, and the guesses with their reasons.

    Raises:
        InvalidArgument: if the URDF is not a single serial arm, or its numbers look as if in other units than URDF's.
    """
    urdf = read_urdf(text, mesh_folder)
    found = arm_and_fingers(urdf)
    guesses: list[Guess] = []
    why = "the URDF has no fingers"
    if plain_hand and found.fingers:
        text, why = without_gripper(text, urdf, found), "in the place of the URDF's gripper"
        urdf = read_urdf(text, mesh_folder)
        found = arm_and_fingers(urdf)
    if found.others:
        names = [joint.name for joint in found.others]
        text = with_fixed(text, names)
        urdf = read_urdf(text, mesh_folder)
        guesses.append(Guess("joints held still", ", ".join(names), "neither the arm's nor fingers: fixed at 0"))
    chain, fingers = found.arm, found.fingers
    check_units(text, urdf, [joint.name for joint in fingers])
    text = with_possible_inertias(text, urdf, guesses)
    if total_mass is not None:
        text = with_guessed_masses(text, urdf, total_mass, guesses)
    urdf = read_urdf(text, mesh_folder)
    read = [f"{len(chain)} joints: {', '.join(joint.name for joint in chain)}"]
    if fingers:
        read.append(f"fingers: {', '.join(joint.name for joint in fingers)}")
    else:
        text = _with_hand(text, mesh_folder, urdf, chain, why, guesses)
        urdf = read_urdf(text, mesh_folder)
        fingers = arm_and_fingers(urdf).fingers
    light = [joint.child for joint in urdf.joints if joint.kind != "fixed" and urdf.links[joint.child].mass <= 0]
    if light:
        read.append(f"moving links without mass, each needs an <inertial> or --total-mass KG: {', '.join(light)}")
    read += _placeholders(chain)
    joints = tuple(_joint(joint, guesses) for joint in chain)
    label = name or urdf.name
    text, urdf, fingers = _with_fingers_shut_at_zero(text, mesh_folder, urdf, joints, fingers, guesses)
    gripper = _first_gripper(urdf, fingers, guesses)
    tool_link = _carrier(urdf, fingers[0])
    bare = RobotDescription(
        name=label,
        urdf=text,
        joints=joints,
        gripper=gripper,
        tool_link=tool_link,
        home=tuple((joint.lower + joint.upper) / 2 + 0.0 for joint in joints),
        mesh_folder=mesh_folder,
        allowed_contacts=_finger_pairs(urdf, fingers),
    )
    robot = _with_tool(bare, urdf, guesses)
    robot = with_reach(robot, guesses)
    robot, base_turn = with_home(robot, guesses)
    robot = with_gains(robot, guesses)
    return Described(with_contact_force(robot, guesses), tuple(read), tuple(guesses), base_turn)


# -- joints and flange -------------------------------------------------------------------------------------------------


def _placeholders(chain: Sequence[UrdfJoint]) -> list[str]:
    """A warning where all turning joints state the same effort and velocity, which hardly any arm has."""
    turning = [joint for joint in chain if joint.kind == "revolute"]
    stated = {(joint.effort, joint.velocity) for joint in turning}
    effort, velocity = next(iter(stated), (0.0, 0.0))
    if len(stated) != 1 or not (0 < effort < math.inf and 0 < velocity < math.inf):
        return []
    same = f"all {len(turning)} joints state {effort:g} Nm and {velocity:g} rad/s"
    follow = "gains and, on hardware, force limits follow from them"
    return [f"{same}, which look like placeholders, and {follow}: state the right ones"]


def _joint(joint: UrdfJoint, guesses: list[Guess]) -> JointDescription:
    lower, upper = joint.lower, joint.upper
    units, slide = joint.units, joint.kind == "prismatic"
    speed, torque = (_SLIDE_SPEED, _SLIDE_EFFORT) if slide else (_SPEED, _EFFORT)
    if not (math.isfinite(lower) and math.isfinite(upper)):
        if slide:
            raise InvalidArgument(f"URDF joint {joint.name!r}", "slides without limits", "lower and upper in m")
        lower, upper = -_TURN, _TURN
        why = "the URDF states no limits: it is planned within one turn either way"
        guesses.append(Guess(f"{joint.name}.limits", f"{lower:.4f} to {upper:.4f} rad", why))
    if not lower < upper:
        problem = f"its limits are {lower:g} to {upper:g}"
        raise InvalidArgument(f"URDF joint {joint.name!r}", problem, "lower < upper")
    velocity, effort = joint.velocity, joint.effort
    if not (math.isfinite(velocity) and velocity > 0):
        guesses.append(Guess(f"{joint.name}.velocity", f"{speed:g} {units.position}/s", _not_stated(velocity)))
        velocity = speed
    if not (math.isfinite(effort) and effort > 0):
        guesses.append(Guess(f"{joint.name}.effort", f"{torque:g} {units.effort}", _not_stated(effort)))
        effort = torque
    return JointDescription(joint.name, lower, upper, velocity, 4 * velocity, 400 * velocity, effort, 1000.0, 100.0)


def _not_stated(value: float) -> str:
    return "the URDF's 0 is taken as not stated" if value == 0 else "the URDF states none"


def _with_hand(
    text: str, mesh_folder: str | None, urdf: Urdf, arm: Sequence[UrdfJoint], why: str, guesses: list[Guess]
) -> str:
    """The URDF text with ``ParallelHand`` on the arm's flange, as far out as the last link's shapes reach."""
    chain = [joint.name for joint in arm]
    flange = _flange(urdf, arm[-1].child)
    turned, leads = mount_rpy(urdf, chain, flange)
    guesses.append(Guess("gripper", "ParallelHand()", f"{why}: a plain hand sits on {flange!r}"))
    if any(turned):
        rpy = f"rpy ({', '.join(f'{value:.4g}' for value in turned)})"
        why = f"the arm leads out along {flange!r}'s {leads}, a hand along its +z: the URDF's hand_mount turns it"
        guesses.append(Guess("hand_mount", rpy, why))
    prefix = "hand_"
    while any(link.startswith(prefix) for link in urdf.links):
        prefix = f"plain_{prefix}"
    shapes = _shapes(text, mesh_folder, urdf, tuple(_joint(joint, []) for joint in arm), flange)
    text = with_parallel_hand(text, flange, ParallelHand(), prefix, turned)
    frames = link_poses(read_urdf(text, mesh_folder), {})
    palm, out = frames[f"{prefix}palm"], 0.0
    for link in fixed_to(urdf, arm[-1].child):
        points = (palm.inverse() * frames[link]).apply(shapes.get(link, _NONE))
        if len(points) and (points[:, :2].min(axis=0) < 0).all() and (points[:, :2].max(axis=0) > 0).all():
            out = max(out, round(float(points[:, 2].max()), 4))
    if out < _OVERLAP:
        return text
    why = f"the shapes of {arm[-1].child!r} reach that far beyond {flange!r}: the URDF's {prefix}mount shifts the hand"
    guesses.append(Guess("gripper's place", f"{1000 * out:.0f} mm out", why))
    root = ElementTree.fromstring(text)
    [origin] = root.iterfind(f"joint[@name='{prefix}mount']/origin")
    origin.set("xyz", numbers(list((frames[flange].inverse() * palm).rotation @ (0.0, 0.0, out))))
    return ElementTree.tostring(root, encoding="unicode")


def _shapes(
    text: str, mesh_folder: str | None, urdf: Urdf, joints: tuple[JointDescription, ...], tool_link: str
) -> dict[str, Array]:
    """Link -> corners of its collision shapes' boxes in the link's frame (m), of an arm without described fingers."""
    arm = RobotDescription(
        urdf.name, text, joints, GripperDescription(finger_joints=()), tool_link, mesh_folder=mesh_folder
    )
    arm = attrs.evolve(arm, home=tuple((joint.lower + joint.upper) / 2 for joint in joints))
    return RobotShape(arm, Kinematics(arm)).corners()


def _flange(urdf: Urdf, last: str) -> str:
    """The link a hand belongs on: the arm's last one, or what is fixed to it and called so."""
    fixed: dict[str, list[str]] = {}
    for joint in urdf.joints:
        if joint.kind == "fixed":
            fixed.setdefault(joint.parent, []).append(joint.child)
    ends, stack = [], [last]
    while stack:
        link = stack.pop()
        ends.append(link)
        stack.extend(fixed.get(link, []))
    named = [link for link in ends if _FLANGE_NAMES.match(link)]
    return named[-1] if named else last


# -- the gripper and the tool frame ------------------------------------------------------------------------------------


def _carrier(urdf: Urdf, finger: UrdfJoint) -> str:
    return urdf.joint(finger.name).parent


def _finger_links(urdf: Urdf, fingers: Sequence[UrdfJoint]) -> list[str]:
    """Links that the finger joints carry, also over fixed joints."""
    links = {joint.child for joint in fingers}
    for joint in urdf.joints:
        if joint.kind == "fixed" and joint.parent in links:
            links.add(joint.child)
    return sorted(links)


def _finger_pairs(urdf: Urdf, fingers: Sequence[UrdfJoint]) -> tuple[tuple[str, str], ...]:
    links = _finger_links(urdf, fingers)
    return tuple((one, other) for number, one in enumerate(links) for other in links[number + 1 :])


def _with_fingers_shut_at_zero(
    text: str,
    mesh_folder: str | None,
    urdf: Urdf,
    joints: tuple[JointDescription, ...],
    fingers: tuple[UrdfJoint, ...],
    guesses: list[Guess],
) -> tuple[str, Urdf, tuple[UrdfJoint, ...]]:
    """The URDF, with finger slides that are not shut at 0, or that close with growing positions, turned about."""
    slides = finger_slides(urdf, fingers, _shapes(text, mesh_folder, urdf, joints, _carrier(urdf, fingers[0])))
    if all(one.counted_from_shut for one in slides if one.joint.mimic is None):
        return text, urdf, fingers
    text = counted_from_shut(text, slides)
    urdf = read_urdf(text, mesh_folder)
    for one in slides:
        value = f"shut at 0, open at {abs(one.open - one.shut):g} m"
        why = f"by its pads' shapes the URDF's {one.shut:g} m is shut, its {one.open:g} m open: turned about"
        guesses.append(Guess(f"{one.joint.name}.origin and axis", value, why))
    return text, urdf, tuple(urdf.joint(joint.name) for joint in fingers)


def _first_gripper(urdf: Urdf, fingers: Sequence[UrdfJoint], guesses: list[Guess]) -> GripperDescription:
    """Its joints and pads; measures follow from the shapes."""
    names = tuple(joint.name for joint in fingers)
    slides = all(joint.kind == "prismatic" for joint in fingers)
    sliding = [joint.child for joint in fingers if joint.kind == "prismatic"]
    if slides or len(sliding) > 1:  # where a motor's hinge drives two slides, too
        pads = tuple(sliding[:2])
    else:
        carried = _finger_links(urdf, fingers)
        tips = [link for link in carried if re.search(r"pad|tip", link, re.IGNORECASE)]
        lowest = [joint.child for joint in fingers if all(other.parent != joint.child for other in fingers)]
        pads = _opposite(urdf, tips if len(tips) >= 2 else lowest)
    efforts = [joint.effort for joint in fingers if slides and 0 < joint.effort < math.inf]
    most = min(max(min(efforts, default=60.0), 10.0), 80.0)
    gripper = GripperDescription(finger_joints=names, pads=pads, max_force=most, min_force=min(5.0, most / 4))
    why = "the least effort of the slides, within 10 to 80 N" if efforts else "no slide states an effort"
    guesses.append(Guess("gripper.max_force", f"{most:g} N", why))
    guesses.append(Guess("gripper.min_force", f"{gripper.min_force:g} N", "5 N, or a quarter of max_force"))
    guesses.append(Guess("gripper.speed", f"{gripper.speed:g} m/s", "no URDF states it; the maker does"))
    guesses.append(Guess("gripper.pad_friction", f"{gripper.pad_friction:g}", "rubber pads; no URDF states it"))
    return gripper


def _opposite(urdf: Urdf, links: Sequence[str]) -> tuple[str, ...]:
    """The two of the links that are farthest apart."""
    poses = link_poses(urdf, {})
    pairs = [(one, other) for number, one in enumerate(links) for other in links[number + 1 :]]
    if not pairs:
        return tuple(links)
    return max(pairs, key=lambda pair: math.dist(poses[pair[0]].position, poses[pair[1]].position))


def _with_tool(robot: RobotDescription, urdf: Urdf, guesses: list[Guess]) -> RobotDescription:
    """Tool frame and measures of the gripper, from the fingers' motion and shapes."""
    gripper = robot.gripper
    if len(gripper.pads) < 2:
        problem = (
            f"has a gripper of one jaw ({', '.join(gripper.finger_joints)}): a joint that moves a second one away "
        )
        right = f"a gripper of two fingers, {_PLAIN_HAND}"
        raise InvalidArgument(f"URDF of {urdf.name!r}", problem + "from it is missing", right)
    try:
        linkage = FingerLinkage(urdf, gripper)
    except InvalidArgument as error:
        raise InvalidArgument(error.argument, error.problem, f"{error.expected}, {_PLAIN_HAND}") from None
    shapes = RobotShape(robot, Kinematics(robot)).corners()
    hand = robot.tool_link
    _check_zero_is_shut(urdf, gripper, linkage)
    shut = _pads_in(urdf, hand, gripper.pads, linkage.positions_at(linkage.driver(0.0)))
    open_ = _pads_in(urdf, hand, gripper.pads, linkage.positions_at(linkage.driver(linkage.stroke)))
    if linkage.slides and not any(link in shapes for pad in gripper.pads for link in fixed_to(urdf, pad)):
        _check_frames_part(urdf, gripper, (shut, open_))
    opening = np.subtract(open_[0].position, open_[1].position) - np.subtract(shut[0].position, shut[1].position)
    y = opening / np.linalg.norm(opening)
    _check_pads_part(urdf, robot, linkage, [_across(urdf, poses, gripper.pads, shapes, y) for poses in (shut, open_)])
    last = link_poses(urdf, {})[hand].inverse() * link_poses(urdf, {})[urdf.joint(robot.joint_names[-1]).child]
    corners = [
        np.concatenate([shut[k].apply(shapes[pad]) for k, pad in enumerate(gripper.pads) if pad in shapes] or [_NONE]),
        np.concatenate([open_[k].apply(shapes[pad]) for k, pad in enumerate(gripper.pads) if pad in shapes] or [_NONE]),
    ]
    middle = np.mean([pose.position for pose in shut], axis=0) if not len(corners[0]) else corners[0].mean(axis=0)
    outwards = middle - np.array(last.position)
    z = _nearest_axis(outwards - (outwards @ y) * y)
    z = z - (z @ y) * y
    z /= np.linalg.norm(z)
    x = np.cross(y, z)
    tip = float((corners[0] @ z).max()) if len(corners[0]) else float(middle @ z)
    # Half way between the fingers' frames across, as far out as the fingertips less a little.
    between = np.mean([pose.position for pose in shut], axis=0)
    origin = (between @ y) * y + (middle @ x) * x + (tip - _TIP) * z
    tool = Pose(tuple(origin), quaternion_from_rotation(np.column_stack([x, y, z])))
    guesses.append(
        Guess("tool_offset", _pose_text(tool), f"between the pads, {1000 * _TIP:.0f} mm short of the fingertips")
    )
    own = tool.inverse().apply(shapes[hand]) if hand in shapes else np.empty((0, 3))
    own = own[own[:, 2] < -0.002] if len(own) else own
    palm = float(-own[:, 2].max()) if len(own) else 0.04
    wide = float(np.ptp(own[:, 1])) if len(own) else 0.15
    thick = float(np.ptp(own[:, 0])) if len(own) else 0.06
    why = "from the collision shapes of the hand and the fingers"
    guesses.append(Guess("gripper.measures", f"palm {palm:.3f} m back, hand {wide:.3f} x {thick:.3f} m", why))
    changed = attrs.evolve(
        gripper,
        stroke=round(linkage.stroke, 6),
        fingertip_reach=_TIP,
        palm_distance=round(max(palm, 0.0), 4),
        hand_size=(round(wide, 4), round(thick, 4)),
    )
    return attrs.evolve(robot, gripper=changed, tool_offset=tool)


_NONE: Array = np.empty((0, 3))


def _check_zero_is_shut(urdf: Urdf, gripper: GripperDescription, linkage: FingerLinkage) -> None:
    """Raise ``InvalidArgument`` for slides that do not begin at 0: their positions add up to the opening."""
    for name in gripper.finger_joints if linkage.slides else ():
        joint = urdf.joint(name)
        if joint.mimic is None and abs(joint.lower) > NEARLY_SHUT:
            problem = f"its limits are {joint.lower:g} to {joint.upper:g} m"
            right = f"a finger that is shut at 0 and opens with growing positions, 0 to {joint.upper - joint.lower:g} m"
            raise InvalidArgument(f"URDF joint {name!r}", problem, right)


def _check_frames_part(urdf: Urdf, gripper: GripperDescription, ends: Sequence[Sequence[Pose]]) -> None:
    """Raise ``InvalidArgument`` for slides without shapes on their pads whose frames draw nearer as they open."""
    apart = [math.dist(poses[0].position, poses[-1].position) for poses in ends]
    if apart[1] < apart[0] - 1e-6:
        joint = urdf.joint(gripper.finger_joints[0])
        problem = (
            f"its pads {' and '.join(gripper.pads)} have no collision shapes to tell by where it is shut, and their "
        )
        problem += f"frames are {1000 * apart[0]:.0f} mm apart at {joint.lower:g} m"
        problem += f", {1000 * apart[1]:.0f} mm at {joint.upper:g} m"
        right = "a <collision> of each pad, or a finger that is shut at 0 and opens with growing positions (move its "
        raise InvalidArgument(
            f"URDF joint {joint.name!r}", problem, right + "<origin> to where it is shut, turn its <axis>)"
        )


def _check_pads_part(urdf: Urdf, robot: RobotDescription, linkage: FingerLinkage, across: list[float]) -> None:
    """Raise ``InvalidArgument`` unless the pads' shapes are farther apart where the fingers count as open."""
    if abs(across[1]) < abs(across[0]) - 1e-6:
        joint = urdf.joint(robot.gripper.finger_joints[0])
        shut, open_ = linkage.driver(0.0), linkage.driver(linkage.stroke)
        problem = f"its pads are nearer to each other at {open_:g} than at {shut:g} m"
        right = "a finger that is shut at 0 and opens with growing positions (turn its axis, move its origin)"
        if joint.kind != "prismatic":
            problem = problem.removesuffix(" m") + " rad"
            right = "links whose frames are on the pads, so that they part as the pads do"
        raise InvalidArgument(f"URDF joint {joint.name!r}", problem, right)


def _across(urdf: Urdf, poses: Sequence[Pose], pads: Sequence[str], shapes: dict[str, Array], y: Array) -> float:
    """m along y from the middle of the last pad's shapes to that of the first's; 0 where one has none."""
    middles = []
    for pose, pad in ((poses[0], pads[0]), (poses[-1], pads[-1])):
        rest = link_poses(urdf, {})
        solid = [
            (rest[pad].inverse() * rest[link]).apply(shapes[link]) for link in fixed_to(urdf, pad) if link in shapes
        ]
        if not solid:
            return 0.0
        middles.append(float(pose.apply(np.concatenate(solid)).mean(axis=0) @ y))
    return middles[0] - middles[1]


def _pads_in(urdf: Urdf, hand: str, pads: Sequence[str], positions: dict[str, float]) -> list[Pose]:
    poses = link_poses(urdf, positions)
    return [poses[hand].inverse() * poses[pad] for pad in pads]


def _nearest_axis(direction: Array) -> Array:
    """The direction itself, or the coordinate axis that it nearly is."""
    unit = direction / np.linalg.norm(direction)
    axis = int(np.argmax(np.abs(unit)))
    if abs(unit[axis]) > math.cos(math.radians(15)):
        unit = np.sign(unit[axis]) * np.eye(3)[axis]
    return unit


# -- source ------------------------------------------------------------------------------------------------------------


def _pose_text(pose: Pose) -> str:
    place = ", ".join(f"{value:.5g}" for value in np.round(pose.position, 5) + 0.0)
    turned = ", ".join(f"{value:.7g}" for value in np.round(pose.orientation, 7) + 0.0)
    return f"Pose(({place}), ({turned}))"


def _source(robot: RobotDescription, why: dict[str, str]) -> str:
    def note(*fields: str) -> str:
        reasons = [why[field] for field in fields if field in why]
        return f"  # guessed: {'; '.join(dict.fromkeys(reasons))}" if reasons else ""

    changed = [what for what in why if what.endswith(".inertia")]
    lines = ["RobotDescription(", f"    name={robot.name!r},", f"    urdf=URDF,{note('inertials', *changed)}"]
    lines += [
        "    mesh_folder=MESH_FOLDER,",
        "    # guessed: acceleration (rad/s2), jerk (rad/s3), kp (Nm/rad), kv (Nm s/rad), armature (kg m2)",
        "    joints=(",
    ]
    for joint in robot.joints:
        fields = [f"{field.name}={getattr(joint, field.name)!r}" for field in attrs.fields(JointDescription)[1:]]
        told = note(*(f"{joint.name}.{field}" for field in ("limits", "velocity", "effort")))
        lines += [f"        JointDescription({told}", f"            {joint.name!r},"]
        lines += [f"            {', '.join(fields[:4])},", f"            {', '.join(fields[4:])},", "        ),"]
    lines += ["    ),", f"    gripper=GripperDescription({note('gripper', 'gripper.measures')}"]
    for field in attrs.fields(GripperDescription):
        lines.append(f"        {field.name}={getattr(robot.gripper, field.name)!r},{note(f'gripper.{field.name}')}")
    lines += ["    ),", f"    tool_link={robot.tool_link!r},"]
    lines += [f"    tool_offset={_pose_text(robot.tool_offset)},{note('tool_offset')}"]
    lines += [f"    home={robot.home!r},{note('home')}", f"    allowed_contacts={robot.allowed_contacts!r},"]
    lines += [f"    reach={robot.reach!r},{note('reach')}"]
    lines += [f"    max_contact_force={robot.max_contact_force!r},{note('max_contact_force')}", ")"]
    return "\n".join(lines)
