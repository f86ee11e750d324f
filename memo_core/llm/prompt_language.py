"""The language of prompt files: Jinja, restricted to the values that a phase declares.

A prompt file is the user's own or part of a downloaded config, so its expressions can read the fields of the phase's
values and call methods of strings, numbers, lists and dicts; they cannot reach modules, functions, files or other
objects (Jinja's immutable sandbox, without Jinja's global functions).
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

from memo_core.llm.prompt_values import one_line, quoted, unfenced

if TYPE_CHECKING:
    import jinja2

_PLAIN = (str, int, float, list, tuple, dict)
_LARGEST_PRODUCT = 10**9


@cache
def prompt_environment() -> jinja2.Environment:
    """The environment that all prompt files are parsed and rendered in. Forbidden expressions raise Jinja's
    ``SecurityError``."""
    import jinja2
    from jinja2.exceptions import SecurityError
    from jinja2.sandbox import ImmutableSandboxedEnvironment

    class _Confined(ImmutableSandboxedEnvironment):
        intercepted_binops = frozenset(("*", "**"))

        def is_safe_callable(self, obj: Any) -> bool:
            owner = getattr(obj, "__self__", None)
            ours = type(obj).__module__.startswith("jinja2.") or type(owner).__module__.startswith("jinja2.")
            return super().is_safe_callable(obj) and (ours or isinstance(owner, _PLAIN))

        def call_binop(self, context: Any, operator: str, left: Any, right: Any) -> Any:
            if operator == "**" or not all(isinstance(one, (int, float)) for one in (left, right)):
                raise SecurityError(f"{operator} is for numbers of reasonable size" if operator == "*" else "no powers")
            product = left * right
            if abs(product) > _LARGEST_PRODUCT:
                raise SecurityError("a product far too large")
            return product

    environment = _Confined(
        undefined=jinja2.StrictUndefined, keep_trailing_newline=True, autoescape=False, finalize=one_line
    )
    environment.globals.clear()
    environment.filters["quoted"] = quoted
    environment.filters["unfenced"] = unfenced
    return environment


@lru_cache(maxsize=32)
def compiled(text: str) -> jinja2.Template:
    """A prompt's text, ready to be filled in. Compiling it takes longer than what a run does between two motions."""
    return prompt_environment().from_string(text)
