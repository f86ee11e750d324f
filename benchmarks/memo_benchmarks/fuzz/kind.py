"""What a kind of input must provide."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import ClassVar

Command = list[str]
Memo = Callable[[Sequence[str]], str]  # runs `memo ARGUMENTS…` where the process stands, and returns what it printed


class Kind(ABC):
    """One kind of input. Both methods are called with the process standing in ``place``, an empty folder."""

    name: ClassVar[str]

    @abstractmethod
    def prepare(self, place: Path, memo: Memo) -> None:
        """Make valid examples with MEMO's own commands and remember them; ``place`` is emptied afterwards."""

    @abstractmethod
    def write(self, place: Path, draw: Random) -> list[Command]:
        """Write one damaged input to ``place``, and return the commands that read it."""
