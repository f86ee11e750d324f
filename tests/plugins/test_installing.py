"""The commands that errors and `memo doctor` print do what they say, and damaged installations are recognised."""

from __future__ import annotations

import importlib.metadata
import shlex
import subprocess
import sys
import venv
from collections.abc import Iterator
from pathlib import Path

import pytest

from memo_core.interfaces.backend import Needs
from memo_core.plugins import installing
from memo_core.plugins.installing import damage, install, install_folder, pip_install, reinstall
from memo_core.plugins.registry import missing_needs

CORE = ("arm_sim/__init__.py", "arm_sim/_native.so", "arm_sim/tests/__init__.py", "arm_sim/readme.txt")


def distribution(site: Path, name: str, files: tuple[str, ...], requires: str = "") -> None:
    folder = site / f"{name.replace('-', '_')}-4.0.0.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text(f"Name: {name}\nVersion: 4.0.0\n" + (requires and f"Requires-Dist: {requires}\n"))
    (folder / "RECORD").write_text("".join(f"{file},sha256=x,1\n" for file in files))
    for file in files:
        (site / file).parent.mkdir(parents=True, exist_ok=True)
        (site / file).write_text("")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A simulator whose wheel was divided into two: arm-sim, which requires arm-sim-core; both are whole."""
    distribution(tmp_path, "arm-sim", ("arm_sim/doc.py",), "arm-sim-core==4.0.0")
    distribution(tmp_path, "arm-sim-core", CORE)
    monkeypatch.syspath_prepend(str(tmp_path))
    damage.cache_clear()
    yield tmp_path
    damage.cache_clear()


NEEDS = Needs(modules={"arm_sim": "arm-sim"})
ANEW = "install --force-reinstall --no-deps arm-sim-core==4.0.0 arm-sim==4.0.0"


def test_a_whole_installation_lacks_nothing(site):
    assert missing_needs(NEEDS) == ()


@pytest.mark.parametrize("gone", ["arm_sim/_native.so", "arm_sim/__init__.py"])
def test_files_that_an_upgrade_removed_are_found_and_all_sharing_distributions_reinstalled(site, gone):
    (site / gone).unlink()
    [lacking] = missing_needs(NEEDS)
    assert "1 files of arm-sim-core 4.0.0, which is installed" in lacking.what and gone in lacking.what
    assert lacking.remedy.endswith(ANEW)


@pytest.mark.parametrize("gone", ["arm_sim/tests/__init__.py", "arm_sim/readme.txt"])
def test_files_that_nothing_imports_may_be_removed(site, gone):
    (site / gone).unlink()
    assert missing_needs(NEEDS) == ()


def test_a_distribution_that_is_installed_without_its_module_is_installed_anew(site):
    needs = Needs(modules={"no_such_module_x": "arm-sim"})
    assert "--force-reinstall" in missing_needs(needs)[0].remedy  # a plain install would say "already satisfied"


def test_versions_are_those_that_an_installed_plugin_asks_for(monkeypatch):
    [asked] = [one for one in importlib.metadata.requires("memo-core") if one.startswith("sqlalchemy")]
    found = importlib.metadata.distribution

    def absent(name: str) -> importlib.metadata.Distribution:
        if name == "sqlalchemy":
            raise importlib.metadata.PackageNotFoundError(name)
        return found(name)

    monkeypatch.setattr(importlib.metadata, "distribution", absent)
    assert install("sqlalchemy") == reinstall("sqlalchemy", "sqlalchemy") == pip_install(asked)


def test_an_extra_of_a_checkout_is_installed_from_its_folder_in_pinned_versions(monkeypatch, tmp_path):
    root = Path(__file__).parents[2]
    monkeypatch.setattr(installing, "folder_of", lambda distribution: root)
    told = shlex.split(install("memo-core[arm]"))
    assert told[-4:] == ["-e", f"{root}[arm]", "--constraint", str(root / "constraints.txt")]
    assert shlex.split(install_folder(tmp_path))[-2:] == ["-e", str(tmp_path)], "not of the checkout"


@pytest.mark.process
def test_the_command_installs_into_the_environment_of_memo_activated_or_not(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    assert shlex.split(pip_install("x"))[:3] == [sys.executable, "-m", "pip"]
    environment = tmp_path / "a folder"
    venv.create(environment, with_pip=False)
    (environment / "bin" / "pip").write_text("#!/bin/sh\n")
    (environment / "bin" / "pip").chmod(0o755)
    code = "from memo_core.plugins.installing import pip_install; print(pip_install('x'))"
    path = {"PATH": str(environment / "bin"), "PYTHONPATH": ":".join(sys.path)}
    told = subprocess.run([environment / "bin" / "python", "-c", code], env=path, capture_output=True, text=True)
    assert told.stdout.strip() == "pip install x", told.stderr
