"""A first description from a URDF: the arm's joints and fingers are found, the rest is guessed, told, and conforms."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import attrs
import numpy as np
import pytest
from memo_franka.description import panda

from memo_core.arm.description_from_urdf import Described, describe_urdf
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.errors import InvalidArgument
from memo_core.robot.finger_linkage import FingerLinkage
from memo_core.robot.parallel_hand import ParallelHand, with_parallel_hand
from memo_core.robot.urdf.reading import link_poses, read_urdf
from memo_core.robot.urdf.text import box_inertia
from memo_core.testing.robot import RULES
from memo_core.testing.simulator_scenes import check_robot
from tests.support.arms import on_a_rail, six_joint_arm

BARE = six_joint_arm((1, 6)).urdf
URDFS = {"panda": panda().urdf, "bare six-joint arm": BARE}


@pytest.fixture(scope="module", params=URDFS)
def described(request) -> Described:
    return describe_urdf(URDFS[request.param], "mine")


@pytest.mark.parametrize("rule", RULES)
def test_what_is_guessed_keeps_the_rules_of_the_suite(described, rule):
    RULES[rule](lambda: described.robot)


def test_home_has_the_hand_pointing_down_clear_of_itself(described):
    kinematics = Kinematics(described.robot)
    pose = kinematics.pose(np.array(described.robot.home))
    assert pose.rotation[2, 2] == pytest.approx(-1.0, abs=1e-3)
    assert pose.position[0] > 0.2 and pose.position[2] > 0.15


def test_a_pandas_hand_and_limits_are_those_of_its_own_description():
    robot, own = describe_urdf(panda().urdf).robot, panda()
    assert robot.joint_names == own.joint_names
    assert [(joint.lower, joint.upper, joint.effort) for joint in robot.joints] == [
        (joint.lower, joint.upper, joint.effort) for joint in own.joints
    ]
    assert robot.gripper.finger_joints == own.gripper.finger_joints
    assert robot.gripper.stroke == pytest.approx(own.gripper.stroke)
    assert robot.gripper.hand_size == pytest.approx(own.gripper.hand_size)
    assert robot.gripper.palm_distance == pytest.approx(own.gripper.palm_distance)
    found, meant = Kinematics(robot), Kinematics(own)
    assert found.pose(np.array(own.home)).distance(meant.pose(np.array(own.home))) == pytest.approx((0, 0), abs=1e-6)


@pytest.mark.parametrize("far", [0.045, 0.005])
def test_a_plain_hand_sits_where_the_last_links_shapes_end(far):
    rim = f'<collision><origin xyz="0 0 {far - 0.02}"/><geometry><cylinder radius="0.04" length="0.04"/></geometry>'
    last = '<joint name="hold" type="fixed"><parent link="tool"/><child link="ring"/></joint>'
    text = BARE.replace("</robot>", f'<link name="ring">{rim}</collision></link>{last}</robot>')
    described = describe_urdf(text, "mine")
    urdf = read_urdf(described.robot.urdf)
    mount = next(joint for joint in urdf.joints if joint.name == "hand_mount")
    shifted = far > 0.01
    assert mount.origin.position == pytest.approx((0, 0, far if shifted else 0.0), abs=1e-6)
    told = [guess for guess in described.guessed if guess.what == "gripper's place"]
    assert [guess.value for guess in told] == (["45 mm out"] if shifted else [])


def test_a_bare_arm_gets_a_hand_and_is_told_so():
    described = describe_urdf(BARE, "mine")
    guesses = {guess.what: guess for guess in described.guessed}
    assert "no fingers" in guesses["gripper"].why
    assert "6.2832" in guesses["joint1.limits"].value
    assert described.robot.gripper.stroke == pytest.approx(ParallelHand().stroke)


def test_the_source_makes_the_same_description(described):
    scope: dict = {"URDF": described.robot.urdf, "MESH_FOLDER": None}
    exec("from memo_core.robot.description import *\nfrom memo_core.scene.pose import Pose", scope)
    made = eval(described.source(), scope)
    assert made.joints == described.robot.joints and made.gripper == described.robot.gripper
    assert made.home == described.robot.home and made.reach == described.robot.reach
    assert np.allclose(made.tool_offset.matrix, described.robot.tool_offset.matrix, atol=1e-4)
    assert "# guessed" in described.source()


def test_fingers_are_told_from_the_wrist_by_what_stands_beside_them():
    one = BARE.replace("</robot>", "")
    one += '<link name="gripper_a"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" '
    one += 'ixz="0" iyz="0"/></inertial></link>'
    one += one[one.index('<link name="gripper_a"') :].replace("gripper_a", "gripper_b")
    for name, axis in (("gripper_a", "0 0 1"), ("gripper_b", "0 0 -1")):
        one += (
            f'<joint name="drive_{name}" type="prismatic"><parent link="link6"/><child link="{name}"/>'
            f'<origin xyz="0 0.1 0"/><axis xyz="{axis}"/>'
            '<limit lower="0" upper="0.03" effort="20" velocity="0.1"/></joint>'
        )
    robot = describe_urdf(one + "</robot>").robot
    assert robot.joint_names == tuple(f"joint{n}" for n in range(1, 7))
    assert robot.gripper.finger_joints == ("drive_gripper_a", "drive_gripper_b")
    assert robot.gripper.stroke == pytest.approx(0.06)
    assert robot.gripper.max_force == 20.0


def test_what_is_no_serial_arm_is_refused_in_a_line():
    two = BARE.replace("</robot>", "").replace('<robot name="six">', "")
    twin = re.sub(r'"(link\d|joint\d|base|tool|tool_joint)"', r'"\1_b"', two)
    both = f'<robot name="twins"><link name="torso"/>{two}{twin}'
    for base in ("base", "base_b"):
        both += f'<joint name="to_{base}" type="fixed"><parent link="torso"/><child link="{base}"/></joint>'
    cases = {
        both + "</robot>": "more than one arm",
        '<robot name="box"><link name="a"/></robot>': "no chain of three or more joints",
        BARE.replace('lower="-3" upper="3"', 'lower="3" upper="-3"'): "its limits are 3 to -3",
    }
    for urdf, what in cases.items():
        with pytest.raises(InvalidArgument, match=what) as raised:
            describe_urdf(urdf)
        assert "\n" not in str(raised.value)


def test_a_hand_needs_a_flange_and_free_names():
    urdf = with_parallel_hand(BARE, "tool")
    with pytest.raises(InvalidArgument, match="already has"):
        with_parallel_hand(urdf, "tool")
    with pytest.raises(InvalidArgument, match="no link 'flange'"):
        with_parallel_hand(BARE, "flange")


def test_fewer_joints_than_six_are_described_too():
    assert len(describe_urdf(check_robot().urdf).robot.joints) == 3


def _slides(axis: str, limits: str, y: float) -> str:
    """BARE with a hand on two slides, the pads ``y`` m off their joints' frames, finger 2 turned about."""
    hand = ParallelHand().text("tool")
    hand = hand.replace('<axis xyz="0 1 0"/>', f'<axis xyz="{axis}"/>').replace('lower="0" upper="0.04"', limits)
    for old in ("0 0.005 ", "0.0 0.005 "):
        hand = hand.replace(f'xyz="{old}', f'xyz="0 {y + 0.005} ')
    return BARE.replace("</robot>", hand + "</robot>")


def test_a_hand_on_slides_is_described_where_zero_is_shut():
    assert describe_urdf(_slides("0 1 0", 'lower="0" upper="0.04"', 0.0)).robot.gripper.stroke == pytest.approx(0.08)


OPEN_AT_ZERO = {
    "open at zero": _slides("0 1 0", 'lower="-0.04" upper="0"', 0.04),
    "growing positions close": _slides("0 -1 0", 'lower="0" upper="0.04"', 0.04),
}


def _pads_on_fixed_links() -> str:
    urdf = _slides("0 -1 0", 'lower="0" upper="0.04"', 0.04)
    for number in (1, 2):
        joint = f'<joint name="tip{number}" type="fixed"><parent link="slide{number}"/>'
        joint += f'<child link="hand_finger{number}"/></joint><link name="slide{number}"/>'
        urdf = urdf.replace(f'<child link="hand_finger{number}"/>', f'<child link="slide{number}"/>')
        urdf = urdf.replace("</robot>", joint + "</robot>")
    return urdf


def _mirrored() -> str:
    """The second finger's axis and limits the other way round."""
    head, joint, tail = _slides("0 1 0", 'lower="0" upper="0.04"', 0.0).partition('<joint name="hand_finger_joint2"')
    tail = tail.replace('"0 1 0"', '"0 -1 0"', 1).replace('lower="0" upper="0.04"', 'lower="-0.04" upper="0"', 1)
    return head + joint + tail


OPEN_AT_ZERO["mirrored without a mimic"] = _mirrored()
OPEN_AT_ZERO["open at zero, the second follows"] = OPEN_AT_ZERO["open at zero"].replace(
    '<joint name="hand_finger_joint2" type="prismatic">',
    '<joint name="hand_finger_joint2" type="prismatic"><mimic joint="hand_finger_joint1"/>',
)


# Both fingers shut, both open, by the URDF.
ENDS = {
    "open at zero": ((-0.04, -0.04), (0.0, 0.0)),
    "growing positions close": ((0.04, 0.04), (0.0, 0.0)),
    "mirrored without a mimic": ((0.0, 0.0), (0.04, -0.04)),
    "open at zero, the second follows": ((-0.04, -0.04), (0.0, 0.0)),
}


@pytest.mark.parametrize("name", OPEN_AT_ZERO)
def test_slides_that_are_not_shut_at_zero_are_turned_about_and_it_is_told(name):
    usual = describe_urdf(_slides("0 1 0", 'lower="0" upper="0.04"', 0.0)).robot
    described = describe_urdf(OPEN_AT_ZERO[name])
    robot = described.robot
    assert robot.gripper.stroke == pytest.approx(0.08)
    assert np.allclose(robot.tool_offset.matrix, usual.tool_offset.matrix, atol=1e-6)
    assert any("hand_finger_joint2" in guess.what and "is shut" in guess.why for guess in described.guessed)
    for rule in RULES.values():
        rule(lambda: robot)
    ends = (FingerLinkage(read_urdf(robot.urdf), robot.gripper).positions(opening) for opening in (0.0, 0.08))
    assert [end.tolist() for end in ends] == [pytest.approx([0.0, 0.0]), pytest.approx([0.04, 0.04])]
    before, after = read_urdf(OPEN_AT_ZERO[name]), read_urdf(robot.urdf)
    for old, new in zip(ENDS[name], ((0.0, 0.0), (0.04, 0.04)), strict=True):  # nothing is anywhere else than before
        fingers = robot.gripper.finger_joints
        were, are = (link_poses(u, dict(zip(fingers, at, strict=True))) for u, at in ((before, old), (after, new)))
        for pad in robot.gripper.pads:
            assert were[pad].distance(are[pad]) == pytest.approx((0, 0), abs=1e-6)


def test_slides_whose_pads_are_fixed_to_them_are_turned_about_too():
    described = describe_urdf(_pads_on_fixed_links())
    assert described.robot.gripper.stroke == pytest.approx(0.08)
    assert any("hand_finger_joint1" in guess.what for guess in described.guessed)


def test_slides_without_shapes_that_are_not_shut_at_zero_are_refused_by_the_joint_and_what_is_right():
    urdf = OPEN_AT_ZERO["open at zero"]
    for number in (1, 2):
        link = re.search(rf'<link name="hand_finger{number}">.*?</link>', urdf, re.DOTALL)
        assert link is not None
        bare = re.sub(r"<collision.*?</collision>", "", link.group(), flags=re.DOTALL)
        urdf = urdf.replace(link.group(), bare)
    with pytest.raises(InvalidArgument, match=r"hand_finger_joint1.*its limits are -0\.04 to 0 m.*shut at 0") as raised:
        describe_urdf(urdf)
    assert "\n" not in str(raised.value)


def test_the_rule_about_the_stroke_refuses_slides_that_are_open_at_zero():
    robot = describe_urdf(BARE).robot
    open_at_zero = robot.urdf.replace('lower="0" upper="0.04"', 'lower="-0.04" upper="0"')
    with pytest.raises(AssertionError, match=r"hand_finger_joint1's limits are -0\.04 to 0 m"):
        RULES["the_gripper_opens_by_its_stroke"](lambda: attrs.evolve(robot, urdf=open_at_zero))


def test_a_velocity_or_effort_of_zero_is_none_for_the_description_and_for_the_rules():
    urdf = BARE.replace('velocity="1.5" effort="100"', 'velocity="0" effort="0"', 2)
    described = describe_urdf(urdf)
    guesses = {guess.what: guess for guess in described.guessed}
    for number in (1, 2):
        for field in ("velocity", "effort"):
            assert "0 is taken as not stated" in guesses[f"joint{number}.{field}"].why
    assert "joint3.velocity" not in guesses
    for rule in RULES.values():
        rule(lambda: described.robot)


def test_all_moving_links_without_mass_are_listed():
    urdf = re.sub(r'(<link name="link[25]">)<inertial>.*?</inertial>', r"\1", BARE)
    described = describe_urdf(urdf)
    (line,) = (line for line in described.read if "mass" in line)
    assert "link2, link5" in line and "link1" not in line and "tool" not in line
    with pytest.raises(AssertionError, match="link2, link5"):
        RULES["what_moves_has_mass"](lambda: described.robot)
    assert not [line for line in describe_urdf(BARE).read if "mass" in line]


def _principal(urdf: str, link: str) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = read_urdf(urdf).links[link].inertia
    return np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def test_an_inertia_slightly_too_large_is_made_possible_and_it_is_told():
    stated = 'ixx="0.01" iyy="0.01" izz="0.01"'
    urdf = BARE.replace(stated, 'ixx="0.00306" iyy="0.0236" izz="0.0269"', 2)
    described = describe_urdf(urdf)
    told = {guess.what: guess for guess in described.guessed}
    assert {what for what in told if what.endswith(".inertia")} == {"link1.inertia", "link2.inertia"}
    assert "0.9% more" in told["link2.inertia"].why and "no solid body has" in described.source()
    assert _principal(described.robot.urdf, "link2") == pytest.approx([0.00306, 0.0236, 0.02666], rel=1e-5)
    RULES["what_moves_has_mass"](lambda: described.robot)


def test_all_inertias_that_are_far_from_possible_are_named_at_once_as_they_stand():
    urdf = BARE.replace('ixx="0.01" iyy="0.01" izz="0.01"', 'ixx="0.01" iyy="0.01" izz="0.03"', 2)
    described = describe_urdf(urdf)
    assert not [guess for guess in described.guessed if guess.what.endswith(".inertia")]
    with pytest.raises(AssertionError, match=r"link1: its <inertia>.*link2: its <inertia>"):
        RULES["what_moves_has_mass"](lambda: described.robot)


def test_masses_that_a_urdf_lacks_are_divided_by_volume_and_it_is_told(tmp_path):
    urdf = re.sub(r"<inertial>.*?</inertial>", "", BARE)
    size, centre = (0.1, 0.2, 0.4), (0.0, 0.05, 0.1)
    for number in (1, 2):
        block = "<box/>" if number == 1 else f'<mesh filename="{_box_mesh(tmp_path / "box.obj", size)}"/>'
        block = block.replace("<box/>", f'<box size="{" ".join(map(str, size))}"/>')
        shape = f'<collision><origin xyz="0 0.05 0.1"/><geometry>{block}</geometry></collision>'
        urdf = re.sub(rf'(<link name="link{number}">)<collision>.*?</collision>', rf"\1{shape}", urdf)
    described = describe_urdf(urdf, total_mass=30.0)
    links = read_urdf(described.robot.urdf).links
    arm = [links[f"link{number}"] for number in range(1, 7)]
    assert sum(link.mass for link in arm) == pytest.approx(30.0, rel=1e-4)
    rod = np.pi * 0.04**2
    assert arm[0].mass / arm[2].mass == pytest.approx(np.prod(size) / (rod * 0.30), rel=1e-4)
    for link in arm[:2]:
        assert link.centre.position == pytest.approx(centre)
        assert link.inertia == pytest.approx(box_inertia(link.mass, size, centre).tensor, rel=1e-4)
    (told,) = (guess for guess in described.guessed if guess.what == "inertials")
    assert "link1" in told.value and "volume" in told.why and "urdf=URDF,  # guessed" in described.source()
    for rule in RULES.values():
        rule(lambda: described.robot)


def _box_mesh(path: Path, size: tuple[float, float, float]) -> Path:
    corners = [[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    lines = [f"v {' '.join(f'{c * s:g}' for c, s in zip(corner, size, strict=True))}" for corner in corners]
    path.write_text("\n".join([*lines, "f 1 2 3", "f 4 5 6", "f 7 8 1"]))
    return path


def test_a_total_mass_is_more_than_what_is_stated_and_there_is_something_to_divide_it_among():
    some = re.sub(r'(<link name="link[25]">)<inertial>.*?</inertial>', r"\1", BARE)
    for urdf, mass, said in ((some, 3.0, "3 kg, and links of the URDF state 4 kg"), (BARE, 30.0, "states its mass")):
        with pytest.raises(InvalidArgument, match=f"--total-mass.*{said}"):
            describe_urdf(urdf, total_mass=mass)


def test_efforts_and_speeds_that_are_all_the_same_are_told_as_placeholders():
    assert [line for line in describe_urdf(BARE).read if "all 6 joints state 100 Nm and 1.5 rad/s" in line]
    assert not [line for line in describe_urdf(panda().urdf).read if "placeholder" in line]


def test_the_guessed_speed_and_forces_of_the_gripper_are_marked_in_the_source():
    for urdf in URDFS.values():
        source = describe_urdf(urdf).source()
        for field in ("speed", "min_force", "max_force", "pad_friction"):
            assert re.search(rf"^        {field}=\S+,  # guessed: ", source, re.MULTILINE), field


def test_of_a_slide_everything_is_told_in_metres_and_newtons():
    urdf = on_a_rail(BARE).replace('velocity="0.5" effort="400"', 'velocity="0" effort="0"')
    described = describe_urdf(urdf)
    told = {guess.what: guess.value for guess in described.guessed}
    assert told["rail.velocity"] == "0.25 m/s" and told["rail.effort"] == "500 N"
    assert re.match(r"kp \d+ N/m, (\d+, ){5}\d+ Nm/rad, kv", told["kp, kv"])
    assert re.match(r"[\d.]+ m/s2, ([\d.]+, ){5}[\d.]+ rad/s2$", told["acceleration, jerk"])
    with pytest.raises(InvalidArgument, match=r"'rail': slides without limits.*lower and upper in m"):
        describe_urdf(urdf.replace('<limit lower="-0.4" upper="0.4" velocity="0" effort="0"/>', "", 1))


def test_no_zero_of_home_has_a_sign():
    described = describe_urdf(check_robot().urdf)
    assert not [value for value in described.robot.home if value == 0 and np.signbit(value)]
    assert "-0.0," not in described.source() and "-0.0)" not in described.source()


def test_shapeless_fingers_whose_frames_draw_nearer_are_refused_by_the_joint():
    root = ElementTree.fromstring(OPEN_AT_ZERO["growing positions close"])
    for link in root.findall("link"):
        for shape in link.findall("collision"):
            link.remove(shape)
    for number, y in ((1, 0.04), (2, -0.04)):
        (joint,) = (one for one in root.findall("joint") if one.get("name") == f"hand_finger_joint{number}")
        origin = joint.find("origin")
        assert origin is not None
        origin.set("xyz", f"0 {y} 0.07")
    urdf = ElementTree.tostring(root, encoding="unicode")
    with pytest.raises(InvalidArgument, match=r"hand_finger_joint1.*no collision shapes to tell by") as raised:
        describe_urdf(urdf)
    assert "\n" not in str(raised.value)


def test_fingers_that_both_slide_the_same_way_are_refused_by_the_joint():
    head, joint, tail = describe_urdf(BARE).robot.urdf.partition('name="hand_finger_joint2"')
    turned = re.sub(r'(<axis xyz=")0(\.0)? (-?)1', lambda m: f"{m[1]}0 {'' if m[3] else '-'}1", tail, count=1)
    turned = turned.replace("</joint>", '<mimic joint="hand_finger_joint1"/></joint>', 1)
    assert "0 -1" in turned
    with pytest.raises(InvalidArgument, match=r"'hand_finger_joint2': moves its pad the same way") as raised:
        describe_urdf(head + joint + turned)
    assert "\n" not in str(raised.value)
