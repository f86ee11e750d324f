"""Pictures of what the robot saw, for plan and code prompts (``policy.images``), as in the paper."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import BackendUnavailable
from memo_core.interfaces.llm import Image, Message
from memo_core.plugins.installing import install
from memo_core.runlog.whole_files import write_whole
from memo_core.scene.pose import Array

FOLDER = "pictures/prompts"
_TOLD = """

## Pictures
With this come pictures that the robot's cameras took just now, in this order: {cameras}. The numbers in the table \
of the scene are measured; take from the pictures what it does not say.
"""


@attrs.frozen
class Picture:
    """What one camera saw."""

    camera: str
    image: Image


def png(picture: Array) -> bytes:
    """RGB, uint8, shape (H, W, 3), as the content of a PNG file. Raises ``BackendUnavailable`` without pillow."""
    content = io.BytesIO()
    image_of(picture).save(content, "PNG")
    return content.getvalue()


def image_of(picture: Array) -> Any:
    """A pillow image of RGB, uint8, shape (H, W, 3). Raises ``BackendUnavailable`` without pillow."""
    try:
        from PIL import Image as Pillow
    except ImportError as error:
        remedy = install("memo-core[video]")
        raise BackendUnavailable("picture writer", "pillow", "it is not installed", remedy) from error
    return Pillow.fromarray(picture)


def taken(pictures: Mapping[str, Array]) -> tuple[Picture, ...]:
    """Pictures by the cameras' names, RGB, uint8, shape (H, W, 3), as prompts have them."""
    return tuple(Picture(camera, Image(png(rgb))) for camera, rgb in sorted(pictures.items()))


class PictureFiles:
    """Keeps pictures beside a run's log, each under its digest, for when the run is resumed. Without a folder they are
    kept in memory."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._kept: dict[str, Image] = {}

    def keep(self, pictures: Sequence[Picture]) -> list[dict[str, str]]:
        """What the log says of them. On disk when this returns."""
        for one in pictures:
            if self._folder is None:
                self._kept[one.image.digest] = one.image
            elif not (file := self._file(one.image.digest)).exists():
                write_whole(file, one.image.data)
        return [{"camera": one.camera, "digest": one.image.digest} for one in pictures]

    def read(self, record: Sequence[dict[str, Any]]) -> tuple[Picture, ...]:
        """The inverse of ``keep``; a picture that was removed is left out."""
        found = []
        for one in record:
            digest = str(one["digest"])
            image = self._kept.get(digest)
            if image is None and self._folder is not None and self._file(digest).is_file():
                image = Image(self._file(digest).read_bytes())
            if image is not None:
                found.append(Picture(str(one["camera"]), image))
        return tuple(found)

    def _file(self, digest: str) -> Path:
        assert self._folder is not None
        return self._folder / FOLDER / f"{digest[:24]}.png"


def with_pictures(messages: tuple[Message, ...], pictures: Sequence[Picture]) -> tuple[Message, ...]:
    """The messages of a request with pictures and their cameras' names in the last one."""
    if not pictures:
        return messages
    *before, last = messages
    told = _TOLD.format(cameras=", ".join(one.camera for one in pictures))
    return (*before, attrs.evolve(last, text=last.text.rstrip() + told, images=tuple(one.image for one in pictures)))
