"""The same experiment on several seeds, as a table; `memo run --seeds 0-4` does it too, and can be resumed.

python examples/sweep_over_seeds.py --task stack-the-cubes --seeds 3
"""

import argparse
from pathlib import Path

import memo_core as memo


def main(task: str, seeds: int, out: Path) -> list[bool]:
    done, book = [], f"skillbook.url={out / 'sweep.db'}"
    for seed in range(seeds):
        # Loaded anew for each seed: settings may refer to it (${seed}).
        experiment = memo.load(None, "teacher.backend=silent", book, task=task, seed=seed)
        report = memo.run(experiment, out=out)
        done.append(report.success)
        print(f"{seed:>4}  {'done' if report.success else 'not done':<8}  {report.wall_s:5.1f} s  {report.why}")
    print(f"{sum(done)} of {len(done)}")
    return done


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--task", default="stack-the-cubes")
    options.add_argument("--seeds", type=int, default=3)
    options.add_argument("--out", type=Path, default=Path("runs"))
    chosen = options.parse_args()
    main(chosen.task, chosen.seeds, chosen.out)
