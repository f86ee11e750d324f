"""Assembles generated code: comments, constants with their reasons, then the steps."""

from __future__ import annotations

import attrs

from memo_offline.code_snippets import compose


@attrs.define
class Sheet:
    """Code under construction."""

    header: list[str] = attrs.field(factory=list)
    constants: dict[str, str] = attrs.field(factory=dict)
    body: list[str] = attrs.field(factory=list)

    def constant(self, name: str, value: str | float, why: str = "") -> str:
        shown = repr(value) if isinstance(value, str) else f"{round(value, 4):g}"
        self.constants[name] = f"{name} = {shown}" + (f"  # {why}" if why else "")
        return name

    def add(self, *lines: str) -> None:
        self.body.extend(lines)

    def code(self, repeat: int) -> str:
        body = self.body
        if repeat > 1:
            body = [f"for again in range({repeat}):", *(f"    {line}" if line else line for line in self.body)]
        return compose(self.header, body, list(self.constants.values())) + "\n"
