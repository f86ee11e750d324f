"""Several sources as one: two makes of cameras give one set of views."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import ExitStack

from memo_core.plugin import InvalidArgument, PerceptionContext
from memo_perception.cameras.frames import Frame
from memo_perception.cameras.settings import CamerasSettings
from memo_perception.cameras.sources import SOURCES
from memo_perception.cameras.sources.source import Source
from memo_perception.cameras.stages import stages_of


def source_from(settings: CamerasSettings) -> Source:
    """The source or sources that the settings name, unopened."""
    sources: list[Source] = stages_of(SOURCES, settings.source, settings)
    return sources[0] if len(sources) == 1 else Together(sources)


class Together(Source):
    """The frames of all sources, in their order. The names of cameras must be unique."""

    def __init__(self, sources: Sequence[Source]) -> None:
        self.sources = tuple(sources)

    def open(self) -> None:
        """Open all, or none."""
        with ExitStack() as opened:
            for source in self.sources:
                source.open()
                opened.callback(source.close)
            opened.pop_all()

    def start(self, context: PerceptionContext | None) -> None:
        for source in self.sources:
            source.start(context)

    def capture(self) -> tuple[Frame, ...]:
        """Raises ``InvalidArgument`` when two cameras have one name."""
        frames = tuple(frame for source in self.sources for frame in source.capture())
        names = [frame.name for frame in frames]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InvalidArgument("perception.source", f"two cameras are called {twice[0]!r}", "names that differ")
        return frames

    def state(self) -> bytes:
        return json.dumps([source.state().decode() for source in self.sources]).encode()

    def restore(self, state: bytes) -> None:
        for source, own in zip(self.sources, json.loads(state), strict=True):
            source.restore(own.encode())

    def close(self) -> None:
        with ExitStack() as closing:
            for source in self.sources:
                closing.callback(source.close)
