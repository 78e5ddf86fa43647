# make reports   set up, synthesise the examples, run the pipeline
# make test      set up, check style and types, run the tests
# make test-thorough  the same with the tests that take seconds each
# make docs      set up, build the documentation site into site/; a warning is an error
# make benchmark set up, print the ratios of docs/performance.md
# make screenshots  set up, take pictures of all reports, check each in a browser
# make coverage-study  do the intervals hold the truth? hours; writes the tables of docs/uncertainty.md
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# One BLAS thread: the matrices are small, and two threads on two busy cores are slower than one.
export OPENBLAS_NUM_THREADS ?= 1
# DVC's own work between stages is one at a time, so that more than four lanes would wait for each other.
LANES ?= $(shell nproc 2>/dev/null | awk '{print ($$1 < 4) ? $$1 : 4}' || echo 1)

.PHONY: reports test tests test-thorough lint docs benchmark screenshots coverage-study schema setup clean
.DEFAULT_GOAL := reports

$(VENV)/ready: requirements.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "rigfit needs Python 3.11 or newer; say which with: make PYTHON=python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

setup: $(VENV)/ready

reports: setup
	@# A kill at the wrong millisecond leaves these of DVC empty, and it refuses to go on with them.
	@for file in .dvc/tmp/rwlock dvc.lock; do test -s $$file || rm -f $$file; done
	@# Campaigns that build on each other go in one lane, the lanes side by side. What fails there is tried once more by the
	@# last command, which also makes the index: its messages and its exit status count.
	$(BIN)/python -m pipeline.campaign.lanes | xargs -P $(LANES) -L 1 $(BIN)/dvc --wait-for-lock repro --keep-going || true
	$(BIN)/dvc repro --keep-going
	@echo "$(CURDIR)/reports/index.html"

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The types are checked on one core while the tests begin on both.
test: setup
	@$(MAKE) --no-print-directory --jobs 2 lint tests docs

tests: setup
	$(BIN)/python -m pytest -n auto -m "not thorough"

test-thorough: lint
	$(BIN)/python -m pytest -n auto

# Not --quiet: it would hide the warnings, and --strict counts only what is said.
docs: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

benchmark: setup
	$(BIN)/python -m benchmarks

# Of the reports that 'make reports' left; needs Chromium, and poppler-utils for the printed sheets.
screenshots: setup
	$(BIN)/python -m benchmarks.pages

coverage-study: setup
	$(BIN)/python -m benchmarks.coverage --write

clean:
	rm -rf $(VENV) site recordings reports datasets/*/synthetic datasets/*/fetched datasets/*/.fetched*

schema: setup
	$(BIN)/python -m pipeline.findings.storage > docs/findings.schema.json
