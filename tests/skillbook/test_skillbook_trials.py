"""What was measured when templates were run again decides what is served first."""

from __future__ import annotations

import pytest

from memo_core.skillbook import history, track_record
from memo_core.skillbook.book import Skillbook
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore
from tests.support.cluster_books import ARC, approve

OTHER = ARC.replace("def ", "def other_").rstrip() + "\n    wait(1)\n"


@pytest.fixture
def book(tmp_path):
    with Skillbook(str(tmp_path / "book.db"), FakeEmbedder(), FakeStore()) as opened:
        yield opened


def served(book: Skillbook) -> list[int]:
    return [one.entry.id for one in book.retrieve("OPEN(oven)").templates]


def test_a_template_that_fails_is_served_after_one_that_does_not(book):
    own, near = approve(book, "OPEN(oven)"), approve(book, "OPEN(old oven)", OTHER)
    assert served(book) == [own, near]
    track_record.note_trial(book, own, "seed 1", False, "the door is shut")
    assert served(book) == [near, own]
    track_record.note_trial(book, own, "seed 2", True)
    assert served(book) == [own, near], "half of its trials succeeded"
    track_record.note_trial(book, own, "seed 2", False)
    track_record.note_trial(book, near, "seed 1", False)
    assert served(book) == [own, near], "both fail"


def test_a_trial_from_the_same_start_replaces_the_one_before_and_survives_a_restart(book):
    own = approve(book, "OPEN(oven)")
    track_record.note_trial(book, own, "seed 1", False, "shut")
    track_record.note_trial(book, own, "seed 1", True)
    book.close()
    with Skillbook(book.url, read_only=True) as again:
        [trial] = track_record.trials_of(again)[own]
    assert trial.success and trial.start == "seed 1" and not trial.reason


def test_an_older_version_that_does_not_fail_is_served_again(book):
    old = approve(book, "OPEN(oven)")
    new = approve(book, "OPEN(oven)", OTHER)
    assert served(book) == [new]
    track_record.note_trial(book, new, "seed 1", False, "shut")
    assert served(book) == [old]
    [_, current] = history.versions(book, "OPEN(oven)")
    assert current.entry.id == new and current.state == "superseded"
    track_record.note_trial(book, old, "seed 1", False, "shut")
    assert served(book) == [new], "neither works: the newer one"
