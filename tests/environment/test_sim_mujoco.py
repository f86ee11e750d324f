"""What MuJoCo promises beyond the conformance suite: materials, masses, joints, grasps with the Panda, resumption in
another process, pictures from any thread, videos."""

from __future__ import annotations

import math
import os
import struct
import subprocess
import sys
import threading
from pathlib import Path

import attrs
import numpy as np
import pinocchio as pin
import pytest
from memo_franka.description import panda
from memo_sim_mujoco.settings import MujocoSettings
from memo_sim_mujoco.simulator import MujocoSimulator, SimulationDiverged

from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.robot.description import GripperDescription, RobotDescription
from memo_core.runs.video import Recording, save_picture
from memo_core.scene.description import (
    Body,
    Camera,
    Free,
    Geom,
    Hinge,
    Latch,
    Material,
    SceneDescription,
    Slide,
)
from memo_core.scene.pose import Pose, look_at, quaternion_from_axis_angle
from memo_core.testing.simulator_scenes import check_robot, check_scene

ROBOT = panda()
CAMERA = Camera("front", look_at((1.5, -0.9, 0.9), (0.4, 0.0, 0.25)), resolution=(160, 120))


def built(*bodies: Body, settings: MujocoSettings | None = None, **scene) -> MujocoSimulator:
    simulator = MujocoSimulator(settings)
    simulator.open()
    simulator.build(SceneDescription(bodies=bodies, cameras=(CAMERA,), **scene), ROBOT)
    return simulator


def run(simulator: MujocoSimulator, seconds: float) -> None:
    for _ in range(round(seconds / simulator.control_period)):
        simulator.tick()


def joints_for(position: tuple[float, float, float], start: np.ndarray) -> np.ndarray:
    """Joint positions with the tool at ``position``, pointing down, by damped least squares."""
    model = pin.buildModelFromXML(ROBOT.urdf)
    data, frame = model.createData(), model.getFrameId("panda_tool")
    goal = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array(position))
    q = np.array([*start, 0.04, 0.04])
    for _ in range(300):
        pin.framesForwardKinematics(model, data, q)
        error = pin.log6(data.oMf[frame].actInv(goal)).vector
        if np.linalg.norm(error) < 1e-9:
            return q[:7]
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL)
        jacobian[:, 7:] = 0
        q = q + jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-8 * np.eye(6), error)
    raise AssertionError(f"no inverse kinematics for {position}")


def move(simulator: MujocoSimulator, start: np.ndarray, end: np.ndarray, seconds: float) -> np.ndarray:
    ticks = round(seconds / simulator.control_period)
    for tick in range(1, ticks + 1):
        s = tick / ticks
        simulator.command_joints(start + (end - start) * s * s * (3 - 2 * s))
        simulator.tick()
    run(simulator, 0.5)
    return end


def grasp(simulator: MujocoSimulator, size: float, force: float) -> np.ndarray:
    """Grasp the cube at (0.45, -0.2) from above and lift it to 0.3 m."""
    above = joints_for((0.45, -0.2, 0.3), np.array(ROBOT.home))
    at = joints_for((0.45, -0.2, size / 2 + 0.005), above)
    start = move(simulator, np.array(ROBOT.home), above, 1.0)
    start = move(simulator, start, at, 1.0)
    simulator.command_gripper(0.0, force)
    run(simulator, 1.0)
    return move(simulator, start, above, 1.0)


def cube(size: float, mass: float = 0.1) -> Body:
    return Body("cube", (Geom("box", (size,) * 3),), Pose((0.45, -0.2, size / 2)), Free(), mass=mass)


@pytest.mark.sim
@pytest.mark.parametrize(("size", "mass", "force"), [(0.04, 0.1, 80.0), (0.05, 0.3, 80.0), (0.045, 0.1, 20.0)])
def test_the_panda_lifts_a_cube_and_holds_it(size, mass, force):
    with built(cube(size, mass)) as simulator:
        grasp(simulator, size, force)
        lifted = np.array(simulator.body_pose("cube").position)
        assert lifted[2] > 0.25
        assert simulator.gripper_effort() == pytest.approx(force, rel=0.1)
        assert simulator.gripper_width() == pytest.approx(size, abs=0.002)
        run(simulator, 10.0)
        assert np.linalg.norm(simulator.body_pose("cube").position - lifted) < 0.002


@pytest.mark.sim
def test_a_weak_grip_drops_what_is_heavy():
    with built(cube(0.045, 2.0)) as simulator:
        grasp(simulator, 0.045, 5.0)
        assert simulator.body_pose("cube").position[2] < 0.1


def with_tips(joint: str) -> RobotDescription:
    """The suite's crane with its pads on links of their own, fixed to the fingers; the left one on ``joint``'s link."""
    crane = check_robot()
    tips = "".join(
        f'<link name="{side} tip"/><joint name="{side} tip joint" type="fixed"><parent link="{parent}"/>'
        f'<child link="{side} tip"/></joint>'
        for side, parent in (("left", joint), ("right", "right"))
    )
    urdf = crane.urdf.replace("</robot>", tips + "</robot>")
    for side in ("left", "right"):
        empty, (start, shape, end) = f'<link name="{side} tip"/>', _collision_of(urdf, side)
        urdf = (urdf[:start] + urdf[end:]).replace(empty, f'<link name="{side} tip">{shape}</link>')
    gripper = attrs.evolve(crane.gripper, pads=("left tip", "right tip"))
    return attrs.evolve(crane, urdf=urdf, gripper=gripper, allowed_contacts=(("left tip", "right tip"),))


def _collision_of(urdf: str, link: str) -> tuple[int, str, int]:
    start = urdf.index("<collision>", urdf.index(f'<link name="{link}">'))
    end = urdf.index("</collision>", start) + len("</collision>")
    return start, urdf[start:end], end


@pytest.mark.sim
def test_pads_may_be_links_that_are_fixed_to_the_fingers():
    with MujocoSimulator() as simulator:
        simulator.build(check_scene(), with_tips("left"))
        simulator.command_gripper(0.0, 60.0)
        run(simulator, 1.2)
        assert simulator.gripper_effort() == pytest.approx(60.0, rel=0.2)


def test_a_pad_that_no_finger_moves_is_refused_by_name():
    with MujocoSimulator() as simulator, pytest.raises(InvalidArgument, match="left tip"):
        simulator.build(check_scene(), with_tips("hand"))


@pytest.mark.sim
def test_a_run_can_be_resumed_in_another_process(tmp_path):
    with built(cube(0.045)) as simulator:
        grasp(simulator, 0.045, 60.0)
        simulator.command_gripper(0.08, 60.0)
        run(simulator, 0.05)
        (tmp_path / "state").write_bytes(simulator.checkpoint())
        run(simulator, 1.0)
        expected = repr((simulator.body_pose("cube"), simulator.joint_positions().tolist(), simulator.gripper_width()))
    code = f"""
import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_sim_mujoco import built, cube, run
with built(cube(0.045)) as s:
    s.restore(open({str(tmp_path / "state")!r}, "rb").read())
    run(s, 1.0)
    print(repr((s.body_pose("cube"), s.joint_positions().tolist(), s.gripper_width())))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == expected, done.stderr


@pytest.mark.sim
def test_a_latch_is_restored_as_it_was():
    door = Body(
        "door",
        (Geom("box", (0.2, 0.01, 0.1), Pose((0.1, 0, 0))),),
        joint=Hinge("hinge", (0, 0, 1), stiffness=1.0, rest=1.5, damping=0.1),
    )
    frame = Body("frame", (Geom("box", (0.02,) * 3),), Pose((0.6, 0.4, 0.3)), bodies=(door,))
    with built(frame, latches=(Latch("hinge", 0.0, 2.0, 0.1),)) as simulator:
        run(simulator, 0.5)
        held = simulator.checkpoint()
        assert simulator.joint_position("hinge") < 0.1
        simulator.data.qpos[simulator._world.joint_qpos["hinge"]] = 0.5
        run(simulator, 0.5)
        assert simulator.joint_position("hinge") > 0.5, "beyond the latch's width nothing holds"
        simulator.restore(held)
        run(simulator, 2.0)
        assert simulator.joint_position("hinge") < 0.1


@pytest.mark.sim
@pytest.mark.parametrize(("friction", "slides"), [(0.8, False), (0.3, True)])
def test_friction_decides_what_slides_down_a_ramp(friction, slides):
    tilt = quaternion_from_axis_angle((0, 1, 0), math.radians(30))
    slippery = Material(friction=friction)
    ramp = Body("ramp", (Geom("box", (0.4, 0.2, 0.02), material=slippery),), Pose((0.6, 0.0, 0.3), tilt))
    block = Body(
        "block",
        (Geom("box", (0.05, 0.05, 0.05), material=slippery),),
        Pose((0.6, 0, 0.3), tilt) * Pose((0, 0, 0.035)),
        Free(),
    )
    with built(ramp, block) as simulator:
        start = np.array(simulator.body_pose("block").position)
        run(simulator, 0.4)
        moved = np.linalg.norm(simulator.body_pose("block").position - start)
        assert moved > 0.05 if slides else moved < 0.003


@pytest.mark.sim
def test_dry_friction_holds_a_door_still():
    door = Body(
        "door",
        (Geom("box", (0.02, 0.3, 0.2), Pose((0, 0, 0.1))),),
        mass=0.5,
        joint=Hinge("hinge", (0, 1, 0), range=(0, 1.5), friction=1.0, damping=1.0, initial=0.7),
    )
    with built(Body("frame", (), Pose((0.6, 0, 0.3)), bodies=(door,))) as simulator:
        run(simulator, 10.0)
        # 0.5 kg with its centre 0.1 m out pull with 0.32 Nm, less than the hinge's 1 Nm.
        assert simulator.joint_position("hinge") == pytest.approx(0.7, abs=1e-3)


@pytest.mark.sim
def test_what_a_joint_connects_does_not_collide_but_two_doors_do():
    def door(name: str, x: float) -> Body:
        return Body(name, (Geom("box", (0.3, 0.02, 0.2)),), Pose((x, 0, 0)), Hinge(f"{name} hinge", (0, 0, 1)))

    trim = Body("trim", (Geom("box", (0.05, 0.05, 0.2)),))
    cabinet = Body("cabinet", (Geom("box", (0.3, 0.3, 0.2)),), Pose((0.7, 0, 0.3)), bodies=(trim, door("left", -0.1)))
    with built(cabinet) as simulator:
        assert simulator.contacts() == ()
    cabinet = attrs.evolve(cabinet, bodies=(door("left", -0.1), door("right", 0.1)))
    with built(cabinet) as simulator:
        touching = {frozenset((one.first, one.second)) for one in simulator.contacts()}
        assert touching == {frozenset(("left", "right"))}


@pytest.mark.sim
def test_contacts_of_a_body_include_its_childrens():
    knob = Body("knob", (Geom("sphere", (0.02,)),), Pose((0.0, 0.0, -0.04)))
    lamp = Body("lamp", (Geom("cylinder", (0.03, 0.06)),), Pose((0.5, 0.3, 0.06)), Free(), bodies=(knob,))
    with built(lamp) as simulator:
        run(simulator, 0.05)
        assert {one.second for one in simulator.contacts("lamp")} | {
            one.first for one in simulator.contacts("lamp")
        } == {
            "table",
            "knob",
        }


def cube_stl(path, size: float) -> str:
    """A cube as a binary STL."""
    c = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * size - size / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [(q[0], q[1], q[2]) for q in quads] + [(q[0], q[2], q[3]) for q in quads]
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *c[list(t)].ravel(), 0) for t in triangles)
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(triangles)) + facets)
    return str(path)


@pytest.mark.sim
def test_every_shape_is_built_with_its_volume(tmp_path):
    shapes = {
        "box": (Geom("box", (0.1, 0.2, 0.3)), 0.006),
        "cylinder": (Geom("cylinder", (0.1, 0.3)), math.pi * 0.01 * 0.3),
        "sphere": (Geom("sphere", (0.1,)), 4 / 3 * math.pi * 0.001),
        "capsule": (Geom("capsule", (0.1, 0.3)), math.pi * 0.01 * 0.3 + 4 / 3 * math.pi * 0.001),
        "mesh": (Geom("mesh", (2.0,), mesh=cube_stl(tmp_path / "cube.stl", 0.1)), 0.008),
    }
    bodies = [
        Body(name, (geom,), Pose((1.0, 0.5 * number - 1, 0.5)), Free())
        for number, (name, (geom, _)) in enumerate(shapes.items())
    ]
    with built(*bodies) as simulator:
        for name, (_, volume) in shapes.items():
            assert simulator.model.body(name).mass[0] == pytest.approx(500 * volume, rel=1e-6), name


@pytest.mark.sim
def test_a_body_weighs_what_it_states(tmp_path):
    plain = Geom("box", (0.1, 0.1, 0.1), Pose((0.2, 0, 0)))
    twice = Geom("box", (0.1, 0.1, 0.2), Pose((0.4, 0, 0)))
    stated = Geom("box", (0.1, 0.1, 0.1), mass=0.4)
    window = Geom("box", (0.1, 0.1, 0.1), collides=False)
    mesh = Geom("mesh", (1.0,), Pose((0.6, 0, 0)), mesh=cube_stl(tmp_path / "c.stl", 0.1))
    body = Body("thing", (plain, twice, stated, window, mesh), Pose((0.6, 0, 1)), Free(), mass=2.4)
    with built(body) as simulator:
        assert simulator.model.body("thing").mass[0] == pytest.approx(2.4)
        first = simulator.model.body("thing").geomadr[0]
        # The stated mass aside, 2 kg are shared by volume 1 : 2 : 1; decoration weighs nothing.
        # A geom's share shows in where the centre of mass is.
        centre = (0.5 * 0.2 + 1.0 * 0.4 + 0.5 * 0.6) / 2.4
        assert simulator.model.body("thing").ipos[0] == pytest.approx(centre)
        assert simulator.model.geom_contype[first + 3] == 0


@pytest.mark.parametrize(
    ("bodies", "scene", "words"),
    [
        ((Body("a", (Geom("sphere", (0.1,)),)), Body("a", (Geom("sphere", (0.1,)),))), {}, "called 'a'"),
        ((Body("robot/x", (Geom("sphere", (0.1,)),)),), {}, "called 'robot/x'"),
        ((Body("a", (Geom("box", (0.1,)),)),), {}, "scene body 'a': a box of size"),
        (
            (Body("a", (attrs.evolve(Geom("box", (0.1, 0.1, 0.1)), shape="tube"),)),),
            {},
            "unknown shape 'tube'; expected box",
        ),
        ((Body("a", (Geom("box", (0.1, -0.1, 0.1)),)),), {}, "positive numbers"),
        ((Body("a", (), joint=Free()),), {}, "moves but has no geoms"),
        ((Body("a", (Geom("mesh", (1.0,), mesh="nowhere.stl"),)),), {}, "nowhere.stl"),
        ((Body("a", (Geom("sphere", (0.1,)),), joint=Hinge("h", (0, 0, 0))),), {}, "axis has no length"),
        ((Body("a", (Geom("sphere", (0.1,)),), joint=Slide("s", (0, 0, 1), initial=0.3)),), {}, "starts at 0.3"),
        ((Body("a", (Geom("sphere", (0.1,)),), mass=0.1, joint=Free()),), {"latches": (Latch("h", 0, 1, 1),)}, "'h'"),
        ((Body("a", (Geom("sphere", (0.1,), mass=0.3), Geom("sphere", (0.1,))), mass=0.2),), {}, "its geoms alone 0.3"),
        (
            (Body("a", (Geom("sphere", (0.1,)),), bodies=(Body("b", (Geom("sphere", (0.1,)),), joint=Free()),)),),
            {},
            "moves freely but is attached to 'a'",
        ),
    ],
)
def test_a_scene_that_cannot_be_is_refused_by_name(bodies, scene, words):
    with pytest.raises(InvalidArgument, match=words):
        built(*bodies, **scene)


def test_a_vacuum_gripper_with_fingers_is_refused():
    robot = attrs.evolve(ROBOT, gripper=GripperDescription(kind="vacuum", finger_joints=ROBOT.gripper.finger_joints))
    with MujocoSimulator() as simulator, pytest.raises(InvalidArgument, match="belong to no vacuum gripper"):
        simulator.build(SceneDescription(bodies=()), robot)


def test_building_before_open_says_so():
    with pytest.raises(BackendUnavailable, match="not open"):
        MujocoSimulator().build(SceneDescription(bodies=()), ROBOT)


@pytest.mark.sim
def test_a_diverged_simulation_is_an_error_not_a_restart(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with built(cube(0.045)) as simulator:
        run(simulator, 0.1)
        good = simulator.checkpoint()
        simulator.data.qvel[:] = 1e30
        with pytest.raises(SimulationDiverged, match=r"smaller simulator\.timestep"):
            run(simulator, 0.5)
        simulator.restore(good)
        run(simulator, 0.1)
    assert os.listdir(tmp_path) == [], "nothing is left behind in the folder one happens to be in"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"timestep": 0.1}, "timestep"),
        ({"steps_per_tick": 9}, "18 ms"),
        ({"steps_per_tick": 0}, "steps_per_tick"),
        ({"impratio": 0.1}, "impratio"),
    ],
)
def test_settings_that_cannot_work_are_refused(changes, words):
    with pytest.raises(ValueError, match=words):
        MujocoSettings(**changes)


@pytest.mark.sim
def test_other_steps_make_the_same_tick():
    with built(cube(0.045), settings=MujocoSettings(timestep=0.001, steps_per_tick=10)) as simulator:
        run(simulator, 0.5)
        assert simulator.time == pytest.approx(0.5)


@pytest.mark.sim
def test_the_table_is_where_the_scene_says():
    low = Body("cube", (Geom("box", (0.04,) * 3),), Pose((0.5, 0.2, -0.18)), Free())
    with built(low, table_height=-0.2) as simulator:
        run(simulator, 0.3)
        assert simulator.body_pose("cube").position[2] == pytest.approx(-0.18, abs=0.001)
        assert "table" in {name for one in simulator.contacts("cube") for name in (one.first, one.second)}


@pytest.mark.sim
def test_a_scene_may_bring_its_own_table():
    desk = Body("table", (Geom("box", (0.4, 0.4, 0.1), Pose((0, 0, -0.05))),), Pose((0.5, 0.0, 0.0)))
    beside = Body("cube", (Geom("box", (0.04,) * 3),), Pose((0.5, 0.5, 0.02)), Free())
    with built(desk, beside) as simulator:
        run(simulator, 1.0)
        assert simulator.body_pose("cube").position[2] == pytest.approx(-0.73, abs=0.01), "it lies on the floor"


# -- pictures ----------------------------------------------------------------------------------------------------------


def can_draw() -> bool:
    with built() as simulator:
        try:
            simulator.render("front")
        except BackendUnavailable:
            return False
        return True


drawing = pytest.mark.skipif(not can_draw(), reason="no OpenGL here")


@pytest.mark.sim
@drawing
def test_pictures_can_be_taken_from_any_thread():
    with built(cube(0.045)) as simulator:
        first = simulator.render("front")
        taken = []
        threads = [threading.Thread(target=lambda: taken.append(simulator.render("front"))) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(taken) == 4
        assert all(np.array_equal(first, one) for one in taken)


@pytest.mark.sim
@drawing
def test_taking_pictures_does_not_change_the_motion():
    ends = []
    for draws in (False, True):
        with built(cube(0.045)) as simulator:
            simulator.command_joints(np.array(ROBOT.home) + 0.2)
            for _ in range(50):
                simulator.tick()
                simulator.tool_pose()
                if draws:
                    simulator.render("front", 64, 48)
                    simulator.render_segmentation("front", 64, 48)
            ends.append((simulator.joint_positions().tolist(), simulator.body_pose("cube")))
    assert ends[0] == ends[1]


@pytest.mark.sim
@drawing
def test_a_video_has_a_frame_for_each_step_of_simulated_time(tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    problems = []
    with built(cube(0.045)) as simulator:
        start = simulator.checkpoint()
        with Recording(simulator, "front", tmp_path / "film" / "a.mp4", problems.append, fps=10, width=161) as film:
            run(simulator, 1.0)
            # A restored checkpoint turns the clock back; the film goes on.
            simulator.restore(start)
            run(simulator, 0.5)
        assert film.stop() == tmp_path / "film" / "a.mp4"
        ticking = simulator.time
        simulator.tick()
        assert simulator.time > ticking
    assert problems == []
    frames = imageio_ffmpeg.read_frames(str(tmp_path / "film" / "a.mp4"))
    about = next(frames)
    assert about["codec"] == "h264" and about["pix_fmt"].startswith("yuv420p")
    assert about["fps"] == 10 and about["size"] == (162, 120)
    assert len(list(frames)) == film.frames == 11 + 5
    assert os.listdir(tmp_path / "film") == ["a.mp4"]


@pytest.mark.sim
def test_without_opengl_a_recording_is_one_problem_and_the_run_goes_on(tmp_path, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    problems = []
    with built(cube(0.045)) as simulator:
        monkeypatch.setattr("importlib.import_module", lambda name: (_ for _ in ()).throw(ImportError(f"no {name}")))
        with Recording(simulator, "front", tmp_path / "a.mp4", problems.append) as film:
            run(simulator, 0.5)
        assert not film.active and film.stop() is None
        assert simulator.time == pytest.approx(0.5)
        with pytest.raises(BackendUnavailable, match="apt-get install libegl1"):
            save_picture(simulator, "front", tmp_path / "a.png")
    assert len(problems) == 1 and "apt-get install libegl1" in problems[0].message
    assert os.listdir(tmp_path) == []


@pytest.mark.process
@pytest.mark.parametrize("kind", ["osmesa", "disabled"])
def test_an_opengl_that_does_not_exist_is_named(kind):
    code = """
from memo_core.errors import BackendUnavailable
from memo_core.testing.simulator_scenes import check_robot, check_scene
from memo_sim_mujoco.simulator import MujocoSimulator
try:
    with MujocoSimulator() as simulator:
        simulator.build(check_scene(), check_robot())
        simulator.tick()
        simulator.render("above")
    print("drew MUJOCO_GL")
except BackendUnavailable as error:
    print(error)
"""
    environment = {key: value for key, value in os.environ.items() if key != "PYOPENGL_PLATFORM"} | {"MUJOCO_GL": kind}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, env=environment)
    assert done.returncode == 0, done.stderr
    assert "MUJOCO_GL" in done.stdout and len(done.stdout.splitlines()) == 1


@pytest.mark.sim
@drawing
def test_an_encoder_that_dies_is_one_problem_and_ctrl_c_does_not_reach_it(tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    problems = []
    with built(cube(0.045)) as simulator, Recording(simulator, "front", tmp_path / "a.mp4", problems.append) as film:
        run(simulator, 0.3)
        process = film._encoder._process
        assert os.getpgid(process.pid) != os.getpgid(0)
        process.kill()
        process.wait()
        run(simulator, 1.0)
        assert not film.active
        assert simulator.time == pytest.approx(1.3)
    assert len(problems) == 1
    assert os.listdir(tmp_path) == [], "half a video is none"


@pytest.mark.sim
@drawing
def test_an_unwritable_folder_is_one_problem(tmp_path):
    (tmp_path / "file").write_text("")
    problems = []
    with built() as simulator, Recording(simulator, "front", tmp_path / "file" / "a.mp4", problems.append):
        run(simulator, 0.3)
    assert len(problems) == 1


@pytest.mark.sim
@drawing
def test_a_picture_is_written(tmp_path):
    image = pytest.importorskip("PIL.Image")
    with built(cube(0.045)) as simulator:
        save_picture(simulator, "front", tmp_path / "a.png", 320)
    assert image.open(tmp_path / "a.png").size == (320, 240)


@pytest.mark.sim
@pytest.mark.skipif(bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")), reason="there is a display")
def test_a_window_without_a_display_is_refused():
    with built() as simulator, pytest.raises(BackendUnavailable, match="no display"):
        simulator.view()
