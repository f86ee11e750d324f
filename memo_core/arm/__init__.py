"""Kinematics, motion and grippers for any serial arm described by a URDF, and the link to a simulator."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.arm.collision import (
        Checker as Checker,
        Held as Held,
        RobotShape as RobotShape,
        obstacles_of as obstacles_of,
    )
    from memo_core.arm.description_from_urdf import describe_urdf as describe_urdf
    from memo_core.arm.guarded_link import GuardedLink as GuardedLink
    from memo_core.arm.inverse_kinematics import Kinematics as Kinematics
    from memo_core.arm.link_checkpoint import LinkCheckpoint as LinkCheckpoint
    from memo_core.arm.meshes import mesh_vertices as mesh_vertices
    from memo_core.arm.rrt_connect import densified as densified
    from memo_core.arm.simulated_link import IncludedGripper as IncludedGripper
    from memo_core.arm.slow_motion import move_joints as move_joints
    from memo_core.arm.wrench import ToolDynamics as ToolDynamics, WrenchEstimate as WrenchEstimate

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
