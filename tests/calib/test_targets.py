"""Tables of truth: read correctly, every mistake one line with file, line and column."""

import random
import re
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from calib.errors import TableError
from calib.targets import join, read_targets, targets_of_capture
from tests.support.refusals import one_line
from tests.support.seeds import SEED


def write(folder: Path, text: str | bytes, frames: tuple[str, ...] = ("a.png", "b.png")) -> Path:
    for name in frames:
        (folder / name).touch()
    table = folder / "targets.csv"
    table.write_bytes(text.encode() if isinstance(text, str) else text)
    return table


def test_columns_become_values_and_missing_ones_do_not_exist(tmp_path: Path) -> None:
    table = write(tmp_path, "sensor_image,pose_z,shear_Rz,colour\na.png,1.5,-2,red\nb.png,2.5,3,blue\n")
    targets = read_targets(table, tmp_path)
    assert [path.name for path in targets.frames] == ["a.png", "b.png"]
    assert targets.values.keys() == {"displacement_mm", "torsion_deg"}
    np.testing.assert_array_equal(targets.values["displacement_mm"], [1.5, 2.5])
    assert targets.rows([1]).frames == targets.frames[1:]
    assert targets.unread == ("colour",)


LONG = "x" * 300
TAKEN = [
    "sensor_image,pose_z\na.png,1.5\nb.png,+25e-1\n",
    "\ufeffsensor_image,pose_z\na.png,1.5\nb.png,2.5\n",
    "sensor_image,pose_z\ra.png,1.50\rb.png,2.5",
    "sensor_image,pose_z\r\n\r\na.png,1.5\r\n\r\nb.png,2.5\r\n\r\n",
    "sensor_image, pose_z \na.png, 1.5 \nb.png,\t2.5\n",
    '"sensor_image","pose_z"\n"a.png","1.5"\n"b.png","2.5"\n',
    "sensor_image,pose_z,,\na.png,1.5,,\nb.png,2.5,, ,\n",  # as a spreadsheet leaves emptied columns
    ",sensor_image,pose_z\n0,a.png,1.5\n1,b.png,2.5\n",  # as pandas writes an index
    "sensor_image,pose_z,note\na.png,1.5\nb.png,2.5,ok\n",
    "sensor_image,note,note,pose_z\na.png,x,y,1.5\nb.png,x,y,2.5\n",
    'sensor_image,note,pose_z\na.png,"two\nlines, ""quoted""",1.5\nb.png,,2.5\n',
    f"sensor_image,{LONG},pose_z\na.png,1,1.5\nb.png,{LONG},2.5\n",
]


@pytest.mark.parametrize("text", TAKEN)
def test_tables_that_differ_in_form_alone_are_the_same(tmp_path: Path, text: str) -> None:
    targets = read_targets(write(tmp_path, text), tmp_path)
    assert [path.name for path in targets.frames] == ["a.png", "b.png"]
    np.testing.assert_array_equal(targets.values["displacement_mm"], [1.5, 2.5])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("image,Fz\na.png,1\n", "no column sensor_image; write sensor_image for image, force_z for Fz"),
        ("sensor_image,colour\na.png,red\n", "none of the columns pose_z"),
        ("sensor_image,pose_z\n", "no rows"),
        ("sensor_image,pose_z\na.png,deep\n", "line 2, column pose_z: 'deep' is not a number"),
        ("sensor_image,pose_z\na.png,1\nb.png,nan\n", "line 3, column pose_z: nan is not a finite number"),
        ("sensor_image,pose_z\na.png,1\nc.png,1\n", "line 3: no frame c.png"),
        ("sensor_image,pose_z\na.png,1\nb.png,1\na.png,2\n", "line 4: a.png is in line 2 already"),
        ("sensor_image,pose_z\na.png,1\n./a.png,2\n", "line 3: ./a.png is in line 2 already"),
        ("sensor_image,pose_z\na.png,1,29\n", "line 2: 3 cells for 2 headings; write decimals with a point"),
        ('sensor_image,pose_z\na.png,"1,29"\n', "'1,29' is not a number; write 1.29"),
        ('sensor_image,pose_z\na.png,"1,234.5"\n', "'1,234.5' is not a number"),
        ("sensor_image;pose_z\na.png;1,29\n", "its cells have semicolons between them, write commas"),
        ("sensor_image\tpose_z\na.png\t1.29\n", "its cells have tabs between them, write commas"),
        *(
            (f"sensor_image,pose_z\na.png,{text}\n", f"line 2, column pose_z: '{text}' is not a number")
            for text in ["1_0", "١", "１", "0x10", "1e", "--1", "1 5", "1.5 mm", "1e5_0", "-", "."]
        ),
        ("sensor_image,pose_z\na.png,1\u00a0000\n", "'1\\xa0000' is not a number"),
        ("sensor_image,pose_z\na.png," + "9" * 5000 + "\n", "... is not a finite number"),
        ("sensor_image,pose_z,pose_z\na.png,1,2\n", "line 1: 2 columns pose_z; leave one of them"),
        ("sensor_image,pose_z,sensor_image\na.png,1,b.png\n", "line 1: 2 columns sensor_image"),
        (f"sensor_image,pose_z\na.png,{LONG}\n", "...' is not a number"),
        (f"sensor_image,pose_z\na.png,{'1' * 140_000}\n", "line 2: no row of a table: field larger"),
        ('sensor_image,pose_z\na.png,1\n"b.png,1\na.png,2\n', "line 3: no row of a table: unexpected end"),
        ("sensor_image,pose_z\n\x1b[2J,1\n", "line 2: no frame"),
        ("sensor_image,pose_z\na.png,1\x00\n", "line 2 has a NUL byte"),
        ("sensor_image,pose_z\na.png,1\n".encode("utf-16"), "UTF-16, not UTF-8"),
        (b"sensor_image,pose_z,gr\xf6sse\na.png,1,1\n", "not a text file, line 1 is not UTF-8"),
        ("sensor_image,pose_z\na.png,0\nb.png,412\n", "column pose_z spans 412 mm"),
        ("sensor_image,pose_z,posez\na.png,1e300,1\n", "line 2, column pose_z: 1e+300 mm is not possible"),
        ("sensor_image,pose_z\na.png,0.0025\n", "pose_z never exceeds 0.05 mm; its unit is mm"),  # metres
        ("", "no column sensor_image"),
    ],
)
def test_mistakes_are_one_line_with_row_and_column(tmp_path: Path, text: str | bytes, expected: str) -> None:
    table = write(tmp_path, text)
    message = one_line(TableError, read_targets, table, tmp_path)
    assert message.startswith(str(table))
    assert expected in message
    assert message.isprintable()
    assert len(message) < len(str(table)) + 300


@pytest.mark.generative
@pytest.mark.parametrize("seed", range(4))
def test_any_bytes_are_one_line_or_a_table_of_numbers_that_stand_in_it(tmp_path: Path, seed: int) -> None:
    """Whatever a byte became: no other exception, and no value that is not written in the file as it is."""
    rng = random.Random(4 * SEED + seed)
    parts = [
        part.encode() for part in (",", ";", '"', "\n", "\r", "\0", "1_0", "\u0661", "nan", "pose_z", LONG)
    ]
    taken = 0
    for _ in range(300):
        raw = bytearray(rng.choice(TAKEN).encode())
        for _ in range(rng.choice([0, 1, 1, 2, 5])):
            k = rng.randrange(len(raw) + 1)
            raw[k : k + rng.randrange(3)] = rng.choice([b"", bytes([rng.randrange(256)]), rng.choice(parts)])
        table = write(tmp_path, bytes(raw))
        message = ""
        try:
            targets = read_targets(table, tmp_path)
        except TableError as error:
            message = str(error)
        if message:
            assert message.startswith(str(table))
            assert message.isprintable()
            continue
        taken += 1
        cells = set[float]()
        for cell in re.findall(rb"[-+.0-9eE]+", bytes(raw)):
            with suppress(ValueError):
                cells.add(float(cell))
        for column in targets.values.values():
            assert len(column) == len(targets)
            assert set(column.tolist()) <= cells
    assert 0 < taken < 300


def test_files_that_are_no_tables(tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"none\.csv: cannot be read"):
        read_targets(tmp_path / "none.csv", tmp_path)
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe")
    with pytest.raises(TableError, match="not a text file"):
        read_targets(tmp_path / "picture.csv", tmp_path)
    for folder in ("none", LONG):
        with pytest.raises(TableError, match="no such folder"):
            read_targets(write(tmp_path, "sensor_image\n"), tmp_path / folder)
    with pytest.raises(TableError, match="cannot be read: File name too long"):
        read_targets(tmp_path / LONG, tmp_path)


def row(**changed: str) -> dict[str, str]:
    pose = {"pose_x": "1", "pose_y": "2", "pose_z": "2.5", "pose_Rx": "4", "pose_Ry": "5"}
    shear = {"shear_x": "0.5", "shear_y": "0", "shear_Rz": "0"}
    return {
        "recording": "a.mcap",
        "sequence": "7",
        "role": "sample",
        "tool": "flat",
        **pose,
        **shear,
    } | changed


def test_a_capture_s_truth_drops_meaningless_values() -> None:
    rows = [
        row(),
        row(tool="sphere", place_x="1", place_y="2", force_n="3", area_mm2="9"),
        row(pose_z="0.0"),
        row(tool="two"),
        row(tool="sphere"),
    ]
    values = targets_of_capture("a.mcap", rows).values
    nan = np.nan
    np.testing.assert_array_equal(values["displacement_mm"], [2.5, 2.5, 0.0, nan, 2.5])
    np.testing.assert_array_equal(values["tilt_x_deg"], [4, nan, nan, nan, nan])
    np.testing.assert_array_equal(values["contact_x_mm"], [nan, 1, nan, nan, 1])
    np.testing.assert_array_equal(values["contact_depth_mm"], [nan, 2.5, nan, nan, 2.5])
    np.testing.assert_array_equal(values["force_n"], [nan, 3, nan, nan, nan])
    np.testing.assert_array_equal(values["contact_area_mm2"], [nan, 9, nan, nan, nan])
    gauge = {"force_n": "3", "force_x_n": "-1", "force_y_n": "0.5", "torque_z_nmm": "7"}
    values = targets_of_capture("a.mcap", [row(**gauge), row()]).values
    for name, text in gauge.items():
        np.testing.assert_array_equal(values[name], [float(text), nan])
    assert "force_n" not in targets_of_capture("a.mcap", [row(), row()]).values
    with pytest.raises(TableError, match=r"a\.mcap#7, column pose_z: 'deep' is not a number"):
        targets_of_capture("press", [row(pose_z="deep")])


def test_joined_tables_keep_the_values_of_their_parts() -> None:
    both = join(
        [targets_of_capture("a", [row()]), targets_of_capture("b", [row(tool="sphere", force_n="1")])]
    )
    assert len(both) == 2
    np.testing.assert_array_equal(both.values["force_n"], [np.nan, 1.0])
    assert both.where == "a, b"
