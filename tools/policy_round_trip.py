"""Measure the time of a question to a policy server on loopback; the policy itself costs nothing.

python tools/policy_round_trip.py --questions 300
"""

from __future__ import annotations

import argparse
import statistics

import numpy as np
from memo_vla.client import PolicyClient
from memo_vla.double.server import PolicyServer
from memo_vla.settings import LIBERO, VlaSettings

from memo_core.plugin import StopSwitch


class Constant:
    """A policy that costs nothing."""

    def begin(self) -> Constant:
        return self

    def infer(self, observation: dict) -> dict:
        return {"actions": np.zeros((10, 7), np.float32)}


def measure(questions: int) -> list[float]:
    """Milliseconds of each question with two pictures of 224 x 224 pixels, as in the preset libero."""
    picture = np.random.default_rng(0).integers(256, size=(224, 224, 3), dtype=np.uint8)
    asked = {key: picture for key in LIBERO.images} | {key: np.zeros(8, np.float32) for key in LIBERO.state}
    asked |= {LIBERO.prompt: "turn on the faucet"}
    with PolicyServer(Constant()) as server, PolicyClient(VlaSettings(url=server.url), StopSwitch()) as client:
        return [1000 * client.ask(asked, 5, 7).took_s for _ in range(questions)]


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--questions", type=int, default=300)
    took = sorted(measure(options.parse_args().questions))
    print(
        f"median {statistics.median(took):.2f} ms, fastest {took[0]:.2f}, 95 % within {took[int(0.95 * len(took))]:.2f}"
    )
