"""Wheels of the core and the plugins hold all they need and work where the checkout is not."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECTS = [ROOT, ROOT / "benchmarks", *sorted(path.parent for path in (ROOT / "plugins").glob("*/pyproject.toml"))]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The folder that `make release` builds."""
    spec = importlib.util.spec_from_file_location("release", ROOT / "tools" / "release.py")
    assert spec is not None and spec.loader is not None
    release = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(release)
    folder = tmp_path_factory.mktemp("release")
    release.build(folder)
    return folder


@pytest.fixture(scope="module")
def wheels(folder) -> dict[str, Path]:
    """Distribution name -> wheel."""
    return {path.name.split("-")[0].replace("_", "-"): path for path in folder.glob("*.whl")}


@pytest.fixture(scope="module")
def clean(tmp_path_factory, wheels) -> Path:
    """An environment with the third-party libraries of this one, the core and one plugin; returns its Python."""
    folder = tmp_path_factory.mktemp("clean")
    venv.create(folder, with_pip=False, symlinks=True)
    python = folder / "bin" / "python"
    code = "import sysconfig; print(sysconfig.get_path('purelib'))"
    packages = Path(subprocess.run([python, "-c", code], capture_output=True, text=True, check=True).stdout.strip())
    for item in Path(sysconfig.get_path("purelib")).iterdir():
        # Paths of editable installs would let the checkout in again.
        ours = item.name.startswith(("memo_", "_editable", "__editable", "_memo"))
        if not ours and (item.suffix != ".pth" or item.name == "cmeel.pth"):
            (packages / item.name).symlink_to(item)
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*install, str(wheels["memo-core"]), str(wheels["memo-franka"])], check=True, timeout=120)
    return python


def memo(python: Path, *arguments: str, folder: Path) -> str:
    done = subprocess.run([python.parent / "memo", *arguments], capture_output=True, text=True, timeout=60, cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.process
def test_every_project_becomes_a_wheel(wheels):
    assert len(wheels) == len(PROJECTS)


def test_nothing_but_byte_code_is_left_out_of_a_wheel(wheels):
    for project, package in [(ROOT, "memo_core"), *((p, next(p.glob("memo_*")).name) for p in PROJECTS[1:])]:
        wheel = wheels["memo-core" if package == "memo_core" else package.replace("_", "-")]
        inside = set(zipfile.ZipFile(wheel).namelist())
        files = [f for f in (project / package).rglob("*") if f.is_file() and f.suffix != ".pyc"]
        missing = {str(file.relative_to(project)) for file in files} - inside
        assert not missing, f"{wheel.name} lacks {missing}"


def test_each_wheel_says_what_it_is_and_under_which_licence(folder, wheels):
    version = re.search(r'^version = "(.*)"', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    assert version is not None
    for name, wheel in wheels.items():
        inside = zipfile.ZipFile(wheel)
        metadata = next(file for file in inside.namelist() if file.endswith(".dist-info/METADATA"))
        head, _, body = inside.read(metadata).decode().partition("\n\n")
        assert head.count("\nClassifier: ") > 5 and "\nProject-URL: " in head and "\nLicense-File: LICENSE" in head
        assert {"License-Expression: Apache-2.0", "Requires-Python: >=3.11"} <= set(head.split("\n")) and "MEMO" in body
        assert f"{name}=={version[1]} \\\n    --hash=sha256:" in (folder / "requirements.lock").read_text()
        assert f"{name}=={version[1]}\n" in (folder / "constraints.txt").read_text()
        assert any(file.endswith("/licenses/LICENSE") for file in inside.namelist()), wheel.name


def test_the_core_s_sdist_holds_the_documentation_and_the_examples_and_nothing_else_of_the_checkout(folder):
    [file] = folder.glob("memo_core-*.tar.gz")
    with tarfile.open(file) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    assert {"docs/tutorial.md", "docs/images/demo.gif", "examples/paper.yaml", "CHANGELOG.md", "README.md"} <= inside
    assert not any(name.startswith(("tests/", "plugins/", "benchmarks/", "tools/")) for name in inside)


@pytest.mark.process
def test_the_core_and_one_plugin_work_in_a_clean_environment(clean, tmp_path):
    code = "import memo_core, memo_franka; print(memo_core.__file__, memo_franka.__file__)"
    where = subprocess.run([clean, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path).stdout
    assert str(ROOT) not in where
    assert "Usage: memo" in memo(clean, "--help", folder=tmp_path)
    listed = json.loads(memo(clean, "plugins", "list", "--json", folder=tmp_path))
    assert {plugin["distribution"] for plugin in listed["plugins"]} == {"memo-core", "memo-franka"}
    assert listed["problems"] == []
    assert "panda" in {backend["name"] for backend in listed["backends"]}
    assert "# Plan" in memo(clean, "prompts", "show", "plan", folder=tmp_path)
    assert json.loads(memo(clean, "plugins", "check", "panda", "--json", folder=tmp_path))["conforms"]
