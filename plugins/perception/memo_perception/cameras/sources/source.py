"""What a source of frames must provide."""

from __future__ import annotations

from abc import ABC, abstractmethod

from memo_core.plugin import PerceptionContext
from memo_perception.cameras.frames import Frame


class Source(ABC):
    """Takes pictures. The constructor touches no device; ``open`` connects, ``close`` disconnects and is idempotent."""

    def open(self) -> None:
        """Connect. Raises ``BackendUnavailable`` with the remedy."""

    def start(self, context: PerceptionContext | None) -> None:
        """Bind to an environment, before the first ``capture``; None when there is no robot (``memo see``)."""

    @abstractmethod
    def capture(self) -> tuple[Frame, ...]:
        """One frame from each camera, taken as nearly at the same time as the source can. May take time. Raises
        ``BackendUnavailable`` when a camera does not answer."""

    def state(self) -> bytes:
        """What must be restored for the same pictures to come again (a noise generator); belongs to a checkpoint."""
        return b""

    def restore(self, state: bytes) -> None: ...

    def close(self) -> None: ...
