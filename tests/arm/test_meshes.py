"""Meshes named by package:// are found by kinematics, collision checks and both simulators alike."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import attrs
import numpy as np
import pytest
from memo_sim_mujoco.simulator import MujocoSimulator
from memo_sim_pybullet.simulator import PybulletSimulator

from memo_core.arm.collision import Obstacle, RobotShape
from memo_core.arm.description_from_urdf import describe_urdf
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.errors import InvalidArgument
from memo_core.robot.urdf import find_mesh, read_urdf
from memo_core.scene.description import SceneDescription
from memo_core.scene.pose import Pose
from tests.arms import six_joint_arm

CYLINDER = r'<cylinder radius="0.04" length="0.3"/>'
MESH = '<mesh filename="package://arm/meshes/bar.stl"/>'


def write_bar(file: Path) -> None:
    """A box of 0.08 x 0.08 x 0.3 m as binary STL."""
    x, y, z = np.array([0.08, 0.08, 0.3]) / 2
    corners = np.array([[a * x, b * y, c * z] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    body = b"".join(
        struct.pack("<12fH", 0, 0, 0, *np.concatenate([corners[i] for i in face]).tolist(), 0) for face in faces
    )
    file.parent.mkdir(parents=True)
    file.write_bytes(b"\0" * 80 + struct.pack("<I", len(faces)) + body)


@pytest.fixture
def robot(tmp_path):
    write_bar(tmp_path / "arm" / "meshes" / "bar.stl")
    urdf = six_joint_arm().urdf
    assert CYLINDER in urdf
    return describe_urdf(urdf.replace(CYLINDER, MESH), "meshed", str(tmp_path)).robot


@pytest.mark.parametrize("urdf_in", ["arm/urdf", "arm", "other_arm/urdf/deep"])
def test_a_package_is_found_from_inside_and_from_next_to_it(urdf_in, tmp_path):
    bar, folder = tmp_path / "arm" / "meshes" / "bar.stl", tmp_path / urdf_in
    write_bar(bar)
    folder.mkdir(parents=True, exist_ok=True)
    assert find_mesh("link", "package://arm/meshes/bar.stl", str(folder)).samefile(bar)
    with pytest.raises(InvalidArgument, match="in each folder above in arm"):
        find_mesh("link", "package://arm/meshes/no.stl", str(folder))


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("<robot name='r'><link name='a'><visual><origin xyz='0 0 ${l}'/></visual></link></robot>", "origin"),
        ("<robot name='r'><link name='$(arg prefix)a'/></robot>", "link"),
        ("<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:arm/></robot>", "arm"),
        ("<robot name='r'><xacro:arm/></robot>", "xacro:…"),
    ],
)
def test_xacro_is_to_be_expanded_first(text, where):
    with pytest.raises(InvalidArgument, match=re.escape(f"<{where}> is xacro; expand it first: xacro ")):
        read_urdf(text)


def test_a_namespace_and_a_comment_that_expanding_left_are_no_xacro():
    text = "<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'><!-- ${l} --><link name='a'/></robot>"
    assert read_urdf(text).root == "a"


def test_the_mesh_counts_in_collision_checks(robot):
    kinematics = Kinematics(robot)
    shape = RobotShape(robot, kinematics)
    corners = shape.corners()["link2"]
    assert np.ptp(corners, axis=0) == pytest.approx([0.08, 0.08, 0.3], abs=1e-6)
    box = Obstacle("wall", "wall", Pose((0.0, 0.12, 0.4)), (0.3, 0.02, 0.3))
    assert shape.checker([box], 0.0).hit(kinematics.home, "free") is not None


@pytest.mark.parametrize("simulator", [MujocoSimulator, PybulletSimulator])
def test_simulators_build_it(robot, simulator):
    with simulator() as world:
        world.build(SceneDescription(bodies=()), robot)
        world.tick()
        expected = Kinematics(robot).pose(np.array(robot.home))
        assert world.tool_pose().distance(expected) == pytest.approx((0.0, 0.0), abs=2e-3)


def test_a_missing_mesh_is_named_before_anything_is_built(robot):
    lost = attrs.evolve(robot, urdf=re.sub("bar.stl", "lost.stl", robot.urdf))
    with pytest.raises(InvalidArgument, match=r"lost\.stl' not found"):
        Kinematics(lost)
