"""The far side of a peer in tests."""

import os
import signal
import time


def operations(arguments):
    """Operations by name; the first argument, if there is one, is what ``hello`` says."""
    return {
        "hello": lambda: {"said": arguments[0] if arguments else "", "pid": os.getpid()},
        "double": lambda arrays, extra=0: ({"extra": extra}, [2 * array for array in arrays]),
        "chatter": lambda: print("a library prints this", flush=True),
        "fail": lambda: {}["missing"],
        "leak": lambda: bytearray(1 << 60),
        "stall": lambda: time.sleep(60),
        "die": lambda code: os._exit(code),
        "be_killed": lambda: os.kill(os.getpid(), signal.SIGKILL),
        "secret": lambda: {"seen": os.environ.get("PEER_SECRET", "")},
    }
