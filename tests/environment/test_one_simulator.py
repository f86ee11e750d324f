"""Installing only one of the two simulators works; the other is reported as not installed, with what installs it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import tomllib
from pathlib import Path

import pytest

from memo_core.plugins.not_installed import uninstalled
from memo_core.plugins.registry import Registry, UnknownBackend

ROOT = Path(__file__).parents[2]
ABSENT = {
    "mujoco": ("memo_sim_mujoco", "mujoco"),
    "pybullet": ("memo_sim_pybullet", "pybullet"),
    "offline": ("memo_offline",),
}


def without(absent: str, site: Path) -> list[str]:
    """The command of a MEMO in whose site-packages that backend is not."""
    site.mkdir()
    for entry in Path(sysconfig.get_path("purelib")).iterdir():
        name = entry.name.lower().removeprefix("_editable_impl_").removeprefix("__editable__.")
        if not name.startswith(ABSENT[absent]) and entry.name != "__pycache__":
            (site / entry.name).symlink_to(entry)
    program = f"import site; site.addsitedir({str(site)!r}); from memo_core.cli.main import main; main()"
    return [sys._base_executable, "-S", "-c", program]  # type: ignore[attr-defined]


def memo(command: list[str], *arguments: str, code: int = 0) -> str:
    # The sandbox's interpreter is a program beside Python's.
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    environment = {**os.environ, "PATH": path}
    done = subprocess.run([*command, *arguments], capture_output=True, text=True, timeout=240, env=environment)
    assert done.returncode == code, done.stderr
    return done.stdout if code == 0 else done.stderr


@pytest.mark.process
@pytest.mark.parametrize(("absent", "present"), [("mujoco", "pybullet"), ("pybullet", "mujoco")])
def test_one_alone_works_and_the_other_is_not_installed(absent, present, tmp_path):
    command = without(absent, tmp_path / "site")
    folder = f"plugins/sim_{absent}"

    said = json.loads(memo(command, "tasks", "verify", "pick-the-left-can", "--seeds", "0", "--json"))
    assert said["tasks"][0]["reference"] == 1, "nobody chose: the one there is serves"

    refused = memo(command, "tasks", "verify", "--set", f"simulator.backend={absent}", code=2)
    assert "not installed" in refused and present in refused.rpartition("installed: ")[2]
    assert f"pip install -e {ROOT / folder}" in " ".join(refused.split()).replace(" \n", "")

    listed = json.loads(memo(command, "plugins", "list", "--json"))["not_installed"]
    assert [one["offers"] for one in listed] == [[{"kind": "simulator", "name": absent}]]
    doctor = json.loads(memo(command, "doctor", "--quick", "--json"))["checks"]
    assert any(f"simulator {absent}" in one["detail"] and folder in one["remedy"] for one in doctor)


@pytest.mark.process
def test_without_the_stand_in_for_a_model_its_name_is_refused_with_what_installs_it(tmp_path):
    command = without("offline", tmp_path / "site")
    refused = memo(command, "run", "--task", "open-the-fridge", "--set", "llm=offline", "--out", str(tmp_path), code=2)
    assert "not installed" in refused and "Traceback" not in refused
    assert f"pip install -e {ROOT / 'plugins/offline'}" in " ".join(refused.split())


def test_every_plugin_of_the_checkout_says_what_it_offers():
    registry = Registry()
    offered: dict[str, set[str]] = {}
    for plugin in registry.plugins:
        offered.setdefault(plugin.distribution, set()).update(
            f"{b.kind} {b.name}" + " default" * b.default for b in plugin.backends
        )
    for file in (ROOT / "plugins").glob("*/pyproject.toml"):
        project = tomllib.loads(file.read_text())
        offers = project.get("tool", {}).get("memo", {}).get("offers", [])
        assert set(offers) == offered.get(project["project"]["name"], set()), file


def test_who_misspells_is_not_told_to_install_something():
    with pytest.raises(UnknownBackend) as caught:
        Registry().get("simulator", "pybulet")
    assert "install" not in str(caught.value)


def test_a_folder_that_is_no_plugin_is_passed_over(tmp_path):
    for name, text in (("a", "no toml ["), ("b", '[project]\nname = "b"'), ("c", "[tool.memo]\noffers = 3")):
        (tmp_path / "plugins" / name).mkdir(parents=True)
        (tmp_path / "plugins" / name / "pyproject.toml").write_text(text)
    (tmp_path / "plugins" / "d").mkdir()
    (tmp_path / "plugins" / "d" / "pyproject.toml").write_text(
        '[project]\nname = "memo-d"\n[tool.memo]\noffers = ["robot d"]\n'
    )
    assert [one.distribution for one in uninstalled((), tmp_path)] == ["memo-d"]
    assert uninstalled({"memo-d"}, tmp_path) == ()
