"""The environment of child processes."""

import os


def uncounted() -> dict[str, str]:
    """This process's, without what has a child's lines counted under `make coverage`.

    For children whose disk is full, or that are stopped in the middle of an import: counting imports and
    writes on its own.
    """
    return {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
