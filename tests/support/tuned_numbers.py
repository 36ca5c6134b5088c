"""Counts the named numbers that were chosen, by stage.

Every field of a parameter class counts, and every constant of a module or class that is a number, unless it
is on the list of those that nobody chose.

    python -m tests.support.tuned_numbers          # the table; with a stage's name its numbers
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

#: Constants that nobody chose, by the reason, then by the file in `edge`. A file without names: all of its.
NOT_TUNED: dict[str, dict[str, str]] = {
    "codes and layouts of a protocol or format": {
        "calibration/file": "VERSION UNTOUCHED", "calibration/inputs": "MODES", "features/modes": "DEGREE",
        "features/params": "CONTACTS_MAX", "cli/checks": "FD_MTU _WARNING_N _STAMP_NS",
        "sources/options": "EXPOSURE_MAX_US _VIDEO_MAX_FRAME", "view/palette": "COLOUR_STEPS",
        "link/medium": "CAN_ERR_BUSOFF CAN_ERR_RESTARTED", "link/socketcan": "", "link/commands": "",
        "limits": "TICK_HZ RATE_MIN_HZ", "link/object_server": "FORCE",
        "link/sinks": "NODE_DEFAULT BITRATE DBITRATE",
        "recording/messages": "_PIXEL_CENTRE _POINT _FILL_COLOR _NUMERIC", "sources/image_header": "",
        "sources/v4l2": "_EXPOSURE_UNIT_US _MANUAL _NO_FOCUS", "link/sdo_server": "TOO_LONG",
        "sources/files": "_DEPTHS", "runtime/systemd": "_WATCHDOG_SHARE",
    },
    "names of states and of places in an array": {
        "features/contact_field": "_UNKNOWN _SLOPE _TOP _PLATEAU _REACHED",
        "features/contacts": "_NONE _UNKNOWN _NOISE",
        "features/several/contact_fit": "_OWN _OWN_OF_DOT _COMMON _EVEN",
        "features/pin_motion": "ROW", "tracking/match": "UNMATCHED SEED",
        "tracking/outliers": "UNKNOWN UNSUPPORTED",
    },
    "mathematics": {
        "calibration/checks": "_CELL_AREA", "cli/picture": "_AROUND", "pins/lens": "",
        "features/several/fitted_contacts": "_HALF PINS_MIN",
        "features/several/contact_fit": "_NORMAL _ROOT_HALF",
        "features/params": "CELL_NOISE RING_NOISE MEDIAN_NOISE", "tracking/outliers": "_SIGMA_OF_MAD",
        "geometry/select": "SIGMA_OF_MAD", "features/pin_motion": "_ELLIPSE", "features/modes": "MODE_POWERS",
        "pins/blobs": "_ANGLES", "pins/pattern": "FLAT", "types": "NOWHERE",
        "geometry/lattice": "N_RING N_TWO_RINGS THIRD_RING", "rest/sensor_match": "_SYMMETRY CLEAR",
        "pins/templates": "FAR_PX", "calibration/grip": "_RADIUS", "cells/mesh": "N_GUARD",
        "features/slip_and_vibration": "_SHARES",
    },
    "rounding and the width of a number": {
        "cells/mesh": "EPSILON SLIVER AREA_TOLERANCE ERROR_BOUND ORIENT_BOUND INCIRCLE_BOUND EXTENT_MIN "
            "EXTENT_MAX SNAP", "limits": "POINTS_MAX NUMBER_MAX", "pins/templates": "STEP_MAX HALF_MAX",
        "calibration/evaluation": "LOST_MAX VOLUME_MIN", "cells/boundary": "ARC_MIN NEGLIGIBLE",
        "features/modes": "INDEPENDENT_REL", "features/pin_motion": "_RIDGE _FLAT",
        "features/contact_field": "_WEIGHT_MAX _VALUE_MAX _ROW_MAX _ROUND BLOCK",
        "features/contacts": "_VARIANCE_MIN", "features/several/contact_fit": "_POINT",
        "geometry/lattice": "RANK_TOLERANCE", "geometry/layout": "", "geometry/motion_field": "AT_ONCE",
        "faults/image_quality": "ONE_LEVEL", "tracking/outliers": "NO_NEIGHBOUR",
        "tracking/motion_model": "UNDETERMINED", "recording/reader": "_TIME_MAX_NS _SEQUENCE_MAX",
        "view/panels": "_SHIFT _ONE",
    },
    "a processor's lanes and cache lines": {
        "calibration/evaluation": "ROWS", "pins/templates": "BLOCK", "sources/shared_memory": "ALIGN",
    },
    "names of glibc's settings": {"runtime/process": "_MMAP_THRESHOLD _TRIM_THRESHOLD _ARENA_MAX"},
    "figures of a maker": {"runtime/board_monitor": "HOT_DEGC", "sources/oak": "RATE_HZ"},
    "colours": {"view/palette": "PAPER SAFE", "view/panels": "_CROSS _RING _HOLE"},
}  # fmt: skip
EXEMPT = frozenset(
    f"edge/{file}.py:{name}"
    for files in NOT_TUNED.values()
    for file, names in files.items()
    for name in names.split() or [""]
)
_PARAMETERS = ("Params", "Limits")


def _has_number(value: ast.expr) -> bool:
    """Whether the number itself is written here; one that is computed from others is none of its own."""
    leaves = [node.value for node in ast.walk(value) if isinstance(node, ast.Constant)]
    return any(isinstance(leaf, int | float) and not isinstance(leaf, bool) for leaf in leaves)


def _assigned(node: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
        return
    for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
        pairs: list[tuple[ast.expr, ast.expr]] = [(target, node.value)]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            pairs = list(zip(target.elts, node.value.elts, strict=True))
        for names, value in pairs:
            yield from ((name.id, value) for name in ast.walk(names) if isinstance(name, ast.Name))


def _is_constant(name: str) -> bool:
    return name.lstrip("_").isupper()


def numbers_of(path: Path) -> Iterator[str]:
    """Names of the tuned numbers of a file."""
    file = path.relative_to(ROOT).as_posix()
    if f"{file}:" in EXEMPT:
        return
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        owner = node.name if isinstance(node, ast.ClassDef) else ""
        for item in node.body if isinstance(node, ast.ClassDef) else [node]:
            for name, value in _assigned(item):
                full = f"{file}:{owner}.{name}" if owner else f"{file}:{name}"
                chosen = owner.endswith(_PARAMETERS) or _is_constant(name)
                if chosen and _has_number(value) and full not in EXEMPT:
                    yield full


def tuned_numbers() -> dict[str, list[str]]:
    """By stage: the folder below `edge`, or `edge` itself; `shared` are those that several stages use."""
    found: dict[str, list[str]] = {}
    for path in sorted((ROOT / "edge").rglob("*.py")):
        stage = path.relative_to(ROOT / "edge").parts
        name = stage[0] if len(stage) > 1 else "shared" if path.name == "params.py" else "edge"
        found.setdefault(name, []).extend(numbers_of(path))
    return found


if __name__ == "__main__":
    found = tuned_numbers()
    for stage in sys.argv[1:]:
        print(*found[stage], sep="\n")
    if not sys.argv[1:]:
        for stage, names in sorted(found.items(), key=lambda row: -len(row[1])):
            print(f"{stage:12} {len(names):4}")
        print(f"{'all':12} {sum(map(len, found.values())):4}")
