"""What things look like reaches the scene graph, the prompts and retrieval, and says nothing that no eye sees."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from memo_perception.ground_truth import GroundTruth
from memo_tabletop.furniture import WOOD
from memo_tabletop.plugin import TabletopSettings, quirks, tasks
from memo_tabletop.quirks.fixtures import with_joint, with_lifting_handle
from memo_tabletop.tasks.bottle import bottle
from memo_tabletop.tasks.drawer import PutTheCubeAway

from memo_core.scene.appearance import appearance, colour_name, colours
from memo_core.scene.description import Body, Free, Geom, Hinge, Material, Part, SceneDescription
from memo_core.scene.graph import SceneGraph
from memo_core.scene.graph_json import pack_scenes, unpack_scenes
from memo_core.scene.pose import Pose
from memo_core.scene.scene_table import read_scene_table, scene_table
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.model.scene_context import SubtaskContext
from memo_core.testing.perception import still_context

RED, WHITE, BROWN = (0.8, 0.2, 0.18, 1.0), (0.93, 0.93, 0.92, 1.0), (0.36, 0.22, 0.13, 1.0)

# What people called colours (the XKCD survey of 2010, https://xkcd.com/color/rgb.txt, CC0), sRGB in hex.
PEOPLE_SAY = {
    "green": "56ae57 70b23f 388004 054907 69d84f 044a05 5fa052 35530a c8ffb0",
    "blue": "acc2d9 0c06f7 3778bf 2242c7 507b9c 26538d 107ab0 247afd 02066f 7bc8f6",
    "purple": "952e8f 9900fa 751973 734a65 a66fb5 ca9bf7",
    "pink": "ff0789 ffb2d0 e78ea5",
    "grey": "6b7c85 3c4142 95a3a6 7d7f7c a8a495",
    "red": "850e04 db5856 b9484e c0022f fe0002",
    "orange": "ca6b02 f0833a ff964f fb7d07",
    "yellow": "fff917 fdb915 fce166 feff7f",
    "brown": "7f5112 836539 b2713d 964e02 1d0200",
    "turquoise": "06b1c4 017374",
    "black": "070d0d",
}


def look(*bodies: Body) -> SceneGraph:
    perception = GroundTruth()
    perception.start(still_context(SceneDescription(bodies)))
    return perception.look()


def block(colour=RED, **more) -> Body:
    return Body(
        "block", (Geom("box", (0.1, 0.1, 0.1), colour=colour),), Pose((0.4, 0, 0.05)), Free(), label="block", **more
    )


def test_colours_are_called_what_people_call_them():
    pairs = [(word, code) for word, codes in PEOPLE_SAY.items() for code in codes.split()]
    called = [(word, colour_name(tuple(byte / 255 for byte in bytes.fromhex(code)))) for word, code in pairs]
    assert sum(word == name for word, name in called) >= 0.8 * len(called), [c for c in called if c[0] != c[1]]


@pytest.mark.parametrize(
    ("colour", "name"),
    [((0, 0, 0), "black"), ((1, 1, 1), "white"), ((0.5, 0.5, 0.5), "grey"), ((1, 0, 0), "red"), ((0, 0, 1), "blue")],
)
def test_plain_colours_have_their_plain_names(colour, name):
    assert colour_name(colour) == name


def test_a_second_colour_is_named_where_it_shows_and_a_speck_is_not():
    side = Geom("box", (0.1, 0.1, 0.1), colour=WHITE)
    assert colours([side, Geom("box", (0.1, 0.1, 0.05), colour=RED)]) == ("white", "red")
    assert colours([side, Geom("sphere", (0.01,), colour=RED)]) == ("white",)
    assert colours([attrs.evolve(side, colour=(0.9, 0.9, 0.9, 0.2))]) == ("transparent",)
    assert colours([]) == ()


def test_a_part_looks_like_its_own_geoms_and_its_body_is_without_them():
    handle = Part("pan/handle", "pan handle", Pose((-0.2, 0, 0)), (0.2, 0.02, 0.02), "wood")
    rim = Part("pan/rim", "pan rim", Pose((0, 0, 0.1)), (0.1, 0.1, 0.01))
    geoms = (
        Geom("box", (0.1, 0.1, 0.1), colour=WHITE),
        Geom("box", (0.4, 0.2, 0.2), Pose((-0.2, 0, 0)), colour=BROWN),
    )
    pan = Body("pan", geoms, label="pan", parts=(handle, rim), made_of="iron")
    assert appearance(pan) == ("white", "iron")
    assert appearance(pan, handle) == ("brown", "wood")
    assert appearance(pan, rim) == ("white",)  # nothing of its own: it is the pan that one sees


def test_what_is_attached_without_a_name_belongs_to_the_look_of_the_whole():
    panel = Body("panel", (Geom("box", (0.2, 0.2, 0.1), colour=BROWN),))
    knob = Body("knob", (Geom("box", (0.5, 0.5, 0.5), colour=RED),), label="knob")
    assert appearance(attrs.evolve(block(WHITE), bodies=(panel, knob))) == ("brown", "white")


def test_perception_says_what_things_parts_and_grains_look_like():
    grains = tuple(
        Body(f"salt/{i}", (Geom("sphere", (0.004,), colour=WHITE),), Pose((0.3, 0.01 * i, 0.01)), Free(), heap="salt")
        for i in range(3)
    )
    graph = look(block(made_of="wood"), *grains)
    assert graph.node("block").attributes == ("red", "wood")
    assert graph.node("salt").attributes == ("white",)


def test_the_looks_of_every_scene_are_words_and_depend_on_nothing_hidden():
    """Frictions, masses and joints may be anything: what is said of a thing stays the same."""

    def otherwise(body: Body) -> Body:
        slippery = tuple(attrs.evolve(g, material=Material(friction=0.1), mass=None) for g in body.geoms)
        joint = attrs.evolve(body.joint, friction=9.0, stiffness=7.0) if isinstance(body.joint, Hinge) else body.joint
        children = tuple(otherwise(child) for child in body.bodies)
        return attrs.evolve(body, geoms=slippery, joint=joint, bodies=children, mass=3.3)

    for task in (*tasks(TabletopSettings()), *quirks(TabletopSettings())):
        scene = task.scene(np.random.default_rng(0))
        seen = [node.attributes for node in look(*scene.bodies).nodes]
        assert all(word.isalpha() for words in seen for word in words)
        assert seen == [node.attributes for node in look(*(otherwise(body) for body in scene.bodies)).nodes]
        assert any(seen)


def test_a_trick_of_the_handle_or_hinge_does_not_show():
    chest = PutTheCubeAway().scene(np.random.default_rng(0)).bodies[0]

    def looks(body: Body) -> dict[str, tuple[str, ...]]:
        return {node.label: node.attributes for node in look(body).nodes}

    plain = looks(chest)
    assert plain["drawer handle"] == ("black", "metal")
    assert looks(with_lifting_handle(chest, 0.03)) == looks(with_joint(chest, stiffness=50.0)) == plain


def test_a_material_is_said_where_the_description_says_it():
    assert appearance(bottle((0.4, 0, 0), 0.0))[-1] == "glass"
    assert appearance(block(WOOD)) == ("brown",)  # brown is not yet wooden


def test_looks_stand_in_the_prompts_table_are_read_from_it_and_survive_the_log():
    graph = look(block(made_of="wood"))
    text = scene_table(graph)
    assert "| block | object |  | red, wood | 0.400 0.000 0.050 |" in text
    assert read_scene_table(text).node("block").attributes == ("red", "wood")
    (again,) = unpack_scenes(pack_scenes([graph]))
    assert again.nodes == graph.nodes


def test_a_table_of_before_there_were_looks_is_still_read():
    head = "| name | kind | part of | centre x y z | size along own axes | turned | opens towards |"
    row = "| oven | fixture |  | 0.8 0.1 0.5 | 0.3 0.3 0.3 |  |  |"
    node = read_scene_table(f"{head}\n|---|---|---|---|---|---|---|\n{row}").node("oven")
    assert node.attributes == () and node.size == (0.3, 0.3, 0.3)


def test_retrieval_is_told_what_the_things_of_a_subtask_look_like():
    graph = look(block(made_of="wood"))
    assert SubtaskContext.of(Key.parse("PICK_UP(block)"), graph).attributes == ("red", "wood")
