"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from typing import Any

from memo_core.plugin import Backend, hookimpl
from memo_wsg.settings import WsgSettings


def _driver(settings: WsgSettings) -> Any:
    from memo_wsg.driver import WsgGripper

    return WsgGripper(settings)


@hookimpl
def memo_gripper_drivers() -> list[Backend]:
    summary = "a Weiss WSG gripper, over its binary protocol; never tried on a real one"
    return [Backend("gripper_driver", "wsg", summary, _driver, WsgSettings)]
