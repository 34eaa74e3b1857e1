# make        what there is to make
# Every target makes the virtual environment first where it is missing or stale.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.made
# uv takes a tenth of pip's time; where it does not reach the package index that pip is set to, pip
# does it.
INSTALL := $(BIN)/uv pip install --quiet --python $(BIN)/python -c constraints.txt -e
PIP_INSTALL := $(BIN)/pip install --quiet --no-compile --disable-pip-version-check -c constraints.txt -e

# Compiled modules are kept, whatever the environment says: each process would compile a thousand.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help demo test check bench bench-all docs arm64 clean

help:  ## what there is to make
	@grep -E '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit("Grebe needs Python 3.11 or newer; name one with PYTHON=...") if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt uv
	$(INSTALL) '.[dev]' || $(PIP_INSTALL) '.[dev]'
	@touch $@

demo: $(STAMP)  ## plan, steer, sample and map a hectare of water in simulation
	$(BIN)/grebe demo --out demo

test: $(STAMP)  ## all tests, the slow ones too
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist worksteal

check: $(STAMP)  ## style, types, import contract
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/basedpyright
	$(BIN)/lint-imports
	$(BIN)/python tools/check_web.py

bench: $(STAMP)  ## what is wanted of speed, measured in one short run, in one table
	$(INSTALL) '.[dev,bench]' || $(PIP_INSTALL) '.[dev,bench]'
	$(BIN)/python -m benchmarks

bench-all: $(STAMP)  ## all benchmarks, for many hours
	$(INSTALL) '.[dev,bench]' || $(PIP_INSTALL) '.[dev,bench]'
	$(BIN)/python -m benchmarks all

docs: $(STAMP)  ## the documentation as a site, its examples run: build/docs/index.html
	$(INSTALL) '.[dev,docs]' || $(PIP_INSTALL) '.[dev,docs]'
	$(BIN)/sphinx-build -W --keep-going -q -b html docs build/docs

arm64: $(STAMP)  ## whether the image's packages install on an arm64 boat, asked of the package index
	$(BIN)/python tools/check_arm64.py

clean:  ## remove what was made
	rm -rf $(VENV) demo dist build
