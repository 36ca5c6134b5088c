# Everything starts here. `make demo` and `make test` set up .venv by themselves; they need Python >= 3.11,
# make and a C compiler.
PYTHON ?= python3
BIN := .venv/bin
# What README's commands need, and what the tests need beside it. Both build with the same Cython, so that what
# the first has compiled is up to date for the second.
USABLE := .venv/.usable
READY := .venv/.ready
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt
# What is compiled, and what that is made of: setup.py has the table.
SOURCES := pyproject.toml constraints.txt setup.py $(wildcard edge/*/*.pxd hostlink/*.pxd hostlink/*/*.pxd \
	$(shell sed -n 's|^ *"\(\(edge\|hostlink\)\.[a-z_.]*\)": .*|\1|p' setup.py | tr . / | sed 's|$$|.py|'))
SECONDS ?= 60
UNIT ?= unit
# One process a core; tests of one file stay together, since what one has prepared serves the others.
PARALLEL ?= -n auto --dist loadscope
PYTEST := OMP_NUM_THREADS=1 $(BIN)/python -m pytest
BASE ?= HEAD
# To collect all tests takes 15 seconds of each process.
KERNEL_TESTS = $$(grep -rl --include='test_*.py' mark.kernels tests)

.PHONY: demo test check check-tests bench lint types unit coverage kernels sanitize slow test-browser stability fuzz soak sbc-test docs generate clean help

help:
	@sed -n 's/^## //p' Makefile

## make demo       replay bundled recordings through the whole chain; pictures and a table in out/demo
demo: $(USABLE)
	$(BIN)/python -m calib demo --out out/demo --overwrite

## make test       lint, types and tests; UNIT=coverage counts the lines that run
test: $(READY)
	$(MAKE) --no-print-directory -j2 -O lint types $(UNIT) kernels # two at once: at its end each leaves a core idle

## make check      after changing a line: lint, types, tests of the folders changed; BASE=main since a branch
check: $(READY)
	$(MAKE) --no-print-directory -j2 -O lint types check-tests

check-tests: $(READY)
	$(PYTEST) $(PARALLEL) $$($(BIN)/python -m tests.support.changed $(BASE))

## make lint       style, duplicates, workflow files
lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python -m pylint edge hostlink calib
	$(BIN)/python -m check_jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml

## make types      strict types
types: $(READY)
	$(BIN)/mypy

## make unit       tests alone
unit: $(READY)
	$(PYTEST) $(PARALLEL)

## make coverage   as unit, counting the lines that run, in child processes too
coverage: $(READY)
	rm -rf build/coverage
	OMP_NUM_THREADS=1 $(BIN)/python -m coverage run -m pytest $(PARALLEL)
	$(BIN)/python -m coverage combine -q
	$(BIN)/python -m coverage report

## make kernels    the kernels' tests again: with every index checked, and uncompiled
kernels: $(READY) build/checked/.ready
	VORONOI_TOUCH_KERNELS=checked $(PYTEST) $(PARALLEL) -m kernels \
		-W error::pytest.PytestUnraisableExceptionWarning $(KERNEL_TESTS)
	VORONOI_TOUCH_KERNELS=python $(PYTEST) $(PARALLEL) -m "kernels and not compiled" $(KERNEL_TESTS)

## make sanitize   the kernels' tests and fuzzer under the sanitizers of addresses and undefined behaviour
sanitize: $(READY) build/sanitized/.ready
	LD_PRELOAD="$$($(or $(CC),cc) -print-file-name=libasan.so) $$($(or $(CC),cc) -print-file-name=libstdc++.so.6)" ASAN_OPTIONS=detect_leaks=0 PYTHONMALLOC=malloc \
		OMP_NUM_THREADS=1 VORONOI_TOUCH_KERNELS=sanitized $(BIN)/python -m pytest -m kernels -p no:cacheprovider $(KERNEL_TESTS)

## make slow       tests that take minutes: a wheel without a compiler, instructions of a step
slow: $(READY)
	$(PYTEST) -m slow

## make test-browser  the live pages in headless Chromium; part of `make test`, skipped where there is none
test-browser: $(READY)
	$(PYTEST) tests/browser

## make bench      time per frame, against the reference
bench: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.bench

## make stability  the long run of the geometry's hard cases
stability: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.bench stability

## make fuzz       kernels, and the tests marked generative with other seeds, rounds of a minute; SECONDS=60 of each
fuzz: $(READY)
	$(BIN)/python -m tests.fuzz.test_fuzz_kernels --seconds $(SECONDS) --seed $$$$
	end=$$(($$(date +%s) + $(SECONDS))); until [ $$(date +%s) -ge $$end ]; do \
		seed=$$(($$(od -An -N3 -tu4 /dev/urandom))); echo "FUZZ_SEED=$$seed --hypothesis-seed=$$seed"; \
		FUZZ_SEED=$$seed $(PYTEST) -x -m generative --hypothesis-seed=$$seed || exit 1; done

## make soak       the program under a random schedule of all faults, and its promises; SECONDS=3600
soak: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.bench soak --seconds $(SECONDS)

## make sbc-test   an emulated arm64 board: installer, service, kernel CAN (root, QEMU; see deploy/sbc/build.sh)
sbc-test: $(READY)
	PYTHON=$(abspath $(BIN))/python deploy/sbc/build.sh
	$(BIN)/python deploy/sbc/run.py

## make docs       the documentation as pages, in out/docs
docs: $(READY)
	$(BIN)/python -m sphinx -W --keep-going -n -q -b html docs out/docs

## make generate   write DBC, EDS, C codec and WIRE.md from the tables in hostlink/wire
generate: $(READY)
	$(BIN)/python -m hostlink.wire.generate

## make clean      remove everything that can be made again
clean:
	rm -rf .venv build dist out *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find edge hostlink -name "*.so" -delete
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(USABLE): $(SOURCES)
	$(PYTHON) -m venv .venv
	$(INSTALL) cython setuptools
	$(BIN)/python setup.py --quiet build_ext --inplace 2>/dev/null & # while pip fetches: its own build waits, and reports
	$(INSTALL) --no-build-isolation -e '.[calib,view]'
	touch $@

$(READY): $(USABLE)
	$(INSTALL) --no-build-isolation -e '.[dev]'
	touch $@

build/%/.ready: $(READY)
	$(BIN)/python setup.py --quiet build_ext --variant $*
	touch $@
