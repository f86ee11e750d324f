"""A real sandbox and a real book for the tests of the method."""

from __future__ import annotations

from pathlib import Path

import pytest

from memo_core.sandbox import Sandbox
from memo_core.skillbook.book import Skillbook
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore


@pytest.fixture(scope="module")
def sandbox():
    with Sandbox(skill_library(BUILTIN_SKILLS)) as opened:
        yield opened


@pytest.fixture
def book(tmp_path: Path):
    with Skillbook(f"sqlite:///{tmp_path / 'book.db'}", FakeEmbedder(), FakeStore()) as opened:
        yield opened
