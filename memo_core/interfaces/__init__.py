"""What a backend of each kind must provide, one file per kind."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.interfaces.backend import Backend as Backend, Demo as Demo, Needs as Needs, NoSettings as NoSettings
    from memo_core.interfaces.driver import (
        GripperDriver as GripperDriver,
        RobotDriver as RobotDriver,
        check_gripper_command as check_gripper_command,
    )
    from memo_core.interfaces.embedder import Embedder as Embedder
    from memo_core.interfaces.link import Health as Health, Link as Link
    from memo_core.interfaces.llm import (
        Answer as Answer,
        Cause as Cause,
        Image as Image,
        LanguageModel as LanguageModel,
        LanguageModelError as LanguageModelError,
        Message as Message,
        Request as Request,
        Usage as Usage,
    )
    from memo_core.interfaces.perception import (
        Ask as Ask,
        Perception as Perception,
        PerceptionContext as PerceptionContext,
    )
    from memo_core.interfaces.simulator import (
        Contact as Contact,
        Simulator as Simulator,
        WorldState as WorldState,
        divided as divided,
    )
    from memo_core.interfaces.task import Monitor as Monitor, Outcome as Outcome, Task as Task
    from memo_core.interfaces.teacher import Episode as Episode, Teacher as Teacher, Verdict as Verdict
    from memo_core.interfaces.vectorstore import VectorStore as VectorStore

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
