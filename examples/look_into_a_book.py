"""Look into a skillbook: what is kept, who said it, and what a subtask would be served.

python examples/look_into_a_book.py lab.db --subtask "OPEN(drawer)"
"""

import argparse

import memo_core as memo


def main(book: str, subtask: str) -> list[str]:
    with memo.open_book(book) as opened:  # read only
        print("people:", ", ".join(opened.people()) or "nobody")
        for entry in opened.entries():
            print(f"{entry.id:>4} {entry.kind:<10} {entry.key or 'everywhere'}: {entry.text.splitlines()[0]}")
        served = opened.retrieve(subtask)
        print(f"{subtask} would be served:")
        found = [one.entry.text for one in (*served.corrections, *served.general, *served.templates)]
        for text in found:
            print(" ", text.splitlines()[0])
    return found


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("book", help="a file or a database URL")
    options.add_argument("--subtask", default="OPEN(drawer)")
    chosen = options.parse_args()
    main(chosen.book, chosen.subtask)
