"""The ``cameras`` backend: frames from a source, names from a detector, everything metric from geometry."""

from __future__ import annotations

import base64
import json
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence

import attrs
import numpy as np

from memo_core.plugin import (
    Ask,
    InvalidArgument,
    NameCorrection,
    Node,
    Observation,
    Perception,
    PerceptionContext,
    Relation,
    SceneGraph,
    corrected,
    held_thing,
)
from memo_perception.cameras.detectors import DETECTORS
from memo_perception.cameras.detectors.chain import Chain
from memo_perception.cameras.detectors.detector import Detection, Detector, Request
from memo_perception.cameras.frames import Frame
from memo_perception.cameras.geometry.arm_mask import ArmMask
from memo_perception.cameras.geometry.estimate_boxes import Measured, measure, sized
from memo_perception.cameras.geometry.segmentation import regions_of
from memo_perception.cameras.geometry.table import View, aligned_view
from memo_perception.cameras.inventory import Hint, Item
from memo_perception.cameras.memory import HIDDEN, Memory
from memo_perception.cameras.overlay import overlaid, png
from memo_perception.cameras.regions import Region
from memo_perception.cameras.scene_items import items_of
from memo_perception.cameras.settings import CamerasSettings
from memo_perception.cameras.sources.source import Source
from memo_perception.cameras.sources.together import source_from
from memo_perception.cameras.stages import stages_of
from memo_perception.spatial_relations import spatial_relations

_AT_REST = 0.02  # rad/s of every joint
_SAME_PLACE = (0.003, 0.02)  # m, then rad, of the tool
_REMEMBERED = 16  # answers of the detector that are kept, by the digest of the pictures


class Cameras(Perception):
    """See the module. Detections are kept by the pictures' digest, so the same pictures are never named twice, nor
    differently after a restore."""

    def __init__(
        self, settings: CamerasSettings | None = None, source: Source | None = None, detector: Detector | None = None
    ) -> None:
        """``source`` and ``detector`` replace those that the settings name."""
        self.settings = settings or CamerasSettings()
        self.source: Source = source or source_from(self.settings)
        self.detector: Detector = detector or _detector(self.settings)
        self.hints: tuple[Hint, ...] = ()
        self._said: tuple[NameCorrection, ...] = ()  # of names, by people
        self.latest: Look | None = None  # everything behind the last graph, for pictures of it
        self._context: PerceptionContext | None = None
        self._arm: ArmMask | None = None
        self._memory = Memory()
        self._show: Callable[[dict[str, bytes]], None] | None = None
        self._answers: OrderedDict[str, tuple[Detection, ...]] = OrderedDict()

    # -- life ----------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        self.source.open()
        try:
            self.detector.open()
        except BaseException:
            self.source.close()
            raise

    def close(self) -> None:
        self.detector.close()
        self.source.close()

    def use_model(self, ask: Ask) -> None:
        self.detector.use_model(ask)

    def correct_names(self, corrections: tuple[NameCorrection, ...]) -> None:
        """Detectors that ask a model are told; whatever they answer, people have the last word."""
        self._said = tuple(dict.fromkeys((*self._said, *corrections)))
        self.hints = tuple(
            dict.fromkeys((*self.hints, *(Hint(one.said, one.label, instead=one.instead) for one in corrections)))
        )

    def show_looks(self, show: Callable[[dict[str, bytes]], None]) -> None:
        self._show = show

    def start(self, context: PerceptionContext) -> None:
        self.source.start(context)
        self.detector.start(context)
        self._context = context
        self._arm = ArmMask(context.robot, context.link)
        self._memory = Memory()
        self._answers.clear()
        self.latest = None

    # -- looking -------------------------------------------------------------------------------------------------------
    def look(self) -> SceneGraph:
        """Raises ``BackendUnavailable`` when a camera does not answer, ``InvalidArgument`` for a camera that is not
        there."""
        graph = self._seen()
        if self._show is not None:
            self._show({name: png(picture) for name, picture in self.drawn().items()})
        return graph

    def _seen(self) -> SceneGraph:
        context = self._started()
        frames = self._frames()
        table = context.scene.table_height if context.scene is not None else 0.0
        blocked = {}
        if self._arm is not None and (links := self._arm.poses()):
            blocked = {frame.name: self._arm.mask(frame, links) for frame in frames}
        views = tuple(aligned_view(frame, table, blocked.get(frame.name)) for frame in frames)
        regions = regions_of(views, blocked, table) if self.detector.needs_regions else ()
        if self.detector.needs_sizes:
            regions = sized(regions, views, blocked, table)
        detections = self._detected(views, regions, table)
        measured = measure(views, blocked, detections, regions, table)
        tool, holding = context.tool_pose(), context.link.holding()
        time = max((frame.time for frame in frames), default=0.0)
        seen = self._memory.named(measured, time)
        hidden = self._memory.unseen(seen, views, holding, tool)
        nodes = (*seen, *hidden)
        held = held_thing(nodes, tool.position) if holding else None
        self._memory.keep(seen, held, tool)
        states = _states(seen, measured)
        said = (*states, *spatial_relations(nodes, held, table))
        pictures = self.settings.images
        observation = Observation(
            tool,
            context.link.gripper_width(),
            holding,
            {frame.name: frame.rgb for frame in frames} if pictures else {},
            {frame.name: frame.depth for frame in frames} if pictures else {},
        )
        label = context.scene.label if context.scene is not None else "table"
        graph = corrected(SceneGraph(nodes, said, observation, table, label, time), self._said)
        self.latest = Look(views, detections, graph)
        return graph

    def glance(self) -> SceneGraph:
        """As by default. With a detector that asks a model, what the last look showed while the arm moves, or has not
        moved since: people beside the robot are given a glance every half second, and each would be a question."""
        latest, context = self.latest, self._started()
        if latest is None or not self.detector.asks_model:
            return self._unnoticed()
        then = latest.graph.observation
        far, turned = context.tool_pose().distance(then.end_effector)
        fingers = abs(context.link.gripper_width() - then.gripper_width)
        elsewhere = far > _SAME_PLACE[0] or turned > _SAME_PLACE[1] or fingers > _SAME_PLACE[0]
        still = float(np.abs(context.link.joint_velocities()).max()) < _AT_REST
        return self._unnoticed() if still and elsewhere else latest.graph

    def _unnoticed(self) -> SceneGraph:
        """A look that leaves no trace."""
        state = self.state()
        try:
            return self._seen()
        finally:
            self.restore(state)

    def drawn(self) -> dict[str, np.ndarray]:
        if self.latest is None:
            return {}
        graph, frames = self.latest.graph, [view.frame for view in self.latest.views]
        return {frame.name: overlaid(frame.rgb, frame.intrinsics, frame.pose, graph) for frame in frames}

    def pictures(self) -> dict[str, np.ndarray]:
        return {} if self.latest is None else {view.frame.name: view.frame.rgb for view in self.latest.views}

    def photograph(self) -> dict[str, np.ndarray]:
        return {frame.name: frame.rgb for frame in self._frames()}

    def state(self) -> bytes:
        source = base64.b64encode(self.source.state()).decode()
        return json.dumps({"memory": self._memory.state(), "source": source}).encode()

    def restore(self, state: bytes) -> None:
        try:
            fields = json.loads(state)
            source = base64.b64decode(fields["source"])
            memory = fields["memory"]
        except (ValueError, KeyError, TypeError) as error:
            raise InvalidArgument("perception state", f"not from this backend ({error})", "what state() gave") from None
        self._memory.restore(memory)
        self.source.restore(source)

    def _frames(self) -> tuple[Frame, ...]:
        frames = self.source.capture()
        wanted = self.settings.cameras
        names = [frame.name for frame in frames]
        unknown = [name for name in wanted if name not in names]
        if unknown:
            raise InvalidArgument("perception.cameras", f"no camera {unknown[0]!r} here", f"one of: {', '.join(names)}")
        return tuple(frame for frame in frames if not wanted or frame.name in wanted)

    def _detected(self, views: Sequence[View], regions: tuple[Region, ...], table: float) -> tuple[Detection, ...]:
        frames = tuple(view.frame for view in views)
        key = repr(([frame.digest() for frame in frames], self.settings.items, self.hints))
        if key not in self._answers:
            request = Request(frames, regions, self._items(), self.hints, table, _noise(views))
            self._answers[key] = self.detector.detect(request)
            while len(self._answers) > _REMEMBERED:
                self._answers.popitem(last=False)
        self._answers.move_to_end(key)
        return self._answers[key]

    def _items(self) -> tuple[Item, ...]:
        """What the settings list, else what the task's scene has."""
        scene = self._started().scene
        return self.settings.items or (items_of(scene) if scene is not None else ())

    def _started(self) -> PerceptionContext:
        if self._context is None:
            raise InvalidArgument("perception", "looked before start()", "start(context) first")
        return self._context


@attrs.frozen(eq=False)
class Look:
    """The pictures of a look with corrected poses, what was detected in them, and the graph that came of it."""

    views: tuple[View, ...]
    detections: tuple[Detection, ...]
    graph: SceneGraph


def _detector(settings: CamerasSettings) -> Detector:
    detectors: list[Detector] = stages_of(DETECTORS, settings.detector, settings)
    return detectors[0] if len(detectors) == 1 else Chain(detectors)


def _noise(views: Sequence[View]) -> float:
    """Of the noisiest picture (m)."""
    return max((view.noise for view in views), default=0.001)


def _states(nodes: Sequence[Node], measured: Sequence[Measured]) -> Iterator[Relation]:
    """``open`` and ``closed`` of the nodes, which are in the order of ``measured``."""
    for node, one in zip(nodes, measured, strict=True):
        if one.state in ("open", "closed") and HIDDEN not in node.attributes:
            yield Relation(node.id, one.state)
