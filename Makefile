# Everything from a fresh clone: `make demo`, `make test` and `make bench` set up what they need.

VENV ?= .venv
PYTEST_ARGS ?= -n 4 --overlap
bin := $(VENV)/bin
stamp := $(VENV)/.installed

# ROS 2 by default talks to every computer of the network. Stay on this one, in a domain of one's own.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
ifndef ROS_DOMAIN_ID
ROS_DOMAIN_ID := $(shell echo $$(( $$$$ % 100 + 1 )))
endif
export ROS_DOMAIN_ID
# What another environment, activated or sourced, may have left behind.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH PYTHONHOME
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH
# Tests start hundreds of processes; each would compile all modules anew, numpy's too.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup lock hooks demo demo-two test interfaces random lint format docs bench release-check clean

help:  ## Show this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 15

setup: $(stamp)  ## Make .venv with ROS 2, the tools and this package (PYTHON=python3.12 chooses one)

# Modules of the package count at once; only what is built or installed asks for another set-up.
$(stamp): $(wildcard msg/* srv/* action/* cmake/*) CMakeLists.txt setup.py package.xml \
		pyproject.toml requirements-dev.txt requirements.lock scripts/setup.sh
	@echo 'Setting up $(VENV): about two minutes the first time.'
	VENV=$(VENV) scripts/setup.sh
	@touch $@

lock: $(stamp)  ## Renew requirements.lock: the newest versions that the ranges admit
	VENV=$(VENV) scripts/lock.sh --upgrade

hooks: $(stamp)  ## Check formatting, types and the message at each git commit
	$(bin)/pre-commit install

demo: $(stamp)  ## Simulated robot, driver and a client that moves it; draws the path
	$(bin)/ur-cartesian demo

demo-two: $(stamp)  ## The same with two arms at once, each with a goal of its own
	$(bin)/ur-cartesian demo --arms 2

test: $(stamp)  ## Lint, then all tests (PYTEST_ARGS='-k name' chooses)
	$(MAKE) --no-print-directory --jobs 2 lint interfaces
	$(bin)/pytest --no-skips $(PYTEST_ARGS)

# The UR driver's messages, for tests. Their build takes longer than a test may.
interfaces: $(stamp)
	$(bin)/python test/support/ur_interfaces.py

random: $(stamp)  ## The random tests with all their cases (RANDOM_SEED=N draws others)
	RANDOM_SHARE=1 $(bin)/pytest -m random -n 2 --timeout 3600

# Lint reads the texts that git tracks, whatever else users have written into the checkout. Where
# there is no git, the tools get no files and look for them.
tracked = git grep --no-color -Ilz '' -- $(1) 2>/dev/null | xargs -0

lint: $(stamp)  ## Formatting, ruff, mypy, the rules for imports, spelling
	$(call tracked,'*.py') $(bin)/ruff format --check
	$(call tracked,'*.py') $(bin)/ruff check
	$(call tracked,'*.py' ':!*setup.py' ':!doc' ':!launch') $(bin)/mypy
	$(bin)/lint-imports --no-logo
	$(call tracked,) $(bin)/codespell

format: $(stamp)  ## Sort the imports and format all Python
	$(bin)/ruff check --select I --fix
	$(bin)/ruff format

docs: $(stamp)  ## Build the documentation site into build/site, and check its links
	$(bin)/python -m sphinx --quiet --fail-on-warning --keep-going doc build/site
	$(bin)/python scripts/check_site.py build/site

bench: $(stamp)  ## Measure, and print a table
	$(bin)/python benchmark/run.py

release-check: $(stamp)  ## Refuse placeholders, versions that disagree, an empty changelog
	$(bin)/python scripts/check_release.py

clean:  ## Remove all that was built or installed here
	rm -rf $(VENV) build install log dist *.egg-info .*_cache .hypothesis
	rm -rf simulator/build simulator/dist simulator/src simulator/LICENSE
	find . -name __pycache__ -prune -exec rm -rf {} +
