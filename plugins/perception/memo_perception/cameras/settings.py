"""Settings of the ``cameras`` backend and of its stages: one nested section per source and detector that has any."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

import attrs
from attrs.validators import and_, ge, le, optional

from memo_core.plugin import InvalidArgument, UnknownName
from memo_perception.cameras.detectors import DETECTORS
from memo_perception.cameras.inventory import Item, Kind
from memo_perception.cameras.sources import SOURCES
from memo_perception.cameras.stages import Stage


@attrs.frozen
class SimulatedSettings:
    """Settings of the ``simulated`` source."""

    cameras: tuple[str, ...] = attrs.field(
        default=(), metadata={"help": "cameras of the scene that it has; empty: all"}
    )
    noise: Literal["none", "d435", "d405", "femto"] = attrs.field(
        default="none", metadata={"help": "depth noise of this camera over the rendered depth"}
    )
    calibration_error: float = attrs.field(
        default=0.0,
        validator=ge(0.0),
        metadata={"help": "distance (m) by which each camera's pose is believed wrong; direction drawn once per seed"},
    )
    calibration_rotation: float = attrs.field(
        default=0.0, validator=ge(0.0), metadata={"help": "angle (rad) by which each camera's pose is believed wrong"}
    )
    width: int = attrs.field(
        default=640, validator=and_(ge(64), le(4096)), metadata={"help": "pixels; the height follows from the camera"}
    )


@attrs.frozen
class FolderSettings:
    """Settings of the ``folder`` source."""

    path: str = attrs.field(default="", metadata={"help": "folder that `memo cameras record` wrote"})
    repeat: bool = attrs.field(default=True, metadata={"help": "begin again after the last recorded look"})


@attrs.frozen
class InventorySettings:
    """Settings of the ``inventory`` detector."""

    accept: float = attrs.field(
        default=0.75,
        validator=and_(ge(0.0), le(1.0)),
        metadata={"help": "least probability at which a name is given; below it a thing is unknown"},
    )


Dictionary = Literal["4x4_50", "4x4_100", "5x5_50", "5x5_100", "6x6_50", "6x6_250", "apriltag_25h9", "apriltag_36h11"]
_REASKS = {"help": "times a model is asked again, with the reason, after an answer that is not usable"}


@attrs.frozen
class MarksSettings:
    """Settings of the ``marks`` detector."""

    reasks: int = attrs.field(default=2, validator=and_(ge(0), le(10)), metadata=_REASKS)


@attrs.frozen
class PointsSettings:
    """Settings of the ``points`` detector."""

    convention: Literal["gemini-robotics-er", "qwen2.5-vl", "qwen3-vl", "molmo", "molmo2", "claude"] = attrs.field(
        default="gemini-robotics-er", metadata={"help": "the kind of model: how it writes coordinates"}
    )
    order: Literal["xy", "yx"] | None = attrs.field(
        default=None, metadata={"help": "which coordinate comes first; null: as the convention has it"}
    )
    scale: float | None = attrs.field(
        default=None,
        validator=optional(ge(0.0)),
        metadata={"help": "what the picture's far edge is called, 0 for pixels; null: as the convention has it"},
    )
    reasks: int = attrs.field(default=2, validator=and_(ge(0), le(10)), metadata=_REASKS)


@attrs.frozen
class LocalSettings:
    """Settings of the ``local`` detector."""

    weights: str = attrs.field(
        default="", metadata={"help": "folder or repository with weights of OWLv2, Grounding DINO or SAM 3"}
    )
    masks: str = attrs.field(
        default="", metadata={"help": "the same for SAM 2, which cuts out boxes; empty: the finder's, or geometry"}
    )
    threshold: float = attrs.field(
        default=0.2,
        validator=and_(ge(0.0), le(1.0)),
        metadata={"help": "least score; models differ in what they give"},
    )
    device: str = attrs.field(default="cpu", metadata={"help": "as torch names it: cpu, cuda, cuda:1, mps"})
    download: bool = attrs.field(default=False, metadata={"help": "whether weights may be fetched from the hub"})


@attrs.frozen
class TaggedThing:
    """A thing that carries a tag. With the tag's ``side`` (m) its pose is the tag's: then ``extents`` are those of its
    box (m: along the direction into what the tag is stuck to, to the left and up, as printed), ``offset`` is where the
    box's middle is in the tag's frame (m: x right, y up, z out of the tag), and ``turn`` how the box is turned about
    its own axes (roll, pitch, yaw; rad)."""

    number: int
    label: str
    kind: Kind = "object"
    part_of: str = ""  # label of another thing
    side: float = attrs.field(default=0.0, validator=ge(0.0))
    extents: tuple[float, float, float] | None = None
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __attrs_post_init__(self) -> None:
        if self.side and (self.extents is None or min(self.extents) <= 0):
            right = "the three extents of its box (m), all above 0"
            raise InvalidArgument("extents", f"{self.label!r} takes its pose from tag {self.number}", right)


@attrs.frozen
class TagsSettings:
    """Settings of the ``tags`` detector."""

    dictionary: Dictionary = attrs.field(default="apriltag_36h11", metadata={"help": "kind of the tags"})
    things: tuple[TaggedThing, ...] = attrs.field(default=(), metadata={"help": "what carries which number"})


@attrs.frozen
class DeviceCamera:
    """One camera of a device source."""

    name: str
    serial: str = attrs.field(metadata={"help": "serial number, as the maker's tools show it"})
    calibration: str = attrs.field(default="", metadata={"help": "file of `memo cameras calibrate`"})


@attrs.frozen
class DeviceSettings:
    """Settings of the sources ``realsense`` and ``orbbec``."""

    devices: tuple[DeviceCamera, ...] = attrs.field(
        default=(), metadata={"help": "cameras to use; empty: the only one that is connected"}
    )
    width: int = attrs.field(default=640, validator=ge(64), metadata={"help": "pixels of the colour picture"})
    height: int = attrs.field(default=480, validator=ge(64), metadata={"help": "pixels of the colour picture"})
    fps: int = attrs.field(default=30, validator=ge(1), metadata={"help": "pictures a second"})
    timeout_s: float = attrs.field(default=5.0, validator=ge(0.1), metadata={"help": "seconds to wait for a picture"})


@attrs.frozen
class RealsenseSettings(DeviceSettings):
    """Settings of the ``realsense`` source."""


@attrs.frozen
class OrbbecSettings(DeviceSettings):
    """Settings of the ``orbbec`` source."""


def _words(stages: Mapping[str, Stage]) -> Callable[[object, attrs.Attribute[Any], str | tuple[str, ...]], None]:
    """A validator: the name of a stage, or a list of different names."""

    def check(_: object, field: attrs.Attribute[Any], value: str | tuple[str, ...]) -> None:
        names = (value,) if isinstance(value, str) else value
        for name in names:
            if name not in stages:
                raise UnknownName(field.name, name, tuple(stages))
        if not names or len(set(names)) < len(names):
            listed = ", ".join(names)
            raise InvalidArgument(f"perception.{field.name}", f"[{listed}]", "one or more different names")

    return check


def _not_empty(_: object, field: attrs.Attribute[Any], value: object) -> None:
    if value == ():
        raise InvalidArgument(f"perception.{field.name}", "no source", "its section, or a list of one or more")


@attrs.frozen
class CamerasSettings:
    """Settings of the ``cameras`` backend."""

    source: str | tuple[str, ...] = attrs.field(
        default="simulated",
        validator=_words(SOURCES),
        metadata={"help": "where frames come from; or a list of sources"},
    )
    detector: str | tuple[str, ...] = attrs.field(
        default="inventory",
        validator=_words(DETECTORS),
        metadata={"help": "what names the things in them; or a list of detectors, each of which refines the former"},
    )
    llm: Any = attrs.field(  # a Choice: made by the configuration, opened by the run
        default=None,
        metadata={"backend": "llm", "help": "language model that looks, with its keys; default: the experiment's"},
    )
    cameras: tuple[str, ...] = attrs.field(default=(), metadata={"help": "cameras to use; empty: all of the source"})
    images: bool = attrs.field(default=False, metadata={"help": "keep RGB and depth in the observation"})
    items: tuple[Item, ...] = attrs.field(
        default=(), metadata={"help": "what may be on the table; empty: what the task's scene lists"}
    )
    simulated: SimulatedSettings | tuple[SimulatedSettings, ...] = attrs.field(
        default=SimulatedSettings(),
        validator=_not_empty,
        metadata={"help": "its section; or a list of sections, a source each"},
    )
    folder: FolderSettings = FolderSettings()
    inventory: InventorySettings = InventorySettings()
    marks: MarksSettings = MarksSettings()
    points: PointsSettings = PointsSettings()
    local: LocalSettings = LocalSettings()
    tags: TagsSettings = TagsSettings()
    realsense: RealsenseSettings = RealsenseSettings()
    orbbec: OrbbecSettings = OrbbecSettings()
