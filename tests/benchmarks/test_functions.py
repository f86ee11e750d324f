"""Books before and after merging: what was opened with each is counted, and prompts are those that were asked."""

from __future__ import annotations

import json

import pytest
from memo_benchmarks.functions import BOOKS, DAMAGED, FunctionBench, first_prompt, measure, table

from memo_core.cli.main import main

BOTH = ("mujoco", "pybullet")


def row(simulator: str, seed: int, opened: tuple[str, ...], books: tuple[str, ...] = tuple(BOOKS)) -> dict:
    openings = [
        {"thing": "suite:open-it", "book": book, "opened": book in opened, "characters": 100 + seed, "tokens": 25}
        for book in books
    ]
    sizes = {book: {"entries": 2, "characters": 10 + seed} for book in books}
    return {"simulator": simulator, "seed": seed, "books": sizes, "openings": openings}


def test_each_book_has_a_line_with_what_it_opened_in_each_simulator():
    rows = [row("mujoco", 0, ("merged",), (*BOOKS, *DAMAGED)), row("pybullet", 0, ()), row("mujoco", 2, ("merged",))]
    lines = {line["book"]: line for line in table(rows)}
    assert lines[BOOKS["merged"]] == {
        "book": BOOKS["merged"],
        "entries": "2",
        "characters": "10 to 12",
        "prompt, characters": 101,
        "prompt, tokens": 25,
        "`open-it`": "2 of 2, 0 of 1",
    }
    assert lines[DAMAGED["calls-shuffled"]]["`open-it`"] == "0 of 1", "damaged books are tried on fewer seeds"


def test_the_prompt_is_the_first_that_asked_for_code(tmp_path):
    (tmp_path / "calls").mkdir()
    for number, text in ((3, "plan"), (12, "four"), (20, "again, longer")):
        call = {"messages": [{"text": text}, {"text": "!"}], "answer": {"usage": {"prompt_tokens": number}}}
        (tmp_path / f"calls/{number:04d}-{'plan' if text == 'plan' else 'code'}.json").write_text(json.dumps(call))
    assert first_prompt(tmp_path) == (5, 12)
    assert first_prompt(tmp_path / "calls") == (0, 0), "a run that came to no code"


def test_damaged_books_are_tried_on_the_first_seeds_and_the_progress_ends_at_one(monkeypatch):
    seen, shares = [], []

    def row_of(self, seed, things, damaged, opened):
        seen.append((self.out, seed, damaged))
        for _ in range(len(things) * (len(BOOKS) + damaged * len(DAMAGED))):
            opened()
        return {}

    monkeypatch.setattr(FunctionBench, "row", row_of)
    measure([FunctionBench({}, None, name) for name in BOTH], (4, 5), ("a:b", "c:d"), 1, shares.append)
    assert seen == [(name, seed, seed == 4) for seed in (4, 5) for name in BOTH]
    assert shares == sorted(shares) and shares[-1] == 1.0


def test_a_thing_without_its_suite_is_refused_before_anything_is_taught(tmp_path, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["bench", "functions", "--thing", "open-the-fridge", "--out", str(tmp_path / "out")])
    assert "names no suite" in capsys.readouterr().err and not (tmp_path / "out").exists()
