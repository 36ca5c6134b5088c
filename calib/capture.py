"""Runs a protocol on a rig and records it: MCAP with the truth beside each frame, and a table.

    press.mcap    images, times, truth (what the rig knows, and the step's pose)
    press.2.mcap  the second part, where a capture was resumed; and so on
    press.csv     one row a frame: where it is stored, its role, its pose

Rules
- The recording is authoritative; the table is made from it when the capture ends. A killed capture loses
  at most the last half second, and the table always agrees with the frames.
- Resuming starts at the first step that is not complete on disk. Frames of an interrupted step
  stay in their part and are not in the table.
- Pose columns are named as those of the published sets: pose_x/y/z mm, pose_Rx/Ry deg, shear_x/y mm,
  shear_Rz deg.
"""

import csv
import io
import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from calib.errors import CaptureError, TableError
from calib.protocols import AnyPlan, Step
from calib.rig.base import Pose, Rig
from calib.table import number, read_table, shown
from edge.recording.mcap_file import raw_messages, read_metadata
from edge.recording.reader import RecordingSource
from edge.recording.topics import TOPICS
from edge.recording.writer import Recorder
from edge.types import Frame
from hostlink.input_file import open_input
from hostlink.output_file import writing

# column of the table: field of the pose
POSE_COLUMNS = {
    "pose_x": "x_mm",
    "pose_y": "y_mm",
    "pose_z": "depth_mm",
    "pose_Rx": "tilt_x_deg",
    "pose_Ry": "tilt_y_deg",
    "shear_x": "shear_x_mm",
    "shear_y": "shear_y_mm",
    "shear_Rz": "twist_deg",
}
COLUMNS = (
    "recording", "sequence", "step", "role", *POSE_COLUMNS,
    "tool", "tool_radius_mm", "tool_angle_deg", "tool_distance_mm",
    "force_n", "area_mm2", "place_x", "place_y", "force_x_n", "force_y_n", "torque_z_nmm",
)  # fmt: skip
_SEQUENCE = re.compile("[0-9]{1,18}")
QUEUE_MB = 1024.0  # the recorder drops what does not fit; a calibration must not lose a frame


def parts(path: Path) -> list[Path]:
    """The recordings of a capture that exist, in order."""
    found = [path] if path.exists() else []
    while (following := _part(path, len(found) + 1)).exists() and found:
        found.append(following)
    return found


def _part(path: Path, number: int) -> Path:
    return path if number == 1 else path.with_suffix(f".{number}{path.suffix}")


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a capture is: complete steps and their frames."""

    steps: int
    frames: int


def progress_of(path: Path, plan: AnyPlan) -> Progress:
    """The recording on disk. Raises CaptureError: the recording belongs to another protocol."""
    truths: list[dict[str, Any]] = []
    counts: list[Counter[int]] = []  # frames of each step, in each part
    for part in parts(path):
        noted = read_metadata(part).get("capture", {})
        if noted.get("digest") != plan.digest:
            was = noted.get("protocol", "none")
            raise CaptureError(
                f"{part}: holds protocol {was!r}, not this {plan.name!r}; give another name for the recording"
            )
        of_part = [truth for _, truth in _truths(part)]
        truths += of_part
        counts.append(Counter(truth["step"] for truth in of_part))
    plan.recall({truth["step"]: Pose(**truth["pose"]) for truth in truths})
    done = 0
    while done < len(plan.steps) and max((n[done] for n in counts), default=0) >= plan.steps[done].frames:
        done += 1
    # Steps without frames just before the interruption are repeated: the rig may be anywhere.
    while 0 < done < len(plan.steps) and plan.steps[done - 1].frames == 0:
        done -= 1
    return Progress(done, sum(step.frames for step in plan.steps[:done]))


def capture(
    rig_at: Callable[[int], Rig],
    plan: AnyPlan,
    path: Path,
    *,
    resume: bool = False,
    on_frame: Callable[[Step, int], None] = lambda step, done: None,
) -> int:
    """Run a protocol, or what is left of it.

    rig_at    opens the rig, given the number of the next frame
    on_frame  called with the step and the number of frames done
    Returns   number of frames taken now
    Raises    CaptureError, RigError; what was recorded before stays and can be resumed
    """
    existing = parts(path)
    if existing and not resume:
        raise CaptureError(f"{path}: exists; continue it with --resume, or give another name")
    _refuse_other_table(path.with_suffix(".csv"), resume)
    if resume and not existing:
        raise CaptureError(f"{path}: there is no recording to continue; leave --resume out to begin one")
    done = progress_of(path, plan)
    plan.review(_paired(path, [_cells(row) for row in _complete_rows(path, plan)]))
    if done.steps == len(plan.steps) and not plan.grow():
        write_table(path, plan)
        return 0
    rig = rig_at(done.frames)
    taken = 0
    try:
        about = {"protocol": plan.name, "digest": plan.digest, "rig": rig.name}
        recorder = Recorder(_part(path, len(existing) + 1), image="png", buffer_mb=QUEUE_MB)
        with recorder:
            recorder.metadata("capture", about)
            tool = None
            number = done.steps
            while number < len(plan.steps) or plan.grow():
                step = plan.steps[number]
                if step.tool != tool:
                    rig.mount(step.tool)
                    tool = step.tool
                rig.move(step.pose)
                for _ in range(step.frames):
                    frame = _with_truth(rig.frame(), number, step)
                    if not recorder.frame(frame):
                        raise CaptureError(
                            f"{recorder.path}: {recorder.fault or 'the disk is too slow'}; resume"
                        )
                    plan.take(frame, _cells(_row(recorder.path.name, frame.sequence, frame.truth or {})))
                    taken += 1
                    on_frame(step, done.frames + taken)
                number += 1
    finally:
        rig.close()
    if recorder.fault is not None or recorder.dropped_n:
        raise CaptureError(
            f"{recorder.path}: {recorder.fault or 'messages were lost'}; free some space and resume"
        )
    write_table(path, plan)
    return taken


def _with_truth(frame: Frame, number: int, step: Step) -> Frame:
    asked = {"step": number, "role": step.role, "pose": asdict(step.pose), "tool": asdict(step.tool)}
    return replace(frame, truth={**(frame.truth or {}), **asked})


def _truths(part: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """(sequence, truth) of each frame whose image is on disk too: the truth is written first."""
    images = {TOPICS["image"].name, TOPICS["image_png"].name}
    held: tuple[int, int, dict[str, Any]] | None = None
    for raw in raw_messages(part, Counter()):
        if raw.topic == TOPICS["truth"].name:
            with suppress(msgspec.DecodeError):  # damaged
                message = msgspec.json.decode(raw.data)
                held = (raw.log_ns, int(message["sequence"]), message["truth"])
        elif raw.topic in images and held is not None and held[0] == raw.log_ns:
            yield held[1], held[2]
            held = None


def _refuse_other_table(table: Path, resume: bool) -> None:
    """Raise CaptureError where the capture's table would replace a file that is not its own."""
    if not table.exists():
        return
    with io.TextIOWrapper(open_input(table), "utf-8", "replace") as file:
        own = file.readline(1000).rstrip() == ",".join(COLUMNS)
    if not (resume and own):
        raise CaptureError(f"{table}: exists, and the capture's table goes there; give another name to -o")


def write_table(path: Path, plan: AnyPlan) -> Path:
    """Write the table of a capture from its recordings. Raises OutputError."""
    rows = _complete_rows(path, plan)
    table = path.with_suffix(".csv")
    with (
        writing(table, overwrite=True) as unfinished,
        unfinished.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, COLUMNS, restval="")
        writer.writeheader()
        writer.writerows(rows)
    return table


def _complete_rows(path: Path, plan: AnyPlan) -> list[dict[str, Any]]:
    """Rows of the table, of all steps that are complete."""
    rows: dict[int, list[dict[str, Any]]] = {}
    for part in parts(path):
        in_part: dict[int, list[dict[str, Any]]] = {}
        for sequence, truth in _truths(part):
            in_part.setdefault(truth["step"], []).append(_row(part.name, sequence, truth))
        rows |= {k: v for k, v in in_part.items() if len(v) >= plan.steps[k].frames}
    return [row for step in sorted(rows) for row in rows[step]]


def _cells(row: dict[str, Any]) -> dict[str, str]:
    """A row as it is read from the table."""
    return {name: str(row.get(name, "")) for name in COLUMNS}


def _row(recording: str, sequence: int, truth: dict[str, Any]) -> dict[str, Any]:
    pose, tool = truth["pose"], truth["tool"]
    row: dict[str, Any] = {"recording": recording, "sequence": sequence}
    row |= {"step": truth["step"], "role": truth["role"]}
    row |= {column: pose[name] for column, name in POSE_COLUMNS.items()}
    if truth["role"] == "rest":  # clear of the tip: no depth, and the rest of the pose has no meaning
        row |= dict.fromkeys(POSE_COLUMNS, 0.0)
    row |= {"tool": tool["kind"], "tool_radius_mm": tool["radius_mm"]}
    row |= {"tool_angle_deg": tool["angle_deg"], "tool_distance_mm": tool["distance_mm"]}
    if "forces_n" in truth:
        row["force_n"] = sum(truth["forces_n"])
    if "drags_n" in truth:
        row["force_x_n"], row["force_y_n"] = (
            sum(force[axis] for force in truth["drags_n"]) for axis in (0, 1)
        )
        row["torque_z_nmm"] = sum(truth["torques_nmm"])
    if "areas_mm2" in truth:
        row["area_mm2"] = sum(truth["areas_mm2"])
    if len(truth.get("places_mm", ())) == 1:
        row["place_x"], row["place_y"] = truth["places_mm"][0]
    return row


def read_rows(path: Path) -> list[dict[str, str]]:
    """The table of a capture. Raises CaptureError: there is none, or it is no capture's."""
    table = path.with_suffix(".csv")
    if not table.exists():
        raise CaptureError(_why_no_table(path, table))
    try:
        found = read_table(table, sorted(("recording", "sequence", "role", *POSE_COLUMNS)), once=COLUMNS)
    except TableError as error:
        way_out = f"move it away; if {path.name} is a capture, --resume makes it anew"
        raise CaptureError(f"{error}; not a table of a capture: {way_out}") from None
    places: dict[tuple[str, int], int] = {}
    for row in found.rows:
        part, sequence = row.cells["recording"], row.cells["sequence"]
        if not row.whole or not _SEQUENCE.fullmatch(sequence):
            raise CaptureError(f"{table}: line {row.line} is not one of a capture's table")
        if not os.path.isfile(path.parent / part):
            raise CaptureError(f"{table}: line {row.line}: no recording {shown(part)} beside it")
        place = part, int(sequence)
        if place in places:
            raise CaptureError(f"{table}: line {row.line}: its frame is in line {places[place]} already")
        places[place] = row.line
        for name in POSE_COLUMNS:
            number(row.cells[name], f"{table}: line {row.line}, column {name}")
    # Frames come in the order of the recordings; a spreadsheet may have sorted the table otherwise.
    parts_in_order = list(dict.fromkeys(part for part, _ in places))
    in_order = sorted(
        zip(places, found.rows, strict=True), key=lambda p: (parts_in_order.index(p[0][0]), p[0][1])
    )
    return [row.cells for _, row in in_order]


def _why_no_table(path: Path, table: Path) -> str:
    if not path.is_file():
        return f"{path}: no such recording"
    if "capture" in read_metadata(path):
        return f"{table}: no such file; finish the capture with --resume"
    return (
        f"{path}: a recording, but no capture: it has no table of truth; give one that `calib capture` made, "
        "or TARGETS.csv with --frames DIR"
    )


def read_capture(path: Path) -> Iterator[tuple[Frame, dict[str, str]]]:
    """Frames of a capture with their rows of the table, in the table's order.

    Raises  CaptureError: no table, or no recording
    """
    yield from _paired(path, read_rows(path))


def _paired(path: Path, rows: Sequence[dict[str, str]]) -> Iterator[tuple[Frame, dict[str, str]]]:
    """The frames of these rows, with them."""
    by_part: dict[str, dict[int, dict[str, str]]] = {}
    for row in rows:
        by_part.setdefault(row["recording"], {})[int(row["sequence"])] = row
    for name, wanted in by_part.items():
        for frame in RecordingSource(path.parent / name):
            if frame.sequence in wanted:
                yield frame, wanted.pop(frame.sequence)
        if wanted:
            table = path.with_suffix(".csv")
            raise CaptureError(f"{table}: frame {min(wanted)} is not in {name}; leave out its row")


def pose_of(row: dict[str, str]) -> Pose:
    """The pose in a row of the table."""
    return Pose(**{name: float(row[column]) for column, name in POSE_COLUMNS.items()})
