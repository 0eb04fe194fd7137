# `make help` tells what there is. PYTHON and VENV may be given: make environment PYTHON=python3.13 VENV=.venv-3.13
PYTHON ?= python3
VENV ?= .venv
SCENARIO ?= lab-to-allens-office
ROOM ?= pose
SAMPLE ?= 60
SEED ?= 0
MINUTES ?= 10
WHEELS ?= build/wheels
PIP_VERSION := 26.3

BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --quiet --quiet --disable-pip-version-check
LOCK := .venv-lock
EXTRAS := $(patsubst %/pyproject.toml,%,$(wildcard extras/*/pyproject.toml))
COMPILE := CUSTOM_COMPILE_COMMAND='make lock' $(LOCK)/bin/pip-compile --quiet --generate-hashes --no-strip-extras --allow-unsafe \
	--no-emit-index-url --no-emit-find-links --no-emit-trusted-host

# Compiled once, as pip does with a package: a third of a second a command where Python is told to write no bytecode.
# Of the packages only what a mission imports is compiled before it, by docs/tools/compiling.py: it takes a third of the time.
ROOMS := blackboard world_models knowledge_sources sim logs harvey

# One thread: faster for matrices as small as ours, and the order of additions never varies.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1

# Two at once; each takes neighbours, so that what the tests of a file share is seldom made twice.
TWO := -n 2 --dist worksteal

.PHONY: help run test test-rest test-all search mutants environment site course wheels lock clean

help:
	@echo "make run          prepare everything, then drive: harvey run $(SCENARIO)"
	@echo "make test         ruff, mypy, import contracts, pytest; says what was skipped and why"
	@echo "make test-all     that, and the tests of every extra (extras/), of an installation and in a browser"
	@echo "make search       other draws of every law than yesterday's, MINUTES=$(MINUTES); what failed is kept, and tried first"
	@echo "make mutants      mutation testing of ROOM=$(ROOM), SAMPLE=$(SAMPLE); goes on where it stopped, and reports"
	@echo "make site         build the documentation site, build/site/index.html, and the man page, build/man/harvey.1"
	@echo "make course       execute the notebooks of the course: build/course"
	@echo "make wheels       build wheels of the core, of the board alone and of each extra: $(WHEELS)"
	@echo "make environment  only prepare $(VENV), for running and for testing"
	@echo "make lock         write the three requirements*.lock anew from pyproject.toml and those of the extras"
	@echo "make clean        remove environments and caches; recordings in runs/ stay"
	@echo "Options: PYTHON=$(PYTHON) (3.11 or newer), VENV=$(VENV), SCENARIO=$(SCENARIO)"

run: $(VENV)/.ready-to-run
	@$(BIN)/harvey run $(SCENARIO)

test: $(VENV)/.ready-to-test
	@echo "== ruff" && $(BIN)/ruff check
	@echo "== mypy" && $(BIN)/mypy
	@echo "== import contracts" && $(BIN)/lint-imports
	@echo "== pytest" && $(BIN)/pytest $(TWO) -m "not slow" tests --ignore tests/installed --ignore tests/browser

test-all: test test-rest

test-rest: $(VENV)/.ready-to-test-all
	@for extra in $(EXTRAS); do echo "== mypy $$extra" && $(BIN)/mypy $$extra/harvey_* || exit 1; done
	@echo "== pytest of the extras, of an installation and in a browser" \
		&& $(BIN)/pytest $(TWO) $(wildcard extras/*/tests) tests/installed tests/browser
	@echo "== pytest of what drives for minutes" && $(BIN)/pytest $(TWO) -m slow tests

# What fails is kept in .hypothesis, and tried first the next time. The files of laws come in another order each day.
search: $(VENV)/.ready-to-test
	@echo "== pytest of the laws, $(MINUTES) minutes" && $(BIN)/python tests/mutation/search_laws.py --minutes $(MINUTES)

# Minutes to hours; not in CI. Rooms and equivalent mutants: tests/mutation/rooms.toml.
mutants: $(VENV)/.ready-to-test
	@$(BIN)/python tests/mutation/mutants.py $(ROOM) --sample $(SAMPLE) --seed $(SEED) --python $(BIN)/python

environment: $(VENV)/.ready-to-test

$(BIN)/python:
	@$(PYTHON) -c "" 2>/dev/null \
		|| { echo "harvey needs Python 3.11 or newer; '$(PYTHON)' does not run. Give one: make run PYTHON=python3.13"; exit 1; }
	@$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11))" \
		|| { echo "harvey needs Python 3.11 or newer; '$(PYTHON)' is $$($(PYTHON) -V 2>&1)." \
			"Give another: make run PYTHON=python3.13"; exit 1; }
	@echo "== Preparing $(VENV) with $$($(PYTHON) -V); the first time takes some minutes"
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

# The pip that comes with Python may be years old; one version installs the rest, everywhere.
$(VENV)/.ready-to-install: requirements-pip.lock | $(BIN)/python
	@$(PIP) install --require-hashes -r requirements-pip.lock
	@touch $@

$(VENV)/.ready-to-run: requirements.lock pyproject.toml $(VENV)/.ready-to-install
	@echo "== Installing what harvey needs ($$(grep -c == requirements.lock) packages)"
	@$(BIN)/python docs/tools/installing.py requirements.lock
	@echo "== Installing harvey"
	@$(PIP) install --no-deps --no-build-isolation -e .
	@$(BIN)/python -m compileall -q $(ROOMS)
	@echo "== Compiling what it computes with, on all processors"
	@PYTHONDONTWRITEBYTECODE= $(BIN)/python -m docs.tools.compiling
	@touch $@

$(VENV)/.ready-to-test: requirements-dev.lock $(VENV)/.ready-to-run
	@echo "== Installing what the tests need ($$(grep -c == requirements-dev.lock) packages)"
	@$(BIN)/python docs/tools/installing.py requirements-dev.lock
	@$(BIN)/python -m compileall -q -q -j 0 $(VENV)/lib || true
	@touch $@

$(VENV)/.ready-to-test-all: $(EXTRAS:%=%/pyproject.toml) $(VENV)/.ready-to-test
	@for extra in $(EXTRAS); do echo "== Installing $$extra" \
		&& $(PIP) install --no-deps --no-build-isolation -e $$extra || exit 1; done
	@touch $@

site: $(VENV)/.ready-to-test
	@$(BIN)/sphinx-build -W -q docs build/site && echo "build/site/index.html"
	@$(BIN)/sphinx-build -W -q -b man docs build/man && echo "build/man/harvey.1: man -l build/man/harvey.1"

course: $(VENV)/.ready-to-test
	@$(BIN)/python -m docs.tools.course build/course

wheels: $(VENV)/.ready-to-test
	@$(PIP) wheel --no-deps --no-build-isolation --wheel-dir $(WHEELS) . ./blackboard $(EXTRAS:%=./%) && ls $(WHEELS)

lock:
	@$(PYTHON) -m venv $(LOCK)
	@$(LOCK)/bin/pip install --quiet --quiet --require-hashes -r requirements-pip.lock
	@$(LOCK)/bin/pip install --quiet --quiet pip-tools==7.6.2
	@echo "== requirements-pip.lock" && echo pip==$(PIP_VERSION) | $(COMPILE) -o requirements-pip.lock -
	@echo "== requirements.lock" && $(COMPILE) --build-deps-for editable -o requirements.lock pyproject.toml
	@echo "== requirements-dev.lock" && $(PYTHON) extras/requirements.py | $(COMPILE) -c requirements.lock -o requirements-dev.lock -
	@rm -rf $(LOCK)

clean:
	rm -rf build .mutants .venv .venv-* .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
