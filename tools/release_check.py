"""``make release-check``: are the wheels good for somebody who has only them?

Builds a wheel of every distribution, installs them with their requirements from the package index into an empty virtual
environment, checks that nothing is imported from the checkout, and runs the demo there. Takes minutes and downloads the
requirements, so it is run before a release and not by CI.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROJECTS = [ROOT, ROOT / "benchmarks", *sorted(path.parent for path in (ROOT / "plugins").glob("*/pyproject.toml"))]
EXTRAS = {"memo_core": "[arm,video]"}


def run(*command: str | Path, cwd: Path) -> str:
    """The command's output. Raises ``CalledProcessError``; what it complains of goes to the terminal."""
    return subprocess.run(command, cwd=cwd, check=True, stdout=subprocess.PIPE, text=True).stdout


def main() -> None:
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="memo-release-") as name:
        folder = Path(name)
        wheels = folder / "wheels"
        for project in PROJECTS:
            run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", wheels, project, cwd=folder)
        built = sorted(wheels.glob("*.whl"))
        assert len(built) == len(PROJECTS), f"{len(built)} wheels of {len(PROJECTS)} distributions"
        print(f"built {len(built)} wheels, {time.monotonic() - started:.0f} s")

        venv.create(folder / "venv", with_pip=True)
        python = folder / "venv" / "bin" / "python"
        # Each as it is, so that what asks for `memo-core[arm]` finds the core, and again with its extras.
        extras = [f"{wheel}{EXTRAS[name]}" for wheel in built if (name := wheel.name.split("-")[0]) in EXTRAS]
        constraints = ["--constraint", ROOT / "constraints.txt"]
        run(python, "-m", "pip", "install", "--quiet", *constraints, *built, *extras, cwd=folder)
        print(f"installed them into an empty environment, {time.monotonic() - started:.0f} s")

        found = run(python, "-c", "import memo_core; print(memo_core.__file__)", cwd=folder).strip()
        assert found.startswith(str(folder)), f"memo_core was imported from {found}"
        plugins = json.loads(run(python.parent / "memo", "plugins", "list", "--json", cwd=folder))
        assert not plugins["problems"], plugins["problems"]
        told = json.loads(run(python.parent / "memo", "demo", "--json", "--out", folder / "runs", cwd=folder))
        assert told["told"], f"the demo told another story: {told['reasons']}"
        print(f"the demo told its story, {time.monotonic() - started:.0f} s in all")


if __name__ == "__main__":
    main()
