"""Recording a simulator's camera as an mp4 (H.264, yuv420p), with frames at equal steps of simulated time. A recording
never makes a run fail: if rendering or encoding is not possible, one ``Problem`` is reported."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from memo_core.errors import BackendUnavailable, InvalidArgument, MemoError
from memo_core.events import Problem
from memo_core.interfaces.simulator import Simulator
from memo_core.plugins.installing import install
from memo_core.policy.pictures import image_of

_PATIENCE_S = 20.0  # for the encoder to write its last frames


class Encoder:
    """An ffmpeg process that encodes frames of one size. The file appears under its name only when it is complete."""

    def __init__(self, path: Path, width: int, height: int, fps: float) -> None:
        """Raises ``BackendUnavailable`` without imageio-ffmpeg, and ``OSError`` if the folder cannot be written."""
        try:
            import imageio_ffmpeg
        except ImportError as error:
            remedy = install("memo-core[video]")
            raise BackendUnavailable("video encoder", "imageio-ffmpeg", "it is not installed", remedy) from error
        self._path = path
        self._shape = (height, width, 3)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._partial = path.with_suffix(".part.mp4")
        size = f"{width}x{height}"
        command = [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error"]
        command += ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", f"{fps:g}", "-i", "-", "-an"]
        # yuv420p wants even sizes; one thread leaves the other core to the run.
        command += ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-preset", "veryfast", "-crf", "26"]
        command += ["-pix_fmt", "yuv420p", "-threads", "1", "-movflags", "+faststart", str(self._partial)]
        # A session of its own: Ctrl-C means "stop the robot", not "stop recording".
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )

    def write(self, frame: np.ndarray) -> None:
        """Add a frame, uint8, shape (height, width, 3). Raises ``OSError`` when the encoder has died."""
        if frame.shape != self._shape or frame.dtype != np.uint8:
            problem = f"{frame.dtype} of shape {frame.shape}"
            raise InvalidArgument("frame", problem, f"uint8 of shape {self._shape}")
        assert self._process.stdin is not None
        self._process.stdin.write(np.ascontiguousarray(frame).data)

    def close(self) -> None:
        """Finish the file. Raises ``OSError`` with ffmpeg's message on failure."""
        process = self._process
        try:
            _, errors = process.communicate(timeout=_PATIENCE_S)
        except (subprocess.TimeoutExpired, BrokenPipeError) as error:
            process.kill()
            process.wait()
            self._partial.unlink(missing_ok=True)
            raise OSError(f"ffmpeg did not finish {self._partial.name}: {error}") from error
        if process.returncode != 0:
            self._partial.unlink(missing_ok=True)
            words = errors.decode(errors="replace").strip().splitlines()
            raise OSError(f"ffmpeg could not write {self._path.name}: {words[-1] if words else process.returncode}")
        self._partial.replace(self._path)


class Recording:
    """Records one camera while it is open. Use as a context manager, or ``start`` and ``stop``.

    ``report`` receives at most one ``Problem``, if recording is not possible. If time jumps back (a restored
    checkpoint), the same video continues.
    """

    def __init__(
        self,
        simulator: Simulator,
        camera: str,
        path: Path,
        report: Callable[[Problem], None],
        fps: float = 8.0,
        width: int = 640,
        height: int | None = None,
    ) -> None:
        if fps <= 0:
            raise InvalidArgument("fps", f"is {fps}", "more than 0")
        self._simulator = simulator
        self._camera = camera
        self._path = Path(path)
        self._report = report
        self._period = 1.0 / fps
        self._size = (width, height or width * 3 // 4)
        self._encoder: Encoder | None = None
        self._next = self._last = 0.0
        self.frames = 0

    @property
    def active(self) -> bool:
        """Whether frames are being recorded."""
        return self._encoder is not None

    def start(self) -> None:
        """Record the first frame now and further frames as time passes."""
        try:
            first = self._simulator.render(self._camera, *self._size)
            self._encoder = Encoder(self._path, *self._size, 1.0 / self._period)
            self._write(first)
        except (MemoError, OSError) as error:
            self._give_up(error)
            return
        self._last = self._simulator.time
        self._next = self._last + self._period
        self._simulator.add_tick_listener(self._tick)

    def stop(self) -> Path | None:
        """Finish the video; returns its path, or None if there is none. Idempotent."""
        if self._encoder is None:
            return self._path if self.frames and self._path.exists() else None
        self._simulator.remove_tick_listener(self._tick)
        encoder, self._encoder = self._encoder, None
        try:
            encoder.close()
        except OSError as error:
            self._report(Problem(f"video {self._path.name}", str(error)))
            return None
        return self._path

    def __enter__(self) -> Recording:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _tick(self) -> None:
        time = self._simulator.time
        if time < self._last:
            self._next = time
        self._last = time
        if time + 1e-9 < self._next:
            return
        self._next += self._period
        try:
            self._write(self._simulator.render(self._camera, *self._size))
        except (MemoError, OSError) as error:
            self._give_up(error)

    def _write(self, frame: np.ndarray) -> None:
        assert self._encoder is not None
        self._encoder.write(frame)
        self.frames += 1

    def _give_up(self, error: Exception) -> None:
        """Stop recording; the run continues."""
        self._simulator.remove_tick_listener(self._tick)
        encoder, self._encoder = self._encoder, None
        if encoder is not None:
            with contextlib.suppress(OSError):
                encoder.close()
        self._report(Problem(f"video {self._path.name}", f"not recorded: {error}"))


def save_picture(simulator: Simulator, camera: str, path: Path, width: int = 640, height: int | None = None) -> None:
    """Write the camera's present image as a PNG. Raises ``BackendUnavailable`` if rendering is not possible."""
    write_picture(simulator.render(camera, width, height or width * 3 // 4), path)


def write_picture(picture: np.ndarray, path: Path) -> None:
    """RGB, uint8, shape (H, W, 3), as a PNG. Raises ``BackendUnavailable`` if no encoder is installed."""
    image = image_of(picture)
    path.parent.mkdir(parents=True, exist_ok=True)
    image.save(path, optimize=False)
