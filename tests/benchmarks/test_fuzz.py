"""Damaged input that once ended in a bug, a hang or a control character is refused now; the fuzzer finds such."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from memo_benchmarks.fuzz.bench import Child, replay
from memo_benchmarks.fuzz.child import faults_of
from memo_benchmarks.fuzz.mutations import Raw, damaged_lines
from memo_benchmarks.fuzz.run_folders import LOG, RunFolders

FOUND = sorted(path for path in (Path(__file__).parents[1] / "fuzz").iterdir() if path.is_dir())


@pytest.fixture(scope="module")
def child():
    with Child() as child:
        yield child


@pytest.mark.parametrize("folder", FOUND, ids=lambda folder: folder.name)
def test_what_was_found_once_is_mended(folder, child):
    assert replay(child, folder) == []


@pytest.mark.parametrize("kind", ["programs", "recordings", "run-folders"])
def test_runs_with_stand_ins_do_what_real_ones_do(kind):
    with Child(kind) as child:
        assert child.run(child.draw(0))["faults"] == []


@pytest.mark.parametrize(
    ("code", "out", "err"),
    [
        (70, "", "memo: unexpected"),
        (-11, "", ""),
        (None, "", ""),
        (1, "", "Traceback (most recent call last):\n"),
        (0, "a\x1b[2J", ""),
        (0, "", "a\rb"),
        (0, "sk-fuzz-0123456789", ""),
        (1, "", "x" * 30_000),
    ],
)
def test_each_kind_of_fault_is_seen(code, out, err):
    assert list(faults_of(code, out, err))


def test_the_same_number_gives_the_same_damage():
    records = [{"record": "book", "a": [1, 2]}, {"record": "entry", "text": "words"}]
    once, again = (damaged_lines(records, Random("imports 0 7")) for _ in range(2))
    assert once == again and once != damaged_lines(records, Random("imports 0 8"))


def test_what_was_damaged_already_can_be_damaged_again():
    files = {LOG: b"[" * 100_000, "config.yaml": b"task: \x97", "calls/1.json": b"\xff" * 9}
    for number in range(300):
        RunFolders()._damage(dict(files), Random(number))


def test_a_mark_of_an_earlier_damage_stays_as_it_is():
    assert Raw(Random(0)).dumped({"a": "@@raw7@@"}) == '{"a": "@@raw7@@"}'
