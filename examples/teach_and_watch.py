"""Teach the robot with words, then watch what it does with them on another task.

    python examples/teach_and_watch.py --out teach

A scripted teacher says one sentence about the fridge's door; the book keeps what is made of it; the microwave is opened
with that book and nobody watching.
"""

import argparse
from pathlib import Path

import memo_core as memo
from memo_core.plugin import FeedbackGiven


def watch(event: object) -> None:
    """Hears everything that happens in a run (memo_core/events.py), in the thread that does it."""
    if isinstance(event, FeedbackGiven):
        print(f"  {event.who}: {event.words}")


def main(out: Path) -> dict[str, bool]:
    book = f"skillbook.url={out / 'lab.db'}"
    lines = '[{subtask: "OPEN(*)", attempt: 1, say: "pull the handle in an arc around the hinge"}, {subtask: "*"}]'
    taught = memo.load(None, book, "teacher.backend=scripted", f"teacher.lines={lines}", task="open-the-fridge")
    print("open-the-fridge, with a teacher")
    first = memo.run(taught, out=out, listener=watch)
    print(f"  {first.why}")

    with memo.open_book(taught) as opened:
        for entry in opened.entries():
            print(f"  kept: {entry.kind} {entry.key or ''}: {entry.text.splitlines()[0]}")

    alone = memo.load(None, book, "teacher.backend=silent", task="put-the-food-in-the-microwave")
    print("put-the-food-in-the-microwave, alone")
    second = memo.run(alone, out=out)
    print(f"  {second.why}")
    return {"taught": first.success, "alone": second.success}


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, default=Path("runs"), help="where the book and the runs go")
    main(options.parse_args().out)
