"""One self-contained HTML page about a demo: outcomes, code before and after, feedback, retrieved and new entries, and
images if there are any."""

from __future__ import annotations

import base64
import difflib
import logging
from importlib import resources
from io import BytesIO
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from memo_core.demo.result import DemoReport
from memo_core.report.run_reader import Story, Try, read_story

STRIP = 5  # pictures of an attempt
STRIP_WIDTH = 320  # pixels
LOOK_WIDTH = 480  # pixels, of what perception saw in a look: its names must be legible


def write_demo_report(report: DemoReport) -> Path:
    """Write ``report.html`` into the demo's folder; returns its path."""
    chapters: list[dict[str, Any]] = []
    for part in report.chapters:
        if part.name not in report.runs:
            continue
        run = report.runs[part.name]
        story = read_story(run.folder)
        chapters.append({"part": part, "run": run, "story": story, "why": report.why()[part.name]})
    page = (
        _environment()
        .get_template("report.html.j2")
        .render(
            report=report,
            chapters=chapters,
            pictures=_Pictures(),
            changes=changes,
        )
    )
    path = report.folder / "report.html"
    path.write_text(page, encoding="utf-8")
    return path


def changes(before: str, after: str) -> list[tuple[str, str]]:
    """The lines of ``after``, each marked as "same" or "new" compared with ``before``."""
    lines = after.splitlines()
    blocks = difflib.SequenceMatcher(None, before.splitlines(), lines).get_matching_blocks()
    same = {place for block in blocks for place in range(block.b, block.b + block.size)}
    return [("same" if place in same else "new", line) for place, line in enumerate(lines)]


def _environment() -> jinja2.Environment:
    def load(name: str) -> str:
        return resources.files("memo_core.demo").joinpath(name).read_text(encoding="utf-8")

    return jinja2.Environment(
        loader=jinja2.FunctionLoader(load),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


class _Pictures:
    """Images of attempts as data URIs; empty if there are none."""

    def strip(self, one: Try) -> list[str]:
        """Frames of the attempt's video, evenly spaced in time, the last one included."""
        frames = _frames(one.video) if one.video else []
        if not frames and one.picture:
            return [_data_uri(one.picture.read_bytes(), "image/png")]
        chosen = [frames[round(i)] for i in np.linspace(0, len(frames) - 1, min(STRIP, len(frames)))] if frames else []
        return [_jpeg(frame) for frame in chosen]

    def looks(self, story: Story) -> list[list[str]]:
        """What perception saw in each look, with boxes and names."""
        return [[_scaled(picture) for picture in pictures] for pictures in story.looks]

    def last(self, story: Story) -> str:
        """The last frame."""
        for act in reversed(story.acts):
            for one in reversed(act.tries):
                found = self.strip(one)
                if found:
                    return found[-1]
        return ""


def _frames(video: Path) -> list[np.ndarray]:
    """All frames, scaled down. Empty if the video cannot be read."""
    try:
        import imageio_ffmpeg

        logging.getLogger("imageio_ffmpeg").setLevel(logging.ERROR)  # it warns that pictures are scaled, as asked
        reader = imageio_ffmpeg.read_frames(str(video), output_params=["-vf", f"scale={STRIP_WIDTH}:-2"])
        width, height = next(reader)["size"]
        return [np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in reader]
    except Exception:  # a video that ends early, no ffmpeg: the page has fewer pictures
        return []


def _scaled(picture: Path) -> str:
    """A picture in a file; empty if it cannot be read."""
    from PIL import Image

    try:
        with Image.open(picture) as opened:
            opened.thumbnail((LOOK_WIDTH, LOOK_WIDTH))
            return _jpeg(np.asarray(opened.convert("RGB")))
    except (OSError, ValueError):
        return ""


def _jpeg(frame: np.ndarray) -> str:
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(frame).save(buffer, "JPEG", quality=82)
    return _data_uri(buffer.getvalue(), "image/jpeg")


def _data_uri(data: bytes, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
