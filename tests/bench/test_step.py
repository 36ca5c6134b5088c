"""A step takes no more instructions and misses than when it was last made cheaper; how they are counted."""

import shutil
from pathlib import Path

import pytest

from tests.bench.arm64 import Board, made
from tests.bench.counter import NoCounter, counted, of_callgrind
from tests.bench.step import VARIANTS, Step

#: The step in contact took so many then.
INSTRUCTIONS, LL_MISSES = {"x86_64": 690_000, "aarch64": 787_000}, 4_900
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


def test_a_step_hands_one_frame_to_the_bus_and_its_calls_are_counted(tmp_path: Path) -> None:
    calls = Step(VARIANTS["contact"], tmp_path).calls()
    assert calls["python"]["edge.link.sinks.CanFdSink.encode"] == 1
    assert calls["python"]["edge.runtime.loop.Loop.step"] == 1
    assert calls["kernel"]["edge.pins.centroids.CentroidKernel.read"] == 1


def test_a_missing_counter_is_named_with_its_package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(NoCounter, match="Debian package valgrind"):
        counted(["tests.bench.step_child"], 1, tmp_path)
    with pytest.raises(NoCounter, match=r"qemu-aarch64.* deploy/sbc/counting\.sh"):
        Board(tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="needs valgrind (.ci/packages)")
def test_a_step_takes_no_more_than_before(tmp_path: Path) -> None:
    counts = Step(VARIANTS["contact"], tmp_path).native()
    assert counts.instructions <= MARGIN * INSTRUCTIONS["x86_64"], counts.parts()
    assert counts.ll_misses <= MARGIN * LL_MISSES


@pytest.mark.slow
@pytest.mark.skipif(not made(), reason="needs deploy/sbc/counting.sh")
def test_a_step_takes_no_more_on_a_board_than_before(tmp_path: Path) -> None:
    counts = Step(VARIANTS["contact"], tmp_path).emulated(Board(tmp_path / "board"))
    assert counts.instructions <= MARGIN * INSTRUCTIONS["aarch64"], counts.parts()
