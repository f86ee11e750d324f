"""A hook that is not documented, or that no test calls, fails here."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from memo_core.config import Choice
from memo_core.errors import BackendUnavailable, UnknownName
from memo_core.events import Problem
from memo_core.interfaces.backend import KINDS, Backend, Needs
from memo_core.plugins import hooks
from memo_core.plugins.hooks import hookimpl
from memo_core.plugins.loading import HOOK_OF_KIND, HOOKS
from memo_core.plugins.registry import Registry
from memo_core.testing.fake_entry_point import FakeEntryPoint
from memo_core.testing.plugins import check_backend, find_backends

ROOT = Path(__file__).parents[2]
SPECS = sorted(name for name in vars(hooks) if hasattr(getattr(hooks, name), "memo_spec"))


def test_there_is_one_registration_hook_a_kind_and_one_for_events():
    assert set(HOOK_OF_KIND) == set(KINDS)
    assert set(SPECS) == set(HOOKS) == {*HOOK_OF_KIND.values(), "memo_event"}


@pytest.mark.parametrize("name", SPECS)
def test_every_hook_says_what_it_promises_and_since_when(name):
    assert getattr(hooks, name).__doc__
    assert re.search(rf"def {name}\(.*\) -> .*:  # since \d+\.\d+", (ROOT / "memo_core/plugins/hooks.py").read_text())


@pytest.mark.parametrize("name", SPECS)
def test_every_hook_is_documented(name):
    assert f"`{name}" in (ROOT / "docs/plugins/README.md").read_text(encoding="utf-8")


def implementation(name: str, returned: Any) -> Any:
    namespace: dict[str, Any] = {"returned": returned}
    exec(f"def {name}():\n    return returned", namespace)
    return hookimpl(namespace[name])


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_registration_hook_returns_can_be_selected(kind):
    backend = Backend(kind, "mine", "for tests", lambda settings: settings)
    point = FakeEntryPoint("p", "d", **{HOOK_OF_KIND[kind]: implementation(HOOK_OF_KIND[kind], [backend])})
    registry = Registry([point])
    assert registry.problems == ()
    assert registry.get(kind, "mine") is backend
    assert registry.plugin_of(backend).distribution == "d"
    with pytest.raises(UnknownName):
        registry.get(kind, "yours")


def test_memo_event_hears_every_event_in_order():
    heard = []

    @hookimpl
    def memo_event(event):
        heard.append(event.message)

    registry = Registry([FakeEntryPoint("p", "d", memo_event=memo_event)])
    assert registry.plugins[0].listens
    for message in ("one", "two", "three"):
        registry.emit(Problem("here", message))
    assert heard == ["one", "two", "three"]


def test_every_event_hook_documented_in_the_design_has_events():
    from memo_core import events

    names = {name.lower() for name in vars(events)}
    for topic in ("run", "subtask", "retrieved", "code", "skill", "feedback", "entry", "cluster"):
        assert any(name.startswith(topic) for name in names)


# -- memo plugins check ------------------------------------------------------------------------------------------------
def installed(backend: Backend, module: str) -> Registry:
    hook = HOOK_OF_KIND[backend.kind]
    point = FakeEntryPoint("p", "d", **{hook: implementation(hook, [backend])})
    point.value = module
    return Registry([point])


def broken_rules(backend: Backend) -> set[str]:
    registry = installed(backend, "json")  # a module that can be imported on its own
    return {result.rule for result in check_backend(registry, backend) if result.outcome == "broken"}


@pytest.mark.process
def test_check_finds_a_wrong_store_and_passes_a_right_one():
    from memo_core.testing.fake_store import FakeStore

    class Deaf(FakeStore):
        def search(self, query, count):
            ids, scores = super().search(query, count)
            return ids[::-1], scores[::-1]

    right = Backend("vectorstore", "right", "for tests", lambda settings: FakeStore())
    wrong = Backend("vectorstore", "wrong", "for tests", lambda settings: Deaf())
    assert broken_rules(right) == set()
    assert broken_rules(wrong)


@pytest.mark.process
def test_check_finds_what_is_no_instance_of_the_interface_and_what_is_shared():
    from memo_core.testing.fake_store import FakeStore

    shared = FakeStore()
    assert "factory_makes_the_kinds_interface" in broken_rules(
        Backend("llm", "x", "for tests", lambda settings: object())
    )
    assert "factory_makes_the_kinds_interface" in broken_rules(
        Backend("vectorstore", "x", "for tests", lambda settings: shared)
    )


@pytest.mark.process
def test_check_finds_settings_without_help_and_defaults_that_are_not_allowed():
    import attrs

    @attrs.frozen
    class Silent:
        size: int = 3

    @attrs.frozen
    class WrongByDefault:
        size: int = attrs.field(default="big", metadata={"help": "how big"})  # type: ignore[assignment]

    def robot(settings: type) -> Backend:
        return Backend("robot", "x", "for tests", lambda settings: object(), settings)

    assert "every_setting_is_explained" in broken_rules(robot(Silent))
    assert "default_settings_pass_their_own_checks" in broken_rules(robot(WrongByDefault))


@pytest.mark.process
def test_check_finds_a_plugin_whose_import_is_heavy(tmp_path, monkeypatch):
    (tmp_path / "heavy_plugin.py").write_text("import scipy.spatial\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    backend = Backend("robot", "x", "for tests", lambda settings: object())
    registry = installed(backend, "heavy_plugin")
    rules = {r.rule: r.outcome for r in check_backend(registry, registry.get("robot", "x"))}
    assert rules["declaring_imports_nothing_heavy"] == "broken"


def test_a_name_can_be_qualified_by_its_kind():
    registry = Registry()
    [method] = find_backends(registry, "method/memo")
    assert method.name == "memo"
    with pytest.raises(UnknownName):
        find_backends(registry, "no-such-backend")
    with pytest.raises(UnknownName):
        find_backends(registry, "metod/memo")


def test_a_backend_is_not_made_without_the_secrets_it_needs(monkeypatch):
    """One line that names the variable, before anything begins; keys of which one suffices are the backend's matter."""
    needs = Needs(keys=("IMAGINARY_KEY",), optional_keys=("OTHER_KEY",))
    choice = Choice(Backend("llm", "imaginary", "x", lambda settings: "made", needs=needs), None)
    monkeypatch.delenv("OTHER_KEY", raising=False)
    monkeypatch.delenv("IMAGINARY_KEY", raising=False)
    with pytest.raises(BackendUnavailable) as raised:
        choice.create()
    missing = "missing environment variable IMAGINARY_KEY (export IMAGINARY_KEY=…)"
    assert str(raised.value) == f"llm 'imaginary' cannot be used: {missing}"
    monkeypatch.setenv("IMAGINARY_KEY", "x")
    assert choice.create() == "made"
