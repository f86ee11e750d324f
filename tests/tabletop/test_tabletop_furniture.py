"""Tasks with doors, a drawer and cubes by physics: references succeed, wrong behaviours are judged failures.

All twenty seeds: ``memo tasks verify``.
"""

from __future__ import annotations

import pytest
from memo_tabletop.tasks.cubes import StackTheCubes
from memo_tabletop.tasks.drawer import PutTheCubeAway
from memo_tabletop.tasks.fridge import OpenTheFridge
from memo_tabletop.tasks.microwave import PutTheFoodInTheMicrowave
from memo_tabletop.tasks.oven import PutTheFoodInTheOven

from tests.support.wrong_behaviours import Wrong, judged, rehearsal_fixture

pytestmark = pytest.mark.sim

DOOR = ("handling", "open_door", "put_inside")
DRAWER = ("handling", "put_the_cube_away")
CUBES = ("handling", "stack_the_cubes")
OPENED = 'open_door("{name}", math.radians(88))'

# The food, held, before the open cabinet: how put_inside begins.
AT_THE_SILL = """
opening = get_opening("{name} inside")
hand = side_orientation([-v for v in opening], "horizontal", math.radians(25))
position = get_position("food")
open_gripper()
move_to([position[0], position[1], position[2] + 0.10], hand)
move_straight(position, hand, slack=0.2)
close_gripper()
move_straight([position[0], position[1], position[2] + 0.10], hand)
inside, room = get_position("{name} inside"), get_size("{name} inside")
sill = add(inside, opening, room[0] / 2)
sill = [sill[0], sill[1], get_bounds("{name} inside")[0][2] + get_size("food")[2] / 2 + 0.012]
deep = add(sill, opening, -0.07)
front = add(add(sill, [0, 0, 0.05]), opening, 0.20)
move_to(front, hand, then=[[add(sill, [0, 0, 0.05]), hand], [add(deep, [0, 0, 0.03]), hand], [deep, hand]])
"""
HALF_IN = "follow_path([[add(sill, [0, 0, 0.02]), hand], [sill, hand]])\nopen_gripper()\nmove_straight(front, hand)"
HOLDS_IT = "follow_path([[add(sill, [0, 0, 0.05]), hand], [add(deep, [0, 0, 0.03]), hand], [deep, hand]])"


def into(name: str) -> tuple[Wrong, ...]:
    """Wrong ways to put the food into a cabinet."""
    opened, held = OPENED.format(name=name), AT_THE_SILL.format(name=name)
    return (
        Wrong("nearly right", "sets it down half outside", held + HALF_IN, "not wholly inside", opened, DOOR),
        Wrong("cheating", "keeps hold of it inside", held + HOLDS_IT, "still touches the food", opened, DOOR),
        Wrong("sloppy", "only opens the door", "go_home()", "not wholly inside", opened, DOOR),
    )


WRONG = {
    StackTheCubes: (
        Wrong(
            "nearly right",
            "stacks two of three",
            "go_home()\nwait(2.5)",
            "not in one tower",
            'stack("green cube", "red cube")',
            CUBES,
        ),
        Wrong(
            "sloppy",
            "sets the third half beside the second, so that it falls",
            'x, y, z = get_position("green cube")\nabove = pick_up("blue cube", lift=0.2)\n'
            "put_down([x, y + 0.035, z + 0.0225], above)\nwait(2.5)",
            "not in one tower",
            'stack("green cube", "red cube")',
            CUBES,
        ),
        Wrong(
            "cheating",
            "keeps hold of the uppermost",
            'x, y, z = get_position("green cube")\nabove = pick_up("blue cube", lift=0.2)\nhand = top_orientation()\n'
            "move_to([x, y, z + 0.0225 + above + 0.06], hand)\nmove_straight([x, y, z + 0.0225 + above], hand)\n"
            "wait(3.0)",
            "not in one tower, let go",
            'stack("green cube", "red cube")',
            CUBES,
        ),
    ),
    PutTheFoodInTheMicrowave: into("microwave"),
    PutTheFoodInTheOven: into("oven"),
    OpenTheFridge: (
        Wrong("sloppy", "opens it by a gap", 'open_door("fridge", 0.5)', "open by only", "", DOOR),
        Wrong("nearly right", "opens it by 50 degrees", 'open_door("fridge", 0.87)', "open by only", "", DOOR),
        Wrong(
            "cheating",
            "holds on to the handle",
            'look()\ngrip, size = get_position("fridge handle"), get_size("fridge handle")\n'
            'out = [-v for v in get_axes("fridge door")[0]]\nhand = side_orientation([-v for v in out], "horizontal")\n'
            "open_gripper(0.05)\nmove_to(add(grip, out, 0.10), hand)\nmove_straight(grip, hand)\nclose_gripper()",
            "still touches the door",
            'open_door("fridge", math.radians(88))',
            DOOR,
        ),
    ),
    PutTheCubeAway: (
        Wrong("nearly right", "leaves the drawer open", "go_home()", "mm open", "pull(0.16)\nput_in()", DRAWER),
        Wrong("sloppy", "shuts the empty drawer", "push_shut()", "not in the drawer", "pull(0.16)", DRAWER),
        Wrong(
            "cheating",
            "puts the cube on top of the chest",
            'x, y, z = get_position("chest")\nabove = pick_up("cube", lift=0.25)\n'
            'put_down([x - 0.08, y, get_bounds("chest")[1][2]], above)',
            "not in the drawer",
            "",
            DRAWER,
        ),
    ),
}

rehearsal = rehearsal_fixture()
test_a_wrong_behaviour_is_not_success, test_the_reference_is_success_and_doing_nothing_is_not = judged(WRONG)
