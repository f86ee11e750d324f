"""What a perception backend must provide: one look at the scene."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import attrs
import numpy as np

from memo_core.interfaces.link import Link
from memo_core.interfaces.llm import Answer, Request
from memo_core.interfaces.simulator import Simulator
from memo_core.robot.description import RobotDescription
from memo_core.scene.description import SceneDescription
from memo_core.scene.graph import SceneGraph
from memo_core.scene.name_corrections import NameCorrection
from memo_core.scene.pose import Pose

Ask = Callable[[Request], Answer]


@attrs.frozen(eq=False)
class PerceptionContext:
    """What a perception backend may use. ``simulator`` and ``scene`` are None on hardware."""

    rng: np.random.Generator
    robot: RobotDescription
    link: Link
    tool_pose: Callable[[], Pose]  # where the tool frame is, by the robot's own kinematics
    simulator: Simulator | None = None
    scene: SceneDescription | None = None


class Perception(ABC):
    """Observes the scene. ``start`` binds it to an environment; object ids stay the same from look to look."""

    def open(self) -> None: ...

    def close(self) -> None: ...

    def use_model(self, ask: Ask) -> None:
        """Receive access to the language model, if there is one; called before ``start``. By default ignored.

        It is the experiment's, or the one that the backend's settings name in a field ``llm``
        (``metadata={"backend": "llm"}``), which users write as ``perception.llm``.

        Args:
            ask: answers a request within the run's budget; raises ``LanguageModelError``, ``BudgetExceeded`` or
                ``Stopped``.
        """

    def show_looks(self, show: Callable[[dict[str, bytes]], None]) -> None:
        """Receive a recorder of pictures; called before ``start`` if pictures are stored. By default ignored.

        Args:
            show: to be called after every ``look`` (not ``glance``) with what was seen, drawn over each camera's
                picture: camera -> PNG.
        """

    def correct_names(self, corrections: tuple[NameCorrection, ...]) -> None:
        """Receive corrections of names that people gave, for all later looks and glances. By default ignored.

        A backend that names objects itself applies them (``memo_core.scene.name_corrections.corrected``).

        Args:
            corrections: the corrections, oldest first, in addition to those of earlier calls.
        """

    @abstractmethod
    def start(self, context: PerceptionContext) -> None: ...

    @abstractmethod
    def look(self) -> SceneGraph:
        """The scene graph as seen now. May take time."""

    def drawn(self) -> dict[str, np.ndarray]:
        """Pictures with the graph of the last look drawn over them, by camera: RGB, uint8, (H, W, 3). Empty before a
        look, and by default."""
        return {}

    def pictures(self) -> dict[str, np.ndarray]:
        """What the cameras saw at the last look, by camera: RGB, uint8, (H, W, 3). Empty before a look, and by
        default: then those in the observation are used, if it has any."""
        return {}

    def photograph(self) -> dict[str, np.ndarray]:
        """Take pictures of this moment, by camera: RGB, uint8, (H, W, 3), for policies that see. By default those of a
        look; a backend with cameras takes them without making a graph, since they are wanted many times a second."""
        graph = self.look()
        return dict(self.pictures() or graph.observation.rgb)

    def state(self) -> bytes:
        """State that belongs to a checkpoint (random generator, known ids)."""
        return b""

    def restore(self, state: bytes) -> None: ...

    def glance(self) -> SceneGraph:
        """What a person beside the robot sees now, for teachers: true poses without noise or dropout, if the backend
        knows them. No state changes and no random number is drawn, so that watching has no effect. The default takes a
        look and restores the state."""
        state = self.state()
        try:
            return self.look()
        finally:
            self.restore(state)


def names_things(perception: Perception) -> bool:
    """Whether perception uses what people said of names: else no book need be searched for it."""
    return type(perception).correct_names is not Perception.correct_names
