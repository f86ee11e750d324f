"""The names that plugins import; each is loaded when it is first used.

A name that is neither here nor in ``memo_core``, ``memo_core.testing`` or the ``__init__`` of a package may change at
any time."""

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
    from memo_core.arm.joint_stream import JointStream as JointStream
    from memo_core.arm.link_checkpoint import LinkCheckpoint as LinkCheckpoint
    from memo_core.arm.meshes import mesh_vertices as mesh_vertices
    from memo_core.arm.rrt_connect import densified as densified
    from memo_core.arm.simulated_link import IncludedGripper as IncludedGripper
    from memo_core.arm.slow_motion import move_joints as move_joints
    from memo_core.arm.wrench import ToolDynamics as ToolDynamics, WrenchEstimate as WrenchEstimate
    from memo_core.config.provider_fields import (
        api_base as api_base,
        api_key_env as api_key_env,
        provider_model as provider_model,
    )
    from memo_core.errors import (
        BackendLost as BackendLost,
        BackendUnavailable as BackendUnavailable,
        InvalidArgument as InvalidArgument,
        MemoError as MemoError,
        MotionError as MotionError,
        RobotFault as RobotFault,
        Stopped as Stopped,
        UnknownName as UnknownName,
        close_match as close_match,
    )
    from memo_core.events import (
        Event as Event,
        FeedbackGiven as FeedbackGiven,
        QuestionAsked as QuestionAsked,
        SessionEnded as SessionEnded,
        SessionTask as SessionTask,
        TimeLeft as TimeLeft,
    )
    from memo_core.interfaces.backend import (
        NO_MEMORY as NO_MEMORY,
        Backend as Backend,
        Demo as Demo,
        DemoRun as DemoRun,
        Memory as Memory,
        Needs as Needs,
        NoSettings as NoSettings,
        Told as Told,
    )
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
    from memo_core.interfaces.reception import Demographics as Demographics, Reception as Reception
    from memo_core.interfaces.simulator import (
        Contact as Contact,
        Simulator as Simulator,
        WorldState as WorldState,
        divided as divided,
    )
    from memo_core.interfaces.task import Monitor as Monitor, Outcome as Outcome, Task as Task
    from memo_core.interfaces.teacher import (
        Arrangement as Arrangement,
        Episode as Episode,
        Noted as Noted,
        Program as Program,
        Proposal as Proposal,
        ReadBack as ReadBack,
        Stage as Stage,
        TaskEpisode as TaskEpisode,
        Teacher as Teacher,
        Verdict as Verdict,
    )
    from memo_core.interfaces.vectorstore import VectorStore as VectorStore
    from memo_core.llm.prompt_sections import (
        Prompt as Prompt,
        PromptEntry as PromptEntry,
        UnreadablePrompt as UnreadablePrompt,
        read_subtask as read_subtask,
    )
    from memo_core.plugins.hooks import hookimpl as hookimpl
    from memo_core.plugins.installing import install as install, reinstall as reinstall
    from memo_core.plugins.registry import Registry as Registry
    from memo_core.policy.method_interface import LanguageMethod as LanguageMethod, Method as Method
    from memo_core.policy.plan_feedback import PLANNING as PLANNING
    from memo_core.policy.results import RunResult as RunResult
    from memo_core.policy.run_context import Session as Session
    from memo_core.process.companion_process import (
        end_companion as end_companion,
        end_with_input as end_with_input,
        start_companion as start_companion,
    )
    from memo_core.process.peer import Peer as Peer, PeerError as PeerError
    from memo_core.process.signal_safe import Flag as Flag
    from memo_core.process.stop_switch import StopSwitch as StopSwitch, abandonable as abandonable
    from memo_core.process.temporary_folders import scratch_folder as scratch_folder
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
    from memo_core.robot.vacuum_hand import VacuumHand as VacuumHand
    from memo_core.runlog.event_log import check_quiet as check_quiet, read_events as read_events
    from memo_core.runs.progress import RunProgress as RunProgress
    from memo_core.scene.appearance import appearance as appearance, colour_name as colour_name
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
    from memo_core.scene.vantage import Vantage as Vantage, vantage_of as vantage_of
    from memo_core.skills.contract import BUILTIN_SKILLS as BUILTIN_SKILLS
    from memo_core.skills.control import Control as Control
    from memo_core.skills.recording_control import Command as Command, RecordingControl as RecordingControl
    from memo_core.skills.skill import skill as skill, skill_library as skill_library
    from memo_core.skills.values import Number as Number
    from memo_core.teachers.answers import (
        Meaning as Meaning,
        meaning_of as meaning_of,
        teaches_nothing as teaches_nothing,
    )
    from memo_core.teachers.terminal import login_name as login_name, place_in_words as place_in_words
    from memo_core.text.parsing import parse_json as parse_json, read_as as read_as
    from memo_core.text.reading_limits import LONGEST_WORDS as LONGEST_WORDS
    from memo_core.text.redaction import Redactor as Redactor

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
