# The one list of commands. Each sets up what it needs: .venv from the lock files; what only looks takes .venv as it is.
PYTHON ?= python3
VENV := .venv
BIN := $(abspath $(VENV))/bin
export PATH := $(BIN):$(PATH)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
ARGS ?=

PROJECTS := live monitoring benchmark

.DEFAULT_GOAL := help
.PHONY: help install install-dev reproduce benchmark test-benchmark test test-all lint format params ui serve track performance readme seeds release lock docs live test-live monitor test-monitoring lint-product $(PROJECTS:%=lint-%)

help: ## list the commands
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

install: $(VENV)/.installed

install-dev: $(VENV)/.installed-dev

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: requirements.lock pyproject.toml | $(VENV)/bin/python
	@cmp -s requirements.lock $(VENV)/requirements.lock || $(BIN)/python -m pip install --quiet -r requirements.lock
	@cp requirements.lock $(VENV)/requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --editable .
	$(BIN)/python -m compileall -q src # which pip does for all but an editable package
	@touch $@

$(BIN)/cylinder-friction:
	$(MAKE) install

$(VENV)/.installed-dev: requirements-dev.lock $(PROJECTS:%=%/pyproject.toml) $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --no-deps -r requirements-dev.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation \
		$(PROJECTS:%=--editable %) # the lock has the build's hatchling
	@touch $@ $(PROJECTS:%=$(VENV)/.installed-%)

reproduce: install ## run the whole pipeline, then print the result and what to do next
	cylinder-friction check
	dvc repro offset
	$(MAKE) --no-print-directory --jobs=3 lane-train lane-baselines lane-lugre
	dvc repro
	cylinder-friction track
	cylinder-friction summary
	@echo 'commit   git add dvc.lock metrics.json params.yaml && git commit --message "Results"'
	@echo '         Commit before an experiment: the way back from one leads to the last commit.'

LANE = dvc --wait-for-lock repro --single-item
lane-train: # dvc runs one stage at a time; side by side, none of the lanes may look at the stages before it
	$(LANE) search
	$(LANE) train

lane-%:
	TQDM_POSITION=1 $(LANE) $*

benchmark: install ## run the comparison of the literature, then print where its page is
	@$(MAKE) --no-print-directory -C benchmark run VENV=$(abspath $(VENV))

test-benchmark: lint-benchmark ## check and test the comparison of the literature: about two minutes on two cores
	@$(MAKE) --no-print-directory -C benchmark test VENV=$(abspath $(VENV))

monitor: install ## a night over a simulated fleet, or over yours: ARGS="LOGS --fleet fleet.yaml --into health"
	@$(MAKE) --no-print-directory -C monitoring install VENV=$(abspath $(VENV))
	cylinder-friction monitor $(or $(ARGS),--demo build/fleet); status=$$?; test $$status -eq 3 || exit $$status # 3: an alarm

test-monitoring: lint-monitoring ## check and test monitoring: about three minutes on two cores
	@$(MAKE) --no-print-directory -C monitoring test VENV=$(abspath $(VENV))

test: install-dev ## run the tests that a change must pass: about seven minutes on two cores
	pytest -n 2 -m "not extended"

test-all: install-dev ## run those and the extended ones: kills, hangs, clusters, browsers, further pipelines
	pytest -n 2

lint: lint-product lint-live lint-monitoring ## check style, types and imports

lint-product: install-dev
	ruff format --check src tests performance docs tools examples
	ruff check src tests performance docs tools examples
	mypy
	mypy --config-file tools/other_platforms.ini --platform win32 --cache-dir .mypy_cache/win32
	mypy --config-file tools/other_platforms.ini --platform darwin --cache-dir .mypy_cache/darwin
	lint-imports
	python tools/import_cycles.py
	python tools/architecture.py
	python tools/mutants.py --look

$(PROJECTS:%=lint-%): lint-%: install-dev
	@$(MAKE) --no-print-directory -C $* lint VENV=$(abspath $(VENV))

format: install-dev ## rewrite style
	ruff format src tests performance docs tools examples
	ruff check --fix src tests performance docs tools examples

params: | $(BIN)/cylinder-friction ## compose conf/ into params.yaml, for example ARGS="experiment=smoke"
	cylinder-friction params $(ARGS)

ui: | $(BIN)/cylinder-friction ## open the MLflow UI on the runs
	cylinder-friction ui

serve: | $(BIN)/cylinder-friction ## serve the champion and print a curl to try
	cylinder-friction serve $(ARGS)

live: install ## friction of the rig's recordings as if they happened now, on a web page
	@$(MAKE) --no-print-directory -C live run VENV=$(abspath $(VENV)) ARGS="$(ARGS)"

test-live: lint-live ## check and test the live service: about five minutes on two cores
	@$(MAKE) --no-print-directory -C live test VENV=$(abspath $(VENV))

track: | $(BIN)/cylinder-friction ## log every finished stage to MLflow, without duplicates
	cylinder-friction track

performance: install ## measure the step, HTTP and logs against peers in the same run, after reproduce
	python performance/latency.py
	python performance/serving_load.py
	python performance/log_throughput.py --gigabytes 0.2

seeds: install ## the comparison for three campaign seeds (about half an hour)
	python performance/campaign_seeds.py $(or $(ARGS),1 2 3)

readme: | $(BIN)/cylinder-friction ## put the pipeline's latest table and picture into README.md
	cylinder-friction readme

release: install-dev ## build sdist and wheel into dist/, check them, and write the bill of materials
	python tools/release.py

lock: ## resolve the lock files anew from pyproject.toml
	tools/lock.sh

docs: install-dev ## build the site into build/site: tutorials executed, warnings as errors (a minute or two)
	sphinx-build --fail-on-warning --keep-going --quiet -b html docs build/site
	@echo "the site: $(abspath build/site/index.html)"
