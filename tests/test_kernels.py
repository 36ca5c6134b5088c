"""The kernels come from the build that the environment selects, and each is listed once."""

import importlib
import os
from pathlib import Path

import pytest

from tests.support.kernels import ROOT, VARIABLE, table

VARIANT = os.environ.get(VARIABLE, "release")
KERNELS = sorted(table().KERNELS)


@pytest.mark.kernels
@pytest.mark.parametrize("name", KERNELS)
def test_a_kernel_comes_from_the_chosen_build(name: str) -> None:
    source = ROOT.joinpath(*name.split("."))
    wanted = {
        "release": source.with_suffix(".abi3.so"),
        "python": source.with_suffix(".py"),
    }.get(VARIANT, ROOT.joinpath("build", VARIANT, *name.split(".")).with_suffix(".abi3.so"))
    module = importlib.import_module(name)
    assert Path(module.__file__ or "") == wanted


def test_every_module_that_uses_cython_is_in_the_table() -> None:
    """A kernel missing in the table would run uncompiled, and need Cython at run time."""
    using = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for package in ("edge", "hostlink", "calib")
        for path in (ROOT / package).rglob("*.py")
        if "\nimport cython\n" in path.read_text(encoding="utf-8")
        or (package == "hostlink" and path.with_suffix(".pxd").is_file())
    }
    assert using == set(KERNELS)
