"""An environment that films: a video of every attempt where the simulator can draw, and a picture of how it ended."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.errors import BackendUnavailable
from memo_core.events import Event, Problem, SubtaskStarted
from memo_core.interfaces.teacher import Sighting
from memo_core.policy.settings import RunSettings
from memo_core.runs.folder import attempt_name, file_name
from memo_core.runs.video import Recording, save_picture


class Filmed:
    """A ``SimulatedEnvironment`` that is filmed while somebody watches (``start_watching``). What cannot be filmed is said once."""

    def __init__(self, world: SimulatedEnvironment, folder: Path, settings: RunSettings, emit: Callable[[Event], None]) -> None:
        self._world = world
        self._folder = folder
        self._settings = settings
        self._emit = emit
        cameras = world.description.cameras
        self._camera = cameras[0].name if cameras and settings.video == "auto" else ""
        self._name = "attempt"
        self._film: Recording | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._world, name)

    def heard(self, event: Event) -> None:
        """Which attempt is filmed next. Every event of the run comes here, also those that were sent before."""
        if isinstance(event, SubtaskStarted):
            attempt = attempt_name(event.attempt, event.take)
            self._name = f"{event.number:02d}-{file_name(event.subtask)}-{attempt}"

    def start_watching(self, seen: tuple[Sighting, ...] = ()) -> None:
        self.close()
        self._world.start_watching(seen)
        if not self._camera:
            return
        self._film = Recording(
            self._world.simulator,
            self._camera,
            self._folder / "video" / f"{self._name}.mp4",
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
            self._picture(f"pictures/{self._name}.png")
        return seen

    def close(self) -> None:
        """End the film. Idempotent."""
        film, self._film = self._film, None
        if film is not None:
            film.stop()

    def _picture(self, name: str) -> None:
        try:
            save_picture(self._world.simulator, self._camera, self._folder / name)
        except (BackendUnavailable, OSError) as error:
            self._no_pictures(Problem("pictures", str(error)))

    def _no_pictures(self, problem: Problem) -> None:
        self._camera = ""
        self._emit(problem)
