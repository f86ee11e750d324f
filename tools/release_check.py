"""``make release-check``: does the folder of a release work without the checkout?

Builds the folder that ``make release`` builds, and follows its notes in an empty virtual environment: the core alone,
which must name what else to install; the demo, its recording and its stand-in; then all plugins. Nothing may be
imported from the checkout. Takes minutes and downloads the requirements, so it is run before a release and not by CI.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
import time
import venv
from pathlib import Path

import release


def run(*command: str | Path, cwd: Path) -> str:
    """The command's output. Raises ``CalledProcessError``; what it complains of goes to the terminal."""
    return subprocess.run(command, cwd=cwd, check=True, stdout=subprocess.PIPE, text=True).stdout


def refused(*command: str | Path, cwd: Path) -> str:
    """The complaint, in one line, of a command that must fail."""
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 2, f"{command[1:]} ended with {done.returncode}, expected 2: {done.stdout}{done.stderr}"
    return " ".join(done.stderr.split())


def main() -> None:
    started = time.monotonic()

    def say(what: str) -> None:
        print(f"{what}, {time.monotonic() - started:.0f} s", flush=True)

    version = release.version_of(release.ROOT)
    with tempfile.TemporaryDirectory(prefix="memo-release-") as name:
        folder = Path(name)
        wheels = release.build(folder / f"memo-{version}")
        assert len(wheels) == len(release.projects()), (
            f"{len(wheels)} wheels of {len(release.projects())} distributions"
        )
        say(f"built {len(wheels)} wheels")

        venv.create(folder / "venv", with_pip=True)
        binaries = folder / "venv" / "bin"
        memo = binaries / "memo"
        constraints = f"memo-{version}/constraints.txt"
        install = [
            binaries / "pip",
            "install",
            "--quiet",
            "--find-links",
            f"memo-{version}",
            "--constraint",
            constraints,
        ]

        run(*install, f"memo-core=={version}", cwd=folder)
        found = run(binaries / "python", "-c", "import memo_core; print(memo_core.__file__)", cwd=folder).strip()
        assert found.startswith(str(folder)), f"memo_core was imported from {found}"
        assert run(memo, "--version", cwd=folder).strip() == f"memo {version}"
        for arguments, plugin in (
            (["demo"], "memo-tabletop"),
            (["run", "--set", "llm=offline"], "memo-offline"),
            (["web"], "memo-web"),
        ):
            told = refused(memo, *arguments, cwd=folder)
            assert f"{constraints} {plugin}=={version}" in told, f"memo {' '.join(arguments)}: {told}"
        say("the core alone names what to install")

        run(*install, f"memo-core[demo]=={version}", cwd=folder)
        say("installed the demo")
        run(memo, "doctor", cwd=folder)
        for options in (["--replay"], []):
            story = json.loads(run(memo, "demo", *options, "--json", "--out", folder / "runs", cwd=folder))
            assert story["told"], f"memo demo {' '.join(options)} told another story: {story['reasons']}"
            say(f"memo demo {' '.join(options)}".strip() + " told its story")

        run(*install, *(wheel.name.split("-")[0].replace("_", "-") + f"=={version}" for wheel in wheels), cwd=folder)
        plugins = json.loads(run(memo, "plugins", "list", "--json", cwd=folder))
        assert not plugins["problems"], plugins["problems"]
        assert not plugins["not_installed"], plugins["not_installed"]
        say("installed all plugins")


if __name__ == "__main__":
    main()
