# Each target makes what it needs: the virtual environment .venv with pinned dependencies.

PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python
READY := $(VENV)/.ready
DOCS_VENV := .venv-docs
DOCS_READY := $(DOCS_VENV)/.ready
PEER := .venv-peer
JAZZY := .venv-jazzy
JAZZY_PYTHON ?= $(shell command -v python3.12 || echo "$(PYTHON)")
# As many test workers as cores, at most four: each starts processes of its own.
WORKERS ?= auto

# Variables of another ROS environment would mix its libraries with those of .venv.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH PYTHONHOME AMENT_PREFIX_PATH
unexport RMW_IMPLEMENTATION
# The tests start hundreds of processes, each of which would compile all modules anew.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup test test-jazzy test-long lint format docs demo bench peer lock clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 20

$(READY): requirements/lock.txt requirements/venv.sh setup.py setup.cfg
	@sh requirements/venv.sh "$(PYTHON)" "$(VENV)"
	@touch $@

setup: $(READY) ## make .venv (the other targets do it, too)

test: $(READY) ## run the tests (a quarter of an hour on two cores)
	$(PY) -m pytest -n $(WORKERS) --maxprocesses=4 $(ARGS)

test-jazzy: $(JAZZY)/.ready ## run the tests with the versions of Ubuntu 24.04, on Python 3.12 if it is there
	$(JAZZY)/bin/python -m pytest -n $(WORKERS) --maxprocesses=4 $(ARGS)

$(JAZZY)/.ready: requirements/jazzy.txt requirements/venv.sh setup.py setup.cfg
	@sh requirements/venv.sh "$(JAZZY_PYTHON)" "$(JAZZY)" requirements/jazzy.txt
	@$(JAZZY)/bin/python -m pip install -q --disable-pip-version-check \
	    --no-deps --no-build-isolation --editable .
	@touch $@

test-long: $(READY) ## run the tests that take minutes each: soak, many fuzzed messages
	$(PY) -m pytest -m long $(ARGS)

lint: $(READY) ## check style and types
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy

format: $(READY) ## format the code as lint expects it
	$(PY) -m ruff check --fix .
	$(PY) -m ruff format .

$(DOCS_READY): requirements/docs.txt requirements/venv.sh
	@sh requirements/venv.sh "$(PYTHON)" "$(DOCS_VENV)" requirements/docs.txt
	@touch $@

docs: $(DOCS_READY) ## build the documentation as a site in site/ (strict: a warning is an error)
	NO_MKDOCS_2_WARNING=1 $(DOCS_VENV)/bin/python -m mkdocs build --strict $(ARGS)

demo: $(READY) ## track a person in a real recording, live over ROS 2 (5 minutes)
	$(PY) -m markerless_tracker.cli.demo $(ARGS)

bench: $(READY) ## measure the published tables (an hour)
	$(PY) bench/run.py $(ARGS)

peer: $(READY) $(PEER)/.ready ## measure MediaPipe with triangulation and this tracker (15 minutes)
	$(PY) bench/peer/run.py $(ARGS)

$(PEER)/.ready: requirements/peer.txt
	$(PYTHON) -m venv $(PEER)
	$(PEER)/bin/python -m pip install -q --disable-pip-version-check -r $<
	@touch $@

lock: ## pin the newest versions of requirements/direct.txt and docs-direct.txt
	rm -rf $(VENV)-lock $(DOCS_VENV)-lock
	$(PYTHON) -m venv $(VENV)-lock
	$(VENV)-lock/bin/python -m pip install -q -r requirements/direct.txt
	sh requirements/pin.sh $(VENV)-lock/bin/python $(VENV) > requirements/lock.txt
	$(PYTHON) -m venv $(DOCS_VENV)-lock
	$(DOCS_VENV)-lock/bin/python -m pip install -q -r requirements/docs-direct.txt
	sh requirements/pin.sh $(DOCS_VENV)-lock/bin/python $(DOCS_VENV) > requirements/docs.txt
	rm -rf $(VENV)-lock $(DOCS_VENV)-lock

clean: ## remove everything that the targets make
	rm -rf $(VENV) $(DOCS_VENV) $(PEER) $(JAZZY) site build install log dist demo out .hypothesis .mypy_cache .ruff_cache *.egg-info
	find . -name __pycache__ -prune -exec rm -rf {} +
