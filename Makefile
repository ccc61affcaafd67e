# `make demo` and `make test` do all the set-up they need, on Debian 12 with Python 3.11 and make.
# Run `make` alone for the list of targets.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SYSTEM_STAMP := $(VENV)/.system-libraries
PYTHON_STAMP := $(VENV)/.python-packages
TEST_STAMP := $(VENV)/.test-programs
# Fit and tests are long single processes: two pytest workers keep two cores busy.
WORKERS ?= 2
PYTHONS ?= 3.11 3.12 3.13

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-all test-pythons bench figures fuzz lint docs clean requirements schema
.DELETE_ON_ERROR:

help: ## list the targets
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 16

setup: $(PYTHON_STAMP) ## system libraries, virtual environment, Python packages

demo: setup ## fit the shipped Cornell box; images and numbers go to out/demo
	@$(BIN)/vpltune fit configs/scenes/cornell-box.glb -o out/demo

test: lint $(TEST_STAMP) ## lint, then the tests that a change must pass
	@$(BIN)/python -m pytest -q -n $(WORKERS) -m "not slow"

test-all: setup $(TEST_STAMP) ## every test, the slow ones too
	@$(BIN)/python -m pytest -q -n $(WORKERS)

test-pythons: setup ## the quick tests on each Python of PYTHONS that is here
	@WORKERS=$(WORKERS) sh scripts/test_pythons.sh $(PYTHONS)

bench: setup ## the benchmarks
	@$(BIN)/vpltune bench all

# Hours; goes on where it was. ONLY=name runs one command of docs/figures.toml.
figures: setup ## run every command that a figure in a document names, and say which figures changed
	@$(BIN)/python scripts/figures.py $(if $(ONLY),--only $(ONLY))

# Minutes. Ctrl-C prints what was found, and FIRST with which the next run goes on.
fuzz: setup ## read some 50,000 files changed at random; SEED=2 takes others, CASES=1000 fewer
	@$(BIN)/python -m tests.fuzzing.run --cases $(or $(CASES),50000) --seed $(or $(SEED),1) --first $(or $(FIRST),0)

lint: setup ## style, format, import rules, docstrings, comments and types
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/lint-imports --no-logo
	@$(BIN)/python scripts/check_words.py
	@$(BIN)/basedpyright

docs: setup ## the documentation as a website, in build/site
	@$(BIN)/mkdocs build -q --strict -d build/site

# Keeps the pins there are; UPGRADE=1 takes the newest releases.
requirements: setup ## pin Python packages, with hashes; with UPGRADE=1 anew
	@$(BIN)/python -m pip install -q pip-tools
	@$(BIN)/pip-compile -q $(if $(UPGRADE),--upgrade) --generate-hashes --extra dev --all-build-deps --strip-extras \
	    --no-header --no-annotate --no-emit-options --no-emit-index-url --no-emit-trusted-host \
	    --no-emit-find-links -o requirements.txt pyproject.toml

schema: setup ## write configs/default.json, the JSON Schema and docs/parameters.md anew from the parameter table
	@$(BIN)/python scripts/make_config_files.py
	@$(BIN)/python scripts/make_parameter_page.py

clean: ## remove the virtual environment and everything made
	@rm -rf $(VENV) build dist out .pytest_cache .hypothesis .ruff_cache .import_linter_cache
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(SYSTEM_STAMP): scripts/install_system_libraries.sh
	@PYTHON=$(PYTHON) sh scripts/install_system_libraries.sh
	@test -x $(BIN)/python || { echo "setup: virtual environment in $(VENV)"; $(PYTHON) -m venv --clear $(VENV); }
	@touch $@

$(PYTHON_STAMP): $(SYSTEM_STAMP) requirements.txt pyproject.toml
	@echo "setup: Python packages, pinned and hashed in requirements.txt"
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --require-hashes -r requirements.txt
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

# The browser that tests open reports in; `make demo` does without. Asked for again until it is there.
$(TEST_STAMP): scripts/install_system_libraries.sh $(PYTHON_STAMP)
	@PYTHON=$(PYTHON) sh scripts/install_system_libraries.sh chromium
	@! command -v chromium >/dev/null || touch $@
