"""``memo doctor``: checks what works on this machine, and says how to make the rest work."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import shutil
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlsplit

import attrs
import typer

from memo_core.cli.faults import FAULTS
from memo_core.cli.options import Json
from memo_core.cli.output import print_json
from memo_core.errors import MemoError
from memo_core.plugins.installing import EXTRAS, install

if TYPE_CHECKING:
    from memo_core.plugins.not_installed import Uninstalled
    from memo_core.plugins.registry import Registry

_LEAST_FREE_GB = 1.0


@attrs.frozen
class Finding:
    """One line. ``state``: ok, missing (required) or optional; ``fault``: unless ok, the entry of ``FAULTS``."""

    what: str
    state: str
    detail: str = ""
    remedy: str = ""
    fault: str = attrs.field(default="", validator=attrs.validators.in_({"", *FAULTS}))


def command(
    quick: Annotated[bool, typer.Option("--quick", help="Look only; open no simulator and no embedder.")] = False,
    json: Json = False,
) -> None:
    """Check what works on this machine, and say how to make the rest work. Exit code 1 when something is missing."""
    from memo_core.plugins.registry import Registry

    findings: list[Finding] = []
    for finding in examine(Registry(), quick):
        if not json:
            print(_line(finding, findings), flush=True)
        findings.append(finding)
    if json:
        print_json({"checks": [attrs.asdict(finding) for finding in findings]})
    if any(finding.state == "missing" for finding in findings):
        raise typer.Exit(1)


def examine(registry: Registry, quick: bool) -> Iterator[Finding]:
    """Check this machine and the installed plugins, one finding after the other.

    Args:
        registry: the installed plugins.
        quick: leave out what starts a process or opens a backend.
    """
    yield _python()
    yield Finding("machine", "ok", f"{platform.machine()}, {os.cpu_count()} processors, {_memory()} of memory")
    yield from _plugins(registry)
    yield from _backends(registry)
    yield from _extras()
    yield _display()
    yield _disk()
    yield _proxy()
    if not quick:
        yield _tried("sandbox", _try_sandbox)
        yield _tried("skillbook", _try_skillbook)
        yield _tried("embedder", lambda: _try_embedder(registry))
        yield from _simulator(registry)


def _python() -> Finding:
    return Finding("Python", "ok", f"{platform.python_version()}, memo-core {importlib.metadata.version('memo-core')}")


def _plugins(registry: Registry) -> Iterator[Finding]:
    for plugin in registry.plugins:
        offered = ", ".join(f"{backend.kind} {backend.name}" for backend in plugin.backends) or "nothing"
        if plugin.error:
            yield Finding(
                f"plugin {plugin.distribution}",
                "missing",
                plugin.error,
                f"repair or uninstall {plugin.distribution}",
                "plugin",
            )
        else:
            yield Finding(f"plugin {plugin.distribution}", "ok", offered)
    for kind, name in registry.ambiguous:
        try:
            registry.get(kind, name)
        except MemoError as error:
            yield Finding(f"{kind} {name}", "missing", str(error), "uninstall one of them", "names")


def _backends(registry: Registry) -> Iterator[Finding]:
    from memo_core.interfaces.backend import KINDS, Needs
    from memo_core.plugins.registry import missing_needs

    told = set()
    for kind in KINDS:
        if kind != "skills":
            for finding in _absent(registry, kind):
                told.add(finding.remedy)
                yield finding
        for backend in registry.backends(kind):
            for lacking in missing_needs(attrs.evolve(backend.needs, keys=())):
                state = "optional" if not backend.default and len(registry.backends(kind)) > 1 else "missing"
                yield Finding(f"{kind} {backend.name}", state, f"needs {lacking.what}", lacking.remedy, "module")
            # Only who selects a backend needs its keys, and one of several providers' keys is enough.
            for lacking in missing_needs(Needs(keys=backend.needs.secrets)):
                yield Finding(f"{kind} {backend.name}", "optional", f"no {lacking.what}", lacking.remedy, "key")
    for one in registry.uninstalled():
        if one.command not in told:
            what, detail = f"plugin {one.distribution}", f"not installed; it brings {_brought(one)}"
            yield Finding(what, "optional", detail, one.command, "uninstalled")


def _absent(registry: Registry, kind: str) -> Iterator[Finding]:
    from memo_core.plugins.registry import NoDefaultBackend

    try:
        registry.default(kind)
    except NoDefaultBackend as error:
        if not error.candidates:
            remedy = error.remedy or f"install a plugin that offers a {kind}"
            offering = [one for one in registry.offering(kind) if one.command == remedy]
            brought = "".join(f"; {one.distribution} brings {_brought(one)}" for one in offering)
            yield Finding(kind, "missing", error.reason + brought, remedy, "kind")
    except MemoError:
        return  # two declare the same name, which is found with the plugins


def _brought(one: Uninstalled) -> str:
    return ", ".join(f"{kind} {name}" for kind, name in one.offers)


def _extras() -> Iterator[Finding]:
    for extra, (use, modules) in EXTRAS.items():
        lacking = [module for module in modules if importlib.util.find_spec(module) is None]
        if lacking:
            state = "missing" if extra == "arm" else "optional"
            needs = f"{use} needs {', '.join(lacking)}"
            yield Finding(f"extra {extra}", state, needs, install(f"memo-core[{extra}]"), "extra")
        else:
            yield Finding(f"extra {extra}", "ok", use)


def _display() -> Finding:
    display = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY")
    if display or sys.platform in ("darwin", "win32"):
        return Finding("display", "ok", display or sys.platform)
    return Finding(
        "display", "optional", "none, so --view opens no window; videos need none", "ssh -X, or a desktop", "display"
    )


def _disk() -> Finding:
    free = shutil.disk_usage(Path.cwd()).free / 1e9
    if free < _LEAST_FREE_GB:
        return Finding("disk", "optional", f"{free:.1f} GB free here, where runs are written", "free space", "disk")
    return Finding("disk", "ok", f"{free:.0f} GB free here, where runs are written")


def _proxy() -> Finding:
    proxy = urllib.request.getproxies().get("http", "")
    if proxy and not urllib.request.proxy_bypass("127.0.0.1"):
        detail = f"{urlsplit(proxy).hostname} is also asked for model servers on this machine"
        return Finding("proxy", "optional", detail, "export NO_PROXY=localhost,127.0.0.1", "proxy")
    return Finding("proxy", "ok", "none stands before this machine's own servers")


def _tried(what: str, attempt: Callable[[], str]) -> Finding:
    try:
        return Finding(what, "ok", attempt())
    except MemoError as error:
        return Finding(what, "missing", *_told(error), what)
    except Exception as error:
        return Finding(what, "missing", f"{type(error).__name__}: {' '.join(str(error).split())}", "", what)


def _told(error: Exception) -> tuple[str, str]:
    """Say what is wrong, in one line, and the remedy."""
    return " ".join(str(getattr(error, "reason", error)).split()), getattr(error, "remedy", "")


def _try_sandbox() -> str:
    from memo_core.sandbox.sandbox import Sandbox
    from memo_core.testing.fake_control import FakeControl

    started = time.monotonic()
    with Sandbox({}) as sandbox:
        execution = sandbox.run("print(6 * 7)", FakeControl(), stopped=lambda: False)
    if execution.printed.strip() != "42":
        raise RuntimeError(execution.error or f"printed {execution.printed!r}")
    return f"runs code, {_ms(started)} from nothing to the answer"


def _try_skillbook() -> str:
    from memo_core.skillbook import stats
    from memo_core.skillbook.book import Skillbook

    with tempfile.TemporaryDirectory() as folder:
        started = time.monotonic()
        with Skillbook(f"sqlite:///{Path(folder) / 'book.db'}") as book:
            stats.stats_of(book)
        return f"a new book opens in {_ms(started)}"


def _try_embedder(registry: Registry) -> str:
    embedder = _made(registry, "embedder")
    started = time.monotonic()
    embedder.open()
    try:
        opened = _ms(started)
        started = time.monotonic()
        embedder.embed(["open the door"])
        return f"{embedder.name}: opens in {opened}, {_ms(started)} a text"
    finally:
        embedder.close()


def _simulator(registry: Registry) -> Iterator[Finding]:
    """Physics and rendering are tested separately, since a machine without GL libraries can still simulate."""
    from memo_core.testing.simulator_scenes import check_robot, check_scene

    try:
        simulator = _made(registry, "simulator")
        simulator.open()
    except Exception as error:
        yield Finding("simulator", "missing", *_told(error), "simulator")
        return
    try:
        scene = check_scene()
        simulator.build(scene, check_robot())
        started = time.monotonic()
        for _ in range(100):
            simulator.tick()
        spent = time.monotonic() - started
        yield Finding(
            "simulator", "ok", f"{100 * simulator.control_period / spent:.0f} times real time in a small scene"
        )
        yield _pictures(simulator, scene)
    except Exception as error:
        said = f"{type(error).__name__}: {' '.join(str(error).split())}"
        yield Finding("simulator", "missing", said, "", "simulator")
    finally:
        simulator.close()


def _pictures(simulator: Any, scene: Any) -> Finding:
    if not scene.cameras:
        return Finding("pictures", "ok", "not tried, the scene has no camera")
    try:
        simulator.render(scene.cameras[0].name, 640, 480)
        started = time.monotonic()
        simulator.render(scene.cameras[0].name, 640, 480)
    except Exception as error:
        return Finding("pictures", "optional", *_told(error), "pictures")
    return Finding("pictures", "ok", f"640x480 in {_ms(started)}")


def _made(registry: Registry, kind: str) -> Any:
    from memo_core.config import load_experiment

    return load_experiment(registry).create(kind)


def _ms(started: float) -> str:
    return f"{(time.monotonic() - started) * 1000:.0f} ms"


def _memory() -> str:
    try:
        return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / (1 << 30):.1f} GiB"
    except (ValueError, OSError, AttributeError):
        return "an unknown amount"


def _line(finding: Finding, before: Sequence[Finding] = ()) -> str:
    """The finding as printed; a command that was printed for one ``before`` is not repeated, but for that of a key."""
    mark = {"ok": "ok      ", "missing": "MISSING ", "optional": "optional"}[finding.state]
    said = f"{mark} {finding.what}: {finding.detail}" if finding.detail else f"{mark} {finding.what}"
    same = next((one.what for one in before if one.remedy == finding.remedy and one.fault != "key"), "")
    remedy = f"as for {same}" if same else finding.remedy
    return said + (f"  -> {remedy}" if finding.remedy else "")
