"""The Panda is one robot: its URDF, Pinocchio, MuJoCo and Franka's published numbers agree."""

from __future__ import annotations

import math

import attrs
import mujoco
import numpy as np
import pinocchio as pin
import pytest
from memo_franka.configured import FR3Settings, PandaSettings, configured
from memo_franka.description import fr3, panda
from memo_sim_mujoco.simulator import MujocoSimulator

from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.errors import InvalidArgument
from memo_core.robot.urdf.reading import read_urdf
from memo_core.scene.description import SceneDescription

# Franka's documentation, Denavit-Hartenberg parameters in Craig's convention: a (m), d (m), alpha (rad).
PUBLISHED_DH = (
    (0.0, 0.333, 0.0),
    (0.0, 0.0, -math.pi / 2),
    (0.0, 0.316, math.pi / 2),
    (0.0825, 0.0, math.pi / 2),
    (-0.0825, 0.384, -math.pi / 2),
    (0.0, 0.0, math.pi / 2),
    (0.088, 0.0, math.pi / 2),
)
FLANGE = 0.107
ROBOT = panda()
NAMES = ("panda_link0", *(f"panda_link{n}" for n in range(1, 8)), "panda_hand", "panda_tool")


@pytest.fixture(scope="module")
def model():
    return pin.buildModelFromXML(ROBOT.urdf)


@pytest.fixture(scope="module")
def simulator():
    with MujocoSimulator() as simulator:
        simulator.build(SceneDescription(bodies=()), ROBOT)
        yield simulator


@pytest.fixture(scope="module")
def configurations(model):
    rng = np.random.default_rng(7)
    return rng.uniform(model.lowerPositionLimit, model.upperPositionLimit, (200, model.nq))


def by_published_dh(joints: np.ndarray) -> np.ndarray:
    """Flange in the base frame, shape (4, 4)."""
    total = np.eye(4)
    for (a, d, alpha), theta in zip(PUBLISHED_DH, joints, strict=True):
        ca, sa, ct, st = math.cos(alpha), math.sin(alpha), math.cos(theta), math.sin(theta)
        total = total @ np.array(
            [[ct, -st, 0, a], [st * ca, ct * ca, -sa, -d * sa], [st * sa, ct * sa, ca, d * ca], [0, 0, 0, 1]]
        )
    return total @ np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, FLANGE], [0, 0, 0, 1]])


def test_forward_kinematics_are_the_published_ones(model, configurations):
    data = model.createData()
    hand = model.getFrameId("panda_hand")
    turned = np.eye(4)
    turned[:2, :2] = [
        [math.cos(-math.pi / 4), -math.sin(-math.pi / 4)],
        [math.sin(-math.pi / 4), math.cos(-math.pi / 4)],
    ]
    for q in configurations:
        pin.framesForwardKinematics(model, data, q)
        assert np.allclose(data.oMf[hand].homogeneous, by_published_dh(q[:7]) @ turned, atol=1e-9)


@pytest.mark.sim
def test_mujoco_and_pinocchio_agree_on_every_link(model, simulator, configurations):
    data = model.createData()
    for q in configurations:
        simulator.data.qpos[:9] = q
        mujoco.mj_kinematics(simulator.model, simulator.data)
        pin.framesForwardKinematics(model, data, q)
        for name in (*NAMES, "panda_leftfinger", "panda_rightfinger"):
            body = simulator.data.body(f"robot/{name}")
            frame = data.oMf[model.getFrameId(name)]
            assert np.allclose(body.xpos, frame.translation, atol=1e-6), name
            assert np.allclose(body.xmat.reshape(3, 3), frame.rotation, atol=1e-6), name


@pytest.mark.sim
def test_masses_and_inertias_agree(model, simulator, configurations):
    total = sum(simulator.model.body(f"robot/{name}").mass[0] for name in read_urdf(ROBOT.urdf).links)
    assert total == pytest.approx(read_urdf(ROBOT.urdf).total_mass, abs=1e-9)
    # Pinocchio leaves the immovable base link out.
    base = read_urdf(ROBOT.urdf).links["panda_link0"].mass
    assert total - base == pytest.approx(pin.computeTotalMass(model), abs=1e-9)
    data = model.createData()
    armature = np.diag(simulator.model.dof_armature[:9])
    full = np.zeros((simulator.model.nv, simulator.model.nv))
    for q in configurations[:30]:
        simulator.data.qpos[:9] = q
        mujoco.mj_forward(simulator.model, simulator.data)
        mujoco.mj_fullM(simulator.model, simulator.data, full)
        matrix = pin.crba(model, data, q)
        matrix = np.triu(matrix) + np.triu(matrix, 1).T
        assert np.allclose(full[:9, :9] - armature, matrix, atol=1e-6)


@pytest.mark.sim
def test_gravity_is_compensated(simulator, model):
    data = model.createData()
    with MujocoSimulator() as own:
        own.build(SceneDescription(bodies=()), ROBOT)
        for _ in range(100):
            own.tick()
        assert np.allclose(own.joint_positions(), ROBOT.home, atol=1e-4)
        expected = pin.computeGeneralizedGravity(model, data, np.array([*ROBOT.home, 0.04, 0.04]))[:7]
        assert np.allclose(own.joint_torques(), expected, atol=0.05)


def test_limits_agree(model, simulator):
    published = {
        "lower": (-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973),
        "upper": (2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973),
        "velocity": (2.175,) * 4 + (2.61,) * 3,
        "acceleration": (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
        "jerk": (7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0),
        "effort": (87.0,) * 4 + (12.0,) * 3,
    }
    for number, joint in enumerate(ROBOT.joints):
        for key, values in published.items():
            assert getattr(joint, key) == values[number], (joint.name, key)
        urdf = read_urdf(ROBOT.urdf).joint(joint.name)
        assert (urdf.lower, urdf.upper) == (joint.lower, joint.upper)
        index = model.getJointId(joint.name) - 1
        assert (model.lowerPositionLimit[index], model.upperPositionLimit[index]) == (joint.lower, joint.upper)
        assert model.velocityLimit[index] == joint.velocity
        assert model.upperEffortLimit[index] == joint.effort
        assert tuple(simulator.model.joint(f"robot/{joint.name}").range) == (joint.lower, joint.upper)
        assert simulator.model.actuator(f"robot/{joint.name}").forcerange[1] == joint.effort


@pytest.mark.sim
def test_self_collision_is_the_same_for_pinocchio_and_mujoco(model, simulator, configurations):
    geometry = pin.buildGeomFromUrdfString(model, ROBOT.urdf, pin.COLLISION)
    geometry.addAllCollisionPairs()
    data, state = model.createData(), geometry.createData()
    neighbours = {frozenset((joint.parent, joint.child)) for joint in read_urdf(ROBOT.urdf).joints}
    neighbours |= {frozenset(pair) for pair in ROBOT.allowed_contacts}
    # The hand is fixed to link 7, so it is a neighbour of link 6 as well.
    neighbours |= {frozenset(("panda_link6", "panda_hand"))}

    def links(pair):
        objects = (geometry.geometryObjects[pair.first], geometry.geometryObjects[pair.second])
        return frozenset(model.frames[one.parentFrame].name for one in objects)

    colliding = 0
    for q in configurations[:100]:
        pin.computeCollisions(model, data, geometry, state, q, False)
        by_pinocchio = {
            links(pair)
            for pair, result in zip(geometry.collisionPairs, state.collisionResults, strict=True)
            if result.isCollision() and len(links(pair)) == 2 and links(pair) not in neighbours
        }
        simulator.data.qpos[:9] = q
        mujoco.mj_forward(simulator.model, simulator.data)
        contacts = simulator.contacts()
        by_mujoco = {
            frozenset((one.first.removeprefix("robot/"), one.second.removeprefix("robot/")))
            for one in contacts
            if one.first.startswith("robot/") and one.second.startswith("robot/")
        }
        assert by_pinocchio == by_mujoco, q
        colliding += bool(by_mujoco)
    assert 0 < colliding < 50, "most configurations are free, some are not"


@pytest.mark.sim
def test_home_touches_nothing(simulator):
    simulator.build(SceneDescription(bodies=()), ROBOT)
    assert simulator.contacts() == ()


def test_gripper_is_as_described(simulator):
    gripper, urdf = ROBOT.gripper, read_urdf(ROBOT.urdf)
    strokes = [urdf.joint(name).upper - urdf.joint(name).lower for name in gripper.finger_joints]
    assert sum(strokes) == pytest.approx(gripper.stroke)
    tool = urdf.joint("panda_tool_joint").origin.position[2]
    palm = max(shape.pose.position[2] + shape.size[2] / 2 for shape in urdf.links["panda_hand"].collisions)
    assert tool - palm == pytest.approx(gripper.palm_distance)
    finger = urdf.links["panda_leftfinger"].collisions
    origin = urdf.joint("panda_finger_joint1").origin.position[2]
    tip = origin + max(shape.pose.position[2] + shape.size[2] / 2 for shape in finger)
    assert tip - tool == pytest.approx(gripper.fingertip_reach)
    assert max(shape.pose.position[1] + shape.size[1] / 2 for shape in finger) == pytest.approx(
        gripper.finger_thickness
    )
    assert min(shape.pose.position[1] - shape.size[1] / 2 for shape in finger) == pytest.approx(0.0)
    hand = urdf.links["panda_hand"].collisions[0].size
    assert (hand[1], hand[0]) == gripper.hand_size


@pytest.mark.sim
def test_another_urdf_can_be_configured(tmp_path):
    text = ROBOT.urdf.replace("panda_joint", "arm_").replace("panda_tool", "grasp_point")
    path = tmp_path / "mine.urdf"
    path.write_text(text.replace('upper="2.8973"', 'upper="2.5"'))
    settings = PandaSettings(
        urdf=str(path), joints=[f"arm_{n}" for n in range(1, 8)], tool_link="grasp_point", home=None
    )
    described = configured(settings)
    assert described.joint_names[0] == "arm_1"
    assert described.joints[0].upper == 2.5
    with MujocoSimulator() as simulator:
        simulator.build(SceneDescription(bodies=()), described)
        own = MujocoSimulator()
        with own:
            own.build(SceneDescription(bodies=()), ROBOT)
            assert simulator.tool_pose().distance(own.tool_pose()) == pytest.approx((0, 0), abs=1e-6)


@pytest.mark.sim
def test_a_urdf_with_meshes_is_built_with_looks_that_mujoco_can_read(tmp_path):
    (tmp_path / "arm").mkdir()
    corners = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    text += "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)
    (tmp_path / "arm" / "hull.obj").write_text(text)
    (tmp_path / "arm" / "look.dae").write_text("<COLLADA/>")
    mesh = '<geometry><mesh filename="package://arm/{}" scale="0.5 0.5 0.5"/></geometry>'
    link = (
        f'<link name="panda_link0"><visual>{mesh.format("look.dae")}</visual>'
        f"<collision>{mesh.format('hull.obj')}</collision></link>"
    )
    start, end = ROBOT.urdf.index('<link name="panda_link0">'), ROBOT.urdf.index('<link name="panda_link1">')
    path = tmp_path / "panda.urdf"
    path.write_text(ROBOT.urdf[:start] + link + ROBOT.urdf[end:])
    with MujocoSimulator() as simulator:
        simulator.build(SceneDescription(bodies=()), configured(PandaSettings(urdf=str(path))))
        base = simulator.model.body("robot/panda_link0")
        first, count = base.geomadr[0], base.geomnum[0]
        kinds = simulator.model.geom_type[first : first + count]
        assert list(kinds) == [mujoco.mjtGeom.mjGEOM_MESH] * 2, "one to see, one to touch"
        assert simulator.model.mesh_vert.max() < 0.051, "scaled by a half"
    with pytest.raises(InvalidArgument, match=r"mesh 'package://arm/look\.dae' not found"):
        configured(PandaSettings(urdf=str(path), mesh_folder=str(tmp_path / "nowhere")))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"urdf": "nowhere.urdf"}, "there is no file nowhere.urdf"),
        ({"home": [0.0] * 6}, "has 6 values; expected 7"),
        ({"home": [0.0, 0.0, 0.0, 0.5, 0.0, 1.0, 0.0]}, "outside panda_joint4's limits"),
    ],
)
def test_wrong_settings_say_what_is_wrong(changes, words):
    with pytest.raises(InvalidArgument, match=words.replace(".", r"\.")):
        configured(PandaSettings(**changes))


def test_wrong_names_are_met_with_the_close_one(tmp_path):
    path = tmp_path / "panda.urdf"
    path.write_text(ROBOT.urdf)
    with pytest.raises(InvalidArgument, match=r"robot.tool_link: .*did you mean 'panda_tool'"):
        configured(PandaSettings(urdf=str(path), tool_link="panda_tol"))


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("<robot", "<ribot", "not well-formed|root element"),
        ('<child link="panda_link3"/>', '<child link="panda_link33"/>', "names the link 'panda_link33'"),
        ('type="revolute"', 'type="ball"', "has the type 'ball'"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "axis has no length"),
        ('<mass value="0.629769"/>', '<mass value="heavy"/>', "value='heavy'"),
        ('<child link="panda_link3"/>', '<child link="panda_link2"/>', "has two parents"),
        ('<box size="', '<box size="1 ', "three numbers"),
    ],
)
def test_a_broken_urdf_is_refused_by_the_element_that_is_wrong(before, after, words):
    assert before in ROBOT.urdf
    with pytest.raises(InvalidArgument, match=words):
        read_urdf(ROBOT.urdf.replace(before, after, 1))


def test_a_urdf_that_does_not_fit_the_description_is_refused():
    loose = attrs.evolve(ROBOT, joints=ROBOT.joints[:6], home=ROBOT.home[:6])
    with MujocoSimulator() as simulator, pytest.raises(InvalidArgument, match=r"nothing drives .*panda_joint7"):
        simulator.build(SceneDescription(bodies=()), loose)


def test_the_fr3_is_a_panda_with_limits_of_its_own():
    research = fr3()
    assert [joint.acceleration for joint in research.joints] == [10.0] * 7
    assert [joint.jerk for joint in research.joints] == [5000.0] * 7
    assert (research.joints[5].lower, research.joints[5].upper) == (0.5410, 4.5205)
    here, there = (pin.buildModelFromXML(robot.urdf) for robot in (ROBOT, research))
    q = pin.randomConfiguration(here)
    poses = []
    for model, name in ((here, "panda_tool"), (there, "fr3_tool")):
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        poses.append(data.oMf[model.getFrameId(name)].homogeneous)
    assert np.allclose(*poses)


def test_the_fr3_is_configured_like_a_panda():
    robot = configured(FR3Settings(max_force=60.0))
    assert robot.name == "fr3" and robot.gripper.max_force == 60.0
    with pytest.raises(InvalidArgument, match="fr3_joint6"):
        configured(FR3Settings(home=[0.0, -0.7, 0.0, -2.3, 0.0, 0.3, 0.7]))


def test_umis_gripper_is_a_description_of_its_own():
    own, umi = configured(FR3Settings()), configured(FR3Settings(hand="umi"))
    assert umi.gripper.pads == ("umi_finger1", "umi_finger2") and umi.joints == own.joints
    tips = {}
    for robot in (own, umi):
        kinematics = Kinematics(robot)
        tips[robot.tool_link] = (
            kinematics.forward(np.array(robot.home)[:, None])[1][2, 0] - robot.gripper.fingertip_reach
        )
    # At home the hand points down: its fingertips are lower by what UMI's gripper is longer, 247 mm instead of 113 mm.
    assert tips["fr3_tool"] - tips["umi_tool"] == pytest.approx(0.247 - 0.1134, abs=1e-6)
    with pytest.raises(InvalidArgument, match=r"robot\.hand"):
        configured(FR3Settings(hand="umi", urdf="mine.urdf"))
