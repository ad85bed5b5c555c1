# Everything a fresh machine needs is Python >= 3.11, make and git.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: help setup validate test test-viewer lint bench mutations package clean
help: ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 14

setup: .venv/ready ## create .venv and install cranectl into it

.venv/ready: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "cranectl needs Python 3.11 or newer; choose one with make PYTHON=python3.12 $(MAKECMDGOALS)" >&2; exit 2; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	@touch $@

validate: setup ## run every scenario with every controller on both plants and judge
	$(BIN)/cranectl validate

test: setup ## run the tests
	@tests/render/install
	$(BIN)/python -m pytest

test-viewer: setup ## open logs in a real viewer, read them with other parsers
	@viewer/install $(BIN)
	$(BIN)/python -m pytest -n 0 viewer

lint: setup ## format, style, types, import directions
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

bench: setup ## measure, and write docs/performance.md
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[bench]'
	$(BIN)/python validation/benchmark.py --json logs/bench.json --write docs/performance.md

mutations: setup ## change every term of the physics and see a test fail; write docs/mutations.md
	$(BIN)/python validation/mutations.py --write docs/mutations.md

package: setup ## build the wheel, install it into an empty environment, validate from there
	rm -rf build/package && mkdir -p build/package/work
	$(BIN)/python -m hatchling build -t wheel -d build/package
	$(PYTHON) -m venv build/package/venv
	build/package/venv/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt build/package/*.whl
	cd build/package/work && ../venv/bin/cranectl validate fixed-position slack-rope

clean: ## remove the environment and everything generated
	rm -rf .venv viewer/node_modules viewer/failures logs build dist .mypy_cache .ruff_cache .pytest_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
