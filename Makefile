# make demo    a virtual environment, then scenes/tabletop.py to out/: sound, contact log, picture
# make test    a virtual environment with the tools, then style, types and tests
# make bench   one table: what sound costs, beside what must hold (benchmarks/README.md names the other scripts)
# make docs    the pages that are made of the code: API, commands, case.json and its schema, contact log
# Python 3.11 is all that is needed: PyBullet has no wheel for a later one. PYTHON=/path/to/python3.11 names another.

SHELL := /bin/bash
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
PIP := $(BIN)/python -m pip -qq --disable-pip-version-check --no-input install
SCENE ?= scenes/tabletop.py
NAME = $(basename $(notdir $(SCENE)))
WORKERS ?= 2

# one thread each: the tests run side by side, and sums of one order are sums of the same bits
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
export MKL_NUM_THREADS := 1
export NUMEXPR_NUM_THREADS := 1
export PYTHONUNBUFFERED := 1
export MPLBACKEND := Agg

.PHONY: help demo test check bench docs clean

help:
	@sed -n 's/^# \(make\)/\1/p' Makefile

demo: .venv/run.stamp
	@mkdir -p out
	$(BIN)/sonic-bullet render $(SCENE) -o out/$(NAME).wav --contacts out/$(NAME).npz --picture out/$(NAME).png
	@echo "made out/$(NAME).wav (sound), out/$(NAME).npz (contact log), out/$(NAME).png (picture)"

test: check
	$(BIN)/python -m pytest -n $(WORKERS)

check: .venv/dev.stamp
	$(BIN)/ruff format --quiet --check .
	$(BIN)/ruff check --quiet .
	$(BIN)/mypy --no-error-summary

bench: .venv/dev.stamp
	@$(BIN)/python benchmarks/run_time.py

docs: .venv/dev.stamp
	$(BIN)/python docs/make_reference.py

clean:
	rm -rf .venv out build

.venv/run.stamp: pyproject.toml .venv/python.stamp
	@echo "installing into .venv (once)"
	@$(PIP) --editable .
	@touch $@

.venv/dev.stamp: pyproject.toml .venv/python.stamp
	@echo "installing into .venv with the tools (once)"
	@$(PIP) --editable '.[dev]'
	@touch $@ .venv/run.stamp

# made anew where it is missing, broken, of another Python, or was made in another folder; else kept as it is
SOUND := $(shell .venv/bin/python -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null && \
	{ [ ! -e .venv/python.stamp ] || [ "$$(cat .venv/python.stamp)" = "$(CURDIR)" ]; } && echo yes)
ifneq ($(SOUND),yes)
.PHONY: .venv/python.stamp
endif
.venv/python.stamp:
ifneq ($(SOUND),yes)
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || { echo "Python 3.11 not found (tried '$(PYTHON)'): install it, or make PYTHON=/path/to/python3.11 ..." >&2; exit 1; }
	@"$(PYTHON)" -m venv --clear .venv
endif
	@echo "$(CURDIR)" >$@
