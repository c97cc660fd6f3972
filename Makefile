# `make demo` and `make test` need Python 3.11 or newer and nothing else: each sets up .venv with the versions in constraints.txt.
PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

.PHONY: demo test check bench soak format build clean

demo: .venv/.runtime
	$(BIN)/metaid study create three-link --exist-ok
	$(BIN)/metaid study run three-link --workers 2

test: .venv/.dev
	$(BIN)/pytest -n 2 --dist worksteal

check: .venv/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

bench: .venv/.runtime
	$(BIN)/python -m benchmarks

soak: .venv/.dev
	$(BIN)/python -m soak

format: .venv/.dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

build: .venv/.dev
	$(BIN)/python -m build

clean:
	rm -rf .venv build dist .pytest_cache .mypy_cache .ruff_cache

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit("metaid needs Python 3.11 or newer: make PYTHON=python3.11 ..." if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv .venv

.venv/.runtime: .venv/bin/python pyproject.toml constraints.txt
	$(PIP) --editable .
	@touch $@

.venv/.dev: .venv/.runtime
	$(PIP) --editable '.[dev]'
	@touch $@
