"""Degrees, millimetres and grams in a URDF are told, by ``memo new robot --urdf`` and by the check alike."""

from __future__ import annotations

import re

import pytest

from memo_core.arm.description_from_urdf import describe_urdf
from memo_core.errors import InvalidArgument
from memo_core.robot.urdf.reading import read_urdf
from memo_core.robot.urdf.units import check_units, implausible_units
from tests.support.arms import six_joint_arm

RIGHT = six_joint_arm().urdf
FINGERS = tuple(joint.name for joint in read_urdf(RIGHT).joints if joint.kind == "prismatic")


def _times(pattern: str, factor: float) -> str:
    """RIGHT with the numbers of attributes multiplied."""

    def multiplied(found: re.Match[str]) -> str:
        values = " ".join(f"{factor * float(value):.9g}" for value in found[2].split())
        return f'{found[1]}="{values}"'

    return re.sub(rf'\b({pattern})="([^"]+)"', multiplied, RIGHT)


def _first(pattern: str, replacement: str) -> str:
    text, count = re.subn(pattern, replacement, RIGHT, count=1)
    assert count == 1
    return text


MISTAKES = {
    "limits in degrees": (_first('lower="-3" upper="3"', 'lower="-172" upper="172"'), r"joint1.*looks like degrees"),
    "speeds in degrees": (_first('velocity="1.5"', 'velocity="86"'), r"velocity of joint 'joint1' \(86 rad/s\).*deg/s"),
    "angles in degrees": (
        _first(
            '<link name="link2">',
            '<link name="link2"><visual><origin rpy="0 90 0"/><geometry><sphere radius="0.01"/></geometry></visual>',
        ),
        r"link 'link2' has rpy='0 90 0': looks like degrees",
    ),
    "lengths in millimetres": (_times("xyz", 1000.0), r"m apart, added up: probably millimetres"),
    "masses in grams": (_times("value", 1000.0), r"link .* kg\).*: probably grams"),
    "inertias in kg mm2": (_times("i[xyz]{2}", 1e6), r"inertia of link .*kg mm2"),
}


def test_a_right_urdf_is_plausible():
    assert implausible_units(RIGHT, read_urdf(RIGHT), FINGERS) == ()


@pytest.mark.parametrize("name", MISTAKES)
def test_other_units_are_told_in_a_line_that_names_where(name):
    text, says = MISTAKES[name]
    with pytest.raises(InvalidArgument, match=says) as raised:
        describe_urdf(text)
    assert "\n" not in str(raised.value)


def test_a_finger_that_slides_by_metres_is_in_millimetres():
    text = describe_urdf(RIGHT).robot.urdf.replace('upper="0.04"', 'upper="40"')
    urdf = read_urdf(text)
    fingers = [joint.name for joint in urdf.joints if joint.kind == "prismatic"]
    with pytest.raises(InvalidArgument, match=r"\(40 m\).*probably millimetres"):
        check_units(text, urdf, fingers)


def test_a_turning_joint_without_limit_is_refused_with_what_to_write():
    text = re.sub(r'<limit lower="-3" upper="3"[^>]*/>', "", RIGHT, count=1)
    with pytest.raises(InvalidArgument, match=r"joint 'joint1': is revolute and has no <limit>.*continuous"):
        describe_urdf(text)
    text = re.sub(r'(<limit lower="-3" upper="3") velocity="[^"]+"', r"\1", RIGHT, count=1)
    with pytest.raises(InvalidArgument, match=r"joint 'joint1': its <limit> has no velocity"):
        describe_urdf(text)


def test_a_heavy_pedestal_a_quick_wrist_and_a_placeholder_are_plausible():
    text = RIGHT.replace('<link name="base"/>', '<link name="base"><inertial><mass value="400"/>' + INERTIA)
    text = text.replace('velocity="1.5"', 'velocity="26.2"')
    dot = '<visual><geometry><box size="0 0 0"/></geometry></visual><inertial><mass value="0.0001"/>'
    text = text.replace('<link name="tool"/>', f'<link name="tool">{dot}{INERTIA.replace("10", "1e-8")}')
    assert implausible_units(text, read_urdf(text), FINGERS) == ()
    moving = text.replace('<mass value="1"/>', '<mass value="400"/>', 1)
    assert "probably grams" in implausible_units(moving, read_urdf(moving), FINGERS)[0]


INERTIA = '<inertia ixx="10" iyy="10" izz="10" ixy="0" ixz="0" iyz="0"/></inertial></link>'


@pytest.mark.parametrize(
    ("pattern", "wrong", "told"),
    [
        (r'upper="[^"]*"', 'upper="nan"', r"joint 'joint\d': <limit> has upper='nan'; expected a number"),
        (r'effort="[^"]*"', 'effort="-10"', r"joint 'joint\d': its <limit> has effort='-10'; expected 0"),
        (r'<origin xyz="[^"]*"', '<origin xyz="0 nan 0"', r"<origin xyz='0 nan 0'>; expected three numbers"),
    ],
)
def test_numbers_that_are_none_and_negative_efforts_are_told_with_their_place(pattern, wrong, told):
    text, changed = re.subn(pattern, wrong, six_joint_arm().urdf, count=1)
    assert changed
    with pytest.raises(InvalidArgument, match=told):
        read_urdf(text)
