# Every target sets up what it needs; a second run finds it done. Wanted beforehand: Python >= 3.11 with venv, Node 20 with npm.
.DEFAULT_GOAL := help
PYTHON ?= python3
BIN := .venv/bin
WEB_SOURCES := $(shell find web -path web/node_modules -prune -o -type f -print 2>/dev/null)
PAGE := server/tracemesh/web/index.html
export OPENBLAS_NUM_THREADS ?= 2

.PHONY: help setup demo test check check-python check-web bench clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-8s %s\n", $$1, $$2 }' Makefile

setup: .make/python $(PAGE)  ## install Python and npm packages, build the web page

demo: setup  ## watch a virtual Morphorider scan, become a network, become a surface
	$(BIN)/tracemesh demo

test: setup .make/browser .make/postgresql  ## every test, the browser's included
	cd web && npm test
	$(BIN)/python -m pytest -n 3

check: check-python check-web  ## formatting, lint, types, import rules

check-python: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

check-web: setup
	cd web && npm run check

bench: export OPENBLAS_NUM_THREADS = 1
bench: setup .make/bench  ## measure and write docs/benchmarks.md
	$(BIN)/python -m benchmarks

clean:  ## remove everything that the other targets made
	rm -rf .venv .make web/node_modules server/tracemesh/web .mypy_cache .ruff_cache .pytest_cache .hypothesis

.make/python: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	@mkdir -p .make && touch $@

.make/bench: pyproject.toml .make/python
	$(BIN)/python -m pip install --quiet --editable '.[dev,bench]'
	@mkdir -p .make && touch $@

.make/npm: web/package-lock.json
	cd web && npm ci --no-fund --no-audit
	@mkdir -p .make && touch $@

$(PAGE): .make/npm .make/python $(WEB_SOURCES)
	cd web && npm run build
	@touch $@

.make/browser:
	tools/install-system-package chromium chromium
	@mkdir -p .make && touch $@

.make/postgresql:
	tools/install-system-package postgresql initdb '/usr/lib/postgresql/*/bin/initdb'
	@mkdir -p .make && touch $@
