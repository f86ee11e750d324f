"""One plugin's mistake is its own problem: it is listed with its distribution and its reason; the others go on."""

from __future__ import annotations

from typing import Any

import attrs
import pytest

from memo_core.events import Problem
from memo_core.interfaces.backend import Backend, Needs
from memo_core.plugins.hooks import hookimpl
from memo_core.plugins.registry import AmbiguousBackend, NoDefaultBackend, Registry, UnknownBackend, missing_needs
from memo_core.testing.fake_entry_point import FakeEntryPoint


def store(name: str, **changes: Any) -> Backend:
    return attrs.evolve(Backend("vectorstore", name, "keeps vectors", lambda settings: settings), **changes)


def stores(*backends: Any) -> Any:
    @hookimpl
    def memo_vector_stores():
        return backends

    return memo_vector_stores


GOOD = FakeEntryPoint("good", "memo-good", memo_vector_stores=stores(store("flat")))


def broken(**members: Any) -> str:
    """The error with which a plugin is listed; the good one beside it must still work."""
    registry = Registry([GOOD, FakeEntryPoint("bad", "memo-bad", **members)])
    assert registry.get("vectorstore", "flat").name == "flat"
    [plugin] = registry.broken
    assert (plugin.name, plugin.distribution) == ("bad", "memo-bad")
    assert any("memo-bad" in line and plugin.error in line for line in registry.problems)
    return plugin.error


@pytest.mark.parametrize(
    "error", [RuntimeError("no licence"), ImportError("no module x"), SystemExit(3), SyntaxError("bad")]
)
def test_a_plugin_that_raises_at_import_is_listed_and_stops_nobody(error):
    assert type(error).__name__ in broken(error=error)


def test_a_misspelt_hook_is_caught_and_the_right_name_suggested():
    @hookimpl
    def memo_vektor_stores():
        return []

    assert "memo_vektor_stores" in broken(memo_vektor_stores=memo_vektor_stores)
    assert "memo_vector_stores" in broken(memo_vektor_stores=memo_vektor_stores)


def test_a_hook_without_its_marker_is_caught():
    def memo_vector_stores():
        return [store("mine")]

    assert "hookimpl" in broken(memo_vector_stores=memo_vector_stores)


def test_a_hook_with_an_argument_that_does_not_exist_is_caught():
    @hookimpl
    def memo_event(happening):
        pass

    assert "happening" in broken(memo_event=memo_event)


@attrs.frozen
class TakesTheWord:
    backend: str = ""


@attrs.frozen
class Unresolvable:
    size: NoSuchType = None  # type: ignore[name-defined] # noqa: F821


@pytest.mark.parametrize(
    ("backend", "said"),
    [
        ("flat", "expected memo_core.interfaces.backend.Backend"),
        (store("mine", kind="llm"), "of kind 'llm'"),
        (store(""), "name"),
        (store("mine", summary=""), "summary"),
        (store("mine", summary="two\nlines"), "summary"),
        (store("mine", factory=None), "factory"),
        (store("mine", config=dict), "attrs class"),
        (store("mine", config=TakesTheWord), "'backend'"),
        (store("mine", config=Unresolvable), "NoSuchType"),
    ],
)
def test_a_descriptor_that_cannot_work_is_caught(backend, said):
    assert said in broken(memo_vector_stores=stores(backend))


def test_a_hook_that_returns_one_backend_instead_of_a_list_is_caught():
    @hookimpl
    def memo_vector_stores():
        return store("mine")

    assert "sequence of Backend" in broken(memo_vector_stores=memo_vector_stores)


def test_a_plugin_that_declares_a_name_twice_is_caught():
    assert "declared twice" in broken(memo_vector_stores=stores(store("mine"), store("mine")))


def test_selecting_what_a_broken_plugin_may_have_offered_says_why_it_is_not_there():
    registry = Registry([GOOD, FakeEntryPoint("bad", "memo-bad", error=RuntimeError("no licence"))])
    with pytest.raises(UnknownBackend, match=r"memo-bad is broken: RuntimeError: no licence"):
        registry.get("vectorstore", "chroma")


def test_an_unknown_name_gets_the_near_one():
    with pytest.raises(UnknownBackend, match="did you mean 'flat'"):
        Registry([GOOD]).get("vectorstore", "flatt")


def test_an_unknown_name_like_no_other_may_be_of_a_plugin_that_is_not_installed():
    with pytest.raises(UnknownBackend, match="a plugin of yours is installed by pip install --editable FOLDER"):
        Registry([GOOD]).get("vectorstore", "workbench")
    with pytest.raises(UnknownBackend) as raised:
        Registry([GOOD]).get("vectorstore", "flatt")
    assert "pip install" not in str(raised.value)


def test_two_distributions_with_one_name_are_both_named_and_the_rest_goes_on():
    other = FakeEntryPoint("other", "memo-other", memo_vector_stores=stores(store("flat"), store("tree")))
    registry = Registry([GOOD, other])
    with pytest.raises(AmbiguousBackend, match=r"memo-good.*memo-other"):
        registry.get("vectorstore", "flat")
    assert registry.get("vectorstore", "tree").name == "tree"
    assert registry.names("vectorstore") == ("tree",)
    assert any("memo-good" in line and "memo-other" in line for line in registry.problems)


def test_the_default_is_the_only_one_or_the_one_declared_so_and_never_a_guess():
    def registry(*backends: Backend) -> Registry:
        return Registry([FakeEntryPoint("p", "d", memo_vector_stores=stores(*backends))])

    assert registry(store("a")).default("vectorstore").name == "a"
    assert registry(store("a"), store("b", default=True)).default("vectorstore").name == "b"
    for undecided in (
        registry(),
        registry(store("a"), store("b")),
        registry(store("a", default=True), store("b", default=True)),
    ):
        with pytest.raises(NoDefaultBackend):
            undecided.default("vectorstore")


def test_a_listener_that_raises_is_reported_once_detached_and_never_ends_a_run():
    heard: list[Any] = []
    calls = []

    @hookimpl
    def memo_event(event):
        calls.append(event)
        raise ValueError("disk full")

    registry = Registry([FakeEntryPoint("log", "memo-log", memo_event=memo_event)])
    registry.listen(heard.append, "test")
    first, second = Problem("here", "first"), Problem("here", "second")
    registry.emit(first)
    registry.emit(second)
    assert len(calls) == 1
    [one, report, two] = heard
    assert (one.message, two.message) == ("first", "second")
    assert "memo-log/log" in report.where and "ValueError: disk full" in report.message
    assert any("disk full" in line for line in registry.problems)


def test_events_are_stamped_with_the_time_and_listening_can_end():
    heard: list[Any] = []
    registry = Registry([])
    end = registry.listen(heard.append, "test")
    registry.emit(Problem("here", "now"))
    end()
    registry.emit(Problem("here", "later"))
    assert [event.message for event in heard] == ["now"]
    assert heard[0].time > 1e9


def test_what_is_missing_is_named_with_what_brings_it():
    needs = Needs(modules={"json": "python", "no_such_module_x": "x-dist"}, keys=("X_KEY",))
    assert [(m.what, m.remedy) for m in missing_needs(needs, {})] == [
        ("Python module no_such_module_x", "install x-dist"),
        ("environment variable X_KEY", "export X_KEY=…"),
    ]
    assert missing_needs(Needs(keys=("X_KEY",)), {"X_KEY": "1"}) == ()


def test_the_installed_plugins_are_found_and_whole():
    registry = Registry()
    assert {"memo-core", "memo-sim-mujoco", "memo-tabletop"} <= {plugin.distribution for plugin in registry.plugins}
    assert registry.problems == ()
