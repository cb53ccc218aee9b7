# SPDX-License-Identifier: Apache-2.0
# Needs Python 3.11, git and make; everything else goes into $(VENV).
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV ?= .venv
DEMO_ARGS ?=
TEST_ARGS ?=
JOBS ?= 4
BENCH_ARGS ?=
FIGURES ?=
DOCS ?= out/docs

BIN := $(VENV)/bin
SOURCES := setup.py setup.cfg pyproject.toml package.xml $(shell find intent_recognition -name "*.c")
# Four on two cores: some wait for nodes and browsers, which leaves a fifth of the time idle.
# Each worker takes half of what remains, so that tests of one module stay together.
# The middleware rarely hangs for good as a node is destroyed, which ends the worker (conftest.py): its
# test is run once more, and no other.
PYTEST = $(BIN)/python -m pytest -n $(JOBS) --dist worksteal --reruns 1 --only-rerun "^no failure$$"
PIP := $(BIN)/python -m pip --disable-pip-version-check
export MPLBACKEND ?= Agg
# A demo or a test starts many processes: each would compile every module again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help venv figures demo test coverage quick lint format bench docs reference clean
.DEFAULT_GOAL := help

help:
	@echo "make demo   watch the simulated coworker and the arm (DEMO_ARGS='--headless --seed 1')"
	@echo "make test   run all tests in JOBS=4 processes (TEST_ARGS='-k ingest')"
	@echo "make quick  run the tests that take less than a third of a second each"
	@echo "make coverage  run the tests and show which branches never ran"
	@echo "make lint   check style, formatting, types and spelling"
	@echo "make bench  measure against the required figures"
	@echo "make figures  measure what of README and docs is not current (FIGURES=--list, FIGURES='demo speed')"
	@echo "make docs   build the site in $(DOCS)"
	@echo "make venv   only create $(VENV)"

venv: $(VENV)/.dev

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.runtime: requirements.txt $(SOURCES) | $(BIN)/python
	@echo "installing ROS 2 Jazzy and the libraries into $(VENV), 1.5 GB: one to three minutes"
	$(PIP) install --quiet -r requirements.txt
	$(PIP) install --quiet --no-deps --no-build-isolation --config-settings editable_mode=compat -e .
	@touch $@

$(VENV)/.dev: requirements-dev.txt $(VENV)/.runtime
	$(PIP) install --quiet -r requirements-dev.txt
	@touch $@

$(VENV)/.bench: requirements-bench.txt $(VENV)/.runtime
	$(PIP) install --quiet -r requirements-bench.txt
	@touch $@

$(VENV)/.docs: requirements-docs.txt $(VENV)/.runtime
	$(PIP) install --quiet -r requirements-docs.txt
	@touch $@

demo: $(VENV)/.runtime
	$(BIN)/intent demo $(DEMO_ARGS)

test: $(VENV)/.dev
	$(PYTEST) $(TEST_ARGS)

coverage: $(VENV)/.dev
	$(PYTEST) --cov --cov-report=term:skip-covered $(TEST_ARGS)

quick: $(VENV)/.dev
	$(PYTEST) -m "not slow" $(TEST_ARGS)

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell
	$(BIN)/mypy

format: $(VENV)/.dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(VENV)/.bench
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks $(BENCH_ARGS)

docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -W --keep-going -q -c docs -b html . $(DOCS)
	@echo "the site is at $(DOCS)/index.html"

figures: $(VENV)/.bench
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python docs/tools/figures.py $(FIGURES)

reference: $(VENV)/.runtime
	$(BIN)/python docs/tools/write_reference.py

clean:
	rm -rf $(VENV) build install log *.egg-info
