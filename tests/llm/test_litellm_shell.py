"""What a user of the litellm backend sees in the shell: quiet imports, streamed text, keys, budgets."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console

from memo_core.config import ConfigErrors, load_experiment
from memo_core.events import CodeWritten
from memo_core.interfaces.llm import Usage
from memo_core.llm.ledger import Ledger
from memo_core.llm.spending import Spent
from memo_core.plugins import Registry
from memo_core.runs.narration import Narrator
from memo_core.runs.sections import SECTIONS

# Whatever wants to leave the machine, looks up where to, or reads an .env file, is noted here.
WATCHED = """
import socket, dotenv
asked = []
def refuse(*given, **_):
    asked.append(given[:2])
    raise OSError("no network")
socket.getaddrinfo = socket.create_connection = refuse
socket.socket.connect = socket.socket.connect_ex = refuse
dotenv.load_dotenv = lambda *given, **_: asked.append(".env")
{open}
assert not asked, asked
import litellm
assert not litellm.telemetry and not litellm.callbacks and not litellm.success_callback, "it reports to somebody"
"""
OPENINGS = {
    "llm": """
from memo_llm.litellm.model import LiteLLMModel
from memo_llm.settings import LiteLLMSettings
for name in ("gemini/gemini-3-flash-preview", "openai/gpt-4o", "anthropic/claude-sonnet-4-5", "ollama_chat/llama3"):
    model = LiteLLMModel(LiteLLMSettings(model=name))
    model.open()
    model.unpriced()
    model.close()
""",
    "embedder": """
from memo_embedder.litellm_embedder import _quiet_litellm
_quiet_litellm()
""",
}


def memo(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=60, check=False, env={**os.environ, **environment}
    )


@pytest.mark.parametrize("kind", OPENINGS)
def test_opening_touches_no_network_and_reads_no_file_and_prints_nothing(kind, tmp_path: Path):
    keys = {name: "k" * 20 for name in ("GEMINI_API_KEY", "OPENAI_API_KEY", "ANTHROPIC_API_KEY")}
    environment = {name: value for name, value in os.environ.items() if not name.startswith("LITELLM")} | keys
    command = [sys.executable, "-W", "ignore", "-c", WATCHED.replace("{open}", OPENINGS[kind])]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=120, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout == done.stderr == ""


def screen(terminal: bool) -> tuple[Narrator, io.StringIO]:
    out = io.StringIO()
    return Narrator(Console(file=out, force_terminal=terminal, no_color=True, width=80, highlight=False)), out


def test_a_terminal_shows_what_is_being_written_once():
    narrator, out = screen(terminal=True)
    show = narrator.on_text
    assert show is not None
    for piece in ("```python\n", "go_", "[home]", "()\n```"):
        show("code", piece)
    narrator(CodeWritten("GO(home)", 1, "go_[home]()"))
    said = re.sub(r"\x1b\[[0-9;]*m", "", out.getvalue())
    assert "code:" in said and said.count("go_[home]()") == 1


def test_elsewhere_nothing_is_streamed_and_the_code_is_shown_when_it_is_there():
    narrator, out = screen(terminal=False)
    assert narrator.on_text is None
    narrator(CodeWritten("GO(home)", 1, "go_home()"))
    assert "go_home()" in out.getvalue()


def test_the_keys_of_a_backend_that_nobody_selected_are_no_failure():
    keys = {"OPENAI_API_KEY": "", "GEMINI_API_KEY": "", "ANTHROPIC_API_KEY": ""}
    done = memo("doctor", "--quick", "--json", **keys)
    found = [check for check in json.loads(done.stdout)["checks"] if check["what"] == "llm litellm"]
    assert {check["state"] for check in found} == {"optional"}
    assert any("GEMINI_API_KEY" in check["detail"] for check in found)


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("llm.model=gpt-5", "llm.model: 'gpt-5' names no provider"),
        ("llm.timeout=3", "did you mean 'timeout_s'?"),
        ("llm.api_key=sk-123456789", "did you mean 'api_key_env'?"),
        ("llm.api_key_env=sk-123456789", "not the name of an environment variable"),
        ("llm.options.api_key=sk-123456789", "'api_key' may not be given here"),
        ("run.study_max_cost=3", "a study's limit without its ledger"),
        ("run.max_cost=-1", "run.max_cost"),
    ],
)
def test_a_mistake_in_the_settings_is_named_with_what_would_be_right(override, said):
    with pytest.raises(ConfigErrors) as raised:
        load_experiment(Registry(), None, ["llm.backend=litellm", "llm.model=openai/x", override], SECTIONS)
    assert said in str(raised.value) and "sk-123456789" not in str(raised.value)


def test_what_a_study_spent_can_be_asked_for(tmp_path: Path):
    path = tmp_path / "study.ledger"
    ledger = Ledger(path)
    for run, usage in (("run-1", Usage(100, 20, 0.5)), ("run-2", Usage(10, 2)), ("run-1", None)):
        line = ledger.begin(run, "plan", "m", 7, lambda spent: None)
        ledger.end(line, usage)
    ledger.begin("run-2", "code", "m", 33, lambda spent: None)
    told = json.loads(memo("budget", str(path), "--json").stdout)
    assert [run["run"] for run in told["runs"]] == ["run-1", "run-2"]
    assert Spent(**told["total"]) == ledger.spent() == Spent(4, 143, 22, 0.5, unpriced=1, unfinished=1)
    shown = memo("budget", str(path))
    assert shown.returncode == 0 and "0.5000" in shown.stdout and "together" in shown.stdout
    missing = memo("budget", str(tmp_path / "other"))
    assert missing.returncode == 2 and "does not exist" in missing.stderr
