"""A frame takes no more instructions and cache misses than when it was last made cheaper."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.bench.instructions import VARIANTS, count, of_functions, record, stage_of

#: This recording's frame then.
INSTRUCTIONS, LL_MISSES = 880_000, 5_800
MARGIN = 1.05

CALLGRIND = """events: Ir I1mr D1mr D1mw ILmr DLmr DLmw
ob=/site/edge/cells/mesh.abi3.so
fn=__pyx_f_4edge_5cells_4mesh_4Mesh__sweep
0 100 0 0 0 1 2 3
cfn=vt_measure.default
calls=1 0
0 30 0 0 0 9 9 9
fn=vt_measure.default
0 30
ob=/lib/libc.so.6
fn=vt_measure.default
0 7
"""


def test_a_function_counts_for_the_library_that_holds_it(tmp_path: Path) -> None:
    path = tmp_path / "callgrind.out"
    path.write_text(CALLGRIND)
    functions, misses = of_functions(path)
    assert functions == {
        ("cells", "mesh.Mesh._sweep"): 100,
        ("cells", "mesh.vt_measure.default"): 30,
        ("interpreter, libraries", "vt_measure.default"): 7,
    }
    assert misses == 6


@pytest.mark.parametrize(
    ("library", "symbol", "stage"),
    [
        ("/x/edge/types.abi3.so", "helper", ("edge", "types.helper")),
        (
            "/x/edge/features/pin_motion.abi3.so",
            "__pyx_pf_4edge_8features_10pin_motion_9PinMotion_3since_rest",
            ("features", "pin_motion.PinMotion.since_rest"),
        ),
        ("/x/libpython3.so", "PyObject_Call", ("interpreter, libraries", "PyObject_Call")),
    ],
)
def test_stage_and_name_of_a_symbol(library: str, symbol: str, stage: tuple[str, str]) -> None:
    assert stage_of(library, symbol) == stage


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="needs valgrind (.ci/packages)")
def test_a_frame_takes_no_more_than_before(tmp_path: Path) -> None:
    counts = count(VARIANTS["contact"][2], record("contact", tmp_path), tmp_path)
    assert counts.instructions <= MARGIN * INSTRUCTIONS, counts.stages()
    assert counts.ll_misses <= MARGIN * LL_MISSES
