from enum import Enum


class State(Enum):
    APPROACH = 1
    GRASP = 2
    LIFT = 3


for state in State:
    print(state.name)
