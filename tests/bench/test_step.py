"""A step takes no more instructions and misses than when it was last made cheaper; how they are counted."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.bench.counter import name_of, of_callgrind
from tests.bench.step import VARIANTS, Step

#: Of the step in contact then.
INSTRUCTIONS, LL_MISSES = 1_500_000, 16_000
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
    functions, misses = of_callgrind(path)
    assert functions == {
        ("edge/cells", "mesh.Mesh._sweep"): 100,
        ("edge/cells", "mesh.vt_measure.default"): 30,
        ("libc.so.6", "vt_measure.default"): 7,
    }
    assert misses == 6


@pytest.mark.parametrize(
    ("library", "symbol", "name"),
    [
        ("/x/edge/types.abi3.so", "helper", ("edge", "types.helper")),
        (
            "/x/edge/features/pin_motion.abi3.so",
            "__pyx_pf_4edge_8features_10pin_motion_9PinMotion_3since_rest",
            ("edge/features", "pin_motion.PinMotion.since_rest"),
        ),
        ("/x/libpython3.so", "PyObject_Call", ("libpython3.so", "PyObject_Call")),
    ],
)
def test_part_and_name_of_a_symbol(library: str, symbol: str, name: tuple[str, str]) -> None:
    assert name_of(library, symbol) == name


def test_a_step_hands_one_frame_to_the_bus_and_its_calls_are_counted(tmp_path: Path) -> None:
    calls = Step(VARIANTS["contact"], tmp_path).calls()
    assert calls["python"]["edge.link.sinks.CanFdSink.encode"] == 1
    assert calls["python"]["edge.runtime.loop.Loop.step"] == 1
    assert calls["kernel"]["edge.pins.centroids.CentroidKernel.read"] == 1


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="needs valgrind (.ci/packages)")
def test_a_step_takes_no_more_than_before(tmp_path: Path) -> None:
    counts = Step(VARIANTS["contact"], tmp_path).native()
    assert counts.instructions <= MARGIN * INSTRUCTIONS, counts.parts()
    assert counts.ll_misses <= MARGIN * LL_MISSES
