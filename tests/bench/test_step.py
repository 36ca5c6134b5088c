"""A step takes no more instructions and misses than when it was last made cheaper; how they are counted."""

import shutil
from pathlib import Path

import pytest

from tests.bench.arm64 import Board, made, of_blocks, places_of
from tests.bench.counter import NoCounter, counted, name_of, of_callgrind
from tests.bench.step import VARIANTS, Step

#: Of the step in contact then.
INSTRUCTIONS, LL_MISSES = {"x86_64": 1_420_000, "aarch64": 1_550_000}, 16_000
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


def test_a_block_counts_for_the_function_that_it_lies_in(tmp_path: Path) -> None:
    program, library = tmp_path / "program", tmp_path / "library.so"
    for path, kind in ((program, 2), (library, 3)):
        path.write_bytes(bytes(16) + bytes([kind, 0]))
    (tmp_path / "maps").write_text(
        f"7000-8000 r-xp 00000000 00:00 1 {library}\n8000-9000 r--p 00001000 00:00 1 {library}\n"
        f"400-500 r-xp 00000000 00:00 2 {program}\n9000-a000 rw-p 00000000 00:00 0 \n"
    )
    places = places_of(tmp_path / "maps")
    names = [(0x10, "first"), (0x1010, "second"), (0x410, "third")]
    for place in places:
        vars(place.binary)["symbols"] = sorted(names)  # in place of what `nm` prints
    (tmp_path / "blocks").write_text("7010 3 4\n801c 5 2\n420 7 2\n9004 1 6\n")
    assert of_blocks(tmp_path / "blocks", places, frames=2).functions == {
        ("library.so", "first"): 6,
        ("library.so", "second"): 5,
        ("program", "third"): 7,
        ("?", "?"): 3,
    }


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
