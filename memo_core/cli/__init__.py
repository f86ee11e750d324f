"""The command line: one file per command, each importing its dependencies only when it runs."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.cli.options import ConfigFile as ConfigFile, Json as Json, Overrides as Overrides, load as load
    from memo_core.cli.output import (
        note as note,
        print_json as print_json,
        print_table as print_table,
        progress_bar as progress_bar,
    )
    from memo_core.cli.robot_link import confirmed as confirmed, connected as connected
    from memo_core.cli.standard_input import agreed as agreed

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
