"""Repeats the generative tests with a new seed each round: `python -m tests.fuzz.repeat --seconds 60`.

A round takes a minute or more and is always finished. The first failure ends it and names the seed.
"""

import os
import secrets
import subprocess
import sys
import time

import click


@click.command()
@click.option("--seconds", type=click.FloatRange(0.0, 1e6), default=60.0, show_default=True)
@click.option("--seed", type=click.IntRange(1, 2**31 - 1), help="Of the first round; else a random one.")
def main(seconds: float, seed: int | None) -> None:
    """Run the tests marked `generative` again and again, for this long."""
    end_s = time.monotonic() + seconds
    while True:
        seed = seed or secrets.randbelow(2**31 - 1) + 1
        command = [sys.executable, "-m", "pytest", "-x", "-m", "generative", f"--hypothesis-seed={seed}"]
        click.echo(f"seed {seed}")
        if subprocess.run(command, env={**os.environ, "FUZZ_SEED": str(seed)}, check=False).returncode:
            raise click.ClickException(f"a test failed with seed {seed}; again: --seed {seed}")
        seed = None
        if time.monotonic() >= end_s:
            return


if __name__ == "__main__":
    main()
