"""What one run of generated code may use. A motion's duration never counts: only the code's own computing does."""

from __future__ import annotations

import attrs


@attrs.frozen
class Limits:
    """Times in seconds of computing inside the sandbox, sizes in bytes unless named otherwise."""

    seconds_between_calls: float = 5.0
    seconds_in_all: float = 20.0
    memory: int = 256 << 20
    output: int = 64 << 10  # characters printed
    code: int = 100_000  # characters of source
    calls: int = 5_000  # skill calls
    recursion: int = 400  # nested function calls
    argument_items: int = 5_000  # numbers, strings and containers in the arguments of one call
