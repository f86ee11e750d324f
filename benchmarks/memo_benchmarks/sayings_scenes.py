"""Small scenes for the things that everyday sentences are about (``memo bench understanding``).

One box a thing, its parts and where they sit: enough for a model to write code for ``OPEN(drawer)`` that a hand
without a robot can run. Lengths in metres, positions in the base frame.
"""

from __future__ import annotations

import re

from memo_core.robot.description import GripperDescription, RobotDescription
from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Pose

ROBOT = RobotDescription("arm", "", (), GripperDescription(), "tool")
_LEVEL = (0.0, 1.0, 0.0, 0.0)  # the hand points down
_DOWN = (0.0, 0.0, 1.0)

# thing -> edge its door hangs on, as the robot sees it
_DOORS = {
    "microwave": "left",
    "fridge": "left",
    "oven": "bottom",
    "cabinet": "right",
    "cupboard": "left",
    "locker": "left",
    "wardrobe": "left",
    "medicine cabinet": "left",
    "freezer": "left",
    "safe": "left",
}
_DRAWERS = {"drawer": "chest", "dresser": "", "nightstand": "", "workbench": ""}  # what slides out of what
# thing -> (part, place of its centre relative to the thing's, size)
_PARTS = {
    "bottle": (("bottle cap", (0.0, 0.0, 0.11), (0.035, 0.035, 0.02)),),
    "medicine bottle": (("medicine bottle cap", (0.0, 0.0, 0.11), (0.035, 0.035, 0.02)),),
    "faucet": (("faucet lever", (-0.04, 0.0, 0.02), (0.08, 0.015, 0.012)),),
    "stove": (
        ("stove knob", (-0.21, -0.12, 0.0), (0.03, 0.04, 0.04)),
        ("burner", (0.0, 0.08, 0.03), (0.13, 0.13, 0.01)),
    ),
    "heater": (("heater knob", (0.0, 0.0, 0.11), (0.04, 0.04, 0.03)),),
    "toaster": (("toaster lever", (-0.09, 0.0, 0.02), (0.02, 0.03, 0.015)),),
    "rice cooker": (
        ("rice cooker button", (-0.12, 0.0, 0.0), (0.01, 0.03, 0.03)),
        ("rice cooker lid", (0.0, 0.0, 0.10), (0.22, 0.22, 0.02)),
    ),
    "safe": (("safe button", (-0.16, 0.12, 0.0), (0.01, 0.03, 0.03)),),
    "microwave": (("button", (-0.16, -0.15, 0.0), (0.01, 0.03, 0.03)),),
    "pan": (("pan handle", (-0.16, 0.0, 0.02), (0.14, 0.02, 0.015)),),
    "knife": (("knife handle", (-0.06, 0.0, 0.0), (0.09, 0.02, 0.012)),),
}
_SIZES = {
    "banana": (0.16, 0.035, 0.035),
    "bottle": (0.06, 0.06, 0.2),
    "medicine bottle": (0.06, 0.06, 0.2),
    "can": (0.066, 0.066, 0.11),
    "cup": (0.07, 0.07, 0.09),
    "carton": (0.05, 0.07, 0.12),
    "milk": (0.06, 0.06, 0.16),
    "juice": (0.06, 0.06, 0.16),
    "fork": (0.18, 0.02, 0.012),
    "knife": (0.2, 0.02, 0.012),
    "spoon": (0.17, 0.03, 0.012),
    "napkin": (0.12, 0.05, 0.01),
    "wrapper": (0.1, 0.04, 0.01),
    "bread": (0.014, 0.09, 0.1),
    "plate": (0.22, 0.22, 0.02),
    "tray": (0.25, 0.2, 0.02),
    "board": (0.25, 0.2, 0.02),
    "cake": (0.18, 0.18, 0.06),
    "pan": (0.2, 0.2, 0.05),
    "bin": (0.2, 0.2, 0.22),
    "tub": (0.25, 0.2, 0.12),
    "bowl": (0.16, 0.16, 0.07),
    "faucet": (0.06, 0.06, 0.17),
    "stove": (0.4, 0.4, 0.05),
    "heater": (0.15, 0.3, 0.2),
    "toaster": (0.16, 0.26, 0.13),
    "rice cooker": (0.24, 0.24, 0.2),
    "shaker": (0.044, 0.044, 0.09),
    "sponge": (0.09, 0.06, 0.03),
}
_HOLLOW = {"bin", "tub", "bowl", "toaster"}
_FIXED = {"faucet", "stove", "heater", "toaster", "rice cooker", "bin"}
_OWNERS = {"button": "microwave", "lever": "toaster", "knob": "stove", "burner": "stove"}  # where nothing else is named
_TOOLS = {"SEASON": "shaker", "SPRINKLE": "shaker", "WIPE": "sponge", "STIR": "spoon"}  # what is held, by the step
_PLACES = ((0.48, 0.12), (0.45, -0.22), (0.52, -0.05), (0.4, 0.3))


def scene_for(subtask: str) -> SceneGraph:
    """A scene in which ``ACTION(thing, place)`` makes sense: things are closed for OPEN and open otherwise, and PLACE
    and POUR begin with the thing in the hand."""
    action, _, rest = subtask.partition("(")
    names = [name.strip() for name in rest.rstrip(")").split(",") if name.strip()]
    nodes: dict[str, Node] = {}
    relations: list[Relation] = []
    opened = action != "OPEN"
    for name in [*names, *(_companions(action, names))]:
        name = re.sub(r"^(?:left|right) of |^next to ", "", name)
        if name != "table" and name not in nodes:
            _add(name, nodes, relations, opened, _PLACES[len(nodes) % len(_PLACES)], names)
    hand, width, holding = Pose((0.4, 0.0, 0.5), _LEVEL), 0.08, False
    held = _TOOLS.get(action) or (names[0] if action in ("PLACE", "PUT", "POUR", "SHAKE") else "")
    if held in nodes:
        relations.append(Relation(held, "held"))
        hand, width, holding = Pose(nodes[held].pose.position, _LEVEL), 0.05, True
    return SceneGraph(tuple(nodes.values()), tuple(relations), Observation(hand, width, holding), 0.0, "kitchen")


def _companions(action: str, names: list[str]) -> list[str]:
    """What stands there besides: the other can, the appliance a lever belongs to."""
    more = {"can": "left can", "left can": "right can", "right can": "left can", "cup": "can"}
    more |= {"red cube": "blue cube", "blue cube": "red cube"}
    found = [owner for name in names if (owner := _owner(name) or more.get(name))]
    if (
        action in ("PLACE", "PUT")
        and names[1:] == ["table"]
        and names[0] in ("fork", "knife", "spoon", "napkin", "glass")
    ):
        found.append("plate")  # cutlery is put down beside one
    return found + ([_TOOLS[action]] if action in _TOOLS else [])


def _owner(name: str) -> str | None:
    """What a button, a lever, a knob is a part of: "faucet lever" of the faucet, "start button" of the microwave."""
    *of, part = name.split()
    if part not in _OWNERS:
        return None
    named = " ".join(of)
    return named if any(part in label.split() for label, *_ in _PARTS.get(named, ())) else _OWNERS[part]


def _add(
    name: str,
    nodes: dict[str, Node],
    relations: list[Relation],
    opened: bool,
    place: tuple[float, float],
    called: list[str],
) -> None:
    """``called``: what the subtask calls things, and parts of things."""
    if _owner(name):
        return  # comes with what it belongs to
    if name in _DOORS:
        _door(name, _DOORS[name], nodes, relations, opened)
    elif name in _DRAWERS:
        _drawer(name, _DRAWERS[name] or name, nodes, relations, opened)
    else:
        size = _SIZES.get(name) or _SIZES.get(name.split()[-1], (0.05, 0.05, 0.05))
        kind = "fixture" if name in _FIXED else "object"
        nodes[name] = Node(name, name, Pose((*place, size[2] / 2)), size, None, kind)
        if name in _HOLLOW:
            inner = (size[0] - 0.02, size[1] - 0.02, size[2] - 0.01)
            if name == "toaster":
                inner = (0.02, 0.11, 0.10)
            centre = (*place, size[2] / 2 + 0.005)
            nodes[f"{name} inside"] = Node(
                f"{name} inside", f"{name} inside", Pose(centre), inner, name, "space", _DOWN
            )
    at = nodes[name].pose.position
    for part, offset, box in _PARTS.get(name, ()):
        plain = part if part not in ("toaster lever", "button") else part.split()[-1]
        label = next((one for one in called if _owner(one) == name and one.split()[-1] == part.split()[-1]), plain)
        centre = (at[0] + offset[0], at[1] + offset[1], at[2] + offset[2])
        nodes[label] = Node(label, label, Pose(centre), box, name, "part")


def _door(name: str, edge: str, nodes: dict[str, Node], relations: list[Relation], opened: bool) -> None:
    x, y, z, depth, width, height = 0.7, 0.05, 0.3, 0.3, 0.36, 0.34
    side = {"left": (0, 1, 0), "right": (0, -1, 0), "bottom": (0, 0, -1)}[edge]
    half = width / 2 if edge in ("left", "right") else height / 2
    bar = (0.018, 0.018, 0.16) if edge in ("left", "right") else (0.018, 0.16, 0.018)
    front = (x - 0.009, y, z)
    handle = (x - 0.063, y - side[1] * (half - 0.03), z - side[2] * (half - 0.03))
    nodes[name] = Node(name, name, Pose((x + depth / 2, y, z)), (depth, width, height), None, "fixture")
    nodes[f"{name} door"] = Node(f"{name} door", f"{name} door", Pose(front), (0.018, width, height), name, "part")
    nodes[f"{name} handle"] = Node(f"{name} handle", f"{name} handle", Pose(handle), bar, f"{name} door", "part")
    relations.append(Relation(f"{name} door", "open" if opened else "closed"))
    if opened:
        inside = Pose((x + depth / 2, y, z))
        label = f"{name} inside"
        nodes[label] = Node(label, label, inside, (0.28, 0.33, 0.31), name, "space", (-1.0, 0.0, 0.0))


def _drawer(name: str, owner: str, nodes: dict[str, Node], relations: list[Relation], opened: bool) -> None:
    slider = name if owner != name else f"{name} drawer"
    shift = -0.16 if opened else 0.0
    nodes[owner] = Node(owner, owner, Pose((0.8, 0.1, 0.08)), (0.28, 0.32, 0.16), None, "fixture")
    nodes[slider] = Node(slider, slider, Pose((0.75 + shift, 0.1, 0.08)), (0.28, 0.3, 0.12), owner, "part")
    label = f"{slider} handle"
    nodes[label] = Node(label, label, Pose((0.55 + shift, 0.1, 0.08)), (0.018, 0.12, 0.018), slider, "part")
    relations.append(Relation(slider, "open" if opened else "closed"))
    if opened:
        label = f"{slider} inside"
        inside = Pose((0.62, 0.1, 0.09))
        nodes[label] = Node(label, label, inside, (0.25, 0.27, 0.1), slider, "space", _DOWN)
