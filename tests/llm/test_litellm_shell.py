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
from memo_llm.litellm.library import quiet_litellm
from memo_llm.litellm.providers import KEYS, known_providers
from rich.console import Console

from memo_core.cli.narration import Narrator
from memo_core.config import ConfigErrors, load_experiment
from memo_core.events import CodeWritten
from memo_core.interfaces.llm import Usage
from memo_core.llm.ledger import Ledger
from memo_core.llm.spending import Spent
from memo_core.plugins.registry import Registry
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


@pytest.mark.process
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


@pytest.mark.process
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


@pytest.mark.process
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


CHECKED = [
    ("model: gpt/foo", "llm.model: litellm knows no provider 'gpt'; did you mean 'openai'?"),
    ("model: opnai/gpt-5", "llm.model: litellm knows no provider 'opnai'; did you mean 'openai'?"),
    ("model: 'localhost:8000'", "llm.model: 'localhost:8000' is an address, which belongs in api_base"),
    ("model: http://10.0.0.7:8000/v1", "llm.model: 'http://10.0.0.7:8000/v1' is an address"),
    ("model: gpu-box:8000/v1", "llm.model: 'gpu-box:8000/v1' is an address"),
    ("model: openai/x, api_base: 'localhost:8000'", "llm.api_base: 'localhost:8000' is not the address of a server"),
    ("model: openai/x, api_base: 127.0.0.1/v1", "expected http:// or https://"),
    ("model: openai/x, api_base: 'http://localhost:port/v1'", "llm.api_base: 'http://localhost:port/v1'"),
    ("model: openai/x, api_base: 'ftp://localhost/v1'", "llm.api_base: 'ftp://localhost/v1'"),
    ("model: openai/x, api_base: 'ana:hunter22@localhost'", "llm.api_base: an address with a password"),
]


@pytest.mark.parametrize(("section", "said"), CHECKED)
def test_a_model_or_address_that_means_nothing_is_a_mistake_of_the_file_with_its_line(section, said, tmp_path):
    file = tmp_path / "lab.yaml"
    file.write_text(f"seed: 1\nllm: {{backend: litellm, {section}}}\n")
    with pytest.raises(ConfigErrors) as raised:
        load_experiment(Registry(), file, [], SECTIONS)
    [issue] = raised.value.issues
    assert issue.origin.line == 2 and said in str(issue) and "expected" in issue.problem
    assert "hunter22" not in str(issue)


def test_an_embedder_is_checked_like_a_language_model(tmp_path):
    file = tmp_path / "lab.yaml"
    file.write_text("embedder: {backend: litellm, model: 'localhost:8000', api_base: 'localhost:8000'}\n")
    with pytest.raises(ConfigErrors) as raised:
        load_experiment(Registry(), file, [], SECTIONS)
    assert {issue.path for issue in raised.value.issues} == {"embedder.model", "embedder.api_base"}


@pytest.mark.parametrize("model", ["ollama_chat/qwen3:8b", "openrouter/openai/gpt-5", "hosted_vllm/Qwen/Qwen3-8B"])
@pytest.mark.parametrize("base", ["http://127.0.0.1:8000/v1", "https://[::1]:8000", "https://lab.local/a/v1?x=1"])
def test_models_and_addresses_that_work_are_in_order(model, base):
    load_experiment(Registry(), None, ["llm.backend=litellm", f"llm.model={model}", f"llm.api_base={base}"], SECTIONS)


@pytest.mark.process
@pytest.mark.parametrize(
    ("section", "variable"),
    [
        ("llm: {backend: litellm, model: openai/gpt-5}", "OPENAI_API_KEY"),
        ("llm: {backend: litellm, model: gemini/x}", "GEMINI_API_KEY"),
        ("llm: {backend: litellm, model: openai/x, api_base: 'http://h/v1', api_key_env: LAB_KEY}", "LAB_KEY"),
        ("clustering: {llm: {backend: litellm, model: anthropic/x}}", "ANTHROPIC_API_KEY"),
    ],
)
def test_a_missing_key_is_said_when_a_file_is_checked_and_before_anything_is_run(section, variable, tmp_path):
    file = tmp_path / "lab.yaml"
    file.write_text(f"task: stack-the-cubes\n{section}\n")
    none = {"OPENAI_API_KEY": "", "GEMINI_API_KEY": "", "GOOGLE_API_KEY": "", "ANTHROPIC_API_KEY": "", "LAB_KEY": ""}
    done = memo("config", "check", str(file), **none)
    assert done.returncode == 0 and "in order, but it cannot be run here yet" in done.stdout
    assert f"export {variable}=…" in done.stderr
    told = json.loads(memo("config", "check", str(file), "--json", **none).stdout)
    assert told["valid"] and variable in told["missing"][0]
    there = memo("config", "check", str(file), **{**none, variable: "k" * 20})
    assert there.stdout.endswith("in order\n") and not there.stderr
    if section.startswith("llm"):
        run = memo("run", str(file), "--out", str(tmp_path / "runs"), **none)
        assert run.returncode == 1 and f"export {variable}=…" in run.stderr and not (tmp_path / "runs").exists()


@pytest.mark.parametrize("variable", [None, "GOOGLE_API_KEY"])
def test_any_variable_that_may_hold_a_key_is_enough(variable, monkeypatch):
    for name in ("GEMINI_API_KEY", "GOOGLE_API_KEY"):
        monkeypatch.delenv(name, raising=False)
    if variable:
        monkeypatch.setenv(variable, "k" * 20)
    chosen = load_experiment(Registry(), None, ["llm.backend=litellm", "llm.model=gemini/x"], SECTIONS).choice("llm")
    assert (chosen.unavailable() is None) == bool(variable)


def test_what_is_known_of_providers_without_litellm_is_what_litellm_knows():
    litellm = quiet_litellm()
    named = {str(getattr(provider, "value", provider)) for provider in litellm.provider_list}
    assert named <= known_providers()
    from litellm.llms.openai_like.json_loader import JSONProviderRegistry

    assert all(JSONProviderRegistry.exists(provider) for provider in known_providers() - named)


@pytest.mark.parametrize("provider", KEYS)
def test_the_variables_of_keys_are_those_that_litellm_reads(provider, monkeypatch):
    litellm = quiet_litellm()
    for name in KEYS[provider]:
        monkeypatch.delenv(name, raising=False)
    assert KEYS[provider][0] in litellm.validate_environment(f"{provider}/x")["missing_keys"]
    for name in KEYS[provider]:
        with monkeypatch.context() as one:
            one.setenv(name, "k" * 20)
            assert not litellm.validate_environment(f"{provider}/x")["missing_keys"]
