"""A release has one version everywhere, notes and a tag that fits, and errors name what to install."""

from __future__ import annotations

import importlib.util
import re
import shlex
import shutil
import subprocess
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

from memo_core.cli.app import run_app
from memo_core.plugins import installing, not_installed
from memo_core.plugins.registry import NoDefaultBackend, Registry, UnknownBackend

ROOT = Path(__file__).parents[1]


def script() -> ModuleType:
    """``tools/release.py``, which is no package."""
    spec = importlib.util.spec_from_file_location("release", ROOT / "tools" / "release.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


RELEASE = script()
VERSION = RELEASE.version_of(ROOT)


def about(project: Path) -> dict:
    return tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The files of the checkout that state the version, and the changelog."""
    for project in RELEASE.projects():
        (tmp_path / project.relative_to(ROOT)).mkdir(parents=True, exist_ok=True)
        shutil.copy2(project / "pyproject.toml", tmp_path / project.relative_to(ROOT))
    (tmp_path / "memo_core").mkdir()
    for name in ("CITATION.cff", "README.md", "CHANGELOG.md", "memo_core/__init__.py"):
        shutil.copy2(ROOT / name, tmp_path / name)
    return tmp_path


def test_all_distributions_have_the_version_and_the_same_facts():
    shared = ("version", "license", "authors", "requires-python", "classifiers", "urls")
    core = about(ROOT)
    for project in RELEASE.projects()[1:]:
        stated = about(project)
        assert {key: stated[key] for key in shared} == {key: core[key] for key in shared}, project
        assert stated["description"] and stated["readme"], project
    assert f"\nversion: {VERSION}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


@pytest.mark.parametrize(("version", "allowed"), [("0.2.0", ">=0.2,<0.3"), ("1.4.2", ">=1.4,<2.0")])
def test_a_version_is_written_everywhere(version, allowed, copy):
    RELEASE.set_version(version, copy)
    for project in RELEASE.projects(copy):
        stated = about(project)
        assert stated["version"] == version
        extras = stated.get("optional-dependencies", {}).values()
        ours = [one for group in (stated["dependencies"], *extras) for one in group if one.startswith("memo-")]
        assert ours and all(one.endswith(allowed) for one in ours), (project, ours)
    for name, shown in (
        ("CITATION.cff", f"\nversion: {version}\n"),
        ("memo_core/__init__.py", f'\n__version__ = "{version}"\n'),
        (
            "README.md",
            f"--find-links memo-{version} --constraint memo-{version}/constraints.txt 'memo-core[demo]=={version}'",
        ),
    ):
        assert shown in (copy / name).read_text(encoding="utf-8")
    RELEASE.set_version(VERSION, copy)
    for file in (path for path in copy.rglob("*") if path.is_file()):
        assert file.read_bytes() == (ROOT / file.relative_to(copy)).read_bytes(), file


@pytest.mark.parametrize("version", ["0.2", "v0.2.0", "0.2.0rc1"])
def test_what_is_no_version_is_refused(version, copy):
    with pytest.raises(RELEASE.ReleaseError, match=r"expected three numbers"):
        RELEASE.set_version(version, copy)


def test_the_notes_are_the_changelog_of_the_version_and_how_to_install_it(tmp_path):
    changes = "# Changelog\n\n## 0.2.0\n\n- [Doors](docs/doors.md) open.\n\n## 0.1.0\n- The first.\n"
    (tmp_path / "CHANGELOG.md").write_text(changes, encoding="utf-8")
    notes = RELEASE.notes("0.2.0", tmp_path)
    assert "# MEMO 0.2.0\n\n- Doors open.\n" in notes and "The first" not in notes
    assert "--find-links memo-0.2.0" in notes and "memo-core[demo]==0.2.0" in notes
    with pytest.raises(RELEASE.ReleaseError, match=r"CHANGELOG\.md.*`## 0\.3\.0`"):
        RELEASE.notes("0.3.0", tmp_path)


def test_this_version_has_notes():
    assert RELEASE.notes(VERSION)


@pytest.mark.process
def test_a_release_is_built_of_what_is_committed_and_tagged_as_its_version(copy, capsys):
    def git(*arguments: str) -> None:
        identity = ("-c", "user.name=x", "-c", "user.email=x@example.org", "-c", "commit.gpgsign=false")
        subprocess.run(["git", *identity, *arguments], cwd=copy, check=True, capture_output=True)

    git("init")
    with pytest.raises(RELEASE.ReleaseError, match="not committed"):
        RELEASE.check_state(copy)
    git("add", ".")
    git("commit", "-m", "x")
    assert RELEASE.check_state(copy) == VERSION and "a trial" in capsys.readouterr().out
    git("tag", "v99.0.0")
    with pytest.raises(RELEASE.ReleaseError, match=rf"v99\.0\.0.*expected v{VERSION}"):
        RELEASE.check_state(copy)
    git("tag", f"v{VERSION}")
    assert RELEASE.check_state(copy) == VERSION and capsys.readouterr().out == ""
    file = copy / "plugins" / "wsg" / "pyproject.toml"
    file.write_text(file.read_text(encoding="utf-8").replace(f'"{VERSION}"', '"77.0.0"'), encoding="utf-8")
    git("commit", "-am", "y")
    with pytest.raises(RELEASE.ReleaseError, match="wsg: not the core's version"):
        RELEASE.check_state(copy)


# -- an installation from wheels ---------------------------------------------------------------------------------------
@pytest.fixture
def from_wheels(monkeypatch: pytest.MonkeyPatch) -> Registry:
    """The core alone, installed from its wheel: the installer recorded no folder."""
    monkeypatch.setattr(not_installed, "folder_of", lambda distribution: None)
    monkeypatch.setattr(installing, "folder_of", lambda distribution: None)
    return Registry([])


def command(distribution: str) -> str:
    return f"install --find-links memo-{VERSION} --constraint memo-{VERSION}/constraints.txt {distribution}=={VERSION}"


def test_without_a_checkout_a_missing_backend_names_its_distribution(from_wheels):
    with pytest.raises(UnknownBackend) as caught:
        from_wheels.get("simulator", "pybullet")
    assert command("memo-sim-pybullet") in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "distribution"),
    [("simulator", "memo-sim-mujoco"), ("suite", "memo-tabletop"), ("llm", "memo-offline"), ("robot", "memo-franka")],
)
def test_the_plugin_of_the_default_is_named(kind, distribution, from_wheels):
    with pytest.raises(NoDefaultBackend) as caught:
        from_wheels.default(kind)
    assert command(distribution) in str(caught.value)


def test_a_command_of_a_plugin_that_is_not_installed_names_it(from_wheels, monkeypatch):
    monkeypatch.setattr("memo_core.cli.app.plugin_commands", list)
    with pytest.raises(not_installed.CommandNotInstalled) as caught:
        run_app(["web"])
    assert command("memo-web") in str(caught.value)
    assert run_app(["wbe"]) == 2  # who misspells is not told to install something


@pytest.mark.parametrize("wanted", ["memo-core[arm]", "memo-perception[local]"])
def test_an_extra_comes_from_the_release_too(wanted, from_wheels):
    told = shlex.split(installing.install(wanted))
    assert told[-1] == f"{wanted}=={VERSION}" and f"memo-{VERSION}" in told


def test_a_wheel_that_was_installed_by_its_path_is_no_checkout(monkeypatch, tmp_path):
    class Recorded:
        def read_text(self, name: str) -> str:
            return f'{{"url": "file://{tmp_path}/memo_core-0.1.0-py3-none-any.whl"}}'

    (tmp_path / "memo_core-0.1.0-py3-none-any.whl").write_bytes(b"")
    monkeypatch.setattr(installing.importlib.metadata, "distribution", lambda name: Recorded())
    assert installing.folder_of("memo-core") is None


def test_the_extra_demo_is_what_make_demo_installs():
    listed = (ROOT / "Makefile").read_text(encoding="utf-8").partition("DEMO_PLUGINS := $(addprefix plugins/,")[2]
    folders = listed.partition(")")[0].split()
    extra = " ".join(about(ROOT)["optional-dependencies"]["demo"])
    named = set(re.findall(r"(memo-[a-z-]+)>", extra))
    assert {about(ROOT / "plugins" / folder)["name"] for folder in folders} == named
