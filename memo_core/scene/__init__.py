"""Poses, the scene graph, relations, and the scene description every simulator builds."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.scene.appearance import colour_name as colour_name
    from memo_core.scene.building import (
        FLOOR_DEPTH as FLOOR_DEPTH,
        check_scene as check_scene,
        check_size as check_size,
        default_table as default_table,
        families as families,
        joined_pairs as joined_pairs,
        masses as masses,
    )
    from memo_core.scene.description import (
        Body as Body,
        Camera as Camera,
        Cavity as Cavity,
        Colour as Colour,
        Free as Free,
        Geom as Geom,
        Hinge as Hinge,
        Latch as Latch,
        Material as Material,
        Part as Part,
        SceneDescription as SceneDescription,
        Slide as Slide,
        Vector as Vector,
    )
    from memo_core.scene.graph import (
        PREDICATES as PREDICATES,
        Node as Node,
        Observation as Observation,
        Relation as Relation,
        SceneGraph as SceneGraph,
    )
    from memo_core.scene.hollow import bar as bar, cup as cup, inside as inside, shelf as shelf, shell as shell
    from memo_core.scene.mechanism_state import Mechanisms as Mechanisms
    from memo_core.scene.mechanisms import (
        Above as Above,
        AllOf as AllOf,
        Below as Below,
        Condition as Condition,
        Lasting as Lasting,
        Lock as Lock,
        Locked as Locked,
        Mechanism as Mechanism,
        Pressed as Pressed,
        Spring as Spring,
        Times as Times,
    )
    from memo_core.scene.name_corrections import NameCorrection as NameCorrection, corrected as corrected
    from memo_core.scene.pose import (
        Array as Array,
        Pose as Pose,
        look_at as look_at,
        quaternion_angle as quaternion_angle,
        quaternion_from_axis_angle as quaternion_from_axis_angle,
        quaternion_from_rotation as quaternion_from_rotation,
    )
    from memo_core.scene.relations import (
        arrangement as arrangement,
        containment as containment,
        held_thing as held_thing,
        support as support,
    )
    from memo_core.scene.sealed_state import seal as seal, unseal as unseal

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
