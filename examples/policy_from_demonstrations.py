"""Record demonstrations, serve them as a policy, and try it in scenes that nobody demonstrated, in one command.

The policy is the smallest there is: it plays the demonstration whose first pictures are most like what it sees. It
stands where a vision-language-action policy would, to try the whole path without a GPU.

python examples/policy_from_demonstrations.py --episodes 8 --scenes 5
"""

import argparse
from pathlib import Path

from memo_vla.demonstrating import WITH_WRIST, dataset_in, layout_of, record_references
from memo_vla.double.nearest import NearestDemonstration
from memo_vla.double.server import PolicyServer

import memo_core as memo
from memo_core.runs import task_of

NEW = 1_000_000  # seed of the first new scene


def main(task: str, episodes: int, scenes: int, out: Path, first: int = 0) -> tuple[list[bool], list[bool]]:
    experiment = memo.load(None, WITH_WRIST)
    dataset = dataset_in(out / "demonstrations", experiment, layout_of("joints", ["front", "wrist"]))
    record_references(experiment, task_of(experiment, task), episodes, first, dataset)
    print(f"{dataset.folder}: {dataset.episodes} demonstrations, {dataset.frames} frames")
    with PolicyServer(NearestDemonstration(dataset.folder)) as server:
        settings = ("method.backend=vla", "method.preset=joints", f"method.url={server.url}", WITH_WRIST)
        played = [tried(task, NEW + number, out / "runs", settings) for number in range(scenes)]
    still = [standing_still(task, NEW + number) for number in range(scenes)]
    print(f"the policy: {sum(played)} of {scenes}; standing still: {sum(still)} of {scenes}")
    return played, still


def tried(task: str, seed: int, out: Path, settings: tuple[str, ...]) -> bool:
    experiment = memo.load(None, "teacher=silent", "run.video=off", *settings, task=task, seed=seed)
    report = memo.run(experiment, out=out)
    print(f"{seed}  {'done' if report.success else 'not done':<8}  {report.why}")
    return report.success


def standing_still(task: str, seed: int) -> bool:
    with memo.make_environment(memo.load(), task, seed) as world:
        world.settle(world.task.settle)
        return world.check().success


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--task", default="turn-on-the-faucet")
    options.add_argument("--episodes", type=int, default=8)
    options.add_argument("--first", type=int, default=0, help="seed of the first demonstration")
    options.add_argument("--scenes", type=int, default=5)
    options.add_argument("--out", type=Path, default=Path("runs/policy-from-demonstrations"))
    chosen = options.parse_args()
    main(chosen.task, chosen.episodes, chosen.scenes, chosen.out, chosen.first)
