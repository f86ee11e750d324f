"""The process that checks and rewrites generated code; it is separate because hostile source decides how much work that
is. The parent (``check_process``) starts ``serve`` with an empty environment and kills it when it takes too long. It
reads one line of JSON per program and answers with one. It imports little, so that it starts within a tenth of a
second.
"""

from __future__ import annotations

import ast
import json
import resource
import signal
import sys
from typing import Any

import attrs

from memo_core.sandbox import subset
from memo_core.sandbox.rewrite import rewrite
from memo_core.sandbox.subset import Finding, SkillShape

_INTERPRETER_BYTES = 256 << 20  # of addresses that the process has before it has read any program


@attrs.frozen
class Checked:
    """A program in the form that the interpreter can run, or the reason why it cannot. ``lines`` as in
    ``Rewritten``."""

    source: str = ""
    lines: tuple[tuple[int, int], ...] = ()
    arrays: bool = False
    findings: tuple[Finding, ...] = ()


def checked(code: str, skills: dict[str, SkillShape]) -> Checked:
    """Check one program and rewrite it."""
    try:
        tree = ast.parse(code)
        if findings := subset.check(tree, skills):
            return Checked(findings=tuple(findings))
        arrays = subset.uses_arrays(tree)
        rewritten = rewrite(code, tree, arrays)
    except SyntaxError as error:
        return Checked(findings=(Finding(error.lineno or 1, f"syntax error: {error.msg}"),))
    except (ValueError, RecursionError):
        return Checked(findings=(Finding(1, "syntax error: nested too deeply, or quotes within quotes"),))
    except MemoryError:
        return Checked(findings=(Finding(1, "the code needs too much memory to be checked"),))
    return Checked(rewritten.source, rewritten.lines, arrays)


def serve() -> None:
    """Answer programs until stdin ends. The first line holds the skills and the limits."""
    given = json.loads(sys.stdin.readline())
    skills = {one["name"]: SkillShape(**one) for one in given["skills"]}
    _confine(given["memory"])
    for line in sys.stdin:
        # Should the parent be gone: the alarm's default action ends the process, whatever it is doing.
        signal.setitimer(signal.ITIMER_REAL, given["seconds"] + 1.0)
        answer = attrs.asdict(checked(json.loads(line), skills))
        print(json.dumps(answer), flush=True)
        signal.setitimer(signal.ITIMER_REAL, 0)


def from_json(answer: dict[str, Any]) -> Checked:
    """Parse what ``serve`` wrote."""
    return Checked(
        answer["source"],
        tuple((new, old) for new, old in answer["lines"]),
        answer["arrays"],
        tuple(Finding(**finding) for finding in answer["findings"]),
    )


def _confine(memory: int) -> None:
    """Forbid core dumps and writing files, and limit memory to ``memory`` bytes beyond what Python itself uses."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (memory + _INTERPRETER_BYTES,) * 2)
