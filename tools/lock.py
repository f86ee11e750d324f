"""``make lock``: writes ``requirements.lock``, the versions of ``constraints.txt`` with the SHA-256 of their files.

``make setup LOCKED=1`` installs from it first, and pip refuses every file whose hash is not in it. uv asks the package
index for the hashes of all files of a version, so that the lock holds for every platform and Python version. It is
installed into a temporary folder: the environment holds what is pinned and nothing else.

PyTorch is left out: which build of it is taken, and with which CUDA libraries, is the machine's choice.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
UV = "uv==0.13.9"
LOWEST_PYTHON = "3.11.5"
LEFT_OUT = re.compile(r"^torch==.*\n", re.MULTILINE)
HEAD = (
    "# Written by `make lock` from constraints.txt: the same versions but PyTorch's, with the SHA-256 of their files.\n"
)


def main() -> None:
    """Raises ``CalledProcessError`` where pip or uv fails; it has said why."""
    options = ["--universal", "--no-deps", "--generate-hashes", "--no-header", "--no-annotate", "--quiet"]
    with tempfile.TemporaryDirectory() as folder:
        pins = Path(folder) / "pins.txt"
        pins.write_text(LEFT_OUT.sub("", (ROOT / "constraints.txt").read_text(encoding="utf-8")), encoding="utf-8")
        subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--target", folder, UV], check=True)
        uv = Path(folder) / "bin" / "uv"
        command = [uv, "pip", "compile", *options, "--python", sys.executable, "--python-version", LOWEST_PYTHON, pins]
        text = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    (ROOT / "requirements.lock").write_text(HEAD + text, encoding="utf-8")


if __name__ == "__main__":
    main()
