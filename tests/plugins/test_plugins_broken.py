"""Fifty ways in which somebody else's plugin can be broken: ``memo`` works, and says in one line which one it is.

Each is a distribution on disk, found by its metadata as an installed one is.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from memo_core.events import Problem
from memo_core.plugins import loading as plugin_loading
from memo_core.plugins.entry_points import installed
from memo_core.plugins.registry import Registry

HEAD = """
import attrs
from memo_core.plugins.hooks import hookimpl
from memo_core.interfaces.backend import Backend, Needs
def make(settings): return object()
"""


def store(arguments: str = "'vectorstore', 'mine', 'keeps vectors', make", before: str = "") -> str:
    return f"{HEAD}\n{before}\n@hookimpl\ndef memo_vector_stores():\n    return [Backend({arguments})]\n"


def with_config(body: str, before: str = "") -> str:
    config = f"{before}\n@attrs.frozen\nclass Settings:\n    {body}\n"
    return store("'vectorstore', 'mine', 'keeps vectors', make, Settings", config)


def hook(body: str, name: str = "memo_vector_stores", marker: str = "@hookimpl") -> str:
    return f"{HEAD}\n{marker}\ndef {name}():\n    {body}\n"


GOOD = store("'vectorstore', 'good', 'keeps vectors', make")
# name -> (source of the module, words of the line that says what is wrong)
BROKEN: dict[str, tuple[str, str]] = {
    # while it is imported
    "raises": ("raise RuntimeError('no licence')", "RuntimeError: no licence"),
    "lacks-a-library": ("import no_such_library", "no_such_library"),
    "syntax": ("def f(:", "SyntaxError"),
    "tabs": ("if True:\n\tx=1\n        y=2", "TabError"),
    "no-text": ("\x00", "null bytes"),
    "exits": ("raise SystemExit(3)", "SystemExit"),
    "exits-in-words": ("import sys; sys.exit('bye')", "bye"),
    "exception-of-its-own": ("class Doom(BaseException): pass\nraise Doom('over')", "Doom: over"),
    "generator-exit": ("raise GeneratorExit", "GeneratorExit"),
    "error-without-text": (
        "class E(Exception):\n  def __str__(self): raise ValueError\nraise E",
        "cannot be turned into",
    ),
    "error-that-is-no-text": ("class E(Exception):\n  def __str__(self): return 3\nraise E", "cannot be turned into"),
    "giant-error": ("raise RuntimeError('x' * 5_000_000)", "…"),
    "error-of-many-lines": ("raise RuntimeError('one\\n' * 1000)", "one one"),
    "endless-recursion": ("def f(): f()\nf()", "RecursionError"),
    "asserts": ("assert 1 == 2, 'arithmetic'", "arithmetic"),
    "out-of-memory": ("raise MemoryError('all of it')", "MemoryError"),
    "unicode": ("raise RuntimeError('\\ud800 \\x1b[2J')", "RuntimeError"),
    "name-that-is-missing": ("from memo_core.plugins.hooks import hookimplement", "hookimplement"),
    # its hooks
    "misspelt-hook": (hook("return []", "memo_vektor_stores"), "did you mean 'memo_vector_stores'"),
    "unmarked-hook": (hook("return []", marker=""), "@hookimpl"),
    "hook-with-an-argument": (f"{HEAD}\n@hookimpl\ndef memo_event(what): pass", "what"),
    "hook-that-raises": (hook("raise KeyError('table')"), "KeyError"),
    "hook-that-exits": (hook("raise SystemExit(1)"), "SystemExit"),
    "hook-that-returns-none-in-a-list": (hook("return [None]"), "returned NoneType"),
    "hook-that-returns-one": (hook("return Backend('vectorstore', 'x', 'x', make)"), "sequence of Backend"),
    "hook-that-returns-text": (hook("return 'mine'"), "sequence of Backend"),
    "hook-that-returns-a-number": (hook("return 3"), "not int"),
    "hook-that-returns-a-dict": (hook("return {'mine': make}"), "returned str"),
    "hook-that-is-a-coroutine": (
        f"{HEAD}\n@hookimpl\nasync def memo_vector_stores(): return []",
        "not coroutine",
    ),
    "hook-that-fails-half-way": (
        hook("yield Backend('vectorstore', 'mine', 'x', make)\n    raise OSError('half')"),
        "OSError: half",
    ),
    "hook-that-never-ends": (
        hook("import itertools\n    return (Backend('vectorstore', str(n), 'x', make) for n in itertools.count())"),
        "more than 1000",
    ),
    "declared-twice": (hook("return [Backend('vectorstore', 'mine', 'x', make)] * 2"), "declared twice"),
    # its descriptors
    "other-kind": (store("'llm', 'mine', 'x', make"), "of kind 'llm'"),
    "kind-that-is-a-list": (store("[], 'mine', 'x', make"), "of kind []"),
    "no-name": (store("'vectorstore', '', 'x', make"), "name must be a word"),
    "name-of-two-lines": (store("'vectorstore', 'a\\nb', 'x', make"), "name must be a word"),
    "name-with-a-slash": (store("'vectorstore', 'a/b', 'x', make"), "name must be a word"),
    "name-that-is-a-number": (store("'vectorstore', 7, 'x', make"), "name must be a word"),
    "giant-name": (store("'vectorstore', 'x' * 1_000_000, 'x', make"), "name must be a word"),
    "no-summary": (store("'vectorstore', 'mine', '   ', make"), "summary must be one line"),
    "giant-summary": (store("'vectorstore', 'mine', 'x' * 1_000_000, make"), "1000000 characters"),
    "no-factory": (store("'vectorstore', 'mine', 'x', None"), "factory must be callable"),
    "needs-a-list": (store("'vectorstore', 'mine', 'x', make, needs=['torch']"), "needs must be a Needs"),
    "needs-modules-as-a-list": (
        store("'vectorstore', 'mine', 'x', make, needs=Needs(modules=['torch'])"),
        "needs.modules",
    ),
    "needs-a-key-as-text": (store("'vectorstore', 'mine', 'x', make, needs=Needs(keys='TOKEN')"), "needs.keys"),
    "default-that-is-a-word": (store("'vectorstore', 'mine', 'x', make, default='yes'"), "default"),
    "demo-of-its-own": (store("'vectorstore', 'mine', 'x', make, demo='mine'"), "demo must be a Demo"),
    "memory-that-is-a-word": (store("'vectorstore', 'mine', 'x', make, memory='all'"), "memory must be a Memory"),
    "a-store-that-takes-feedback": (store("'vectorstore', 'mine', 'x', make, takes_feedback=True"), "methods only"),
    "alias-as-text": (store("'vectorstore', 'mine', 'x', make, aliases='old'"), "aliases"),
    # its settings
    "config-no-class": (store("'vectorstore', 'mine', 'x', make, dict"), "attrs class"),
    "config-of-unknown-type": (with_config("size: 'NoSuchType' = None"), "NoSuchType"),
    "config-in-itself": (with_config("inner: 'Settings | None' = None"), "holds itself"),
    "help-that-is-no-text": (with_config("size: int = attrs.field(default=1, metadata={'help': 3})"), "'help' must be"),
    "field-called-backend": (with_config("backend: str = ''"), "'backend'"),
}


def install(site: Path, name: str, source: str, entry_points: str = "", metadata: str = "") -> None:
    """Write what an installer would have written for a distribution of one module."""
    module = f"plugin_{name.replace('-', '_')}"
    (site / f"{module}.py").write_text(source, encoding="utf-8", errors="surrogatepass")
    info = site / f"memo_{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(metadata or f"Metadata-Version: 2.1\nName: memo-{name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(entry_points or f"[memo]\n{name} = {module}\n")


def found_in(site: Path) -> Registry:
    points, damaged = installed("memo", importlib.metadata.distributions(path=[str(site)]))
    assert not damaged
    return Registry(points)


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_plugin_is_named_in_one_line_and_the_others_work(name, tmp_path, monkeypatch):
    source, said = BROKEN[name]
    install(tmp_path, name, source)
    install(tmp_path, "good", GOOD)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "plugin_good", raising=False)
    registry = found_in(tmp_path)
    assert registry.default("vectorstore").name == "good"
    [line] = registry.problems
    assert f"memo-{name}" in line and said in line
    assert "\n" not in line and len(line) < 700


def test_there_are_fifty():
    assert len(BROKEN) >= 50


# -- all of them at once, in the command line --------------------------------------------------------------------------
@pytest.fixture(scope="module")
def crowded(tmp_path_factory) -> Path:
    site = tmp_path_factory.mktemp("site")
    for name, (source, _) in BROKEN.items():
        install(site, name, source)
    install(site, "good", GOOD)
    install(site, "prints", "print('{\"hello\": 1}')\n" + store("'vectorstore', 'prints', 'x', make"))
    install(site, "no-pairs", GOOD, entry_points="[memo]\nthis is no pair\n")
    install(site, "empty-metadata", GOOD)
    (site / "memo_empty_metadata-1.0.dist-info" / "METADATA").unlink()
    binary = site / "memo_bytes-1.0.dist-info"
    binary.mkdir()
    (binary / "entry_points.txt").write_bytes(b"\xff\xfe[memo]\n")
    return site


def memo(site: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    environment = os.environ | {"PYTHONPATH": str(site)}
    return subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)


@pytest.mark.process
def test_with_all_of_them_installed_memo_lists_each_and_what_works(crowded):
    listed = memo(crowded, "plugins", "list", "--json")
    assert listed.returncode == 0, listed.stderr[-2000:]
    told = json.loads(listed.stdout)
    assert {"mujoco", "offline", "prints"} <= {backend["name"] for backend in told["backends"]}
    errors = {plugin["distribution"]: plugin["error"] for plugin in told["plugins"]}
    assert {name for name in BROKEN if not errors[f"memo-{name}"]} == set()
    assert "metadata cannot be read" in errors["memo_no_pairs-1.0.dist-info"]
    assert "metadata cannot be read" in errors["memo_bytes-1.0.dist-info"]
    assert any("memo-prints printed while it was imported" in problem for problem in told["problems"])


@pytest.mark.process
@pytest.mark.parametrize(
    "arguments", [("--help",), ("tasks", "list", "--json"), ("config", "show"), ("config", "schema")]
)
def test_with_all_of_them_installed_commands_work(crowded, arguments):
    done = memo(crowded, *arguments)
    assert done.returncode == 0, done.stderr[-2000:]
    if arguments[-1] in ("--json", "schema"):
        json.loads(done.stdout)
    assert "Traceback" not in done.stderr
    assert "warning: plugin" in done.stderr or arguments == ("--help",)


# -- what works, and should be mended ----------------------------------------------------------------------------------
def test_a_plugin_that_is_slow_to_import_works_and_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(plugin_loading, "SLOW_IMPORT_S", 0.05)
    monkeypatch.syspath_prepend(str(tmp_path))
    install(tmp_path, "slow", f"import time; time.sleep(0.1)\n{GOOD}")
    registry = found_in(tmp_path)
    assert registry.names("vectorstore") == ("good",)
    [line] = registry.problems
    assert "memo-slow" in line and "s to import" in line


def test_while_a_plugin_does_not_finish_loading_the_terminal_says_which(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(plugin_loading, "STILL_LOADING_S", 0.05)
    monkeypatch.syspath_prepend(str(tmp_path))
    said = tmp_path / "said"
    waits = f"import pathlib, sys, time\nwhile not pathlib.Path({str(said)!r}).exists(): time.sleep(0.01)\n"
    install(tmp_path, "endless", waits + GOOD)

    class Stderr:
        text = ""

        def write(self, text: str) -> None:
            self.text += text
            said.touch()  # the plugin waits for this: it loads only because it was named meanwhile

        def flush(self) -> None: ...

    stderr = Stderr()
    monkeypatch.setattr(sys, "stderr", stderr)
    found_in(tmp_path)
    assert "still loading plugin 'endless' of memo-endless" in stderr.text


def test_a_listener_that_exits_is_detached_and_one_that_is_slow_is_named_once(tmp_path, monkeypatch):
    import memo_core.plugins.registry as plugins

    monkeypatch.setattr(plugins, "SLOW_LISTENER_S", 0.01)
    monkeypatch.syspath_prepend(str(tmp_path))
    install(tmp_path, "quits", f"{HEAD}\n@hookimpl\ndef memo_event(event): raise SystemExit(2)")
    install(tmp_path, "dawdles", f"import time\n{HEAD}\n@hookimpl\ndef memo_event(event): time.sleep(0.02)")
    registry = found_in(tmp_path)
    registry.emit(Problem("here", "first"))
    registry.emit(Problem("here", "second"))
    quits, dawdles = (
        [line for line in registry.problems if name in line] for name in ("memo-quits/quits", "memo-dawdles/dawdles")
    )
    assert len(quits) == 1 and "detached after SystemExit" in quits[0]
    assert len(dawdles) == 1 and "over one event" in dawdles[0]


def test_a_factory_that_raises_is_named_with_its_backend(tmp_path, monkeypatch):
    from memo_core.config import load_experiment
    from memo_core.errors import BackendUnavailable

    monkeypatch.syspath_prepend(str(tmp_path))
    install(tmp_path, "raising-factory", store(before="def make(settings): raise ZeroDivisionError('one by nothing')"))
    experiment = load_experiment(found_in(tmp_path))
    with pytest.raises(BackendUnavailable, match=r"vectorstore 'mine'.*ZeroDivisionError: one by nothing"):
        experiment.create("vectorstore")
