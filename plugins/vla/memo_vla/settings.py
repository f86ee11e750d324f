"""Settings of the method ``vla``, and their presets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeVar
from urllib.parse import urlsplit

import attrs
from attrs.validators import ge, gt, optional

from memo_core.plugin import InvalidArgument, close_match

ActionKind = Literal["joint-position", "joint-velocity", "delta-pose"]
GripperKind = Literal["closed", "sign", "width"]
Fit = Literal["pad", "crop"]

# What a state vector may be made of; ``observing.PARTS`` says how each is read.
STATE_PARTS = ("joints", "position", "rotation-vector", "fingers", "gripper-closed", "gripper-width")

_Value = TypeVar("_Value")


@attrs.frozen
class Layout:
    """Names, sizes and units of messages. A preset is one layout; settings replace single values."""

    rate_hz: float
    horizon: int
    actions: ActionKind
    action_scale: tuple[float, ...]
    gripper: GripperKind
    images: dict[str, str]
    state: dict[str, tuple[str, ...]]
    prompt: str = "prompt"
    image_size: tuple[int, int] = (224, 224)
    fit: Fit = "pad"
    rotate_180: bool = False
    image_values: Literal["bytes", "unit"] = "bytes"
    image_order: Literal["hwc", "chw"] = "hwc"


# openpi's examples/droid: 15 Hz, eight of ten actions, joint velocities where 1 means 0.2 rad a step, fingers 0 to 1.
DROID = Layout(
    rate_hz=15.0,
    horizon=8,
    actions="joint-velocity",
    action_scale=(0.2,),
    gripper="closed",
    images={"observation/exterior_image_1_left": "front", "observation/wrist_image_left": "wrist"},
    state={"observation/joint_position": ("joints",), "observation/gripper_position": ("gripper-closed",)},
)
# openpi's examples/libero: 20 Hz, five of ten actions, steps of the hand where 1 means 5 cm or 0.5 rad.
LIBERO = Layout(
    rate_hz=20.0,
    horizon=5,
    actions="delta-pose",
    action_scale=(0.05, 0.05, 0.05, 0.5, 0.5, 0.5),
    gripper="sign",
    images={"observation/image": "front", "observation/wrist_image": "wrist"},
    state={"observation/state": ("position", "rotation-vector", "fingers")},
)
# Joint positions and openings in SI units: nothing is rounded to open or closed, and steps cannot add up to an error.
JOINTS = Layout(
    rate_hz=10.0,
    horizon=5,
    actions="joint-position",
    action_scale=(1.0,),
    gripper="width",
    images={"observation/image": "front", "observation/wrist_image": "wrist"},
    state={"observation/state": ("joints", "gripper-width")},
)
PRESETS = {"droid": DROID, "libero": LIBERO, "joints": JOINTS}


def _websocket(instance: object, attribute: attrs.Attribute[str], value: str) -> None:
    parts = urlsplit(value)
    if parts.scheme not in ("ws", "wss") or not parts.hostname:
        raise InvalidArgument("method.url", f"{value!r} is no websocket's address", "such as ws://127.0.0.1:8000")


def _state_parts(instance: object, attribute: attrs.Attribute[Any], value: dict[str, tuple[str, ...]]) -> None:
    for key, parts in value.items():
        for part in parts:
            if part not in STATE_PARTS:
                given = f"{part!r} in {key!r} is no part of a state{close_match(part, STATE_PARTS)}"
                raise InvalidArgument("method.state", given, f"some of {', '.join(STATE_PARTS)}")


def _of_preset(help: str, check: Callable[..., Any] | None = None) -> Any:
    """A setting that is the preset's unless it is given."""
    return attrs.field(default=None, validator=optional(check) if check else None, metadata={"help": help})


@attrs.frozen
class VlaSettings:
    """Settings of the method ``vla``. Those that are null are the preset's."""

    url: str = attrs.field(
        default="ws://127.0.0.1:8000", validator=_websocket, metadata={"help": "address of the policy server"}
    )
    api_key_env: str = attrs.field(
        default="", metadata={"help": "environment variable with the server's key, if it wants one"}
    )
    timeout_s: float = attrs.field(
        default=30.0, validator=gt(0.0), metadata={"help": "seconds to wait for a connection, and for each answer"}
    )
    seconds: float = attrs.field(
        default=120.0, validator=gt(0.0), metadata={"help": "seconds of the robot's time after which the policy ends"}
    )
    still_s: float = attrs.field(
        default=4.0,
        validator=gt(0.0),
        metadata={"help": "seconds for which the policy keeps the arm still, after which it has ended"},
    )
    preset: Literal["droid", "libero", "joints"] = attrs.field(
        default="libero",
        metadata={
            "help": "what goes over the wire: droid, libero: as in openpi's examples of this name; joints: joint "
            "positions and the opening, in rad and m"
        },
    )
    rate_hz: float | None = _of_preset("actions for each second of the robot's time", gt(0.0))
    horizon: int | None = _of_preset("actions of a chunk that are executed before the next is asked for", ge(1))
    actions: ActionKind | None = _of_preset(
        "joint-position: rad; joint-velocity: a step of each joint; delta-pose: a step of the hand in the base frame, "
        "its position, then its rotation vector"
    )
    action_scale: tuple[float, ...] | None = _of_preset(
        "rad, or m and rad, that 1 means in the arm's part of an action; one value, or one each"
    )
    gripper: GripperKind | None = _of_preset(
        "last value of an action; closed: 0 open, 1 closed; sign: -1 open, 1 closed; width: m. The first two close "
        "from the middle on"
    )
    images: dict[str, str] | None = _of_preset("key of each picture: the camera that takes it")
    state: dict[str, tuple[str, ...]] | None = _of_preset(
        f"key of each vector: what it is made of ({', '.join(STATE_PARTS)})", _state_parts
    )
    prompt: str | None = _of_preset("key of the instruction")
    image_size: tuple[int, int] | None = _of_preset("width and height of pictures in pixels")
    fit: Fit | None = _of_preset("pad: the whole picture with black edges; crop: its middle")
    rotate_180: bool | None = _of_preset("turn pictures upside down, for policies that were trained so")
    image_values: Literal["bytes", "unit"] | None = _of_preset("bytes: uint8; unit: float32 from 0 to 1")
    image_order: Literal["hwc", "chw"] | None = _of_preset("hwc: height, width, colour; chw: colour first")

    @property
    def layout(self) -> Layout:
        """The preset with what is set here in place of its own."""
        given = {field.name: getattr(self, field.name) for field in attrs.fields(Layout)}
        return attrs.evolve(PRESETS[self.preset], **{name: one for name, one in given.items() if one is not None})
