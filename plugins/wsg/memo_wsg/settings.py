"""Settings of the driver."""

from __future__ import annotations

import attrs
from attrs.validators import gt


@attrs.frozen
class WsgSettings:
    """Where the gripper is and how long it may take."""

    address: str = attrs.field(default="192.168.1.20", metadata={"help": "network address of the gripper"})
    port: int = attrs.field(default=1000, validator=gt(0), metadata={"help": "TCP port of its command interface"})
    timeout_s: float = attrs.field(
        default=1.0, validator=gt(0.0), metadata={"help": "seconds in which it must begin to answer"}
    )
    deadline_s: float = attrs.field(
        default=5.0, validator=gt(0.0), metadata={"help": "seconds after which a motion that has not ended is a fault"}
    )
