"""The faults of an installation that ``memo doctor`` recognises, from which docs/troubleshooting.md is generated."""

from __future__ import annotations

import attrs


@attrs.frozen
class Fault:
    """A fault as the troubleshooting page describes it: the ``sign`` a user sees, its ``cause`` and the ``remedy``."""

    sign: str
    cause: str
    remedy: str


FAULTS = {
    "plugin": Fault(
        "`memo plugins list` names a plugin with an error; its backends are unknown names",
        "the plugin raises while it is loaded, often after an upgrade of something it imports",
        "repair or uninstall the distribution; all other plugins go on working",
    ),
    "names": Fault(
        "two distributions offer the same backend", "both are installed", "uninstall one of the two that are named"
    ),
    "kind": Fault(
        "`no plugin that offers one is installed`",
        "a part that every run needs (simulator, robot, perception …) has no plugin here",
        "the command that is printed: it installs a plugin of that kind",
    ),
    "uninstalled": Fault(
        "a backend that comes with MEMO is an unknown name",
        "its plugin is not installed, as after `make demo`",
        "the command that is printed; `make setup` in a checkout installs all",
    ),
    "module": Fault(
        "`cannot be used: missing Python module …`, or files of an installed distribution are gone",
        "an optional dependency is not installed, or an upgrade in place removed files (MuJoCo 3 to 4)",
        "the command that is printed: it names the distributions and their versions",
    ),
    "key": Fault(
        "`environment variable GEMINI_API_KEY` is missing",
        "the provider of the selected model wants a key",
        "`export GEMINI_API_KEY=…`, or `llm.api_key_env` with the name of another variable",
    ),
    "extra": Fault(
        "`memo-core[arm]` or `[video]` is asked for",
        "the core is installed without the extra that moves robots or writes videos",
        "the command that is printed",
    ),
    "display": Fault(
        "`--view` opens no window",
        "no display: a server, a container, `ssh` without `-X`",
        "a desktop or `ssh -X`; pictures and videos need no display, nor does `memo web`",
    ),
    "pictures": Fault(
        "no videos, no pictures; `libEGL` or `OpenGL` in the message",
        "no library for rendering without a display",
        "`apt install libegl1 libgl1`, then `MUJOCO_GL=egl`",
    ),
    "sandbox": Fault(
        "no robot code runs",
        "the process that runs generated code cannot be started, or ends",
        "the message says why; containers with a limit on processes or memory are the usual reason",
    ),
    "skillbook": Fault(
        "a new skillbook cannot be opened",
        "the temporary folder is full, read-only or on a file system without locks",
        "`export TMPDIR=` a local folder; keep skillbooks on a local disk or in PostgreSQL",
    ),
    "embedder": Fault(
        "the sentence model does not open",
        "its first use exports the model once, which needs space in the cache folder and PyTorch",
        "free space, and `make setup` again; `--set embedder.backend=litellm` takes a provider's embeddings",
    ),
    "simulator": Fault(
        "no task can be simulated",
        "the simulator cannot be opened or cannot build a small scene",
        "the message says why; often an installation of which files are missing",
    ),
    "disk": Fault(
        "`No space left on device`, in the middle of a run",
        "less than 1 GB is free where runs are written; a run with videos takes about 10 MB",
        "free space, then `memo run --resume` of the run folder",
    ),
    "proxy": Fault(
        "a model server on this machine (Ollama, vLLM) does not answer, or a proxy answers for it",
        "`HTTP_PROXY` is set and `NO_PROXY` does not except this machine",
        "`export NO_PROXY=localhost,127.0.0.1`",
    ),
}
