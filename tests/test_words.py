"""Names say what a thing is, in the field's words: those that were replaced stay replaced."""

from __future__ import annotations

import ast
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
#: Modules and folders: what they were called -> what they are called.
MODULES = {
    "aside": "worker",
    "tape": "frame_recorder",
    "recorded": "session",
    "leave": "process",
    "threads": "process",
    "notify": "systemd",
    "judge": "image_quality, pin_visibility",
    "track": "tracking",
    "tessellate": "cells",
    "transport": "link",
    "draw": "view",
}
#: Names in code: what they were called -> what they are called.
RENAMED = {
    "Health": "FaultRegistry",
    "Vitals": "BoardMonitor",
    "Faults": "FaultDetector",
    "mend": "repair",
    "torn": "inconsistent",
    "loose": "unassigned",
    "_believed": "_inliers",
    "_witnessed": "_neighbour_consistent",
    "_soundness": "_match_quality",
    "_lead": "_margin",
    "_rival": "_best_alternative",
    "effort": "deformation_cost",
    "doubt": "reject_photometric_outliers",
    "doubtful": "outlier",
    "odd": "outlier",
    "usual": "baseline",
    "bend": "residual",
    "surprise": "innovation",
    "light": "brightness",
    "touched": "in_contact",
    "relief": "contact_field",
    "VALLEY": "MIN_PROMINENCE_REL",
    "PART": "MIN_PROMINENCE_SIGMA",
    "rise": "interpolate",
    "stretch": "divergence",
    "growth": "area_change",
    "grown": "area_change",
    "watchers": "result_callbacks",
    "blank": "no_reading",
    "beat": "keepalive",
    "told": "notified",
    "room": "free_space",
    "starve": "stop_recording",
    "mourn": "on_worker_exit",
    "hear": "receive_loop",
    "Moments": "Polynomial",
    "Ring": "RingBuffer",
    "Refiner": "CentroidRefiner",
}
#: Where a word is the field's own in another sense.
ALLOWED = {
    "calib/protocols.py": {"usual"},  # the poses that the paper took
    "calib/sim/camera.py": {"bend"},  # of the lens
    "calib/sim/render.py": {"light", "stretch"},  # of the lamp; of the skin
    "calib/report/study.py": {"growth", "light"},  # of time with pins and pixels; of the lamp
    "edge/cli/checks.py": {"light"},  # of the image: dark or overexposed
    "edge/runtime/image_quality.py": {"light"},  # of the image: dark or overexposed
    "hostlink/web/server.py": {"hear"},
    "hostlink/wire/generate/doc.py": {"room"},  # in a frame
}
#: Of these not even a sentence may be left.
NOT_IN_SENTENCES = (
    "aside",
    "mend",
    "mends",
    "mended",
    "doubt",
    "doubtful",
    "mourn",
    "vitals",
    "starve",
    "starved",
)


def files(*patterns: str) -> list[Path]:
    listed = subprocess.run(
        ["git", "ls-files", *patterns], capture_output=True, text=True, cwd=ROOT, check=True
    )
    return [ROOT / name for name in listed.stdout.split() if (ROOT / name).is_file()]


SOURCES = files("edge/*.py", "hostlink/*.py", "calib/*.py")
PROSE = [path for path in files("*.py", "*.md", "*.toml", "*.sh", "*.js") if path.name != "test_words.py"]


def names_in(path: Path) -> set[str]:
    """Every name that a module makes: of functions, classes, arguments, variables, attributes."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            names.add(node.attr)
    return names


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_old_name_is_left(path: Path) -> None:
    allowed = ALLOWED.get(path.relative_to(ROOT).as_posix(), set())
    for name in sorted(names_in(path)):
        for old, new in RENAMED.items():
            if name.strip("_") == old.strip("_") and old.strip("_") not in allowed:
                pytest.fail(f"{path.relative_to(ROOT)}: {name} is called {new} now")


def test_no_old_module_is_left() -> None:
    rooms = {part for path in SOURCES for part in (*path.relative_to(ROOT).parts[:-1], path.stem)}
    assert not rooms & MODULES.keys()


@pytest.mark.parametrize("path", PROSE, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_old_word_is_left_in_sentences(path: Path) -> None:
    text = path.read_text(encoding="utf-8").lower()
    for word in NOT_IN_SENTENCES:
        assert not re.search(rf"\b{word}\b", text), f"{path.relative_to(ROOT)}: {word!r}"
