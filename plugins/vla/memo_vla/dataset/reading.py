"""Reading a dataset that ``memo demonstrate`` wrote."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import attrs
import cattrs
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from memo_core.plugin import InvalidArgument
from memo_vla.dataset.columns import Names, names_of
from memo_vla.dataset.format import DATA_PATHS, VIDEO_PATHS, place
from memo_vla.dataset.video import read_video
from memo_vla.dataset.writer import MEMO, Kind


@attrs.frozen(eq=False)
class Episode:
    """An episode as it was recorded: ``columns`` by name, shape (T, …)."""

    number: int
    instruction: str
    about: dict[str, Any]
    columns: dict[str, Any]


class Dataset:
    """A dataset in a folder, of either version."""

    def __init__(self, folder: Path) -> None:
        """Read what describes it.

        Args:
            folder: the dataset's folder.

        Raises:
            InvalidArgument: if there is no dataset of MEMO's.
        """
        try:
            kept = json.loads((folder / MEMO).read_text(encoding="utf-8"))
            self.info: dict[str, Any] = json.loads((folder / "meta/info.json").read_text(encoding="utf-8"))
            self.kind: Kind = cattrs.structure(kept["kind"], Kind)
        except (OSError, ValueError, KeyError, cattrs.BaseValidationError) as error:
            problem = f"{folder} is no dataset of memo demonstrate ({type(error).__name__}: {error})"
            raise InvalidArgument("DATASET", problem, "a folder that it wrote") from None
        self.folder = folder
        self.names: Names = names_of(self.kind.version, self.kind.cameras)
        self._episodes = kept["episodes"][: self.info["total_episodes"]]

    def __len__(self) -> int:
        return len(self._episodes)

    def episode(self, number: int) -> Episode:
        """Read an episode's columns."""
        about = self._episodes[number]["about"]
        table = pq.read_table(self.folder / place(DATA_PATHS[self.kind.version], number))
        columns = {name: _values(table[name]) for name in table.column_names}
        return Episode(number, about["instruction"], about, columns)

    def pictures(self, number: int, camera: str, most: int | None = None) -> Iterator[np.ndarray]:
        """The pictures of a camera in an episode, the first ``most`` of them, RGB, uint8, shape (H, W, 3)."""
        path = place(VIDEO_PATHS[self.kind.version], number, self.names.pictures[camera])
        return read_video(self.folder / path, most)


def _values(column: Any) -> Any:
    """Numbers as an array; language rows as lists."""
    rows = column.to_pylist()
    return rows if pa.types.is_list(column.type) else np.asarray(rows)
