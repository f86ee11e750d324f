"""Phase 4: code that worked becomes one documented function; names and amounts become parameters."""

from __future__ import annotations

import ast
import re
import textwrap

from memo_core.plugin import Prompt, UnreadablePrompt


def generalise(prompt: Prompt) -> str:
    """The template in a fence. Raises ``UnreadablePrompt`` when the prompt's code does not parse."""
    code = prompt.code("code that worked")
    action, objects = prompt.subtask
    labels = [node.label for node in prompt.scene().nodes]
    try:
        tree = ast.parse(code)
    except SyntaxError as error:
        raise UnreadablePrompt(f"the code that worked does not parse (line {error.lineno}: {error.msg})") from None
    function = _Function(code, tree, [*objects, *labels])
    name = re.sub(r"\W+", "_", f"{action} by {function.manner()}").strip("_").lower()
    return f"```python\n{function.text(name, action)}\n```"


class _Function:
    """One function made of a program: constants become parameters, functions become inner functions."""

    def __init__(self, code: str, tree: ast.Module, labels: list[str]) -> None:
        self._lines = code.splitlines()
        self._tree = tree
        self._labels = {label.lower(): label for label in labels}
        self._comments = [line.lstrip("# ").rstrip() for line in self._lines if line.startswith("#")]
        self.parameters: dict[str, str] = {}  # name -> default, as source
        self._imports: list[str] = []
        self._functions: list[str] = []
        self._body: list[str] = []
        last = 0
        for node in tree.body:
            first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", []))])
            end = node.end_lineno or node.lineno
            lead = [line for line in self._lines[last : first - 1] if line.startswith("#")] if last else []
            lines = self._lines[first - 1 : end]
            last = end
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                self._imports += lines
            elif self._constant(node):
                continue
            elif isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                self._functions += ["", *lead, *lines]
            elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                continue
            else:
                gap = [""] if self._body and not self._lines[first - 2 - len(lead)].strip() else []
                self._body += [*gap, *lead, *lines]
        self._name_literals()

    def _constant(self, node: ast.stmt) -> bool:
        """Whether a statement only gives an amount or a name, which then becomes a parameter."""
        if not isinstance(node, ast.Assign) or len(node.targets) != 1 or not isinstance(node.targets[0], ast.Name):
            return False
        value = node.value
        simple = isinstance(value, ast.Constant) or (
            isinstance(value, ast.UnaryOp) and isinstance(value.operand, ast.Constant)
        )
        name = node.targets[0].id
        if not simple or self._assigned(name) != 1:
            return False
        self.parameters[name] = ast.unparse(value)
        return True

    def _assigned(self, name: str) -> int:
        stores = [
            n for n in ast.walk(self._tree) if isinstance(n, ast.Name) and n.id == name and isinstance(n.ctx, ast.Store)
        ]
        return len(stores)

    def _name_literals(self) -> None:
        """Names of things and places written into the statements become parameters too."""
        text = "\n".join([*self._functions, "\x00", *self._body])
        known = {ast.literal_eval(v).lower(): k for k, v in self.parameters.items() if v[:1] in "'\""}

        def replaced(match: re.Match[str]) -> str:
            label = match.group(2)
            if label.lower() not in self._labels:
                return match.group(0)
            if label.lower() not in known:
                name = re.sub(r"\W+", "_", label).lower()
                known[label.lower()] = name
                self.parameters[name] = repr(label)
            return known[label.lower()]

        text = re.sub(r"(['\"])([^'\"\n]+)\1", replaced, text)
        functions, _, body = text.partition("\x00")
        body = _places_out(body, self.parameters)
        self._functions, self._body = functions.splitlines(), body.splitlines()

    def manner(self) -> str:
        """The manner in a word or two, derived from the functions that the code calls."""
        called = {n.func.id for n in ast.walk(self._tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}
        if {"turn_point", "arc", "arc_path"} & called:
            return "an arc"
        if "rotate_gripper" in called:
            return "turning"
        if "close_gripper" in called:
            return "gripping"
        return "letting go" if "open_gripper" in called else "moving"

    def text(self, name: str, action: str) -> str:
        lower = {p: self._parameter(p) for p in self.parameters}
        body, functions = "\n".join(self._body), "\n".join(self._functions)
        for old, new in lower.items():
            pattern = rf"(?<![\w.'\"]){re.escape(old)}(?![\w'\"=])"
            body, functions = re.sub(pattern, new, body), re.sub(pattern, new, functions)
        required = [new for old, new in lower.items() if self.parameters[old] == ""]
        optional = [f"{new}={self.parameters[old]}" for old, new in lower.items() if self.parameters[old] != ""]
        signature = ", ".join([*required, *optional]) or "repeat=1"
        doc = self._doc(action)
        inner = "\n".join(part for part in (functions.strip("\n"), body.strip("\n")) if part)
        imports = "\n".join(self._imports)
        text = f"def {name}({signature}):\n{textwrap.indent(doc, '    ')}\n{textwrap.indent(inner, '    ')}"
        return f"{imports}\n\n\n{text}" if imports else text

    def _parameter(self, constant: str) -> str:
        """A constant's name as a parameter's, unless the code already calls something else that where it is used."""
        name = constant.lower() if constant.isupper() else constant
        return f"given_{name}" if name != constant and name in self._locals_beside(constant) else name

    def _locals_beside(self, constant: str) -> set[str]:
        """Names given a value in the statements, or in a function that uses the constant."""
        taken: set[str] = set()
        for node in self._tree.body:
            names = [n for n in ast.walk(node) if isinstance(n, ast.Name)]
            function = isinstance(node, (ast.FunctionDef, ast.ClassDef))
            if function and constant not in {n.id for n in names}:
                continue
            taken |= {n.id for n in names if isinstance(n.ctx, ast.Store)}
            taken |= {n.arg for n in ast.walk(node) if isinstance(n, ast.arg)}
        return taken

    def _doc(self, action: str) -> str:
        told = [line for line in self._comments[:6] if line and not line.lower().startswith("not understood")]
        first = told[0].partition(": ")[2] if told and ": " in told[0] else ""
        how = textwrap.wrap(
            (first or f"{action} something.").capitalize() if first else f"{action.capitalize()} something.", 100
        )
        lines = [f'"""{how[0]}', *how[1:], ""]
        lines.append(
            "Parameters: names as in the scene, amounts in metres and degrees. Positions are read when it runs;"
        )
        lines.append(
            'look() first when things may have moved. The hand must be empty unless something is to be put down."""'
        )
        return "\n".join(lines)


def _places_out(body: str, parameters: dict[str, str]) -> str:
    """Lists of three or four numbers other than directions are places: they become parameters without a default."""

    def replaced(match: re.Match[str]) -> str:
        values = [float(v) for v in re.findall(r"-?\d+(?:\.\d*)?(?:e-?\d+)?", match.group(0))]
        if len(values) not in (3, 4) or all(abs(v) in (0.0, 1.0) for v in values):
            return match.group(0)
        name = f"place_{sum(p.startswith('place_') for p in parameters) + 1}"
        parameters[name] = ""
        return name

    number = r"\s*-?\d+(?:\.\d*)?(?:e-?\d+)?\s*"
    return re.sub(rf"[\[(](?:{number},){{2,3}}{number},?[\])]", replaced, body)
