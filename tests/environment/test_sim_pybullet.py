"""What PyBullet promises beyond the conformance suite: servos, friction, many shapes, resumption, a quiet stdout."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import subprocess
import sys

import attrs
import numpy as np
import pytest
from memo_sim_pybullet.settings import PybulletSettings
from memo_sim_pybullet.simulator import PybulletSimulator

from memo_core.errors import InvalidArgument
from memo_core.scene.description import Body, Free, Geom, Hinge, Latch, Material, SceneDescription, Slide
from memo_core.scene.hollow import cup
from memo_core.scene.pose import Pose, quaternion_from_axis_angle
from memo_core.testing.simulator_scenes import check_robot, check_scene


def built(scene: SceneDescription) -> PybulletSimulator:
    simulator = PybulletSimulator()
    simulator.open()
    simulator.build(scene, check_robot())
    return simulator


def run(simulator: PybulletSimulator, seconds: float) -> None:
    for _ in range(round(seconds / simulator.control_period)):
        simulator.tick()


@pytest.mark.sim
def test_a_held_joint_is_pushed_with_the_servos_torque():
    wall = Body("wall", (Geom("box", (0.5, 0.02, 0.5)),), Pose((0.4, 0.15, 0.3)))
    with built(SceneDescription((wall,))) as simulator:
        target = np.array([0.1, 0.0, 0.0])
        for step in range(200):
            simulator.command_joints(target * min(1.0, step / 100))
            simulator.tick()
        held = simulator.joint_positions()[0]
        run(simulator, 0.5)
        expected = 4000.0 * (0.1 - simulator.joint_positions()[0])
        assert abs(held - simulator.joint_positions()[0]) < 1e-3, "it still moves"
        assert 0.1 - held > 0.002, "the wall does not hold it"
        assert simulator.joint_torques()[0] == pytest.approx(min(expected, 100.0), rel=0.1)


@pytest.mark.sim
@pytest.mark.parametrize(("friction", "slides"), [(0.9, False), (0.3, True)])
def test_things_slide_on_a_slope_steeper_than_their_friction(friction, slides):
    slope = quaternion_from_axis_angle((0, 1, 0), 0.45)  # tan is 0.48
    material = Material(friction=friction)
    ramp = Body("ramp", (Geom("box", (0.6, 0.3, 0.02), material=material),), Pose((0.9, 0.6, 0.3), slope))
    above = Pose((0.9, 0.6, 0.3), slope) * Pose((0.0, 0.0, 0.0301))
    block = Body("block", (Geom("box", (0.04, 0.04, 0.04), material=material),), above, Free(), mass=0.2)
    with built(SceneDescription((ramp, block))) as simulator:
        run(simulator, 0.6)
        moved = math.dist(simulator.body_pose("block").position, above.position)
        assert (moved > 0.05) == slides, f"it moved {moved:.3f} m"


@pytest.mark.sim
def test_each_shape_of_a_body_has_its_own_friction():
    slope = quaternion_from_axis_angle((0, 1, 0), 0.45)  # tan is 0.48
    halves = tuple(
        Geom("box", (0.6, 0.15, 0.02), Pose((0.0, y, 0.0)), material=Material(friction=friction))
        for y, friction in ((-0.08, 0.9), (0.08, 0.1))
    )
    ramp = Body("ramp", halves, Pose((0.9, 0.6, 0.3), slope))
    block = (Geom("box", (0.04, 0.04, 0.04), material=Material(friction=0.1)),)
    above = {name: ramp.pose * Pose((0.0, y, 0.0301)) for name, y in (("rough", -0.08), ("smooth", 0.08))}
    blocks = tuple(Body(name, block, pose, Free(), mass=0.2) for name, pose in above.items())
    with built(SceneDescription((ramp, *blocks))) as simulator:
        run(simulator, 0.6)
        moved = {name: math.dist(simulator.body_pose(name).position, pose.position) for name, pose in above.items()}
        assert moved["rough"] < 0.01 and moved["smooth"] > 0.05, moved
        assert {c.first for c in simulator.contacts("ramp")} | {c.second for c in simulator.contacts("ramp")} <= {
            "ramp",
            *above,
        }


@pytest.mark.sim
def test_round_things_are_as_large_as_they_say():
    lying = quaternion_from_axis_angle((0, 1, 0), math.pi / 2)
    can = (Geom("cylinder", (0.03, 0.1)),)
    bodies = (
        Body("standing", can, Pose((0.6, 0.5, 0.0505)), Free()),
        Body("lying", can, Pose((0.6, 0.3, 0.0305), lying), Free(damping=0.5)),
    )
    with built(SceneDescription(bodies)) as simulator:
        run(simulator, 0.5)
        heights = [simulator.body_pose(body.name).position[2] for body in bodies]
        assert heights == pytest.approx([0.05, 0.03], abs=2e-4)


@pytest.mark.sim
def test_a_strong_catch_holds_a_light_lever():
    lever = Body(  # 7 N of spring against a catch of 12 N
        "lever",
        (Geom("box", (0.05, 0.04, 0.012)),),
        Pose((0.7, 0.4, 0.3)),
        Slide("slide", (0, 0, -1), (0.0, 0.042), 0.3, 6.0, stiffness=120.0, rest=-0.02, initial=0.0417),
        mass=0.06,
    )
    with built(SceneDescription((lever,), latches=(Latch("slide", 0.039, 12.0, 0.004),))) as simulator:
        run(simulator, 0.5)
        assert simulator.joint_position("slide") == pytest.approx(0.039, abs=0.002)
        assert abs(simulator.joint_velocity("slide")) < 1e-3


@pytest.mark.sim
def test_a_body_of_many_shapes_has_all_of_them():
    rim = tuple(
        Geom("box", (0.02, 0.08, 0.05), Pose.from_yaw((0.1 * math.cos(a), 0.1 * math.sin(a), 0.025), a))
        for a in np.linspace(0, 2 * math.pi, 24, endpoint=False)
    )
    ring = Body("ring <&>", rim, Pose((0.6, 0.6, 0.0)), Free(), mass=0.5)
    ball = Body("ball", (Geom("sphere", (0.02,)),), Pose((0.6, 0.6, 0.02)), Free(), mass=0.05)
    with built(attrs.evolve(check_scene(), bodies=(ring, ball), latches=())) as simulator:
        pushed = {name for contact in simulator.contacts() for name in (contact.first, contact.second)}
        for _ in range(100):
            simulator.client.applyExternalForce(
                simulator._world.places["ball"].body, -1, (0.3, 0.2, 0), simulator.body_pose("ball").position, 1
            )
            simulator.tick()
            pushed |= {name for contact in simulator.contacts("ball") for name in (contact.first, contact.second)}
        away = math.dist(simulator.body_pose("ball").position[:2], simulator.body_pose("ring <&>").position[:2])
        assert "ring <&>" in pushed and away < 0.1, "the ball left the ring through its wall"


@pytest.mark.sim
def test_a_hinge_turns_about_its_anchor():
    door = Body(
        "door",
        (Geom("box", (0.2, 0.02, 0.1)),),
        Pose((0.7, 0.4, 0.3)),
        Hinge("hinge", (0, 0, 1), (-0.1, 0.0, 0.0), (0.0, 1.5), initial=0.5),
        mass=1.0,
    )
    with built(SceneDescription((door,))) as simulator:
        run(simulator, 0.02)
        centre = np.array(simulator.body_pose("door").position)
        expected = np.array((0.6, 0.4, 0.3)) + 0.1 * np.array((math.cos(0.5), math.sin(0.5), 0.0))
        assert np.allclose(centre, expected, atol=1e-3)


@pytest.mark.sim
def test_dry_friction_holds_a_joint_up_to_its_effort():
    for friction, turns in ((0.6, False), (0.2, True)):
        flap = Body(  # 0.5 kg, 0.1 m out: 0.49 Nm
            "flap",
            (Geom("box", (0.2, 0.05, 0.01), Pose((0.1, 0.0, 0.0))),),
            Pose((0.7, 0.4, 0.4)),
            Hinge("hinge", (0, 1, 0), range=(0.0, 1.5), friction=friction),
            mass=0.5,
        )
        with built(SceneDescription((flap,))) as simulator:
            run(simulator, 1.0)
            assert (simulator.joint_position("hinge") > 0.1) == turns


@pytest.mark.process
def test_a_checkpoint_continues_in_another_process(tmp_path):
    program = """
import json, sys
from pathlib import Path
from memo_sim_pybullet.simulator import PybulletSimulator
from memo_core.testing.simulator import _history
from memo_core.testing.simulator_scenes import check_robot, check_scene
with PybulletSimulator() as simulator:
    simulator.build(check_scene(), check_robot())
    if sys.argv[1] == "go":
        simulator.command_gripper(0.0, 40.0)
        for _ in range(60):
            simulator.tick()
        Path(sys.argv[2]).write_bytes(simulator.checkpoint())
    else:
        simulator.restore(Path(sys.argv[2]).read_bytes())
    print(json.dumps(repr(_history(simulator))))
"""
    said = [
        subprocess.run(
            [sys.executable, "-c", program, what, str(tmp_path / "state")], capture_output=True, text=True, check=True
        ).stdout
        for what in ("go", "on")
    ]
    assert json.loads(said[0]) == json.loads(said[1])  # and nothing but JSON on the standard output


@pytest.mark.process
def test_a_world_is_built_in_one_order_in_every_process():
    """The order of a set of names differs from process to process, and with it a can was crushed or not."""
    program = """
import json
from memo_core.testing.simulator_scenes import check_robot, check_scene
from memo_sim_pybullet.simulator import PybulletSimulator
from memo_sim_pybullet.world import build_world
class Told:
    def __init__(self, client):
        self.client, self.calls = client, []
    def __getattr__(self, name):
        def call(*arguments, **named):
            self.calls.append([name, *(one for one in arguments if not isinstance(one, str))])
            return getattr(self.client, name)(*arguments, **named)
        return call
with PybulletSimulator() as simulator:
    told = Told(simulator.client)
    build_world(told, check_scene(), check_robot(), simulator.settings)
print(json.dumps(told.calls, default=str))
"""
    told = [
        subprocess.run(
            [sys.executable, "-c", program],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    ]
    assert len(json.loads(told[0])) > 100
    assert told[0] == told[1]


@pytest.mark.sim
def test_the_grip_is_felt_whatever_the_fingers_inertia_looks_like():
    robot = check_robot()
    skew = re.sub(r'ixy="0[.0]*"', 'ixy="2e-5"', robot.urdf)
    assert skew != robot.urdf
    simulator = PybulletSimulator()
    simulator.open()
    with simulator:
        simulator.build(check_scene(), attrs.evolve(robot, urdf=skew))
        simulator.command_gripper(0.0, 30.0)
        run(simulator, 1.5)
        assert simulator.gripper_effort() == pytest.approx(30.0, rel=0.15)


LOOK = """
import json
from memo_core.errors import BackendUnavailable
from memo_core.testing.simulator import _history
from memo_core.testing.simulator_scenes import check_robot, check_scene
from memo_sim_pybullet.simulator import PybulletSimulator
with PybulletSimulator() as simulator:
    simulator.build(check_scene(), check_robot())
    why = ""
    try:
        simulator.view()
    except BackendUnavailable as error:
        why = str(error)
    simulator.command_gripper(0.0, 30.0)
    history = repr(_history(simulator, 12))
    print("still looking")
print(json.dumps([why, history]))
"""


def looked(display: str) -> tuple[str, str]:
    environment = {**os.environ, "DISPLAY": display}
    done = subprocess.run([sys.executable, "-c", LOOK], capture_output=True, text=True, env=environment, timeout=120)
    assert done.returncode == 0, done.stderr
    first, answer = done.stdout.splitlines()  # and nothing of Bullet's
    assert first == "still looking"
    why, history = json.loads(answer)
    return why, history


@pytest.mark.process
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="displays are those of X11")
def test_a_window_needs_a_display_and_changes_nothing():
    why, unseen = looked("")
    assert "DISPLAY is not set" in why
    assert "':987' does not answer" in looked(":987")[0]
    if shutil.which("Xvfb") is None:
        pytest.skip("no Xvfb to try a window in")
    read, write = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(write)], pass_fds=(write,), stderr=subprocess.DEVNULL)
    try:
        number = os.read(read, 16).decode().strip()
        why, seen = looked(f":{number}")
    finally:
        server.terminate()
        server.wait()
    assert not why and seen == unseen


@pytest.mark.sim
def test_a_small_light_thing_does_not_tip_in_the_grip():
    cap = Body("cap", cup(0.0145, 0.02, 0.003), Pose((0.4, 0.0, 0.0)), Free(), mass=0.03)
    with built(SceneDescription((cap,))) as simulator:
        simulator.command_gripper(0.0, 30.0)
        run(simulator, 2.0)
        assert simulator.gripper_effort() == pytest.approx(30.0, rel=0.1)
        tilt = math.degrees(math.acos(min(1.0, simulator.body_pose("cap").rotation[2, 2])))
        assert tilt < 0.5, f"it tips by {tilt:.1f} degrees"


@pytest.mark.sim
def test_smooth_things_meet_rough_ones_and_each_other():
    """Smooth shapes are there twice, for smooth partners and for all others: each pair has one contact patch."""
    smooth = Material(friction=0.2)
    plate = Body("plate", (Geom("box", (0.3, 0.3, 0.02), material=smooth),), Pose((0.6, 0.5, 0.01)), Free(), mass=1.0)
    brick = Body("brick", (Geom("box", (0.05,) * 3, material=smooth),), Pose((0.6, 0.5, 0.0451)), Free(), mass=0.3)
    with built(SceneDescription((plate, brick))) as simulator:
        run(simulator, 0.5)
        weights = {}
        for contact in simulator.contacts():
            pair = frozenset((contact.first, contact.second))
            weights[pair] = weights.get(pair, 0.0) + contact.force
        assert weights[frozenset(("plate", "brick"))] == pytest.approx(0.3 * 9.81, rel=0.05)
        assert weights[frozenset(("plate", "table"))] == pytest.approx(1.3 * 9.81, rel=0.05)


@pytest.mark.sim
def test_what_bullet_cannot_build_is_named():
    mesh = Body("statue", (Geom("mesh", (1.0,), mesh="nowhere.obj", mass=1.0),), joint=Free())
    with pytest.raises(InvalidArgument, match="statue"):
        built(SceneDescription((mesh,)))


def test_a_control_period_longer_than_the_stop_allows_is_refused():
    with pytest.raises(ValueError, match="control period of 20 ms"):
        PybulletSettings(timestep=0.004, steps_per_tick=5)
