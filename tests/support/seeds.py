"""Seed of the generative tests: 0 in `make test`, another one in each round of `make fuzz`."""

import os

SEED = int(os.environ.get("FUZZ_SEED", "0"))
