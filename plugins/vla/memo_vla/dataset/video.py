"""Videos of one camera and one episode, written and read with imageio-ffmpeg (H.264, yuv420p)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

CODEC, PIXELS = "h264", "yuv420p"
# Training reads single frames, so a key frame is never far; the quality is what LeRobot's readers expect of H.264.
_GROUP, _QUALITY = 2, 20
_EVERY, _COARSE = 5, 4  # frames, and pixels of them along each side, that statistics are made of


class PictureStatistics:
    """Running statistics of each colour over some pixels of some frames; values from 0 to 1."""

    def __init__(self) -> None:
        self._seen = 0
        self._parts: list[np.ndarray] = []  # of shape (N, 3)

    def add(self, picture: np.ndarray) -> None:
        """Look at a picture, uint8, shape (H, W, 3)."""
        if self._seen % _EVERY == 0:
            self._parts.append(picture[::_COARSE, ::_COARSE].reshape(-1, 3))
        self._seen += 1

    @property
    def pixels(self) -> np.ndarray:
        """The colours looked at, shape (N, 3), from 0 to 1."""
        return np.concatenate(self._parts) / 255.0

    @property
    def frames(self) -> int:
        return len(self._parts)


class Video:
    """A video that is being written; the file is complete after ``close``."""

    def __init__(self, path: Path, size: tuple[int, int], rate_hz: float) -> None:
        """Start the encoder.

        Args:
            path: file to write.
            size: width and height in pixels, both even.
            rate_hz: frames a second.
        """
        import imageio_ffmpeg

        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self.statistics = PictureStatistics()
        quality = ["-preset", "veryfast", "-crf", str(_QUALITY), "-g", str(_GROUP), "-bf", "0", "-threads", "1"]
        self._frames: Any = imageio_ffmpeg.write_frames(
            str(path),
            size,
            fps=rate_hz,
            codec="libx264",
            quality=None,
            pix_fmt_out=PIXELS,
            macro_block_size=2,
            ffmpeg_log_level="error",
            output_params=[*quality, "-movflags", "+faststart"],
        )
        self._frames.send(None)

    def add(self, picture: np.ndarray) -> None:
        """Add a frame, RGB, uint8, shape (H, W, 3). Raises ``OSError`` if the encoder has ended."""
        self.statistics.add(picture)
        self._frames.send(np.ascontiguousarray(picture))

    def close(self) -> Path:
        """Finish the file; returns its path."""
        self._frames.close()
        return self.path

    def discard(self) -> None:
        """Stop, and remove the file."""
        self._frames.close()
        self.path.unlink(missing_ok=True)


def read_video(path: Path, most: int | None = None) -> Iterator[np.ndarray]:
    """Frames of a video, RGB, uint8, shape (H, W, 3).

    Args:
        path: the file.
        most: number of frames to read at most; None: all.

    Raises:
        OSError: if it cannot be read.
    """
    import imageio_ffmpeg

    limit = [] if most is None else ["-frames:v", str(most)]
    reader = imageio_ffmpeg.read_frames(str(path), output_params=limit)
    width, height = next(reader)["size"]
    for frame in reader:
        yield np.frombuffer(frame, np.uint8).reshape(height, width, 3)
