"""The description of a robot arm, and reading and checking its URDF."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.robot.description import (
        GripperDescription as GripperDescription,
        JointDescription as JointDescription,
        RobotDescription as RobotDescription,
    )
    from memo_core.robot.finger_linkage import FingerLinkage as FingerLinkage
    from memo_core.robot.mounting import Mounting as Mounting, turned_by as turned_by
    from memo_core.robot.parallel_hand import (
        ParallelHand as ParallelHand,
        with_hand as with_hand,
        with_parallel_hand as with_parallel_hand,
    )
    from memo_core.robot.safety import SafetyLimits as SafetyLimits
    from memo_core.robot.vacuum_hand import VacuumHand as VacuumHand

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
