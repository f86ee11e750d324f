import copy
import json

state = {"hand": get_gripper_position(), "objects": {n: get_position(n) for n in ["bowl"]}}
before = copy.deepcopy(state)
state["objects"]["bowl"][0] += 1
print(json.dumps(before, sort_keys=True), state["objects"]["bowl"][0] != before["objects"]["bowl"][0])
print(json.loads('{"force": 20}')["force"])
