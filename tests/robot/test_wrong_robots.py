"""``memo plugins check`` names the cause of what is wrong with a robot in its first line, once."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import attrs
import pytest

pytest.importorskip("memo_robots", reason="make setup installs it")

from memo_robots.ur5e import ur5e

from memo_core.arm.description_from_urdf import describe_urdf
from memo_core.cli.main import main
from memo_core.plugins.registry import Registry
from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Pose, quaternion_from_axis_angle
from memo_core.testing.plugins import Result, check_robot
from memo_core.testing.robot_check.page import write_robot_page
from tests.support.arms import on_a_rail, six_joint_arm

RIGHT = ur5e()
UPSIDE_DOWN = Pose(orientation=quaternion_from_axis_angle((0, 1, 0), math.pi))


def _joints(*numbers: int, **changes: float) -> RobotDescription:
    """The right robot with values of some joints changed; ``kp`` and ``kv`` are factors."""
    joints = list(RIGHT.joints)
    for number in numbers or range(6):
        joint = joints[number]
        factors = {key: getattr(joint, key) * value for key, value in changes.items() if key in ("kp", "kv")}
        joints[number] = attrs.evolve(joint, **(changes | factors))
    return attrs.evolve(RIGHT, joints=tuple(joints))


def _urdf(pattern: str, replacement: str, **changes: object) -> RobotDescription:
    urdf, count = re.subn(pattern, replacement, RIGHT.urdf, flags=re.DOTALL)
    assert count, pattern
    return attrs.evolve(RIGHT, urdf=urdf, **changes)


def _finger2(inside: str) -> str:
    return rf"\1{inside}\2"


FINGER2 = r'(<joint name="hand_finger_joint2".*?)(</joint>)'
ONE_FINGER = attrs.evolve(RIGHT.gripper, finger_joints=("hand_finger_joint1",), pads=("hand_finger1",))
# name -> (description, the rule it breaks, what the first line says)
WRONG: dict[str, tuple[RobotDescription, str, str]] = {
    "weak gains": (_joints(kp=0.013, kv=0.013), "it_follows_a_motion", r"elbow_joint.*the servo is weak, kp 58\.5"),
    "one servo lags": (
        _joints(2, kv=1.4),
        "it_follows_a_motion",
        r"^elbow_joint \(kv 630, kp 4500\): the servo lags 140 ms behind its target, which is kv/kp",
    ),
    "soft to the touch": (
        _joints(1, kp=0.08, kv=0.08),
        "the_hand_does_not_give_way",
        r"shoulder_lift_joint's servo is weak: the hand gives way by \d+ mm under 20 N",
    ),
    "hard gains": (_joints(kp=1000.0), "it_holds_home", r"shakes at home.*the servo is too hard, kp 2e\+06 Nm/rad"),
    "hardly damped": (_joints(kv=0.01), "it_follows_a_motion", r"the servo is hardly damped, kv 4\.5 for kp 4500"),
    "home in the table": (
        attrs.evolve(RIGHT, home=(-0.3398, -0.6, 1.6168, -1.3637, -1.5708, -1.9105)),
        "home_is_clear",
        r"the hand touches the table \(the tool is at x 0\.39, y 0\.00, z -0\.10 m",
    ),
    "tool centre beyond the fingertips": (
        attrs.evolve(RIGHT, tool_offset=Pose((0.0, 0.0, 0.06))),
        "the_tool_centre_is_between_the_pads",
        r"the tool centre is 50 mm beyond the fingertips.*move tool_offset by -60 mm",
    ),
    "tool centre aside": (
        attrs.evolve(RIGHT, tool_offset=Pose((0.0, 0.02, 0.0))),
        "the_tool_frame_sits_between_the_fingers",
        r"the fingers meet 0 mm along x and -20 mm along y from the tool centre: tool_offset is off",
    ),
    "limits swapped": (
        _joints(0, lower=6.28, upper=-6.28),
        "limits_are_possible",
        r"shoulder_pan_joint's limits are 6\.28 to -6\.28: they are swapped",
    ),
    "mass zero": (
        _urdf(r'<mass value="2\.846"', '<mass value="0"'),
        "what_moves_has_mass",
        r"the moving link forearm_link weighs 0\.0 kg",
    ),
    "finger axis wrong": (
        _urdf(r'(<joint name="hand_finger_joint1".*?<axis xyz=")0 1 0', r"\g<1>1 0 0"),
        "the_tool_frame_sits_between_the_fingers",
        r"opening moves hand_finger1 by \(\+10\.0, \+0\.0, \+0\.0\) mm.*the <axis> of its joint",
    ),
    "five joints": (
        _urdf(
            '<joint name="wrist_2_joint" type="revolute">',
            '<joint name="wrist_2_joint" type="fixed">',
            joints=RIGHT.joints[:4] + RIGHT.joints[5:],
            home=RIGHT.home[:4] + RIGHT.home[5:],
        ),
        "it_reaches_in_six_dimensions",
        r"^it has 5 joints: where the hand is decides which way it can point",
    ),
    "mesh missing": (
        _urdf(r'<cylinder radius="0\.038" length="0\.04" ?/>', '<mesh filename="package://ur/wrist.stl"/>'),
        "names_are_those_of_the_urdf",
        r"^URDF link 'wrist_3_link': mesh 'package://ur/wrist\.stl' not found",
    ),
    "continuous without limits": (
        attrs.evolve(_joints(5, lower=-math.inf, upper=math.inf), urdf=ur5e(("wrist_3",)).urdf),
        "limits_are_possible",
        r"wrist_3_joint is continuous, its limits are -inf to inf: state what it is to be planned within",
    ),
    "mimic the wrong way": (
        _urdf(FINGER2, _finger2('<mimic joint="hand_finger_joint1" multiplier="-1"/>')),
        "the_gripper_opens_by_its_stroke",
        r"hand_finger_joint2'?: moves its pad the same way as 'hand_finger_joint1'.*hand_finger1 and hand_finger2 stay "
        r"\d+ mm apart",
    ),
    "masses in grams": (
        _urdf(r'<mass value="2\.846"', '<mass value="2846"'),
        "the_urdf_is_in_rad_m_and_kg",
        r"link 'forearm_link' \(2846 kg\): probably grams",
    ),
    "joints swapped": (
        attrs.evolve(RIGHT, joints=(RIGHT.joints[1], RIGHT.joints[0], *RIGHT.joints[2:])),
        "the_arm_is_one_chain",
        r"^shoulder_pan_joint and shoulder_lift_joint are swapped; from the base to the tool: shoulder_pan_joint, ",
    ),
    "a pad that no finger moves": (
        attrs.evolve(RIGHT, gripper=attrs.evolve(RIGHT.gripper, pads=("hand_tool",))),
        "the_gripper_opens_by_its_stroke",
        r"^gripper\.pads: no finger joint moves hand_tool",
    ),
    "home in degrees": (
        attrs.evolve(RIGHT, home=tuple(math.degrees(angle) for angle in RIGHT.home)),
        "home_is_within_the_limits",
        r": home looks like degrees, it is in rad",
    ),
    "home singular": (
        attrs.evolve(RIGHT, home=(*RIGHT.home[:4], 0.0, RIGHT.home[5])),
        "home_is_no_singularity",
        r"^home is singular: .*wrist_1_joint.*wrist_3_joint",
    ),
    "grip beyond the fingers' effort": (
        attrs.evolve(RIGHT, gripper=attrs.evolve(RIGHT.gripper, max_force=800.0)),
        "the_grip_is_within_the_fingers_effort",
        r"^gripper\.max_force is 800 N, the URDF's effort of the fingers is hand_finger_joint1 \d+ N",
    ),
    "half the reach": (
        attrs.evolve(RIGHT, reach=RIGHT.reach / 2),
        "reach_is_what_the_arm_reaches",
        r"but the tool gets [\d.]+ m from the first joint",
    ),
    "too weak for its weight": (
        attrs.evolve(_joints(1, effort=10.0), max_contact_force=5.0),
        "it_holds_home",
        r"^shoulder_lift_joint's effort of 10 Nm does not hold the arm's weight, which is \d+ Nm at home",
    ),
    "mimic not described": (
        _urdf(FINGER2, _finger2('<mimic joint="hand_finger_joint1"/>'), gripper=ONE_FINGER),
        "every_moving_joint_is_described",
        r"belong in gripper\.finger_joints too: hand_finger_joint2 \(mimics hand_finger_joint1\)",
    ),
    "tool upside down": (
        attrs.evolve(RIGHT, tool_offset=RIGHT.tool_offset * UPSIDE_DOWN),
        "the_approach_axis_leads_out_of_the_hand",
        r"the last joint is 135 mm ahead of the tool along its z: the tool frame is upside down",
    ),
}
REGISTRY = Registry()


def results(robot: RobotDescription) -> list[Result]:
    """Up to the first thing wrong."""
    found = []
    for result in check_robot(REGISTRY, "robot/mine", lambda: robot):
        found.append(result)
        if result.outcome in ("broken", "limited"):
            break
    return found


LIMITED = {"five joints", "home singular", "grip beyond the fingers' effort", "half the reach"}


@pytest.mark.sim
@pytest.mark.parametrize("name", WRONG)
def test_the_first_thing_said_is_the_cause(name):
    robot, rule, cause = WRONG[name]
    last = results(robot)[-1]
    assert (last.rule, last.outcome) == (rule, "limited" if name in LIMITED else "broken"), last.why
    assert re.search(cause, last.why), last.why
    assert "\n" not in last.why


@pytest.mark.parametrize("name", ["limits swapped", "mesh missing", "mass zero", "continuous without limits"])
def test_one_cause_is_one_line_however_many_rules_it_breaks(name):
    found = list(check_robot(REGISTRY, "robot/mine", lambda: WRONG[name][0]))
    assert [one.rule for one in found if one.outcome in ("broken", "limited")] == [WRONG[name][1]]
    assert found[-1].rule == "in motion" and found[-1].outcome == "skipped"


@pytest.mark.sim
def test_a_tool_offset_in_millimetres_is_one_line():
    off = attrs.evolve(RIGHT, tool_offset=Pose((0.0, 0.0, 110.0)))
    found = list(check_robot(REGISTRY, "robot/mine", lambda: off))
    wrong = [one for one in found if one.outcome in ("broken", "limited")]
    assert [one.rule for one in wrong] == ["the_tool_centre_is_between_the_pads"], wrong
    assert wrong[0].why.endswith("tool_offset looks like millimetres, it is in m")


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (attrs.evolve(RIGHT, tool_link="hand_plam"), r"no link 'hand_plam'; did you mean 'hand_palm'\?"),
        (_joints(0, name="shoulder"), r"no joint 'shoulder'; did you mean 'shoulder_"),
    ],
)
def test_a_name_that_is_not_in_the_urdf_is_told_once(wrong, told):
    broken = [one for one in check_robot(REGISTRY, "robot/mine", lambda: wrong) if one.outcome == "broken"]
    assert [one.rule for one in broken] == ["names_are_those_of_the_urdf"]
    assert re.search(told, broken[0].why), broken[0].why


@pytest.mark.sim
def test_what_is_wrong_with_a_slide_is_told_in_its_units():
    right = describe_urdf(on_a_rail(six_joint_arm().urdf), "railed").robot
    rail = right.joints[0]
    soft = attrs.evolve(right, joints=(attrs.evolve(rail, kp=50.0, kv=5.0), *right.joints[1:]))
    last = results(soft)[-1]
    assert last.why.startswith("rail: the servo is weak, kp 50 N/m on "), last.why
    assert re.search(r"on \d+ kg \(", last.why), last.why


@pytest.mark.sim
def test_a_right_robot_keeps_every_rule_in_motion_too():
    found = list(check_robot(REGISTRY, "robot/ur5e", lambda: RIGHT))
    assert {one.outcome for one in found} == {"kept"}, [one for one in found if one.outcome != "kept"]
    assert "it_grasps_a_cube" in {one.rule for one in found}


@pytest.mark.sim
def test_the_docs_example_keeps_every_rule():
    page = Path(__file__).parents[2] / "docs" / "plugins" / "robot.md"
    [source] = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    scope: dict = {"__name__": "page"}
    exec(compile(source, page.name, "exec"), scope)
    [backend] = scope["memo_robots"]()
    found = list(check_robot(REGISTRY, "robot/reacher", lambda: backend.factory(backend.config())))
    assert {one.outcome for one in found} == {"kept"}, [one for one in found if one.outcome != "kept"]


@pytest.mark.process
def test_the_command_says_the_cause_in_its_first_line(monkeypatch, capsys):
    monkeypatch.setattr("memo_robots.configured.ur5e", lambda hand: WRONG["tool upside down"][0])
    with pytest.raises(SystemExit, match="1"):
        main(["plugins", "check", "ur5e"])
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("robot/ur5e broken: the last joint is 135 mm ahead of the tool")
    with pytest.raises(SystemExit, match="1"):
        main(["plugins", "check", "ur5e", "--json"])
    document = json.loads(capsys.readouterr().out)
    assert document["causes"] == [first.removeprefix("robot/ur5e broken: ")]


@pytest.mark.sim
def test_a_page_shows_the_robot_its_reach_and_its_rules(tmp_path, monkeypatch):
    registry, trials = Registry(), {}
    found = list(check_robot(registry, "robot/ur5e", lambda: WRONG["one servo lags"][0], trials))
    file = tmp_path / "robot.html"
    write_robot_page(file, "ur5e", "<an arm>", found, trials["robot/ur5e"])
    page = file.read_text()
    assert page.index("the servo lags 140 ms") < page.index("<h2>Joints")
    assert "&lt;an arm&gt;" in page and "elbow_joint" in page
    assert page.count("data:image/png") == 3 or "No pictures" in page
    assert page.count("<svg") == 2
    write_robot_page(file, "ur5e", "an arm", [Result("robot/ur5e", "limits", "broken", "swapped")], None)
    assert "swapped" in file.read_text() and "<svg" not in file.read_text()


def test_only_robots_have_a_page(capsys, tmp_path):
    with pytest.raises(SystemExit, match="2"):
        main(["plugins", "check", "mujoco", "--html", str(tmp_path / "x.html")])
    assert "'mujoco' is no robot" in capsys.readouterr().err
