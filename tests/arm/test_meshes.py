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
from memo_core.arm.meshes import mesh_vertices
from memo_core.errors import InvalidArgument
from memo_core.robot.urdf.reading import find_mesh, read_urdf, with_meshes_found
from memo_core.scene.description import SceneDescription
from memo_core.scene.pose import Pose
from tests.support.arms import six_joint_arm

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
    file.parent.mkdir(parents=True, exist_ok=True)
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


@pytest.mark.sim
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


@pytest.mark.parametrize(
    "named",
    [
        "file:///home/someone/ws/install/arm/share/arm/meshes/bar.stl",
        "/home/someone/arm/meshes/bar.stl",
        "package://another/arm/meshes/bar.stl",
        "../arm/meshes/bar.stl",
    ],
)
def test_a_path_of_another_machine_falls_back_on_its_longest_tail_near_the_urdf(named, tmp_path):
    bar = tmp_path / "src" / "arm" / "meshes" / "bar.stl"
    write_bar(bar)
    write_bar(tmp_path / "meshes" / "bar.stl")  # a shorter tail, farther up
    folder = tmp_path / "src" / "arm" / "urdf" / "deep"
    folder.mkdir(parents=True)
    assert find_mesh("link", named, str(folder)).samefile(bar)


def test_a_bare_file_name_is_too_little_to_go_by_outside_the_folder_itself(tmp_path):
    write_bar(tmp_path / "arm" / "bar.stl")
    (tmp_path / "arm" / "urdf").mkdir()
    with pytest.raises(InvalidArgument, match=r"bar\.stl' not found.*--mesh-folder"):
        find_mesh("link", "file:///home/someone/bar.stl", str(tmp_path / "arm" / "urdf"))
    assert find_mesh("link", "file:///home/someone/bar.stl", str(tmp_path / "arm")).is_file()


def _arm_of_meshes(visual: str, collision: str) -> str:
    look = f'<visual><geometry><mesh filename="{visual}"/></geometry></visual></link>'
    mesh = f'<geometry><mesh filename="{collision}"/></geometry>'
    return re.sub("</link>", look, six_joint_arm().urdf, count=2).replace(f"<geometry>{CYLINDER}</geometry>", mesh)


def test_meshes_are_found_in_any_of_several_folders_and_their_names_say_where(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    write_bar(one / "visual" / "bar.stl")
    write_bar(other / "lib" / "collision" / "bar.stl")
    urdf = _arm_of_meshes("file:///ws/arm/visual/bar.stl", "file:///ws/arm/collision/bar.stl")
    found = with_meshes_found(urdf, [str(tmp_path), str(one), str(other / "lib")])
    assert {file.parent.name for _, file in found.moved} == {"visual", "collision"} and not found.unseen
    assert len(describe_urdf(found.text).robot.joints) == 6, "no folder is needed any more"
    assert with_meshes_found(found.text, [str(tmp_path)]).text == found.text


def test_missing_looks_are_left_out_and_missing_collision_shapes_only_when_asked(tmp_path):
    urdf = _arm_of_meshes("package://arm/look.dae", "package://arm/solid.stl")
    with pytest.raises(
        InvalidArgument, match=r"of package://arm: solid\.stl, look\.dae.*--skip-missing-meshes"
    ) as raised:
        with_meshes_found(urdf, [str(tmp_path)])
    assert "\n" not in str(raised.value)
    found = with_meshes_found(urdf, [str(tmp_path)], skip_missing=True)
    assert found.unseen == ("package://arm/look.dae",) and found.untouched == ("package://arm/solid.stl",)
    assert len(describe_urdf(found.text).robot.joints) == 6
    write_bar(tmp_path / "arm" / "meshes" / "bar.stl")
    seen = with_meshes_found(_arm_of_meshes("package://arm/look.dae", "package://arm/meshes/bar.stl"), [str(tmp_path)])
    assert seen.unseen == ("package://arm/look.dae",) and "bar.stl" in seen.text


def test_an_arm_of_meshes_may_leave_what_it_touches(robot):
    """Pairs that touch at the start get a negative margin, which coal knows for convex shapes only."""
    shape = RobotShape(robot, Kinematics(robot))
    home = shape.kinematics.home
    near = [Obstacle("wall", "wall", Pose((0.0, 0.12, z)), (0.3, 0.08, 0.3)) for z in (0.3, 0.6)]
    checker = shape.checker(near, 0.0)
    assert checker.hit(home, "free") is not None
    checker.leave(home)
    assert checker.hit(home, "free") is None


def test_a_flat_mesh_has_a_thin_shape(tmp_path):
    write_bar(tmp_path / "arm" / "meshes" / "bar.stl")
    flat = MESH.replace("/>", ' scale="1 0 1"/>')
    urdf = six_joint_arm().urdf.replace(CYLINDER, flat)
    robot = describe_urdf(urdf, "flat", str(tmp_path)).robot
    corners = RobotShape(robot, Kinematics(robot)).corners()["link2"]
    assert np.ptp(corners, axis=0) == pytest.approx([0.08, 0.002, 0.3], abs=1e-3)


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"), (b"\0" * 900, "cannot be read")],
)
def test_a_file_that_is_no_mesh_is_refused_by_the_link_and_the_file(content, said, tmp_path):
    (tmp_path / "arm" / "meshes").mkdir(parents=True)
    (tmp_path / "arm" / "meshes" / "bar.stl").write_bytes(content)
    with pytest.raises(InvalidArgument, match=rf"link 'link2': mesh .*bar\.stl.*{said}") as raised:
        describe_urdf(six_joint_arm().urdf.replace(CYLINDER, MESH), "broken", str(tmp_path))
    assert "\n" not in str(raised.value)


def test_a_mesh_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InvalidArgument, match=r"link1: mesh .*none\.stl.*No such file"):
        mesh_vertices(str(tmp_path / "none.stl"), (1, 1, 1), "link1")


DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh><source id="p">
<float_array id="a" count="12">0 0 0 0.08 0 0 0 0.08 0 0 0 0.3</float_array><technique_common>
<accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source><vertices id="v">
<input semantic="POSITION" source="#p"/></vertices><triangles count="4">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry>
</library_geometries><library_visual_scenes>
<visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


@pytest.mark.sim
@pytest.mark.parametrize("simulator", [MujocoSimulator, PybulletSimulator])
@pytest.mark.parametrize(("name", "scale"), [("bar.dae", "1 1 1"), ("bar.stl", "1 -1 1"), ("bar.stl", "0.5 1 1")])
def test_simulators_build_collada_and_mirrored_meshes(name, scale, simulator, tmp_path):
    write_bar(tmp_path / "arm" / "meshes" / "bar.stl")
    (tmp_path / "arm" / "meshes" / "bar.dae").write_text(DAE)
    mesh = f'<mesh filename="package://arm/meshes/{name}" scale="{scale}"/>'
    robot = describe_urdf(six_joint_arm().urdf.replace(CYLINDER, mesh), "meshed", str(tmp_path)).robot
    wide = np.ptp(RobotShape(robot, Kinematics(robot)).corners()["link2"], axis=0)
    assert wide == pytest.approx(np.abs([float(v) for v in scale.split()]) * [0.08, 0.08, 0.3], abs=1e-6)
    with simulator() as world:
        world.build(SceneDescription(bodies=()), robot)
        world.tick()


def test_vertices_are_scaled_axis_by_axis(tmp_path):
    write_bar(tmp_path / "m" / "bar.stl")
    points = mesh_vertices(str(tmp_path / "m" / "bar.stl"), (1.0, -2.0, 0.5), "link")
    assert np.ptp(points, axis=0) == pytest.approx([0.08, 0.16, 0.15])


IMPOSSIBLE = {"a point": "0 0 0", "a line": "0 0.01 0", "beyond the sum of the others": "0.001 0.001 0.01"}


@pytest.mark.sim
@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_mujoco_builds_moments_of_inertia_that_no_body_has(case):
    xx, yy, zz = IMPOSSIBLE[case].split()
    urdf = six_joint_arm().urdf.replace('ixx="0.01" iyy="0.01" izz="0.01"', f'ixx="{xx}" iyy="{yy}" izz="{zz}"', 1)
    with MujocoSimulator() as world:
        world.build(SceneDescription(bodies=()), describe_urdf(urdf).robot)
        world.tick()
