# Each target sets itself up: the virtual environment in .venv, with pinned dependencies.

PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python
READY := $(VENV)/.ready
WORKERS ?= 2

# What a parent of another ROS environment leaves behind would mix its libraries with ours.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH PYTHONHOME AMENT_PREFIX_PATH
unexport RMW_IMPLEMENTATION

.DEFAULT_GOAL := help
.PHONY: help setup test lint format demo bench lock clean

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 16

$(READY): requirements/lock.txt requirements/venv.sh setup.py setup.cfg
	@sh requirements/venv.sh "$(PYTHON)" "$(VENV)"
	@touch $@

setup: $(READY) ## make .venv (the other targets do it themselves)

test: $(READY) ## run all tests
	$(PY) -m pytest -n $(WORKERS) $(ARGS)

lint: $(READY) ## check style and types
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy

format: $(READY) ## put the code into the style that lint asks for
	$(PY) -m ruff check --fix .
	$(PY) -m ruff format .

demo: $(READY) ## track a person in a real recording, live over ROS 2 (5 minutes)
	$(PY) -m markerless_tracker.cli.demo $(ARGS)

bench: $(READY) ## remake the published figures (long)
	@set -e; for script in bench/*.py; do echo "$$script"; $(PY) "$$script" $(ARGS); done

lock: ## pin anew what requirements/direct.txt names, newest versions
	rm -rf $(VENV)-lock
	$(PYTHON) -m venv $(VENV)-lock
	$(VENV)-lock/bin/python -m pip install -q -r requirements/direct.txt
	sh requirements/pin.sh $(VENV)-lock/bin/python > requirements/lock.txt
	rm -rf $(VENV)-lock

clean: ## remove everything that the targets made
	rm -rf $(VENV) build install log dist demo out .hypothesis .mypy_cache .ruff_cache *.egg-info
	find . -name __pycache__ -prune -exec rm -rf {} +
