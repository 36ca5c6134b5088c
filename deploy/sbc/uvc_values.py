"""Compares, on the emulated board, what a finger sees with its recording and with another processor's values.

    uvc_values.py images RECORDING SOURCE LEVELS  the camera's images are the recording's, within so many
    uvc_values.py untouched SAMPLES MM            a sample on vcan0 says so
    uvc_values.py pressed SAMPLES MM              those of the press are the replayed ones, within so much
    uvc_values.py equal SAMPLES OTHERS            whole numbers are alike, others to 1e-9

SAMPLES are lines of JSON from `edge replay --samples`. Prints the largest differences; exit status 0: within.
"""

from __future__ import annotations

import json
import sys
from itertools import islice
from pathlib import Path

import numpy as np

from edge.sources import open_source
from hostlink import connect

PATIENCE_S = 200.0
NEAR_MM = 0.1  # a sample on the way to what is waited for is further off
NAMES = ("displacement_mm", "shear_x_mm", "shear_y_mm")


def images(recording: str, camera: str, levels: float) -> bool:
    """Whether eight images of the camera are the recording's, on average of their pixels."""
    recorded = np.array([frame.image for frame in open_source(recording)], np.int16)
    source = open_source(camera)
    worst = 0.0
    for frame in islice(source, 8):
        worst = max(worst, float(np.abs(recorded - frame.image).mean(axis=(1, 2)).min()))
    source.close()
    print(f"{worst:.2f} levels")
    return worst <= levels


def values(what: str, replayed: str, limit_mm: float) -> bool:
    """Whether samples are those of the recording's end, or one is that of its beginning."""
    lines = Path(replayed).read_text().splitlines()
    rows = [json.loads(line) for line in (lines[:1] if what == "untouched" else lines[-5:])]
    wanted = np.array([[row[name] for name in NAMES] for row in rows])
    worst, missing = np.zeros(len(NAMES)), len(rows)
    with connect("can:vcan0") as host:
        samples = host.samples(PATIENCE_S)
        while missing:
            state = next(samples).state
            off = np.abs(wanted - [getattr(state, name) for name in NAMES])
            nearest = off[off[:, 0].argmin()]
            if nearest[0] < NEAR_MM and state.pins_tracked == 1.0:  # else: not there yet, or no rest frame
                worst, missing = np.maximum(worst, nearest), missing - 1
    print(*(f"{name} {value:.4f}" for name, value in zip(NAMES, worst, strict=True)))
    return bool((worst <= limit_mm).all())


def numbers(lines: str) -> tuple[list[object], list[float]]:
    """Of each sample but its latency: what has to be alike, and numbers in turn."""
    alike: list[object] = []
    near: list[float] = []

    def take(value: object) -> None:
        if isinstance(value, (dict, list)):
            for one in value.values() if isinstance(value, dict) else value:
                take(one)
        elif isinstance(value, float):
            near.append(value)
        else:
            alike.append(value)

    for line in lines.splitlines():
        take({name: value for name, value in json.loads(line).items() if name != "latency_us"})
    return alike, near


def equal(samples: str, others: str) -> bool:
    """Whether two processors read the same."""
    (alike, near), (wanted, around) = (numbers(Path(path).read_text()) for path in (samples, others))
    if not near or alike != wanted or len(near) != len(around):
        print("the whole numbers differ")
        return False
    worst = max(abs(a - b) / max(1.0, abs(b)) for a, b in zip(near, around, strict=True))
    print(f"{worst:.1e} of {len(near)} numbers")
    return worst <= 1e-9


if __name__ == "__main__":
    what, given, other, *levels = sys.argv[1:]
    if what == "equal":
        sys.exit(not equal(given, other))
    sys.exit(not (images(given, other, float(levels[0])) if levels else values(what, given, float(other))))
