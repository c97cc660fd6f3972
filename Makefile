# `make demo` and `make test` need Python 3.11 or newer and nothing else: each sets up .venv with the versions in constraints.txt;
# the first with what a study needs, the second with every extra and the tools of development.
PYTHON ?= python3
NEWEST ?= python3.14
VENV ?= .venv
CONSTRAINTS ?= constraints.txt
BIN := $(VENV)/bin
# Tests run side by side: what BLAS's threads do for one takes as much from the others. What one process compiles of
# sources is kept for the hundreds that tests start.
PYTEST := env -u PYTHONDONTWRITEBYTECODE OPENBLAS_NUM_THREADS=1 $(BIN)/pytest
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint $(CONSTRAINTS)

.PHONY: demo test test-quick coverage robots test-min test-newest pin-min check hooks docs audit bench figures soak format build release clean

demo: $(VENV)/.runtime
	@$(BIN)/metaid study run three-link --create --workers 2
	@printf '%s\n' '' 'What next:' '    source $(BIN)/activate' \
	  '    metaid study report three-link -o report.html     what was found, in a browser' \
	  '    metaid estimate double-pendulum --nominal double-pendulum     logs of a real pendulum' \
	  '    metaid estimate YOUR.csv --nominal YOUR.urdf     yours: docs/log.md'

# As many workers as there are cores: each further one makes anew what tests of a process share.
test: $(VENV)/.dev .venv-tools/bin/pip-licenses
	$(PYTEST) -n 2 --dist worksteal --durations 15

# Under a minute on two idle cores: what is not marked slow.
test-quick: $(VENV)/.dev
	$(PYTEST) -n 2 --dist worksteal -m "not slow and not robots"

# Which lines of metaid no test runs in its own process: kernels that numba compiles and what other processes run are not seen.
coverage: $(VENV)/.dev .venv-tools/bin/pip-licenses
	$(PYTEST) -n 2 --dist worksteal --cov --cov-report term:skip-covered --cov-report html:build/coverage

# Installs pinocchio and example-robot-data, 820 MB, for the tests and benchmarks that need them, and runs these tests.
robots: $(VENV)/.robots
	$(PYTEST) -n 2 -m robots

# The lowest version that pyproject.toml allows of each direct dependency; and the newest of everything, on the newest Python.
test-min:
	$(MAKE) test VENV=.venv-min CONSTRAINTS=constraints-min.txt

test-newest:
	$(MAKE) test VENV=.venv-newest CONSTRAINTS=/dev/null PYTHON=$(NEWEST)

pin-min: .venv-tools/bin/uv
	.venv-tools/bin/uv pip compile --quiet pyproject.toml --all-extras --resolution lowest-direct --only-binary :all: \
		--python-version 3.11 --no-annotate --no-header --output-file constraints-min.txt

check: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

# `make check` before each commit, and the quick tests before each push.
hooks: .venv-tools/bin/pre-commit $(VENV)/.dev
	.venv-tools/bin/pre-commit install --hook-type pre-commit --hook-type pre-push

# The site, in build/site: README, docs/, notebooks, calls. A link that leads nowhere is an error. Nothing is fetched, and
# the pages can be opened as files.
docs: .venv-docs/.ready
	rm -rf build/pages
	$(PYTHON) docs/pages.py build/pages
	NO_MKDOCS_2_WARNING=1 .venv-docs/bin/mkdocs build --quiet --strict

# Licences, pins, and known vulnerabilities where the internet is; status 2 where it is not.
audit: $(VENV)/.dev .venv-docs/.ready .venv-tools/bin/pip-audit .venv-tools/bin/pip-licenses
	$(BIN)/python -m supply

bench: $(VENV)/.runtime
	$(BIN)/python -m benchmarks

# Every figure of every document, printed anew and compared: an hour on two idle cores.
figures: $(VENV)/.dev
	$(BIN)/python -m soak.figures

soak: $(VENV)/.dev
	$(BIN)/python -m soak

format: $(VENV)/.dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

build: $(VENV)/.dev
	$(BIN)/python -m build

# The wheel is built from the sdist, and does a study and a log in an environment and a folder that have nothing else.
release: $(VENV)/.dev
	rm -rf dist build/release
	$(BIN)/python -m build
	$(PYTHON) -m venv build/release/venv
	build/release/venv/bin/python -m pip install --quiet --disable-pip-version-check --constraint $(CONSTRAINTS) dist/*.whl
	cd build/release && venv/bin/metaid --version && venv/bin/metaid study run three-link --create --quiet && \
		venv/bin/metaid estimate double-pendulum --nominal double-pendulum -o found.urdf

clean:
	rm -rf .venv .venv-min .venv-newest .venv-docs .venv-tools build dist .pytest_cache .mypy_cache .ruff_cache

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit("metaid needs Python 3.11 or newer: make PYTHON=python3.11 ..." if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv $(VENV)

# Machine code is made when a loop is first run, and kept: here by the demonstration, in a DB that is thrown away.
$(VENV)/.runtime: $(BIN)/python pyproject.toml $(CONSTRAINTS)
	$(PIP) --editable .
	@folder=$$(mktemp -d) && trap 'rm -r "$$folder"' EXIT && \
		$(BIN)/metaid study create three-link --storage "$$folder/metaid.db" >/dev/null && \
		$(BIN)/metaid study run three-link --storage "$$folder/metaid.db" --quiet >/dev/null
	@touch $@

$(VENV)/.dev: $(VENV)/.runtime
	$(PIP) --editable '.[all,dev]'
	@touch $@

# The packages of a group of pyproject.toml; pip knows groups since 25.1.
GROUP := import sys, tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["dependency-groups"][sys.argv[1]], sep="\n")

.venv-docs/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv-docs
	$(PYTHON) -c '$(GROUP)' docs >.venv-docs/needs.txt
	.venv-docs/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --requirement .venv-docs/needs.txt
	@touch $@

$(VENV)/.robots: $(VENV)/.dev constraints-robots.txt
	$(PYTHON) -c '$(GROUP)' robots >$(VENV)/robots.txt
	$(PIP) --constraint constraints-robots.txt --requirement $(VENV)/robots.txt
	@touch $@

.venv-tools/bin/%:
	$(PYTHON) -m venv .venv-tools
	.venv-tools/bin/python -m pip install --quiet --disable-pip-version-check $*
