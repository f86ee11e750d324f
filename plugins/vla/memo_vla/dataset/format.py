"""Paths, fixed columns and Arrow types of LeRobot's formats v3.0 and v2.1.

Each episode has files of its own in both: v3.0 allows several in one file and does not ask for it. Readers of v3.0
ignore language columns that they do not know; v2.1 has none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import pyarrow as pa

Version = Literal["v3.0", "v2.1"]

CHUNK = 1000  # episodes in one folder
_V3_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
DATA_PATHS: dict[str, str] = {
    "v3.0": f"data/{_V3_FILE}.parquet",
    "v2.1": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
}
VIDEO_PATHS: dict[str, str] = {
    "v3.0": f"videos/{{video_key}}/{_V3_FILE}.mp4",
    "v2.1": "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
}
EPISODES_V3 = f"meta/episodes/{_V3_FILE}.parquet"
FIXED = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
    "next.success": "bool",
}
PERSISTENT, EVENTS = "language_persistent", "language_events"
_LANGUAGE = {
    PERSISTENT: {"dtype": "language", "shape": [1], "names": None},
    EVENTS: {"dtype": "language", "shape": [1], "names": None},
}


def place(template: str, episode: int, video_key: str = "") -> str:
    """The path of an episode's file, relative to the dataset."""
    return template.format(
        chunk_index=episode // CHUNK,
        file_index=episode % CHUNK,
        episode_chunk=episode // CHUNK,
        episode_index=episode,
        video_key=video_key,
    )


def fixed_features(version: Version) -> dict[str, dict[str, Any]]:
    """Entries of ``info.json`` for the columns that every dataset has."""
    numbers = {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in FIXED.items()}
    return numbers | (_LANGUAGE if version == "v3.0" else {})


def picture_feature(size: tuple[int, int], rate_hz: int, codec: str, pixels: str) -> dict[str, Any]:
    """The entry of ``info.json`` for a camera's video; ``size`` is width and height."""
    width, height = size
    return {
        "dtype": "video",
        "shape": [height, width, 3],
        "names": ["height", "width", "channels"],
        "info": {
            "video.height": height,
            "video.width": width,
            "video.codec": codec,
            "video.pix_fmt": pixels,
            "video.fps": rate_hz,
            "video.channels": 3,
            "video.is_depth_map": False,
            "has_audio": False,
        },
    }


def persistent_column(rows: list[Any]) -> pa.Array:
    """``language_persistent``: rows that hold from their time on, the same list in every frame of an episode."""
    return _language_column(rows, (pa.field("timestamp", pa.float32(), nullable=False),))


def events_column(rows: list[Any]) -> pa.Array:
    """``language_events``: rows in the frame at whose time they happened."""
    return _language_column(rows, ())


def _language_column(rows: list[Any], further: tuple[pa.Field, ...]) -> pa.Array:
    # Arrow makes no array of its JSON type from Python values, and casts one of texts.
    texts, wanted = (_row_type(kind, further) for kind in (pa.string(), pa.json_()))
    return pa.array(rows, texts).cast(wanted)


def _row_type(call: pa.DataType, further: tuple[pa.Field, ...]) -> pa.DataType:
    text = pa.string()
    fields = [pa.field("role", text, nullable=False), pa.field("content", text), pa.field("style", text), *further]
    return pa.list_(pa.struct([*fields, pa.field("camera", text), pa.field("tool_calls", pa.list_(call))]))


def tasks_table(tasks: Sequence[str]) -> pa.Table:
    """The instructions of v3.0 with their numbers, the instruction being the index that pandas reads back."""
    import json

    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, kind, numpy in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    about = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.2.0"}
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks, pa.string())})
    return table.replace_schema_metadata({"pandas": json.dumps(about)})


def flattened(statistics: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Statistics of an episode as columns of its row in v3.0."""
    return {f"stats/{column}/{name}": one for column, some in statistics.items() for name, one in some.items()}
