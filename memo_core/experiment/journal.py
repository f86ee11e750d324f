"""The journal of a run in a world: the run's folder, and a video of every attempt where the simulator can draw."""

from __future__ import annotations

from collections.abc import Callable

from memo_core.errors import BackendUnavailable
from memo_core.events import Event, Problem
from memo_core.experiment.folder import RunFolder, attempt_name, file_name
from memo_core.experiment.video import Recording, save_picture
from memo_core.experiment.world import World
from memo_core.interfaces.llm import Answer, Request, Usage
from memo_core.policy.progress import Progress
from memo_core.policy.settings import RunSettings


class WorldJournal:
    """A journal (``memo_core.policy.session.Journal``) that also films. What cannot be filmed is said once."""

    def __init__(
        self,
        folder: RunFolder,
        world: World,
        settings: RunSettings,
        emit: Callable[[Event], None],
        keep: Callable[[Progress], None] = lambda progress: None,
    ) -> None:
        """``keep`` writes down how far the run has come."""
        self._folder = folder
        self._world = world
        self._settings = settings
        self._emit = emit
        cameras = world.description.cameras
        self._camera = cameras[0].name if cameras and settings.video == "auto" else ""
        self._subtask = self._name = ""
        self._keep = keep
        self._film: Recording | None = None

    def model_call(
        self, request: Request, answer: Answer | None, problem: str, abandoned: bool, usage: Usage | None = None
    ) -> str:
        return self._folder.model_call(request, answer, problem, abandoned, usage)

    def code(self, subtask: str, attempt: int, repair: int, code: str, take: int = 1) -> str:
        return self._folder.code(subtask, attempt, repair, code, take)

    def planning_start(self, number: int, done: tuple[str, ...], checkpoint: bytes) -> None:
        self._folder.planning_start(number, done, checkpoint)

    def subtask_start(self, number: int, subtask: str, done: tuple[str, ...], checkpoint: bytes) -> None:
        self._folder.subtask_start(number, subtask, done, checkpoint)

    def attempt_over(self, number: int, subtask: str, done: tuple[str, ...], checkpoint: bytes) -> None:
        self._folder.attempt_over(number, subtask, done, checkpoint)

    def progress(self, progress: Progress) -> None:
        self._subtask = progress.key
        self._folder.at_subtask(progress.number)
        self._keep(progress)

    def attempt_begins(self, number: int, attempt: int, take: int = 1) -> None:
        self.close()
        self._name = f"{number:02d}-{file_name(self._subtask)}-{attempt_name(attempt, take)}"
        if not self._camera:
            return
        width = self._settings.video_width // 16 * 16
        self._film = Recording(
            self._world.simulator,
            self._camera,
            self._folder.path / "video" / f"{self._name}.mp4",
            self._no_pictures,
            fps=self._settings.video_fps,
            width=width,
        )
        self._film.start()

    def attempt_ends(self, number: int, attempt: int) -> None:
        self.close()
        if self._camera:
            self._picture(f"pictures/{self._name}.png")

    def close(self) -> None:
        """Idempotent."""
        film, self._film = self._film, None
        if film is not None:
            film.stop()

    def _picture(self, name: str) -> None:
        try:
            save_picture(self._world.simulator, self._camera, self._folder.path / name)
        except (BackendUnavailable, OSError) as error:
            self._no_pictures(Problem("pictures", str(error)))

    def _no_pictures(self, problem: Problem) -> None:
        self._camera = ""
        self._emit(problem)
