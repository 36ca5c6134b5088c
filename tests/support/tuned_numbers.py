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

#: Constants that nobody chose, by the reason. A file alone: all of its constants.
NOT_TUNED: dict[str, frozenset[str]] = {
    "codes and layouts of a protocol or format": frozenset({
        "edge/calibration/file.py:VERSION", "edge/calibration/file.py:UNTOUCHED",
        "edge/calibration/inputs.py:MODES",
        "edge/features/modes.py:DEGREE", "edge/features/params.py:CONTACTS_MAX",
        "edge/cli/checks.py:FD_MTU", "edge/cli/checks.py:_WARNING_N", "edge/cli/checks.py:_STAMP_NS",
        "edge/sources/options.py:EXPOSURE_MAX_US", "edge/sources/options.py:_VIDEO_MAX_FRAME",
        "edge/view/palette.py:COLOUR_STEPS",
        "edge/link/medium.py:CAN_ERR_BUSOFF",
        "edge/link/medium.py:CAN_ERR_RESTARTED", "edge/link/socketcan.py", "edge/link/commands.py",
        "edge/limits.py:TICK_HZ", "edge/limits.py:RATE_MIN_HZ", "edge/link/object_server.py:FORCE",
        "edge/link/sinks.py:NODE_DEFAULT", "edge/link/sinks.py:BITRATE", "edge/link/sinks.py:DBITRATE",
        "edge/recording/messages.py:_PIXEL_CENTRE", "edge/recording/messages.py:_POINT",
        "edge/recording/messages.py:_FILL_COLOR", "edge/sources/image_header.py",
        "edge/sources/v4l2.py:_EXPOSURE_UNIT_US", "edge/sources/v4l2.py:_MANUAL",
        "edge/sources/v4l2.py:_NO_FOCUS",
        "edge/link/sdo_server.py:TOO_LONG",
        "edge/sources/files.py:_DEPTHS",
        "edge/recording/messages.py:_NUMERIC",
        "edge/runtime/systemd.py:_WATCHDOG_SHARE",
    }),
    "names of states and of places in an array": frozenset({
        "edge/features/contact_field.py:_UNKNOWN", "edge/features/contact_field.py:_SLOPE",
        "edge/features/contact_field.py:_TOP", "edge/features/contact_field.py:_PLATEAU",
        "edge/features/contact_field.py:_REACHED", "edge/features/contacts.py:_NONE",
        "edge/features/several/contact_fit.py:_OWN", "edge/features/several/contact_fit.py:_COMMON",
        "edge/features/several/contact_fit.py:_EVEN",
        "edge/features/contacts.py:_UNKNOWN", "edge/features/contacts.py:_NOISE",
        "edge/features/pin_motion.py:ROW", "edge/tracking/match.py:UNMATCHED",
        "edge/tracking/match.py:SEED", "edge/tracking/outliers.py:UNKNOWN",
        "edge/tracking/outliers.py:UNSUPPORTED",
    }),
    "mathematics": frozenset({
        "edge/calibration/checks.py:_CELL_AREA", "edge/cli/picture.py:_AROUND",
        "edge/pins/lens.py",
        "edge/features/several/fitted_contacts.py:_HALF",
        "edge/features/several/fitted_contacts.py:_PINS_MIN",
        "edge/features/params.py:CELL_NOISE",
        "edge/features/params.py:RING_NOISE", "edge/features/params.py:MEDIAN_NOISE",
        "edge/tracking/outliers.py:_SIGMA_OF_MAD",
        "edge/geometry/select.py:SIGMA_OF_MAD",
        "edge/features/pin_motion.py:_ELLIPSE", "edge/features/modes.py:MODE_POWERS",
        "edge/pins/blobs.py:_ANGLES", "edge/faults/detector.py:_NOWHERE",
        "edge/geometry/lattice.py:N_RING", "edge/geometry/lattice.py:N_TWO_RINGS",
        "edge/geometry/lattice.py:THIRD_RING", "edge/rest/sensor_match.py:_SYMMETRY",
        "edge/rest/sensor_match.py:CLEAR", "edge/pins/templates.py:FAR_PX",
        "edge/calibration/grip.py:_RADIUS",
        "edge/cells/mesh.py:N_GUARD",
        "edge/features/slip_and_vibration.py:_SHARES",
    }),
    "rounding and the width of a number": frozenset({
        "edge/cells/mesh.py:EPSILON", "edge/cells/mesh.py:SLIVER", "edge/cells/mesh.py:AREA_TOLERANCE",
        "edge/cells/mesh.py:ERROR_BOUND", "edge/cells/mesh.py:ORIENT_BOUND",
        "edge/cells/mesh.py:INCIRCLE_BOUND",
        "edge/cells/mesh.py:EXTENT_MIN", "edge/cells/mesh.py:EXTENT_MAX", "edge/cells/mesh.py:SNAP",
        "edge/limits.py:POINTS_MAX",
        "edge/limits.py:NUMBER_MAX", "edge/pins/templates.py:STEP_MAX",
        "edge/calibration/evaluation.py:LOST_MAX",
        "edge/cells/boundary.py:ARC_MIN", "edge/cells/boundary.py:NEGLIGIBLE",
        "edge/calibration/evaluation.py:VOLUME_MIN", "edge/features/modes.py:INDEPENDENT_REL",
        "edge/features/pin_motion.py:_RIDGE", "edge/features/pin_motion.py:_FLAT",
        "edge/features/contact_field.py:_WEIGHT_MAX", "edge/features/contact_field.py:_VALUE_MAX",
        "edge/features/contact_field.py:_ROW_MAX", "edge/features/contact_field.py:_ROUND",
        "edge/features/contact_field.py:BLOCK", "edge/features/contacts.py:_VARIANCE_MIN",
        "edge/geometry/lattice.py:RANK_TOLERANCE", "edge/geometry/layout.py",
        "edge/faults/image_quality.py:ONE_LEVEL",
        "edge/tracking/outliers.py:NO_NEIGHBOUR", "edge/tracking/motion_model.py:UNDETERMINED",
        "edge/recording/reader.py:_TIME_MAX_NS",
        "edge/recording/reader.py:_SEQUENCE_MAX", "edge/view/panels.py:_SHIFT", "edge/view/panels.py:_ONE",
    }),
    "a processor's lanes and cache lines": frozenset({
        "edge/calibration/evaluation.py:ROWS",
        "edge/pins/templates.py:LANES", "edge/pins/templates.py:BLOCK",
        "edge/sources/shared_memory.py:ALIGN",
    }),
    "names of glibc's settings": frozenset({
        "edge/runtime/process.py:_MMAP_THRESHOLD", "edge/runtime/process.py:_TRIM_THRESHOLD",
    }),
    "figures of a maker": frozenset({
        "edge/runtime/board_monitor.py:HOT_DEGC", "edge/sources/oak.py:RATE_HZ",
    }),
    "colours": frozenset({
        "edge/view/palette.py:PAPER", "edge/view/palette.py:SAFE", "edge/view/panels.py:_CROSS",
        "edge/view/panels.py:_RING", "edge/view/panels.py:_HOLE",
    }),
}  # fmt: skip
_EXEMPT = frozenset().union(*NOT_TUNED.values())
_PARAMETERS = ("Params", "Limits")


def _has_number(value: ast.expr) -> bool:
    """Whether the number itself is written here; one that is computed from others is none of its own."""
    leaves = [node for node in ast.walk(value) if isinstance(node, ast.Constant)]
    numbers = [n for n in leaves if isinstance(n.value, int | float) and not isinstance(n.value, bool)]
    return bool(numbers)


def _assigned(node: ast.stmt) -> list[tuple[str, ast.expr]]:
    if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
        return [(node.target.id, node.value)]
    if not isinstance(node, ast.Assign):
        return []
    pairs: list[tuple[str, ast.expr]] = []
    for target in node.targets:
        if isinstance(target, ast.Name):
            pairs.append((target.id, node.value))
        elif isinstance(target, ast.Tuple):
            values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value] * len(target.elts)
            pairs += [(t.id, v) for t, v in zip(target.elts, values, strict=True) if isinstance(t, ast.Name)]
    return pairs


def _is_constant(name: str) -> bool:
    return name.lstrip("_").isupper()


def numbers_of(path: Path) -> Iterator[str]:
    """Names of the tuned numbers of a file."""
    file = path.relative_to(ROOT).as_posix()
    if file in _EXEMPT:
        return
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        for name, value in _assigned(node):
            if _is_constant(name) and _has_number(value) and f"{file}:{name}" not in _EXEMPT:
                yield f"{file}:{name}"
        if isinstance(node, ast.ClassDef):
            parameters = node.name.endswith(_PARAMETERS)
            for item in node.body:
                for name, value in _assigned(item):
                    if (parameters or _is_constant(name)) and _has_number(value):
                        yield f"{file}:{node.name}.{name}"


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
