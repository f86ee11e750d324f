"""The smallest simulator in which the arm can be moved: no contacts, no pictures, doors stand still.

A start for a simulator of your own (docs/plugins/simulator.md). ``tests/plugins/test_third_simulator.py`` moves the
Panda in it, and checks that the conformance suite reports exactly the rules that need contacts or moving scene joints.
"""

import hashlib
import json

import numpy as np

from memo_core.plugin import (
    Backend,
    BackendUnavailable,
    Free,
    Hinge,
    InvalidArgument,
    Kinematics,
    Mechanisms,
    Pose,
    Simulator,
    Slide,
    ToolDynamics,
    check_scene,
    families,
    hookimpl,
)


class GhostSimulator(Simulator):
    """An arm that goes through everything; what is loose falls to the table; doors do not move."""

    def __init__(self):
        self._listeners = ()

    def open(self): ...

    def close(self):
        self._listeners = ()

    def build(self, scene, robot):
        check_scene(scene)
        self._robot, self._kinematics, self._families = robot, Kinematics(robot), families(scene)
        self._dynamics = ToolDynamics(self._kinematics)
        self._mark = hashlib.sha256(repr((scene, robot.name, robot.home)).encode()).hexdigest()
        self._poses, self._joints, self._falls, self._gravity = {}, {}, {}, scene.gravity
        for body, parent in scene.walk():
            self._poses[body.name] = (self._poses[parent.name] if parent else Pose()) * body.pose
            if isinstance(body.joint, (Hinge, Slide)):
                self._joints[body.joint.name] = body.joint.initial
            elif isinstance(body.joint, Free):
                shape = body.geoms[0]
                self._falls[body.name] = scene.table_height + shape.size[-1] / (2 if shape.shape == "box" else 1)
        self._share = 1.0 - np.exp([-self.control_period * joint.kp / joint.kv for joint in robot.joints])
        home, still, wide = list(robot.home), [0.0] * len(robot.home), robot.gripper.stroke
        heights = {name: self._poses[name].position[2] for name in self._falls}
        self._state = {"ticks": 0, "q": home, "dq": still, "ddq": still, "targets": home, "width": wide, "goal": wide}
        self._state |= {"heights": heights, "falling": dict.fromkeys(heights, 0.0)}
        self.mechanisms = Mechanisms(scene, self, self)

    def tick(self):
        state, period = self._state, self.control_period
        step = self._share * (np.array(state["targets"]) - state["q"])
        before, state["dq"] = np.array(state["dq"]), (step / period).tolist()
        state["ddq"] = ((np.array(state["dq"]) - before) / period).tolist()
        state["q"] = (np.array(state["q"]) + step).tolist()
        most = self._robot.gripper.speed * period
        state["width"] += min(max(state["goal"] - state["width"], -most), most)
        for name, lowest in self._falls.items():
            speed = state["falling"][name]
            height = state["heights"][name] - speed * period - self._gravity * period**2 / 2
            lands = height <= lowest
            state["heights"][name] = max(height, min(lowest, state["heights"][name]))
            state["falling"][name] = 0.0 if lands else speed + self._gravity * period
        state["ticks"] += 1
        self.mechanisms.update()
        for listener in self._listeners:
            listener()

    def add_tick_listener(self, listener):
        self._listeners = (*self._listeners, listener)

    def remove_tick_listener(self, listener):
        self._listeners = tuple(one for one in self._listeners if one != listener)

    @property
    def time(self):
        return self._state["ticks"] * self.control_period

    def body_pose(self, body):
        pose = self._poses[body]
        x, y, z = pose.position
        return Pose((x, y, self._state["heights"].get(body, z)), pose.orientation)

    def body_velocity(self, body):
        self._poses[body]
        return np.array([0.0, 0.0, -self._state["falling"].get(body, 0.0)]), np.zeros(3)

    def joint_position(self, joint):
        return self._joints[joint]

    def joint_velocity(self, joint):
        return 0.0 * self._joints[joint]

    def contacts(self, body=None):
        self._families[body] if body else None  # a KeyError for who is not there
        return ()

    def tool_pose(self):
        return self._kinematics.pose(self.joint_positions())

    def joint_positions(self):
        return np.array(self._state["q"])

    def joint_velocities(self):
        return np.array(self._state["dq"])

    def joint_accelerations(self):
        return np.array(self._state["ddq"])

    def joint_torques(self):
        return self._dynamics.torques(self.joint_positions(), self.joint_velocities(), self.joint_accelerations())

    def gripper_width(self):
        return self._state["width"]

    def gripper_effort(self):
        return 0.0

    def command_joints(self, targets):
        if not np.all(np.isfinite(targets)):
            raise InvalidArgument("targets", f"not all finite: {targets}", "angles in rad")
        self._state["targets"] = np.asarray(targets, dtype=float).tolist()

    def command_gripper(self, width, force):
        if not (np.isfinite(width) and force > 0):
            raise InvalidArgument("gripper", f"width {width} m with {force} N", "a finite width and a force above 0")
        self._state["goal"] = float(min(max(width, 0.0), self._robot.gripper.stroke))

    def limit_joint(self, joint, lower, upper): ...  # nothing moves them anyway

    def spring_joint(self, joint, stiffness, rest): ...

    def checkpoint(self):
        return json.dumps([self._mark, self._state, self.mechanisms.memory()]).encode()

    def restore(self, checkpoint):
        try:
            mark, state, memory = json.loads(checkpoint)
        except ValueError:
            raise InvalidArgument("checkpoint", "these bytes are no checkpoint", "what checkpoint() gave") from None
        if mark != self._mark:
            raise InvalidArgument("checkpoint", "it is of another scene or robot", "one of this scene")
        self._state = state
        self.mechanisms.recall(memory)

    def render(self, camera, width=None, height=None):
        raise BackendUnavailable("renderer", "ghost", "it draws nothing", "use another simulator for pictures")

    render_depth = render_segmentation = render


@hookimpl
def memo_simulators():
    return [Backend("simulator", "ghost", "no contacts at all", lambda settings: GhostSimulator())]
