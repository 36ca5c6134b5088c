# Everything starts here. `make demo` and `make test` set up .venv by themselves; they need Python >= 3.11,
# make and a C compiler.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
SECONDS ?= 60

.PHONY: demo test bench lint types unit test-browser stability fuzz soak sbc-test generate clean help

help:
	@sed -n 's/^## //p' Makefile

## make demo       replay bundled recordings through the whole chain; pictures and a table in out/demo
demo: $(READY)
	$(BIN)/python -m calib demo --out out/demo

## make test       lint, types and tests
test: lint types unit

## make lint       style
lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

## make types      strict types
types: $(READY)
	$(BIN)/mypy

## make unit       tests alone
unit: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest

## make test-browser  the live pages in headless Chromium; part of `make test`, skipped where there is none
test-browser: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest tests/browser

## make bench      time per frame and stage, against the reference and the floor
bench: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.bench

## make stability  the long run of the geometry's hard cases
stability: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.bench stability

## make fuzz       coverage-guided fuzzing of the decoder, SECONDS=60
fuzz: $(READY)
	$(BIN)/pip install -q -c constraints.txt atheris
	$(BIN)/python tests/fuzz/fuzz_decoder.py -max_total_time=$(SECONDS)

## make soak       the app under a random schedule of all faults, and its promises; SECONDS=3600
soak: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.bench soak --seconds $(SECONDS)

## make sbc-test   an emulated arm64 board: installer, service, kernel CAN (root, QEMU; see deploy/sbc/build.sh)
sbc-test: $(READY)
	PYTHON=$(abspath $(BIN))/python deploy/sbc/build.sh
	$(BIN)/python deploy/sbc/run.py

## make generate   write DBC, EDS, C codec and WIRE.md from the tables in hostlink/wire
generate: $(READY)
	$(BIN)/python -m hostlink.wire.generate

## make clean      remove everything that can be made again
clean:
	rm -rf .venv build dist out *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis edge/*.so
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(READY): pyproject.toml constraints.txt $(wildcard edge/*.[ch])
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@
