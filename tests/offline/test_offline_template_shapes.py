"""The shape of a path that a template leads the handle along, as the offline backend reads it off."""

from __future__ import annotations

from memo_offline.recipe import habits
from memo_offline.surroundings import Surroundings
from memo_offline.templates import path_shaped

from memo_core.scene.pose import Pose
from memo_core.skills.recording_control import Command
from tests.support.offline_prompts import scene, thing

BOX = scene(thing("crate", (0.6, 0.0, 0.1), (0.2, 0.2, 0.2)))


def led(*xs: float) -> list[Command]:
    """The hand goes to the first place, closes, and goes on to the others."""
    poses = [Pose((x, 0.0, 0.3)) for x in xs]
    return [Command("go", poses[0]), Command("close", poses[0]), *(Command("go", pose) for pose in poses[1:])]


def test_a_path_out_and_back_on_a_line_is_no_arc():
    recipe = habits().recipe("open", ("crate",))
    around = Surroundings.of(BOX, "crate", None)
    assert path_shaped(recipe, led(0.5, 0.45, 0.4, 0.5), around) == recipe
    assert path_shaped(recipe, led(0.5, 0.45, 0.4), around).shape == "straight"
