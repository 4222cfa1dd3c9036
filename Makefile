# Everything a person needs. `make demo` and `make test` set up whatever is missing.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUST := $(wildcard Cargo.toml Cargo.lock crates/*/Cargo.toml) $(shell find crates -name '*.rs')

# The browser's engine, and the profile it is built in: `web` ships, `tested` is built faster and has the same bits.
PKG := web/src/engine/pkg
WASM_PROFILE ?= web
MODULES := $(PKG)/single_bg.wasm $(PKG)/double_bg.wasm
VERSION := $(shell sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
WEB := $(shell find web -path web/node_modules -prune -o -path web/dist -prune -o -path $(PKG) -prune -o -type f -print) \
	$(shell find python/tumble/scenes docs/theory -type f)

.PHONY: help setup demo test prepare rust-tests rust-tests-next lint lint-rust test-rust test-python test-web web wasm wasm-target wheel debian chromium openvdb blender validate validate-rust validate-python validate-matrix validate-native audit bench clean

help:
	@echo "make demo      set up, let a dress dance, show where the film is"
	@echo "make test      set up, pass all tests"
	@echo "make setup     leave $(BIN)/tumble"
	@echo "make web       build the browser laboratory into web/dist, and for \`tumble view\`"
	@echo "make wheel     the package with all of it, in dist/"
	@echo "make validate  all that is promised, in full, and counted"
	@echo "make audit     known faults and licences of what tumble depends on"
	@echo "make bench     speed against peers, which it installs into .venv-bench"

setup: $(VENV)/.engine

$(VENV)/.python: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip "maturin>=1.9,<2"
	@touch $@

# What the package, pictures and tests import. Byte code is left to the first import.
$(VENV)/.imports: $(VENV)/.python
	$(BIN)/python -c 'import tomllib; p = tomllib.load(open("pyproject.toml", "rb"))["project"]; \
		print(*p["dependencies"], *sum(p["optional-dependencies"].values(), []), sep="\n")' > $(VENV)/imports.txt
	$(BIN)/python -m pip install --quiet --no-compile -r $(VENV)/imports.txt
	@touch $@

# The engine and the package, editable; maturin installs what is lacking, too, and two installations at a time break each other.
$(VENV)/.engine: $(VENV)/.imports $(RUST)
	$(BIN)/maturin develop --release --quiet --extras pictures,dev
	@touch $@

# The first five seconds of ten: simulated, drawn and written in less than four minutes on two cores.
demo: setup
	$(BIN)/tumble run cloth/dress --frames 120 --set 'output.stills=[0, 60, 120]' --usd --out out/demo --force

# Each part in turn, and a table of their seconds.
PARTS := prepare lint test-rust test-python test-web
test: export WASM_PROFILE := tested
test:
	@mkdir -p target; rm -f target/seconds; \
	for part in $(PARTS); do \
		echo "== $$part"; start=$$(date +%s); \
		$(MAKE) --no-print-directory $$part || exit 1; \
		echo "$$part $$(($$(date +%s) - start))" >> target/seconds; done; \
	echo "All tests passed."; \
	awk '{ printf "%-12s %5d s\n", $$1, $$2; sum += $$2 } END { printf "%-12s %5d s\n", "all", sum }' target/seconds

# Downloads beside the first build. The native build waits until clippy is done, and takes what the one for browsers leaves: its
# dependencies fill the end of the other, and two engines at a time keep two cores busy; four take a third longer and twice the memory.
prepare:
	@$(MAKE) --no-print-directory -j 6 debian web/node_modules/.ready wasm rust-tests-next

rust-tests-next: $(VENV)/.imports lint-rust
	@nice $(MAKE) --no-print-directory rust-tests

# Python's engine last: what tests link is built beside the engines.
rust-tests: $(VENV)/.imports
	@cargo test $(RUST_TESTS) --no-run --quiet
	@$(MAKE) --no-print-directory setup

lint-rust:
	cargo fmt --all --check
	cargo clippy --workspace --exclude tumble-units --all-targets --quiet -- -D warnings

lint: setup lint-rust
	$(BIN)/ruff format --quiet --check python benchmarks
	$(BIN)/ruff check --quiet python benchmarks
	$(BIN)/mypy
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory web/node_modules/.ready && cd web && npm run --silent lint; \
		else echo "no Node here: the source of the browser laboratory is not checked"; fi

# Of the same packages as the build for Python, which shares the engine with these; those for WebAssembly have no tests.
RUST_TESTS := --workspace --exclude tumble-wasm --exclude tumble-wasm-f64 --exclude tumble-bindgen --release --tests

# Tests tell their time only where RUSTC_BOOTSTRAP is set, as it is here when they run, not when they are built.
TIMED := --config 'target."cfg(all())".runner = ["env", "RUSTC_BOOTSTRAP=1"]' -- -Zunstable-options --report-time
test-rust:
	@mkdir -p target; cargo test $(RUST_TESTS) $(TIMED) > target/rust-tests.txt 2>&1 \
		|| { cat target/rust-tests.txt; exit 1; }
	@grep "^test result" target/rust-tests.txt; echo "the ten longest"; \
		sed -n 's/^test \(.*\) \.\.\. ok <\(.*\)s>$$/\2 s  \1/p' target/rust-tests.txt | sort -rn | head -n 10

# What VDB files are checked against: Debian's OpenVDB, for the system's Python; there is no wheel.
openvdb:
	@/usr/bin/python3 -c "import pyopenvdb" 2>/dev/null || /usr/bin/python3 -c "import openvdb" 2>/dev/null \
		|| { command -v apt-get >/dev/null && apt-get update -qq && apt-get install -qq -y --no-install-recommends python3-openvdb; } \
		|| echo "no python3-openvdb here: tests of VDB files need it where there is apt, and are skipped elsewhere"

# What stages are opened in: Blender as a module, which needs a Python of its own and one version of it.
blender:
	@test -x .venv-blender/bin/python || { $(PYTHON) -m venv .venv-blender && .venv-blender/bin/python -m pip install --quiet bpy; } \
		|| { rm -rf .venv-blender; echo "no bpy for this Python: tests of stages in Blender are skipped"; }

# A worker per core: most tests keep one busy.
PYTEST := $(BIN)/python -m pytest -n auto --dist worksteal --durations 10

# With it, what is lacking fails a test instead of skipping it.
test-python: export TUMBLE_PREPARED := $(shell [ "$$(uname)" = Linux ] && command -v npm)
test-python: setup openvdb wasm
	$(PYTEST)

web: python/tumble/web/index.html

# A static folder, with the versions that were built there before; this one ships in the wheel.
python/tumble/web/index.html: $(MODULES) web/node_modules/.ready $(WEB)
	cd web && npm run --silent build
	rm -rf python/tumble/web
	mkdir -p python/tumble/web/v
	cp web/dist/*.html python/tumble/web
	cp -r web/dist/v/$(VERSION) python/tumble/web/v

# To give away: with the scenes and the laboratory inside.
wheel: setup web
	$(BIN)/maturin build --release --quiet --out dist
	@$(BIN)/python -m zipfile --list dist/tumble-*.whl | grep -q " *tumble/web/index.html" && ls dist/tumble-*.whl

# The browser's engine, where there is a Node that its bits can be compared in.
wasm:
	@if command -v node >/dev/null; then $(MAKE) --no-print-directory $(MODULES); \
		else echo "no Node here: the bits of WebAssembly are not compared"; fi

web/node_modules/.ready: web/package-lock.json
	@command -v npm >/dev/null || { echo "make web needs Node 20.19 or later, with npm"; exit 1; }
	cd web && npm ci --silent --no-audit --no-fund
	@touch $@

wasm-target:
	@if command -v rustup >/dev/null; then rustup --quiet target add wasm32-unknown-unknown; \
		else echo "no rustup here: the build needs Rust's target wasm32-unknown-unknown"; fi

# Modules of another profile are made anew.
$(PKG)/.$(WASM_PROFILE):
	@mkdir -p $(PKG) && rm -f $(PKG)/.web $(PKG)/.tested && touch $@

# Of one build, side by side: each module compiles an engine.
$(PKG)/single_bg.wasm: $(PKG)/.$(WASM_PROFILE) $(RUST) | wasm-target
	cargo build --quiet --profile $(WASM_PROFILE) -p tumble-wasm -p tumble-wasm-f64 --target wasm32-unknown-unknown --target-dir target/wasm
	cargo build --quiet -p tumble-bindgen --target-dir target/wasm
	target/wasm/debug/tumble-bindgen target/wasm/wasm32-unknown-unknown/$(WASM_PROFILE)/tumble_wasm.wasm single $(PKG)
	target/wasm/debug/tumble-bindgen target/wasm/wasm32-unknown-unknown/$(WASM_PROFILE)/tumble_wasm_f64.wasm double $(PKG)

$(PKG)/double_bg.wasm: $(PKG)/single_bg.wasm ;

debian: openvdb chromium

chromium: | openvdb # apt does one thing at a time
	@command -v chromium chromium-browser google-chrome >/dev/null \
		|| { command -v apt-get >/dev/null && apt-get update -qq && apt-get install -qq -y --no-install-recommends chromium; } \
		|| echo "no Chromium here, and no apt to install it: the tests of the browser laboratory need one"

test-web: setup chromium
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory web && cd web && npm test --silent; \
		else echo "no Node here: the browser laboratory is not tested; it needs Node 20.19 or later, with npm"; fi

# With the tests that are marked long, every scene in the determinism matrix, and a million random cases. Where one part fails the others
# go on; at the end stands what was counted.
COUNTS := $(CURDIR)/target/counts.jsonl
validate: export TUMBLE_FUZZ = 30
validate: export TUMBLE_WHOLE = 1
validate: export TUMBLE_COUNTS = $(COUNTS)
validate: setup openvdb blender wasm
	@mkdir -p $(dir $(COUNTS)) && rm -f $(COUNTS)
	@failed=; \
	for part in validate-rust validate-python test-web validate-matrix validate-native; do \
		echo "== $$part"; $(MAKE) --no-print-directory $$part || failed="$$failed $$part"; done; \
	echo "== what was counted"; $(BIN)/python python/tests/counts.py $(COUNTS) || failed="$$failed counts"; \
	if test -n "$$failed"; then echo "FAILED:$$failed"; exit 1; fi

validate-rust:
	cargo test $(RUST_TESTS) --quiet --no-fail-fast -- --include-ignored --nocapture
	cargo test -p tumble-units --features double --release --quiet --no-fail-fast -- --include-ignored

validate-python:
	$(PYTEST) -m "" -rfEP

validate-matrix:
	$(BIN)/python python/tests/matrix.py --all

validate-native:
	$(BIN)/python python/tests/matrix.py --bits native

# Known faults and licences of what tumble depends on; asks three databases in the network, and says which do not answer.
audit: setup
	@$(BIN)/python python/tests/audit.py

# The browser's engine is among what is measured.
bench: setup web chromium
	$(PYTHON) benchmarks/bench.py

clean:
	rm -rf target out dist $(VENV) .venv-audit .venv-bench .venv-blender web/dist web/node_modules $(PKG) python/tumble/web
