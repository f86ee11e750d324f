"""A release: one version for all distributions, and one folder that they are installed from.

    python tools/release.py version 0.2.0    # write the next version everywhere
    python tools/release.py build            # dist/memo-VERSION: wheels, sdists, constraints, lock file, release notes

``make release`` builds from a clean checkout only. Where the commit has a tag, it must be ``v`` and the version.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
_VERSION = re.compile(r"(\d+)\.(\d+)\.(\d+)")
_STATED = re.compile(r'^((?:__)?version(?:__)?(?: = "|: ))[\d.]+', re.MULTILINE)
_RANGE = re.compile(r'("memo-[a-z-]+(?:\[[a-z,]+\])?)>=[\d.]+,<[\d.]+"')

INSTALLING = """
## Installing

With this folder beside you, Python 3.11 or newer on Linux, and an empty virtual environment:

```
pip install --find-links memo-{version} --constraint memo-{version}/constraints.txt 'memo-core[demo]=={version}'
memo demo --replay
```

More plugins are added by the same command with their names in place of `memo-core[demo]`, such as
`memo-sim-pybullet=={version}`; `memo doctor` prints it for what is missing.

To install everything and have the hash of each file checked, choose a build of PyTorch first:

```
pip install --constraint memo-{version}/constraints.txt torch
pip install --find-links memo-{version} --require-hashes --no-deps --requirement memo-{version}/requirements.lock
```

`memo_core-{version}.tar.gz` holds the documentation (`docs`) and the experiment files (`examples`).
"""


class ReleaseError(Exception):
    """Something that a release needs is wrong; the message names the file or the command."""


def projects(root: Path = ROOT) -> list[Path]:
    """The folders of all distributions, the core first."""
    return [root, root / "benchmarks", *sorted(path.parent for path in root.glob("plugins/*/pyproject.toml"))]


def version_of(project: Path) -> str:
    """The version that a distribution states."""
    return str(tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"])


def set_version(version: str, root: Path = ROOT) -> None:
    """Write a version into all distributions, what they require of one another, CITATION.cff and README.md.

    Raises:
        ReleaseError: if it is not three numbers, or not stated once in a file.
    """
    numbers = _VERSION.fullmatch(version)
    if numbers is None:
        raise ReleaseError(f"version {version!r}: expected three numbers, such as 0.2.0")
    major, minor = int(numbers[1]), int(numbers[2])
    # What is imported may change with the first number, and before 1.0 with the second.
    allowed = f">={major}.{minor},<{major + 1}.0" if major else f">=0.{minor},<0.{minor + 1}"
    before = version_of(root)
    stating = [root / "memo_core" / "__init__.py", root / "CITATION.cff"]
    for file in [*(project / "pyproject.toml" for project in projects(root)), *stating]:
        text, stated = _STATED.subn(rf"\g<1>{version}", file.read_text(encoding="utf-8"))
        if stated != 1:
            raise ReleaseError(f"{file}: its version is stated {stated} times, expected once")
        file.write_text(_RANGE.sub(rf'\g<1>{allowed}"', text), encoding="utf-8")
    readme = (root / "README.md").read_text(encoding="utf-8")
    shown = re.sub(rf"(\bmemo(?:_core)?-|==){re.escape(before)}\b", rf"\g<1>{version}", readme)
    (root / "README.md").write_text(shown, encoding="utf-8")


def notes(version: str, root: Path = ROOT) -> str:
    """The release notes: the version's section of CHANGELOG.md, and how it is installed.

    Raises:
        ReleaseError: if there is no such section, or nothing in it.
    """
    text = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    found = re.search(rf"^## {re.escape(version)}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    if found is None or not found[1].strip():
        raise ReleaseError(f"CHANGELOG.md: nothing under a heading `## {version}`; expected what users notice")
    # Links to other files lead nowhere from here.
    changes = re.sub(r"\[([^]]+)\]\((?!https?:)[^)]*\)", r"\1", found[1].strip())
    return f"# MEMO {version}\n\n{changes}\n{INSTALLING.format(version=version)}"


def check_state(root: Path = ROOT) -> str:
    """Check that a release may be built from a checkout.

    Returns:
        The version.

    Raises:
        ReleaseError: if files are not committed, versions differ, or the commit's tag is of another version.
    """
    version = version_of(root)
    if changed := _git(root, "status", "--porcelain"):
        raise ReleaseError(f"files that are not committed:\n{changed}\ncommit or remove them")
    if other := [str(project) for project in projects(root) if version_of(project) != version]:
        raise ReleaseError(f"{', '.join(other)}: not the core's version {version}; run tools/release.py version")
    tags = [tag for tag in _git(root, "tag", "--points-at", "HEAD").split() if tag.startswith("v")]
    if tags and f"v{version}" not in tags:
        raise ReleaseError(f"the commit's tag is {', '.join(tags)}, its version {version}; expected v{version}")
    if not tags:
        print(f"no tag v{version} on this commit: a trial, not a release")
    return version


def copy_source(target: Path, root: Path = ROOT) -> None:
    """Copy the files that git knows or would add, and the licence into each distribution: so nothing is left in the
    checkout, and nothing of it that git ignores gets into a distribution."""
    for name in _git(root, "ls-files", "-z", "--cached", "--others", "--exclude-standard").split("\0"):
        if name and (file := root / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(file, target / name)
    for project in projects(target)[1:]:
        shutil.copy2(target / "LICENSE", project / "LICENSE")


def build(folder: Path, root: Path = ROOT) -> list[Path]:
    """Build all distributions, each sdist from the checkout and each wheel from its sdist, and write constraints, lock
    file and release notes beside them.

    Args:
        folder: where they are written.
        root: the checkout.

    Returns:
        The wheels.

    Raises:
        ReleaseError: if a distribution cannot be built, or CHANGELOG.md says nothing about the version.
    """
    version = version_of(root)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "RELEASE_NOTES.md").write_text(notes(version, root), encoding="utf-8")
    with tempfile.TemporaryDirectory(prefix="memo-source-") as name:
        source = Path(name) / "memo"
        copy_source(source, root)
        for project in projects(source):
            # Without isolation: the build backend is one of the development requirements, so no index is asked.
            command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(project)]
            done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
            if done.returncode:
                raise ReleaseError(f"{project.relative_to(source)} cannot be built:\n{done.stdout}")
    wheels = sorted(folder.glob("*.whl"))
    names = {wheel: wheel.name.split("-")[0].replace("_", "-") for wheel in wheels}
    pins = "".join(f"{name}=={version}\n" for name in names.values())
    hashed = "".join(
        f"{name}=={version} \\\n    --hash=sha256:{hashlib.sha256(wheel.read_bytes()).hexdigest()}\n"
        for wheel, name in names.items()
    )
    for file, own in (("constraints.txt", pins), ("requirements.lock", hashed)):
        (folder / file).write_text((root / file).read_text(encoding="utf-8") + own, encoding="utf-8")
    return wheels


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ReleaseError(f"git {arguments[0]} in {root}: {done.stderr.strip()}")
    return done.stdout


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description="Prepare or build a release.")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("version", help="write a version everywhere").add_argument("version")
    commands.add_parser("build", help="build dist/memo-VERSION")
    given = parser.parse_args(arguments)
    try:
        if given.command == "version":
            set_version(given.version)
            return 0
        version = check_state()
        folder = ROOT / "dist" / f"memo-{version}"
        shutil.rmtree(folder, ignore_errors=True)
        print(f"{len(build(folder))} wheels and as many sdists, lock file and notes: {folder.relative_to(ROOT)}")
    except ReleaseError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
