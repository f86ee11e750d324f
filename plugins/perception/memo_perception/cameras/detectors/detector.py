"""What a detector must provide: names for what the pictures show. It measures nothing; geometry does."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Literal

import attrs
import numpy as np

from memo_core.plugin import Ask, PerceptionContext, Pose
from memo_perception.cameras.frames import Frame
from memo_perception.cameras.inventory import Hint, Item, Kind
from memo_perception.cameras.regions import Region

State = Literal["open", "closed", "unclear"]


Prompt = tuple[float, ...]  # px: a box (left, top, right, bottom) or a point (x, y)


@attrs.frozen(eq=False)
class Request:
    """Input of a detector. ``found``: what earlier stages of a chain detected; ``cut_out_later``: whether a
    later stage masks what this one only points at."""

    frames: tuple[Frame, ...]
    regions: tuple[Region, ...] = ()  # numbered pieces found by geometry; the arm and the bare table are not among them
    inventory: tuple[Item, ...] = ()  # may be empty
    hints: tuple[Hint, ...] = ()
    table_height: float = 0.0  # m, base frame
    noise: float = 0.001  # m, standard deviation of depth where the table is
    found: tuple[Detection, ...] = ()
    cut_out_later: bool = False


@attrs.frozen(eq=False)
class Detection:
    """One thing, or part of one, that a detector names.

    Where it is: ``masks`` and ``regions`` together (their union), or ``pose`` and ``size`` (full extents, m) of its box
    in the base frame, where a marker tells them; ``prompts`` say where a model pointed, by frame. ``part_of`` is the
    ``key`` of another detection of the same answer. A ``space`` (the inside of a container) may have neither mask nor
    region: its place follows from what it is part of.
    """

    label: str  # what a person calls it, without a number
    kind: Kind = "object"
    key: str = ""  # unique in an answer; empty: the label
    part_of: str | None = None
    state: State | None = None  # of what opens and closes; None: it does not
    masks: dict[str, np.ndarray] = attrs.field(factory=dict)  # frame name -> (H, W) bool
    regions: frozenset[int] = frozenset()
    confidence: float = 1.0  # 0 to 1: probability that the name is right
    source: str = ""  # name of the detector
    flag: str = ""  # why this may be wrong, in words; empty: nothing is known against it
    prompts: dict[str, Prompt] = attrs.field(factory=dict)
    refines: str = ""  # name of the detection of an earlier stage that this one is about
    pose: Pose | None = None
    size: tuple[float, float, float] | None = None

    @property
    def placed(self) -> bool:
        """Whether it is anywhere; the place of a space follows from what it is part of."""
        return bool(self.masks or self.regions or self.pose or self.kind == "space")

    def pixels(self, frame: Frame, regions: Iterable[Region]) -> np.ndarray | None:
        """Its mask (H, W) in a frame; None if it has none there."""
        masks = [self.masks[frame.name]] if frame.name in self.masks else []
        masks += [one.masks[frame.name] for one in regions if one.id in self.regions and frame.name in one.masks]
        return np.logical_or.reduce(masks) if masks else None

    @property
    def name(self) -> str:
        """The key, or the label if none is set."""
        return self.key or self.label


class Detector(ABC):
    """Names what frames show. The constructor touches nothing; ``open`` loads and connects, ``close`` is idempotent."""

    asks_model: bool = False  # whether a look costs a question to a language model
    needs_regions: bool = True  # whether requests have regions; they take time to find
    needs_sizes: bool = False  # whether regions have sizes; they take time to measure
    cuts_out: bool = False  # whether it masks what earlier stages of a chain point at
    refines: bool = False  # set by a chain: whether there are earlier stages

    def open(self) -> None:
        """Raises ``BackendUnavailable`` with the remedy."""

    def start(self, context: PerceptionContext | None) -> None:
        """Bind to an environment, before the first ``detect``; None when there is no robot."""

    def use_model(self, ask: Ask) -> None:
        """Given before ``start`` wherever there is a language model. The default has no use for it."""

    @abstractmethod
    def detect(self, request: Request) -> tuple[Detection, ...]:
        """What is seen, whole things before their parts, at most one detection per thing. May take time. A name that
        is only guessed is left out, or has a low confidence and a ``flag``."""

    def close(self) -> None: ...
