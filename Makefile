# make verify   builds the FMUs, runs the verification scenarios, writes out/verify/report.html
# make test     the tests, two processes, without the long ones; at the end the twenty that took longest
# make check    format, lint, types, import layers, generated files up to date
# make long     tests of many seconds each, after the others in continuous integration
# make soak     the longest tests (not part of the others)
# make fuzz     damaged systems, frames, requests, configurations, until 10 min bring nothing new
# make generated  regenerates the files made from definitions (specs/generated, docs/reference)
# make docs     the documentation's site in out/site; fails at a dead link, an unknown command, a missing picture
# make wheelhouse PLATFORM=x86_64|aarch64  all wheels of an installation without a network (docs/how-to/installation.md)
# make lock     resolves the dependencies anew
#
# All of them set up .venv themselves; PYTHON=... names another Python (3.11 or newer).

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.PHONY: help verify test check long soak fuzz generated docs wheelhouse lock clean

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input
ARGS ?=

# Two processes share the work; a numeric library's own threads would only get in their way.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
# Containers often set it, and then each of the many processes compiles anew all that it imports.
unexport PYTHONDONTWRITEBYTECODE

help:
	@sed -n 's/^# make /make /p' Makefile

verify: $(VENV)/.verify-ready
	$(BIN)/slewright verify $(ARGS)

test: $(VENV)/.test-ready
	$(BIN)/python -m pytest -n 2 --dist loadfile --durations 20 $(ARGS)

# Files in their own order: else those of one test come last, the longest among them.
long: $(VENV)/.test-ready
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder -m "long and not soak" --durations 20 --timeout 1200 $(ARGS)

soak: $(VENV)/.test-ready
	$(BIN)/python -m pytest -m soak --timeout 0 $(ARGS)

fuzz: $(VENV)/.test-ready
	$(BIN)/python -m tests.orchestrator.fuzz --minutes 60 --until-quiet 10 $(ARGS)
	$(BIN)/python -m tests.runtime.fuzz --minutes 60 --until-quiet 10 $(ARGS)

# All steps run, so that one go shows everything that is wrong.
check: $(VENV)/.test-ready
	@start=$$(date +%s); failed=; \
	for step in "ruff format --check ." "ruff check ." pyright "lint-imports --no-logo" "slewright generate --check"; do \
	    echo "== $$step"; $(BIN)/$$step || failed="$$failed [$$step]"; \
	done; \
	if [ -n "$$failed" ]; then echo "check: failed:$$failed, $$(( $$(date +%s) - start )) s"; exit 1; fi; \
	echo "check: passed in $$(( $$(date +%s) - start )) s"

generated: $(VENV)/.verify-ready
	$(BIN)/slewright generate

# `-n` reports every reference that leads nowhere, `-W` makes each warning an error, after all of them were shown.
docs: $(VENV)/.docs-ready
	$(BIN)/python -m tests.docs.commands
	$(BIN)/python -m sphinx -n -W --keep-going -q -b html -d out/doctrees docs out/site
	@echo "the site: out/site/index.html"

# EXTRAS="runtime verify" adds what simulates the machine; FOR is the Python of the computer it is for.
PLATFORM ?= x86_64
EXTRAS ?= runtime
FOR ?= 3.11

wheelhouse: $(VENV)/.verify-ready $(VENV)/.runtime-locked
	$(BIN)/python requirements/wheelhouse.py --platform $(PLATFORM) --python $(FOR) --extras $(EXTRAS) \
		--out dist/wheelhouse-$(PLATFORM)

# --- set-up: hashed dependencies first, then the project itself without looking at an index ------------

$(VENV)/.made: requirements/make-venv
	if ! $(BIN)/python -m pip --version >/dev/null 2>&1; then requirements/make-venv $(VENV); fi
	touch $@

$(VENV)/.verify-locked: requirements/verify.lock | $(VENV)/.made
	requirements/install $(VENV) $<
	touch $@

# Signing bundles takes what the machine controller has.
$(VENV)/.runtime-locked: requirements/runtime.lock $(VENV)/.verify-locked
	requirements/install $(VENV) $<
	touch $@

# The documentation's lock holds the site's generator and what the commands need to be looked up.
$(VENV)/.docs-locked: requirements/docs.lock $(VENV)/.runtime-locked
	requirements/install $(VENV) $<
	touch $@

# The test lock holds everything of the verify lock in the same versions.
$(VENV)/.test-locked: requirements/test.lock | $(VENV)/.made
	requirements/install $(VENV) $<
	touch $(VENV)/.verify-locked $@

$(VENV)/.verify-ready: $(VENV)/.verify-locked pyproject.toml
	$(PIP) install --quiet --no-deps --no-build-isolation --editable .
	touch $@

$(VENV)/.docs-ready: $(VENV)/.docs-locked $(VENV)/.verify-ready
	touch $@

$(VENV)/.test-ready: $(VENV)/.test-locked pyproject.toml
	$(PIP) install --quiet --no-deps --no-build-isolation --editable .
	touch $(VENV)/.verify-ready $@

# One resolution for Python 3.11 and newer on every platform; hashes, but no index address.
LOCK := $(BIN)/uv pip compile pyproject.toml --quiet --universal --python-version 3.11 --generate-hashes \
	--no-emit-index-url --no-emit-find-links --annotation-style line --custom-compile-command "make lock"

lock: $(VENV)/.test-ready
	$(LOCK) --all-extras $(ARGS) --output-file requirements/test.lock
	$(LOCK) --extra verify --extra build --constraint requirements/test.lock --output-file requirements/verify.lock
	$(LOCK) --extra runtime --constraint requirements/test.lock --output-file requirements/runtime.lock
	$(LOCK) --extra docs --constraint requirements/test.lock --output-file requirements/docs.lock
	awk '/^uv==/{p=1} p{print} p&&!/\\$$/{exit}' requirements/test.lock > requirements/uv.txt

clean:
	rm -rf build out dist $(VENV)
