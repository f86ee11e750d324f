"""Robot code: the reference solutions of the tasks and small programs, changed token by token and statement by
statement, and expressions that cost more than they look."""

from __future__ import annotations

import ast
import copy
import io
import tokenize
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random

from memo_benchmarks.fuzz.kind import Command, Kind, Memo
from memo_benchmarks.fuzz.mutations import damaged_bytes, damaged_text, text

TASK = "put-the-cube-away"
SMALL = (
    "for i in range(3):\n    print(i, get_position('red cube'))\n",
    "import math\nimport numpy as np\na = np.array([1.0, 2.0])\nprint(a * 2 + np.linalg.norm(a), math.pi)\n",
    "def f(x, *rest, y=1, **more):\n    return x + y + sum(rest)\nprint(f(1, 2, y=3), [f(n) for n in range(4)])\n",
    "try:\n    move_to([9, 9, 9])\nexcept RuntimeError as error:\n    print(error)\nfinally:\n    print('end')\n",
    "class A:\n    def __init__(self, x):\n        self.x = x\n    def twice(self):\n        return self.x * 2\n"
    "print(A(2).twice())\n",
    "with_dict = {k: v for k, v in zip('abc', range(3))}\nwith_dict.pop('a')\nprint(f'{with_dict!r:>20}')\n",
    "x = 0\nwhile x < 5:\n    x += 1\n    if x == 3:\n        continue\n    print(x)\nelse:\n    print('done')\n",
    "open_gripper()\np = get_position('red cube')\nmove_to([p[0], p[1], p[2] + 0.1])\nclose_gripper()\n",
    "match [1, 2]:\n    case [a, b] if a < b:\n        print(a)\n    case _:\n        pass\n",
    "f = lambda *a: (yield a)\nprint((x := 3), *[1, 2], sep='-')\nassert x == 3, 'no'\n",
)
ROOTS = ("x", "{}", "[]", "''", "get_position", "print", "np", "math", "A", "(1).real", "f''", "object", "type", "()")
NAMES = (
    "__class__",
    "__globals__",
    "__init__",
    "pop",
    "items",
    "format",
    "__subclasses__",
    "real",
    "T",
    "sort",
    "copy",
)
_CHAINS: tuple[Callable[[str, str, int], str], ...] = (
    lambda root, name, n: root + f".{name}" * n,
    lambda root, name, n: root + f".{name}()" * n,
    lambda root, name, n: root + "[0]" * n,
    lambda root, name, n: "(" * n + root + ")" * n,
    lambda root, name, n: "-" * n + root,
    lambda root, name, n: "not " * n + root,
    lambda root, name, n: "[" * n + root + "]" * n,
    lambda root, name, n: "lambda: " * n + root,
    lambda root, name, n: f"{root} if {root} else " * n + root,
    lambda root, name, n: f"{root} + " * n + root,
    lambda root, name, n: f"{root} ** " * n + root,
    lambda root, name, n: f"{root} < " * n + root,
    lambda root, name, n: f"{name}(" * n + root + ")" * n,
    lambda root, name, n: f"[{root} for {root} in " * n + root + "]" * n,
    lambda root, name, n: "".join(f"{' ' * i}if {root}:\n" for i in range(n)) + " " * n + "pass",
    lambda root, name, n: "".join(f"{' ' * i}def f{i}():\n" for i in range(n)) + " " * n + f"return {root}",
    lambda root, name, n: f"a = [{root}]\n" + "a = [a, a]\n" * n + "print(a)",
    lambda root, name, n: "a = 'x'\n" + "a += a\n" * n + "print(len(a))",
    lambda root, name, n: "a = 7\n" + "a = a * a\n" * n + "print(a)",
    lambda root, name, n: f"print({root!r} * {10**7 * n})",
    lambda root, name, n: f"{root} = 1\n" * n,
    lambda root, name, n: f"print('{chr(0x1b)}[2J' * {n}, {root}.{name})",
    lambda root, name, n: f"raise ValueError('{ESC}' * {n})",
    lambda root, name, n: "f'" + "{" * n + root + "}" * n + "'",
    lambda root, name, n: f"x = {'9' * n * 40}\nprint(x)",
    lambda root, name, n: f"move_to({'[' * n}{root}{']' * n})",
    lambda root, name, n: f"move_to([float('nan'), 1e{n}, {root}])",
    lambda root, name, n: f"print(sorted(range({n}00), key=lambda a: {root}.{name}))",
    lambda root, name, n: f"{root}.{name} = {root}\ndel {root}.{name}\n" * n,
    lambda root, name, n: f"import {name}\nfrom {root} import {name}\n" * n,
)  # fmt: skip
ESC = "\\x1b]52;c;ZQ==\\x07"
LENGTHS = (1, 2, 8, 18, 40, 90, 200, 1_000, 5_000)


class Programs(Kind):
    name = "programs"

    def prepare(self, place: Path, memo: Memo) -> None:
        from memo_core.cli.options import load
        from memo_core.runs.factories import tasks_of

        _, experiment = load(None, None)
        solutions = {task.reference_solution for task in tasks_of(experiment)} - {""}
        self._programs = [*sorted(solutions), *SMALL, *SMALL, *SMALL]

    def write(self, place: Path, draw: Random) -> list[Command]:
        (place / "code.py").write_bytes(self._program(draw))
        command = ["exec", "code.py", "--task", TASK]
        for limit in ("seconds_between_calls=0.3", "seconds_in_all=0.6", "calls=200", "memory=67108864"):
            command += ["--set", f"sandbox.{limit}"]
        return [[*command, "--json"] if draw.random() < 0.2 else command]

    def _program(self, draw: Random) -> bytes:
        code = draw.choice(self._programs)
        how = draw.random()
        if how < 0.3:
            return _encoded(draw.choice(_CHAINS)(draw.choice(ROOTS), draw.choice(NAMES), draw.choice(LENGTHS)))
        if how < 0.6:
            return _encoded(_other_tokens(code, draw.choice(self._programs), draw))
        if how < 0.85:
            return _encoded(_other_statements(code, draw.choice(self._programs), draw))
        if how < 0.93:
            return _encoded(damaged_text(code, draw))
        return damaged_bytes(code.encode(), draw)


def _encoded(code: str) -> bytes:
    return code.encode("utf-8", "surrogatepass")


def _other_tokens(code: str, other: str, draw: Random) -> str:
    """Some tokens replaced by those of another program, or hostile ones."""
    tokens, others = _tokens(code), [one.string for one in _tokens(other)]
    lines = code.splitlines(keepends=True)
    for one in sorted(draw.sample(tokens, min(len(tokens), draw.choice((1, 2, 4)))), key=lambda t: t.start)[::-1]:
        if one.start[0] != one.end[0] or one.start[0] > len(lines):
            continue
        line = lines[one.start[0] - 1]
        hostile = draw.choice(
            (*ROOTS, *NAMES, repr(text(draw)), "1e999", "0x" + "f" * 300, "**", "*", "await", "yield")
        )
        new = draw.choice(others) if others and draw.random() < 0.5 else hostile
        lines[one.start[0] - 1] = line[: one.start[1]] + new + line[one.end[1] :]
    return "".join(lines)


def _tokens(code: str) -> list[tokenize.TokenInfo]:
    try:
        return [one for one in tokenize.generate_tokens(io.StringIO(code).readline) if one.string.strip()]
    except (tokenize.TokenError, SyntaxError):
        return []


def _other_statements(code: str, other: str, draw: Random) -> str:
    """Statements and expressions moved about within a program and between two."""
    tree, from_ = ast.parse(code), ast.parse(other)
    for _ in range(draw.choice((1, 2, 5))):
        bodies = (getattr(node, "body", None) for node in ast.walk(tree))
        blocks = [body for body in bodies if isinstance(body, list)]
        statements = [node for node in ast.walk(from_) if isinstance(node, ast.stmt)]
        block = draw.choice(blocks)
        if draw.random() < 0.5 or not block:
            block.insert(draw.randint(0, len(block)), copy.deepcopy(draw.choice(statements)))
        else:
            block[draw.randrange(len(block))] = copy.deepcopy(draw.choice(statements))
        _other_expression(tree, from_, draw)
    try:
        return ast.unparse(ast.fix_missing_locations(tree))
    except (RecursionError, ValueError, AttributeError, TypeError):
        return code


def _other_expression(tree: ast.Module, from_: ast.Module, draw: Random) -> None:
    places = [
        (node, name)
        for node in ast.walk(tree)
        for name, child in ast.iter_fields(node)
        if isinstance(child, ast.expr) and isinstance(getattr(child, "ctx", ast.Load()), ast.Load)
    ]
    found: Sequence[ast.expr] = [node for node in ast.walk(from_) if isinstance(node, ast.expr)]
    found = [node for node in found if isinstance(getattr(node, "ctx", ast.Load()), ast.Load)]
    if places and found:
        node, name = draw.choice(places)
        setattr(node, name, copy.deepcopy(draw.choice(found)))
