"""``python -m memo_franka.testing [ADDRESS]``: a double of an FR3 and its Hand on loopback, until Ctrl-C."""

from __future__ import annotations

import sys
import time

from memo_franka.description import fr3
from memo_franka.testing.control_box import ControlBox
from memo_franka.testing.hand import HandDouble


def main(address: str) -> None:
    hand = HandDouble(address)
    with hand, ControlBox(fr3(), address, hand=hand):
        print(f"test double of an FR3 at {address}; Ctrl-C ends it", flush=True)
        try:
            while True:
                time.sleep(1.0)
        except KeyboardInterrupt:
            return


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.2")
