# Everything a person needs. `make demo` and `make test` set up whatever is missing.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUST := $(wildcard Cargo.toml Cargo.lock crates/*/Cargo.toml) $(shell find crates -name '*.rs')

# A test that panics has failed, which is what tests are for.
TESTS_MAY := -A clippy::unwrap_used -A clippy::expect_used -A clippy::panic

.PHONY: help setup demo test lint test-rust test-python openvdb validate bench clean

help:
	@echo "make demo      set up, drape a sheet over the Stanford bunny, show where the film is"
	@echo "make test      set up, pass all tests"
	@echo "make setup     leave $(BIN)/tumble"
	@echo "make validate  the long figures"
	@echo "make bench     speed against peers, which it installs into .venv-bench"

setup: $(VENV)/.engine

$(VENV)/.python: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip "maturin>=1.9,<2"
	@touch $@

# The engine and the package, editable, with everything that pictures and tests need.
$(VENV)/.engine: $(VENV)/.python $(RUST)
	$(BIN)/maturin develop --release --quiet --extras pictures,dev
	@touch $@

demo: setup
	$(BIN)/tumble run drape/sheet-on-bunny --out out/demo --force

test: setup lint test-rust test-python
	@echo "All tests passed."

lint: setup
	cargo fmt --all --check
	cargo clippy --workspace --quiet -- -D warnings
	cargo clippy --workspace --tests --quiet -- -D warnings $(TESTS_MAY)
	$(BIN)/ruff format --quiet --check python benchmarks
	$(BIN)/ruff check --quiet python benchmarks
	$(BIN)/mypy

test-rust:
	cargo test --workspace --exclude tumble-python --release --quiet

# What VDB files are checked against: Debian's OpenVDB, for the system's Python; there is no wheel.
openvdb:
	@/usr/bin/python3 -c "import pyopenvdb" 2>/dev/null || /usr/bin/python3 -c "import openvdb" 2>/dev/null \
		|| { command -v apt-get >/dev/null && apt-get update -qq && apt-get install -qq -y --no-install-recommends python3-openvdb; } \
		|| echo "no python3-openvdb here: tests of VDB files need it where there is apt, and are skipped elsewhere"

test-python: setup openvdb
	$(BIN)/python -m pytest

validate: setup openvdb
	cargo test --workspace --exclude tumble-python --release --quiet -- --include-ignored --nocapture
	$(BIN)/python -m pytest -s

bench: setup
	$(PYTHON) benchmarks/bench.py

clean:
	rm -rf target out dist $(VENV) .venv-bench
