"""Reading and checking URDFs."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.robot.urdf.checks import check_fits as check_fits, may_touch as may_touch
    from memo_core.robot.urdf.reading import (
        Urdf as Urdf,
        UrdfJoint as UrdfJoint,
        UrdfLink as UrdfLink,
        UrdfShape as UrdfShape,
        link_poses as link_poses,
        read_urdf as read_urdf,
    )
    from memo_core.robot.urdf.text import (
        Inertia as Inertia,
        Solid as Solid,
        between as between,
        box_inertia as box_inertia,
        joint_text as joint_text,
        link_text as link_text,
        materials_text as materials_text,
        rod_inertia as rod_inertia,
    )

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
