"""Which signal handlers are in place, and until when."""

from __future__ import annotations

import gc
import signal

from memo_core.cli.signal_handling import STOPS, handling, ignore


def test_handlers_that_are_forgotten_do_not_come_back_after_ignoring():
    before = {number: signal.getsignal(number) for number in STOPS}
    try:
        signals = handling(lambda *_: None)
        signals.__enter__()
        ignore()
        del signals
        gc.collect()
        assert [signal.getsignal(number) for number in STOPS] == [signal.SIG_IGN] * len(STOPS)
    finally:
        for number, one in before.items():
            signal.signal(number, one)


def test_a_block_restores_what_was_there():
    before = [signal.getsignal(number) for number in STOPS]
    with handling(lambda *_: None):
        assert signal.getsignal(signal.SIGTERM) not in (signal.SIG_DFL, signal.SIG_IGN)
    assert [signal.getsignal(number) for number in STOPS] == before
