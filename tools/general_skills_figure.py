"""Draw the figure of docs/consolidation.md: run its three tasks, cluster the book between them, compose the pictures.

Usage: ``python tools/general_skills_figure.py docs/images/general-skills.png`` (MUJOCO_GL=egl without a display; about
a minute).
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import functions_of, record_of

SETTINGS = (
    "llm=offline",
    "simulator=mujoco",
    "robot=panda",
    "perception=ground-truth",
    "suite=tabletop",
    "method=memo",
)
WIDE = dict(fontsize=9, family="monospace", va="top")


def main(file: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        taught = [_run(at, task, "simulated") for task in ("put-the-food-in-the-microwave", "open-the-fridge")]
        memo("cluster", at)
        oven = _run(at, "put-the-food-in-the-oven", "silent")
        with Skillbook(str(at / "book.db")) as book:
            [record] = [record_of(book, learnt) for learnt in functions_of(book)]
        attempts = sorted(taught[0].glob("pictures/01-*.png"))
        pictures = [attempts[0], attempts[-1], *taught[1].glob("pictures/01-*.png"), *oven.glob("pictures/01-*.png")]
        _draw(pictures, record, file)


def _run(at: Path, task: str, teacher: str) -> Path:
    memo("run", at, f"task={task}", f"teacher={teacher}", "run.video=auto")
    return max((at / "runs").iterdir(), key=lambda folder: folder.stat().st_mtime)


def memo(command: str, at: Path, *settings: str) -> None:
    given = [part for one in (*SETTINGS, *settings) for part in ("--set", one)]
    subprocess.run(
        [str(Path(sys.executable).with_name("memo")), command, *given, "--book", "book.db"], cwd=at, check=True
    )


def _draw(pictures: list[Path], record: Any, file: Path) -> None:
    words = next(said.words for said in record.said if said.words.strip())
    function, calls = record.learnt.function, record.learnt.calls
    before, after = (sum(len(one.text) for one in some) for some in (record.replaced, (record.learnt.entry, *calls)))
    titles = (
        "1. a straight pull fails",
        "2. as told; the program is approved",
        "3. another thing, the same way",
        "5. an oven that nobody ever taught",
    )
    figure, axes = pyplot.subplots(2, 4, figsize=(14, 5.2), height_ratios=(3, 2))
    figure.subplots_adjust(left=0.01, right=0.99, top=0.94, bottom=0.01, wspace=0.04, hspace=0.02)
    for above, below, picture, title in zip(axes[0], axes[1], pictures, titles, strict=True):
        above.imshow(pyplot.imread(picture))
        above.set_title(title, fontsize=10)
        above.axis("off")
        below.axis("off")
    axes[1][0].text(0, 1, _lines(f"“{words}”", 40), fontsize=9, style="italic", va="top")
    for below, program in zip(axes[1][1:3], record.replaced, strict=True):
        below.text(0, 1, f"[{program.key}]  {len(program.text)} characters", **WIDE)
    merged = [
        f"4. memo cluster: {before} -> {after} characters",
        "",
        *_lines(f"def {function.signature}:", 62, "    ").splitlines(),
        f'    """{function.docstring.splitlines()[0]}"""',
        "",
        *(f"[{call.key}]  {call.text}" for call in calls),
    ]
    axes[1][1].text(0, 0.84, "\n".join(merged), **WIDE, bbox={"facecolor": "#eef4fb", "edgecolor": "#0072b2"})
    axes[1][3].text(0, 1, "written from that function, for the oven", fontsize=9, va="top")
    figure.savefig(file, dpi=90)


def _lines(text: str, width: int, indent: str = "") -> str:
    import textwrap

    return textwrap.fill(text, width, subsequent_indent=indent)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
