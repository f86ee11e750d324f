"""An environment that records a video of every attempt and an image of its end, if the simulator can render."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import attrs
import numpy as np

from memo_core.environment.hardware import World
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.errors import BackendUnavailable
from memo_core.events import Event, Problem, SubtaskStarted
from memo_core.interfaces.teacher import Episode, Sighting, TaskEpisode
from memo_core.policy.settings import RunSettings
from memo_core.runs.folder import attempt_name, file_name
from memo_core.runs.video import Recording, save_picture, write_picture

_Shown = TypeVar("_Shown", Episode, TaskEpisode)


class Filmed:
    """An environment that records while a teacher watches (``start_watching``). If it cannot record, that is reported
    once."""

    def __init__(self, world: World, folder: Path, settings: RunSettings, emit: Callable[[Event], None]) -> None:
        self._world = world
        self._folder = folder
        self._settings = settings
        self._emit = emit
        cameras = world.description.cameras if isinstance(world, SimulatedEnvironment) else ()
        self._camera = cameras[0].name if cameras and settings.video == "auto" else ""
        self._name = "attempt"
        self._names: dict[int, str] = {}  # of the latest attempt at each subtask, by its number
        self._film: Recording | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._world, name)

    def heard(self, event: Event) -> None:
        """Determines from events which attempt is recorded next. Receives every event of the run, also replayed
        ones."""
        if isinstance(event, SubtaskStarted):
            attempt = attempt_name(event.attempt, event.take)
            self._name = f"{event.number:02d}-{file_name(event.subtask)}-{attempt}"
            self._names[event.number] = self._name

    def shown(self, episode: _Shown) -> _Shown:
        """The episode with the paths of existing videos and images: of the latest attempt, or, for a whole task, of the
        latest attempt at each subtask."""
        names = self._names.values() if isinstance(episode, TaskEpisode) else (self._name,)
        files = [path for name in names for path in (self._video(name), self._folder / _picture_name(name))]
        return attrs.evolve(episode, recordings=tuple(str(path) for path in files if path.is_file()))

    def start_watching(self, seen: tuple[Sighting, ...] = ()) -> None:
        self.close()
        self._world.start_watching(seen)
        if not self._camera:
            return
        assert isinstance(self._world, SimulatedEnvironment)
        self._film = Recording(
            self._world.simulator,
            self._camera,
            self._video(self._name),
            self._no_pictures,
            fps=self._settings.video_fps,
            width=self._settings.video_width // 16 * 16,
        )
        self._film.start()

    def stop_watching(self) -> tuple[Sighting, ...]:
        seen = self._world.stop_watching()
        filmed = self._film is not None
        self.close()
        if filmed and self._camera:
            self._picture(_picture_name(self._name))
        return seen

    def with_pictures(self, episode: Episode) -> Episode:
        """The episode with camera images of the subtask's start, if there are any."""
        shown = tuple(self._kept(name, picture) for name, picture in episode.before.observation.rgb.items())
        return attrs.evolve(episode, recordings=(*episode.recordings, *shown))

    def _kept(self, camera: str, picture: np.ndarray) -> str:
        path = self._folder / f"pictures/{self._name}-before-{file_name(camera)}.png"
        write_picture(picture, path)
        return str(path)

    def close(self) -> None:
        """Finish the recording. Idempotent."""
        film, self._film = self._film, None
        if film is not None:
            film.stop()

    def _video(self, name: str) -> Path:
        return self._folder / "video" / f"{name}.mp4"

    def _picture(self, name: str) -> None:
        assert isinstance(self._world, SimulatedEnvironment)
        try:
            save_picture(self._world.simulator, self._camera, self._folder / name)
        except (BackendUnavailable, OSError) as error:
            self._no_pictures(Problem("pictures", str(error)))

    def _no_pictures(self, problem: Problem) -> None:
        self._camera = ""
        self._emit(problem)


def _picture_name(name: str) -> str:
    return f"pictures/{name}.png"
