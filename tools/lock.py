"""``make lock``: writes ``requirements.lock``, the versions of ``constraints.txt`` with the SHA-256 of their files.

``make setup LOCKED=1`` installs from it, and pip refuses every file whose hash is not in it. uv asks the package index for
the hashes of all files of a version, so that the lock holds for every platform and Python version.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
LOWEST_PYTHON = "3.11.5"
HEAD = "# Written by `make lock` from constraints.txt: the same versions, with the SHA-256 of their files.\n"
# Files that are not on the package index: PyTorch's own build without CUDA.
ELSEWHERE = {"torch": ["6746dbcbeb526eb61330b76b41ff1b4eb848951103a892eeb080dfa2b264667b"]}


def main() -> None:
    """Raises ``CalledProcessError`` where uv fails; it has said why."""
    options = ["--universal", "--no-deps", "--generate-hashes", "--no-header", "--no-annotate", "--quiet"]
    command = [sys.executable, "-m", "uv", "pip", "compile", *options, "--python-version", LOWEST_PYTHON]
    text = subprocess.run([*command, "constraints.txt"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    lines = []
    for line in text.splitlines():
        lines.append(line)
        for digest in ELSEWHERE.get(line.partition("==")[0], ()):
            lines.append(f"    --hash=sha256:{digest} \\")
    (ROOT / "requirements.lock").write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
