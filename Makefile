# Everything lives in .venv; `make demo` and `make test` set it up when it is missing or its requirements changed.

VENV := .venv
BIN := $(VENV)/bin
PYTHON ?= $(shell command -v python3.11 || command -v python3.12 || command -v python3.13 || command -v python3 || echo python3)
PLUGINS := $(patsubst %/pyproject.toml,%,$(wildcard plugins/*/pyproject.toml))
EXTRAS_vectorstore := [chroma]
EXTRAS_web := [dev]
# franky-control has wheels for this platform only.
EXTRAS_franka := $(if $(filter Linux-x86_64,$(shell uname -s)-$(shell uname -m)),[hardware])
STAMP := $(VENV)/.set-up
# A part of the whole set-up, for whoever only wants to see the demo.
DEMO_STAMP := $(VENV)/.set-up-demo
DEMO_PLUGINS := $(addprefix plugins/,embedder franka llm offline perception sim_mujoco tabletop vectorstore web)
# It also exports the sentence model, which would otherwise be the first run's wait.
DOCTOR = @$(BIN)/memo doctor | grep '^MISSING'; echo "$(BIN)/memo doctor lists all that was found, and how to add what is optional."
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
REQUIREMENTS := Makefile pyproject.toml constraints.txt benchmarks/pyproject.toml $(addsuffix /pyproject.toml,$(PLUGINS))

.PHONY: setup demo test test-fast lint docs lock release release-check clean

setup: $(STAMP)

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || \
		{ echo "MEMO needs Python 3.11 or newer; $(PYTHON) is not. Try: make PYTHON=/path/to/python3.11 $(MAKECMDGOALS)" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
		{ echo "$(PYTHON) cannot make virtual environments; install its venv package (Debian, Ubuntu: python3-venv)" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(STAMP): $(REQUIREMENTS) | $(VENV)/bin/python
	@echo "Installing all of MEMO and what it needs into $(VENV): about 4.5 GB. pip prints nothing meanwhile: 4 minutes on a fast line, 10 or more on a slow one."
	$(if $(LOCKED),$(PIP) --require-hashes --no-deps --requirement requirements.lock)
	$(PIP) $(if $(LOCKED),--no-build-isolation) --constraint constraints.txt \
		--editable '.[arm,xacro,video,experiment,ray,postgres,docs,dev]' --editable ./benchmarks $(foreach p,$(PLUGINS),--editable './$(p)$(EXTRAS_$(notdir $(p)))')
	@touch $@
	$(DOCTOR)

$(DEMO_STAMP): $(REQUIREMENTS) | $(VENV)/bin/python
	@echo "Installing what the demo needs into $(VENV): about 2.8 GB. pip prints nothing meanwhile: 4 minutes on a fast line, 10 or more on a slow one."
	$(PIP) --constraint constraints.txt --editable '.[arm,video]' $(foreach p,$(DEMO_PLUGINS),--editable ./$(p))
	@touch $@
	$(DOCTOR)

# Where everything has been set up before, the demo uses that.
demo: $(if $(wildcard $(STAMP)),$(STAMP),$(DEMO_STAMP))
	$(BIN)/memo demo

test: setup
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal

test-fast: setup
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal -m 'fast and not on_request'

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

lock: setup
	$(BIN)/python tools/lock.py

release: setup
	$(BIN)/python tools/release.py build

release-check: setup
	$(BIN)/python tools/release_check.py

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
