"""`memo doctor` recognises each fault that the troubleshooting page describes."""

from __future__ import annotations

import importlib.util
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import attrs
import pytest
import typer

from memo_core.cli import doctor
from memo_core.cli.faults import FAULTS
from memo_core.interfaces.backend import Backend, Needs
from memo_core.plugins import installing, not_installed, registry
from memo_core.plugins.hooks import hookimpl
from memo_core.plugins.registry import NoDefaultBackend, Registry
from memo_core.sandbox.sandbox import Sandbox
from memo_core.testing.fake_entry_point import FakeEntryPoint

ROOT = Path(__file__).parents[2]


def plugin(name: str, /, **changes: Any) -> FakeEntryPoint:
    backend = Backend("vectorstore", "flat", "keeps vectors", lambda settings: settings)

    @hookimpl
    def memo_vector_stores():
        return [attrs.evolve(backend, **changes)]

    return FakeEntryPoint(name, f"memo-{name}", memo_vector_stores=memo_vector_stores)


def raising(error: Exception) -> Callable[..., Any]:
    def call(*arguments: Any, **options: Any) -> Any:
        raise error

    return call


def nothing(patch: pytest.MonkeyPatch) -> None:
    pass


def no_coal(patch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    patch.setattr(importlib.util, "find_spec", lambda name, *more: None if name == "coal" else find(name, *more))


def no_display(patch: pytest.MonkeyPatch) -> None:
    patch.delenv("DISPLAY", raising=False)
    patch.delenv("WAYLAND_DISPLAY", raising=False)


def full_disk(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=3e8))


def proxy(patch: pytest.MonkeyPatch) -> None:
    patch.setenv("http_proxy", "http://user:secret@proxy.example:3128")
    patch.delenv("no_proxy", raising=False)
    patch.delenv("NO_PROXY", raising=False)


BROKEN = FakeEntryPoint("bad", "memo-bad", error=ImportError("no module x"))
PROVOKED: dict[str, tuple[list[FakeEntryPoint], Callable[[pytest.MonkeyPatch], None]]] = {
    "plugin": ([BROKEN], nothing),
    "names": ([plugin("one"), plugin("two")], nothing),
    "kind": ([], nothing),
    "uninstalled": ([], nothing),
    "module": ([plugin("one", needs=Needs(modules={"no_such_module_x": "x-dist"}))], nothing),
    "key": ([plugin("one", needs=Needs(keys=("X_KEY",)))], nothing),
    "extra": ([], no_coal),
    "display": ([], no_display),
    "disk": ([], full_disk),
    "proxy": ([], proxy),
}
OPENED: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "sandbox": lambda patch: patch.setattr(Sandbox, "run", raising(OSError("too many processes"))),
    "skillbook": lambda patch: patch.setattr(tempfile, "TemporaryDirectory", raising(OSError("read-only"))),
    "embedder": nothing,
    "simulator": nothing,
}


@pytest.mark.parametrize("fault", PROVOKED)
def test_a_quick_look_finds(fault, monkeypatch):
    plugins, provoke = PROVOKED[fault]
    provoke(monkeypatch)
    found = [finding for finding in doctor.examine(Registry(plugins), quick=True) if finding.fault == fault]
    assert found and all(finding.state != "ok" and finding.remedy for finding in found)
    assert "secret" not in str(found)


@pytest.mark.process
@pytest.mark.parametrize("fault", OPENED)
def test_a_full_look_finds(fault, monkeypatch):
    OPENED[fault](monkeypatch)
    [found] = [finding for finding in doctor.examine(Registry([]), quick=False) if finding.fault == fault]
    assert found.state == "missing" and found.detail


def test_pictures_that_cannot_be_rendered_are_optional():
    found = doctor._pictures(SimpleNamespace(render=raising(OSError("no libEGL"))), SimpleNamespace(cameras=[_CAMERA]))
    assert (found.fault, found.state) == ("pictures", "optional") and "libEGL" in found.detail


def test_every_fault_of_the_page_is_provoked_here_and_no_other_can_be_reported():
    assert {*PROVOKED, *OPENED, "pictures"} == set(FAULTS)
    with pytest.raises(ValueError):
        doctor.Finding("tea", "missing", fault="cold")


@pytest.fixture
def checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    """MEMO as installed from this checkout, wherever the environment that runs the tests has it from."""
    for module in (installing, not_installed):
        monkeypatch.setattr(module, "folder_of", lambda distribution: ROOT)


def missing(plugins: list[FakeEntryPoint], kind: str) -> doctor.Finding:
    found = doctor.examine(Registry(plugins), quick=True)
    [one] = [finding for finding in found if finding.what == kind and finding.fault == "kind"]
    return one


@pytest.mark.parametrize(
    ("kind", "folder"),
    [("simulator", "sim_mujoco"), ("suite", "tabletop"), ("llm", "offline"), ("embedder", "embedder")],
)
def test_what_is_missing_is_installed_by_the_plugin_of_the_default_in_pinned_versions(kind, folder, checkout):
    pinned = f"install -e {ROOT / 'plugins' / folder} --constraint {ROOT / 'constraints.txt'}"
    assert missing([], kind).remedy.endswith(pinned)


def test_a_simulator_with_scenes_of_its_own_only_is_named_beside_what_is_missing(checkout):
    backend = Backend("simulator", "libero", "builds its own scenes", lambda settings: settings, own_world=True)

    @hookimpl
    def memo_simulators():
        return [backend]

    own = [FakeEntryPoint("own", "memo-libero", memo_simulators=memo_simulators)]
    found = missing(own, "simulator")
    assert "only 'libero' is installed" in found.detail and "scenes of its own only" in found.detail
    assert "plugins/sim_mujoco" in found.remedy
    with pytest.raises(NoDefaultBackend, match=r"only 'libero' is installed.*sim_mujoco"):
        Registry(own).default("simulator")


def test_each_command_is_printed_once_with_all_that_it_brings(monkeypatch, capsys, checkout):
    needs = Needs(modules={"no_such_module_x": "x-dist"})
    lacking = [plugin("one", needs=needs), plugin("two", name="deep", needs=needs)]
    for plugins in ([], lacking):
        monkeypatch.setattr(registry, "Registry", lambda plugins=plugins: Registry(plugins))
        with pytest.raises(typer.Exit):
            doctor.command(quick=True)
        lines = capsys.readouterr().out.splitlines()
        commands = Counter(line.partition("  -> ")[2] for line in lines if "install " in line.partition("  -> ")[2])
        assert commands and set(commands.values()) == {1}
        [arms] = [line for line in lines if str(ROOT / "plugins" / "robots") in line]
        assert "robot ur5e, robot gen3" in arms
        [default] = [line for line in lines if str(ROOT / "plugins" / "tabletop") in line]
        assert default.startswith("MISSING  suite: no plugin") and "suite tabletop" in default and "quirks" in default
    deep = [line for line in lines if "no_such_module_x" in line]
    assert len(deep) == 2 and deep[1].endswith("  -> as for vectorstore deep")


def test_what_is_not_ok_names_its_fault():
    findings = [*doctor.examine(Registry(), quick=True), *doctor.examine(Registry([]), quick=True)]
    assert all((finding.state == "ok") == (finding.fault == "") for finding in findings)


def test_the_page_describes_every_fault():
    page = (Path(__file__).parents[2] / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    assert all(f"| `{name}` | {fault.sign} |" in page for name, fault in FAULTS.items())


_CAMERA = SimpleNamespace(name="front")
