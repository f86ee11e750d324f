"""A recipe for fine-tuning π0.5 on a dataset with openpi, in the scheme of its LIBERO example."""

from __future__ import annotations

from pathlib import Path

from memo_vla.dataset.writer import DatasetWriter

STEPS = 20_000
NAME = "pi05_memo"

_CONFIG = '''"""Add this entry to the list of training configs in openpi's src/openpi/training/config.py."""

TrainConfig(
    name="{name}",
    model=pi0_config.Pi0Config(pi05=True, action_horizon=10, discrete_state_input=False),
    data=LeRobotLiberoDataConfig(
        repo_id="{repo}",
        base_config=DataConfig(prompt_from_task=True),
        extra_delta_transform=False,
    ),
    batch_size=256,
    weight_loader=weight_loaders.CheckpointWeightLoader("gs://openpi-assets/checkpoints/pi05_base/params"),
    num_train_steps={steps},
)
'''

_TEXT = """# Fine-tuning on this dataset

{episodes} episodes, {frames} frames at {rate} Hz, {tasks} instructions. Format {version}.

{which}

```sh
export HF_LEROBOT_HOME={parent}                # where openpi looks for {repo}
# add {config} to src/openpi/training/config.py, then, in openpi's checkout:
uv run scripts/compute_norm_stats.py --config-name {name}
XLA_PYTHON_CLIENT_MEM_FRACTION=0.9 uv run scripts/train.py {name} --exp-name=memo --overwrite
uv run scripts/serve_policy.py policy:checkpoint --policy.config={name} --policy.dir=checkpoints/{name}/memo/{last}
```

Then, beside MEMO:

```sh
memo run --task TASK -s method=vla -s method.preset={preset} -s scene.wrist_camera=true -s method.url=ws://SERVER:8000
```

{steps} steps, as in the paper. Training needs a GPU with the memory that openpi's page states; neither it nor the
commands above were run where MEMO is developed. The path from a server's answers to the arm is tested with
`memo policy-server`, which plays demonstrations.
"""

_OPENPI = "The columns are those that openpi's LIBERO scheme repacks: `image`, `wrist_image`, `state`, `actions`."
_OTHER = (
    "openpi's LIBERO scheme reads format v2.1 and preset libero with two cameras: `memo demonstrate … --format v2.1 "
    "--preset libero` writes that. For this dataset copy its data config and name the columns of `meta/info.json`."
)


def write_recipe(writer: DatasetWriter) -> Path:
    """Write ``FINETUNING.md`` and the training config beside a dataset's folders; returns the page's path.

    Args:
        writer: the dataset, with at least one episode.
    """
    folder, kind = writer.folder.resolve(), writer.kind
    fits = kind.version == "v2.1" and kind.layout.actions == "delta-pose" and len(kind.cameras) == 2
    config = writer.folder / f"{NAME}.py"
    config.write_text(_CONFIG.format(name=NAME, repo=folder.name, steps=f"{STEPS:_}"), encoding="utf-8")
    page = writer.folder / "FINETUNING.md"
    text = _TEXT.format(
        episodes=writer.episodes,
        frames=writer.frames,
        rate=kind.rate_hz,
        tasks=writer.instructions,
        version=kind.version,
        which=_OPENPI if fits else _OTHER,
        parent=folder.parent,
        repo=folder.name,
        config=config.name,
        name=NAME,
        last=STEPS - 1,
        steps=f"{STEPS:,}".replace(",", " "),
        preset="libero" if kind.layout.actions == "delta-pose" else "droid",
    )
    page.write_text(text, encoding="utf-8")
    return page
