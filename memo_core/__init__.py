"""MEMO: memory-enhanced manipulation. The framework; it knows no vendor, no simulator and no particular robot.

The names in ``__all__`` are its public Python interface (``memo_core.api``). Plugins import theirs from
``memo_core.plugin``."""

from memo_core.lazy_exports import lazy_exports
from memo_core.moved_modules import install

TYPE_CHECKING = False  # importing typing would take longer than everything else here
if TYPE_CHECKING:
    from memo_core.api import (
        load as load,
        make_environment as make_environment,
        open_book as open_book,
        registry as registry,
        run as run,
        tasks as tasks,
    )
    from memo_core.config import ConfigErrors as ConfigErrors, Experiment as Experiment
    from memo_core.environment.simulated import SimulatedEnvironment as SimulatedEnvironment
    from memo_core.errors import MemoError as MemoError
    from memo_core.runs.run import RunReport as RunReport
    from memo_core.skillbook.book import Skillbook as Skillbook

__version__ = "0.1.0"

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
install()
