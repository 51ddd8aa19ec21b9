# make demo      a virtual environment, then scenes/tabletop.py to out/: sound, contact log, picture
# make test      a virtual environment with the tools, then style, types and tests, ways of use first
# make test-all  the same with those marked slow: tests that take minutes, and all cases of what `make test` samples
# make bench     one table: what sound costs, beside what must hold (benchmarks/README.md names the other scripts)
# make gate      BASE=main [HEAD=branch]: does a revision keep every bit of another? One line a probe
# make release   sdist and wheel of this machine to build/dist, the wheel made of the sdist and tested as it is installed
# make docs      the pages that are made of the code, then all of docs/ as a site in build/site, links checked
# Python 3.11, 3.12 or 3.13 is all that is needed. PYTHON=python3.13 or a path names one.

SHELL := /bin/bash
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
LOOKED_FOR := python3.11 python3.12 python3.13 python3
IS_SUPPORTED := import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))
SAY_VERSION := import sys; print(f"{sys.version_info[0]}.{sys.version_info[1]}")
# asked, not only looked up: a version manager's stand-in is on PATH and runs nothing
PYTHON ?= $(shell for name in $(LOOKED_FOR); do "$$name" -c '$(IS_SUPPORTED)' 2>/dev/null && { echo $$name; break; }; done)
ifneq ($(filter-out file default undefined,$(origin PYTHON)),)
ASKED_FOR := $(PYTHON)
endif
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

.PHONY: help demo test test-all tidy check bench gate release docs clean

help:
	@sed -n 's/^# \(make\)/\1/p' Makefile

demo: .venv/run.stamp
	@mkdir -p out
	$(BIN)/sonic-bullet render $(SCENE) -o out/$(NAME).wav --contacts out/$(NAME).npz --picture out/$(NAME).png
	@echo "made out/$(NAME).wav (sound), out/$(NAME).npz (contact log), out/$(NAME).png (picture)"

# types are checked beside the tests: both take minutes. A file's tests run in one worker, which shares what they set
# up, in the order of tests/conftest.py: left to itself, xdist puts files of few tests last, which are the long ones
TESTS := pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder
test: .venv/dev.stamp
	$(BIN)/ruff format --quiet --check .
	$(BIN)/ruff check --quiet .
	@echo "checking types beside the tests"
	@{ $(BIN)/mypy --no-error-summary && $(BIN)/python -m tools.user_types; } >.venv/types.txt 2>&1 & types=$$!; \
	$(BIN)/python -m $(TESTS) -m "not slow" && \
	$(BIN)/python -m tools.installed_tests build/wheel tests/engine/compiled; tests=$$?; \
	wait $$types || { cat .venv/types.txt; exit 1; }; exit $$tests

# the engine's tests again, from an installed wheel, and with sanitizers
ENGINE_TESTS := tests/engine tests/geometry

test-all: check .venv/lerobot.stamp .venv/bpy.stamp
	$(BIN)/python -m tools.installed_tests build/sanitized --sanitized $(ENGINE_TESTS)
	@$(PIP) 'datasets>=4'
	$(BIN)/python -m $(TESTS)

# a stage's units are those that the build made: several files each, whose headers are read once
TIDY := $(BIN)/clang-tidy --quiet
tidy: .venv/dev.stamp
	@$(PIP) 'clang-tidy==23.1.*'
	$(TIDY) build/cp*/CMakeFiles/stages.dir/Unity/*.cxx -- -std=c++20 -O2
	$(TIDY) $(wildcard src/*/*_vector.cpp src/*/*/*_vector.cpp) -- -std=c++20 -O2 -DVECTOR_LEVEL=baseline

check: .venv/dev.stamp
	$(BIN)/ruff format --quiet --check .
	$(BIN)/ruff check --quiet .
	$(BIN)/mypy --no-error-summary
	$(BIN)/python -m tools.user_types

bench: .venv/dev.stamp
	@$(BIN)/python benchmarks/run_time.py

gate: .venv/dev.stamp
	@$(BIN)/python tools/gate.py $(or $(BASE),main) $(or $(HEAD),HEAD)

# nothing is uploaded and nothing tagged: that is a person's
release: .venv/dev.stamp
	$(BIN)/python -m pytest -n 0 tests/contracts/test_release.py
	@rm -rf build/dist
	$(BIN)/python -m build --outdir build/dist .
	$(BIN)/python -m tools.installed_tests build/released --wheel build/dist/*.whl $(ENGINE_TESTS) tests/journeys/test_first_sound.py
	@ls -l build/dist

docs: .venv/docs.stamp docs/how-to/pictures/strike-bowl.png docs/how-to/pictures/blender-scene.png
	$(BIN)/python docs/make_reference.py
	$(BIN)/python docs/make_media.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "made build/site/index.html"

# where a page or the extension has changed since, and a Chromium or Blender is at hand: else they stay as they are
docs/how-to/pictures/strike-bowl.png: docs/make_page_pictures.py $(wildcard sonic_bullet/apps/*/page/*.*) | .venv/docs.stamp
	$(BIN)/python docs/make_page_pictures.py

docs/how-to/pictures/blender-scene.png: docs/make_blender_picture.py $(wildcard addons/blender/*/*.py) | .venv/docs.stamp
	$(BIN)/python docs/make_blender_picture.py

clean:
	rm -rf .venv out build

# the engine is built where one of these is newer than what stands there; what did not change is not compiled again: pip
# would build in an environment of its own, another each time, and what another environment has compiled is thrown away
ENGINE := $(wildcard CMakeLists.txt tools/build_backend.py src/*.?pp src/*/*.?pp src/*/*/*.?pp)
SAY_TOOLS := import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"], sep="\n")
BUILD := $(PIP) --no-build-isolation

.venv/build.stamp: pyproject.toml $(wildcard tools/build_backend.py) .venv/python.stamp
	@$(BIN)/python -c '$(SAY_TOOLS)' >.venv/build.txt && $(PIP) -r .venv/build.txt
	@$(BIN)/python tools/build_backend.py >.venv/build.txt && $(PIP) -r .venv/build.txt
	@touch $@

.venv/run.stamp: pyproject.toml $(ENGINE) .venv/build.stamp
	@echo "installing into .venv, and building the engine (once, and where its sources change)"
	@command -v c++ g++ clang++ >/dev/null || echo "no C++ compiler found: one comes from the package index, which takes minutes (Debian: apt install g++)"
	@$(BUILD) --editable .
	@touch $@

.venv/dev.stamp: pyproject.toml $(ENGINE) .venv/build.stamp
	@echo "installing into .venv with the tools, and building the engine (once, and where its sources change)"
	@$(BUILD) --editable '.[dev]'
	@touch $@ .venv/run.stamp

# LeRobot's library brings PyTorch, 8 GB in all, and old versions of what others need: it has an environment of its own
.venv/lerobot.stamp: pyproject.toml .venv/python.stamp
	@echo "installing LeRobot's library into .venv/lerobot (once)"
	@$(BIN)/python -m venv .venv/lerobot
	@.venv/lerobot/$(PIP:.venv/%=%) --config-settings=build-dir=build/lerobot --editable '.[lerobot]'
	@touch $@

# Blender as a module is of Python 3.11 alone and wants an older numpy; where it is not to be had its tests are skipped
.venv/bpy.stamp: .venv/python.stamp
	@echo "installing Blender as a module into .venv/bpy (once)"
	@$(BIN)/python -m venv .venv/bpy
	@.venv/bpy/$(PIP:.venv/%=%) 'bpy==5.0.1' || echo "no bpy for this Python: tests in Blender are skipped"
	@touch $@

.venv/docs.stamp: .venv/dev.stamp
	@echo "installing what builds the site into .venv (once)"
	@$(BUILD) --editable '.[dev,docs]'
	@touch $@

# made anew where it is missing, broken, of another Python than was asked for, or was made in another folder; else kept
SOUND := $(shell [ -x .venv/bin/python ] && .venv/bin/python -c '$(IS_SUPPORTED)' 2>/dev/null && \
	{ [ -z "$(ASKED_FOR)" ] || \
	[ "$$(.venv/bin/python -c '$(SAY_VERSION)')" = "$$("$(ASKED_FOR)" -c '$(SAY_VERSION)' 2>/dev/null)" ]; } && \
	{ [ ! -e .venv/python.stamp ] || [ "$$(cat .venv/python.stamp)" = "$(CURDIR)" ]; } && echo yes)
ifneq ($(SOUND),yes)
.PHONY: .venv/python.stamp
endif
.venv/python.stamp:
ifneq ($(SOUND),yes)
	@"$(PYTHON)" -c '$(IS_SUPPORTED)' 2>/dev/null || { echo "no Python 3.11, 3.12 or 3.13 (looked for: $(or $(ASKED_FOR),$(LOOKED_FOR))): install one, or make PYTHON=/path/to/python3.13 ..." >&2; exit 1; }
	@"$(PYTHON)" -m venv --clear .venv
endif
	@echo "$(CURDIR)" >$@
