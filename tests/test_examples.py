"""The programs in docs/examples run, and do what they say."""

import runpy
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from math import nan
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hostlink
from edge import EdgeError, Fingertip, open_source
from hostlink import State, Status

EXAMPLES = Path(__file__).resolve().parent.parent / "docs" / "examples"


def hand_of(program: dict[str, Any], states: list[State]) -> None:
    """Have a program find a hand whose finger 3 sends these samples, and then no more."""
    samples = [SimpleNamespace(finger=3, state=state) for state in states]
    hand = nullcontext(SimpleNamespace(samples=lambda timeout_s: iter(samples)))
    link = {"NO_CONTROL": hostlink.NO_CONTROL, "Status": Status, "connect": lambda address: hand}
    program["main" if "main" in program else "on_link"].__globals__["hostlink"] = SimpleNamespace(**link)


def read_a_finger(of: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    hand_of(of, [State(displacement_mm=k / 10, force_n=nan) for k in range(3)])
    of["main"]("can:can0")
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[3] for line in lines] == ["0.00", "0.10", "0.20"]
    assert lines[0].startswith("finger 3: depth 0.00 mm, force nan N, shear nan")


def features_of_images(of: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    of["main"]()
    depth_mm = [float(line.split()[3]) for line in capsys.readouterr().out.splitlines()]
    assert max(depth_mm) == pytest.approx(2.5, abs=0.05)
    assert depth_mm[0] == depth_mm[-1] == 0.0


def gentle_grip(of: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    closed, slides = np.transpose(list(of["simulated"]()))
    assert slides.max() < 0.5
    assert 0.8 < closed[-1] < 4.0
    of["Grip"].speed_mm_s.__globals__["FRICTION"] = np.inf  # never asks for more
    _, slides = np.transpose(list(of["simulated"]()))
    assert slides[-1] == 1.0
    grip = of["Grip"]()
    assert [grip.speed_mm_s(x, nan, nan) for x in (nan, 0.7, 0.8, 0.9)] == [0.0, 2.0, 0.0, 0.0]
    seen = ((Status(0), 0.01), (Status.NOT_LIVE, 0.01), (Status(0), nan), (Status.SATURATED, 1.5))
    hand_of(of, [State(status=s, displacement_mm=0.3, displacement_sigma_mm=mm) for s, mm in seen])
    moves: list[float] = []
    of["on_link"]("can:can0", moves.append)
    assert moves == [2.0, 0.0, 0.0, 0.0, 0.0]


def follow_an_edge(of: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    x_mm, off_mm, depth_mm = np.transpose(list(of["follow"](30)))
    assert x_mm[-1] - x_mm[0] > 20.0
    assert np.abs(off_mm[8:]).max() < 0.1
    assert depth_mm[8:] == pytest.approx(1.5, abs=0.1)


TESTS = (read_a_finger, features_of_images, gentle_grip, follow_an_edge)


@pytest.mark.parametrize("test", TESTS, ids=lambda test: test.__name__)
def test_an_example_does_what_it_says(
    test: Callable[[dict[str, Any], pytest.CaptureFixture[str]], None], capsys: pytest.CaptureFixture[str]
) -> None:
    test(runpy.run_path(str(EXAMPLES / f"{test.__name__}.py")), capsys)


def test_the_notebook_calibrates_pictures_and_draws_the_errors(tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLES / "calibrate_pictures.py")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    *rows, said = done.stdout.splitlines()
    errors = {line.split(":")[0]: float(line.split()[4]) for line in rows}
    assert max(errors.values()) < 0.05
    assert (tmp_path / said.split(":")[0] / "errors.png").stat().st_size > 10_000


def test_examples_are_short_and_all_tried() -> None:
    lines = {path.stem: len(path.read_text().splitlines()) for path in EXAMPLES.glob("*.py")}
    assert set(lines) == {*(test.__name__ for test in TESTS), "calibrate_pictures"}
    assert max(lines.values()) <= 60


def test_bad_images_and_files_are_refused_in_one_line() -> None:
    image = next(iter(open_source("example:press"))).image
    tip = Fingertip([image] * 8)
    wrong: Any
    for wrong in (np.dstack([image] * 3), image[1:], image.astype(float)):
        with pytest.raises(ValueError, match=r"give a grey one|give 160x160"):
            tip.read(wrong, 0.0)
    with pytest.raises(EdgeError, match="no such example"):
        Fingertip([image], "example:absent")
