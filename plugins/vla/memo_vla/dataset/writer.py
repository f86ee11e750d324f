"""Writing a dataset episode by episode. An episode is in it when ``meta/info.json`` counts it; what a crash leaves
beyond that is written over."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import attrs
import cattrs
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from memo_core.plugin import InvalidArgument, RobotDescription
from memo_vla.dataset import statistics
from memo_vla.dataset.columns import columns_of, features_of, names_of
from memo_vla.dataset.format import (
    CHUNK,
    DATA_PATHS,
    EPISODES_V3,
    EVENTS,
    FIXED,
    PERSISTENT,
    VIDEO_PATHS,
    Version,
    events_column,
    fixed_features,
    flattened,
    persistent_column,
    picture_feature,
    place,
    tasks_table,
)
from memo_vla.dataset.recorder import Recording, Said
from memo_vla.dataset.video import CODEC, PIXELS
from memo_vla.settings import Layout

MEMO = "meta/memo.json"  # what only MEMO reads
_INFO = "meta/info.json"
_LASTING = ("subtask", "memory")  # styles of ``language_persistent``


@attrs.frozen
class Kind:
    """Properties that all episodes of a dataset have in common."""

    version: Version
    rate_hz: int
    layout: Layout
    cameras: tuple[str, ...]
    height: int
    robot: str


@attrs.frozen
class About:
    """The task, scene and outcome of an episode. ``source`` is ``reference`` or the folder of a run."""

    task: str  # name
    instruction: str
    seed: int
    source: str
    success: bool
    reason: str


class DatasetWriter:
    """A dataset in a folder, begun or gone on with."""

    def __init__(self, folder: Path, kind: Kind, robot: RobotDescription) -> None:
        """Read what is there; nothing is written.

        Args:
            folder: the dataset's folder, which may not exist yet.
            kind: what its episodes have in common.
            robot: the arm that is recorded.

        Raises:
            InvalidArgument: if the folder holds another kind of dataset, or anything else.
        """
        self.folder, self.kind, self._robot = folder, kind, robot
        self._names = names_of(kind.version, kind.cameras)
        self._episodes: list[dict[str, Any]] = []
        self._tasks: list[str] = []
        self._info: dict[str, Any] = {}
        if (folder / MEMO).exists():
            self._read()
        elif folder.exists() and any(folder.iterdir()):
            raise InvalidArgument("--out", f"{folder} holds something else", "an empty or a new folder")

    def _read(self) -> None:
        kept = json.loads((self.folder / MEMO).read_text(encoding="utf-8"))
        wanted = cattrs.unstructure(self.kind)
        if different := [name for name in wanted if _plain(kept["kind"].get(name)) != _plain(wanted[name])]:
            name = different[0]
            problem = f"{self.folder} was begun with {name} {kept['kind'].get(name)!r}, not {wanted[name]!r}"
            raise InvalidArgument("--out", problem, "another folder, or the same settings")
        if (self.folder / _INFO).exists():
            self._info = json.loads((self.folder / _INFO).read_text(encoding="utf-8"))
            self._episodes, self._tasks = kept["episodes"][: self._info["total_episodes"]], kept["tasks"]

    # -- what is there -------------------------------------------------------------------------------------------------
    @property
    def episodes(self) -> int:
        return len(self._episodes)

    @property
    def frames(self) -> int:
        return sum(one["length"] for one in self._episodes)

    def has(self, task: str, seed: int, source: str) -> bool:
        """Whether this demonstration is in the dataset."""
        asked = {"task": task, "seed": seed, "source": source}
        return any(asked.items() <= one["about"].items() for one in self._episodes)

    def succeeded(self, task: str, seed: int, source: str) -> bool:
        """Whether this demonstration is in the dataset and was a success."""
        asked = {"task": task, "seed": seed, "source": source, "success": True}
        return any(asked.items() <= one["about"].items() for one in self._episodes)

    @property
    def instructions(self) -> int:
        """Number of different instructions."""
        return len(self._tasks)

    def size(self) -> int:
        """Bytes of all files."""
        return sum(path.stat().st_size for path in self.folder.rglob("*") if path.is_file())

    # -- adding --------------------------------------------------------------------------------------------------------
    def add(self, recording: Recording, about: About) -> int:
        """Add an episode; its videos are moved. Returns its number.

        Raises:
            InvalidArgument: for a recording of fewer than two frames.
            OSError: if the folder cannot be written.
        """
        if len(recording) < 2:
            raise InvalidArgument("recording", f"{len(recording)} frames", "at least 2: the arm did not move")
        number = self.episodes
        if about.instruction not in self._tasks:
            self._tasks.append(about.instruction)
        columns = columns_of(recording, self.kind.layout, self._robot, self._names)
        length = len(recording) - 1
        columns |= self._fixed(number, length, about)
        self._move_videos(number, recording)
        table = self._table(columns, recording.said, length)
        _write_table(table, self.folder / place(DATA_PATHS[self.kind.version], number))
        stats = {name: statistics.of_numbers(rows) for name, rows in columns.items()}
        for camera, column in self._names.pictures.items():
            stats[column] = statistics.of_pictures(recording.pictures[camera])
        row = {"about": attrs.asdict(about), "length": length, "from": self.frames, "stats": stats}
        self._episodes.append(row)
        self._write_meta(recording.size)
        return number

    def _fixed(self, number: int, length: int, about: About) -> dict[str, np.ndarray]:
        index = np.arange(length)
        success = np.zeros(length, bool)
        success[-1] = about.success
        task = self._tasks.index(about.instruction)
        values = {
            "timestamp": index / self.kind.rate_hz,
            "frame_index": index,
            "episode_index": np.full(length, number),
            "index": index + self.frames,
            "task_index": np.full(length, task),
            "next.success": success,
        }
        return {name: values[name].astype(kind) for name, kind in FIXED.items()}

    def _move_videos(self, number: int, recording: Recording) -> None:
        for camera, column in self._names.pictures.items():
            target = self.folder / place(VIDEO_PATHS[self.kind.version], number, column)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(recording.videos[camera], target)

    def _table(self, columns: dict[str, np.ndarray], said: list[Said], length: int) -> pa.Table:
        made = {name: _arrow(rows) for name, rows in columns.items()}
        if self.kind.version == "v3.0":
            lasting, events = self._language(said, length)
            made[PERSISTENT] = persistent_column(lasting)
            made[EVENTS] = events_column(events)
        return pa.table(made)

    def _language(self, said: list[Said], length: int) -> tuple[list[Any], list[Any]]:
        """Rows that hold from their time on, the same list in every frame, and the rows of events in each frame."""
        lasting: list[dict[str, Any]] = []
        events: list[list[dict[str, Any]]] = [[] for _ in range(length)]
        for one in said:
            row = {"role": one.role, "content": one.content, "style": one.style, "camera": None, "tool_calls": None}
            frame = min(one.frame, length - 1)
            if one.style in _LASTING:
                lasting.append(row | {"timestamp": np.float32(frame / self.kind.rate_hz)})
            else:
                events[frame].append(row)
        return [lasting] * length, events

    # -- what describes the dataset ------------------------------------------------------------------------------------
    def _write_meta(self, size: tuple[int, int]) -> None:
        """Describe the dataset with its newest episode; ``info.json`` last."""
        total = statistics.together([one["stats"] for one in self._episodes])
        if self.kind.version == "v3.0":
            self._write_meta_v3()
        else:
            self._write_meta_v2()
        _write_text(self.folder / "meta/stats.json", json.dumps(total))
        kept = {"kind": cattrs.unstructure(self.kind), "tasks": self._tasks, "episodes": self._episodes}
        _write_text(self.folder / MEMO, json.dumps(kept))
        _write_text(self.folder / _INFO, json.dumps(self._described(size), indent=4))

    def _write_meta_v3(self) -> None:
        number = self.episodes - 1
        _write_table(tasks_table(self._tasks), self.folder / "meta/tasks.parquet")
        _write_table(pa.Table.from_pylist([self._row_v3(number)]), self.folder / place(EPISODES_V3, number))

    def _row_v3(self, number: int) -> dict[str, Any]:
        episode = self._episodes[number]
        chunk, file, start = number // CHUNK, number % CHUNK, episode["from"]
        row = {
            "episode_index": number,
            "tasks": [episode["about"]["instruction"]],
            "length": episode["length"],
            "data/chunk_index": chunk,
            "data/file_index": file,
            "dataset_from_index": start,
            "dataset_to_index": start + episode["length"],
            "meta/episodes/chunk_index": chunk,
            "meta/episodes/file_index": file,
        }
        for column in self._names.pictures.values():
            row[f"videos/{column}/chunk_index"], row[f"videos/{column}/file_index"] = chunk, file
            row[f"videos/{column}/from_timestamp"] = 0.0
            row[f"videos/{column}/to_timestamp"] = episode["length"] / self.kind.rate_hz
        return row | flattened(episode["stats"])

    def _write_meta_v2(self) -> None:
        episodes = [
            {"episode_index": number, "tasks": [one["about"]["instruction"]], "length": one["length"]}
            for number, one in enumerate(self._episodes)
        ]
        stats = [{"episode_index": number, "stats": one["stats"]} for number, one in enumerate(self._episodes)]
        tasks = [{"task_index": number, "task": one} for number, one in enumerate(self._tasks)]
        for name, rows in (("episodes", episodes), ("episodes_stats", stats), ("tasks", tasks)):
            _write_text(self.folder / f"meta/{name}.jsonl", "".join(f"{json.dumps(row)}\n" for row in rows))

    def _described(self, size: tuple[int, int]) -> dict[str, Any]:
        kind, rate = self.kind, self.kind.rate_hz
        pictures = {column: picture_feature(size, rate, CODEC, PIXELS) for column in self._names.pictures.values()}
        numbers = features_of(kind.layout, self._robot, self._names)
        described = {
            "codebase_version": kind.version,
            "robot_type": kind.robot,
            "total_episodes": self.episodes,
            "total_frames": self.frames,
            "total_tasks": len(self._tasks),
            "chunks_size": CHUNK,
            "fps": rate,
            "splits": {"train": f"0:{self.episodes}"},
            "data_path": DATA_PATHS[kind.version],
            "video_path": VIDEO_PATHS[kind.version],
            "features": pictures | numbers | fixed_features(kind.version),
        }
        if kind.version == "v3.0":
            return described | {"data_files_size_in_mb": 100, "video_files_size_in_mb": 200}
        videos = self.episodes * len(pictures)
        return described | {"total_videos": videos, "total_chunks": (self.episodes - 1) // CHUNK + 1}


def _arrow(rows: np.ndarray) -> pa.Array:
    if rows.ndim == 1 or rows.shape[1] == 1:
        return pa.array(rows.reshape(-1))
    return pa.FixedSizeListArray.from_arrays(pa.array(rows.reshape(-1)), rows.shape[1])


def _plain(value: Any) -> Any:
    """The value as JSON returns it."""
    return json.loads(json.dumps(value))


def _write_table(table: pa.Table, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    pq.write_table(table, part, compression="snappy")
    os.replace(part, path)


def _write_text(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)
