# Two commands do everything on a fresh machine with Python 3.11 or later: `make demo` and `make test`.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test test-all bench prove docs lint wheel setup clean

setup: .venv/ready

.venv/ready: pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit("origami_sim needs Python 3.11 or later: make PYTHON=python3.11 ...") if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

demo: setup
	$(BIN)/origami-sim demo --out runs/demo

# tests share the cores already: threads of the linear algebra would only wait for each other
test test-all: export OPENBLAS_NUM_THREADS = 1

test: setup
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

test-all: setup
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder -m 'slow or not slow'

bench: setup
	$(BIN)/python benchmarks/run.py

CASES ?= 12
SEED ?= 1
prove: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable proof
	$(BIN)/origami-proof --cases $(CASES) --seed $(SEED)

docs: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet origami_sim scenes studies examples tests benchmarks docs/*.py .ci
	$(BIN)/pyright

wheel: setup
	$(BIN)/python .ci/wheel.py

clean:
	rm -rf .venv runs build *.egg-info
