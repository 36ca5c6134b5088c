"""Tables of truth: read correctly, every mistake one line with file, line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calib.errors import TableError
from calib.targets import join, read_targets, targets_of_capture


def write(folder: Path, text: str, frames: tuple[str, ...] = ("a.png", "b.png")) -> Path:
    for name in frames:
        (folder / name).touch()
    table = folder / "targets.csv"
    table.write_text(text, encoding="utf-8")
    return table


def test_columns_become_values_and_missing_ones_do_not_exist(tmp_path: Path) -> None:
    table = write(tmp_path, "sensor_image,pose_z,shear_Rz,colour\na.png,1.5,-2,red\nb.png,2.5,3,blue\n")
    targets = read_targets(table, tmp_path)
    assert [path.name for path in targets.frames] == ["a.png", "b.png"]
    assert targets.values.keys() == {"displacement_mm", "torsion_deg"}
    np.testing.assert_array_equal(targets.values["displacement_mm"], [1.5, 2.5])
    assert targets.rows([1]).frames == targets.frames[1:]


def test_a_byte_order_mark_is_not_part_of_a_name(tmp_path: Path) -> None:
    table = write(tmp_path, "\ufeffsensor_image,pose_z\na.png,1\n")
    assert len(read_targets(table, tmp_path)) == 1


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("image,pose_z\na.png,1\n", "no column sensor_image"),
        ("sensor_image,colour\na.png,red\n", "none of the columns pose_z"),
        ("sensor_image,pose_z\n", "no rows"),
        ("sensor_image,pose_z\na.png,deep\n", "line 2, column pose_z: 'deep' is not a number"),
        ("sensor_image,pose_z\na.png,1\nb.png,nan\n", "line 3, column pose_z: nan is not a finite number"),
        ("sensor_image,pose_z\na.png,inf\n", "line 2, column pose_z: inf is not a finite number"),
        ("sensor_image,pose_z\na.png\n", "line 2, column pose_z: '' is not a number"),
        ("sensor_image,pose_z\na.png,1\nc.png,1\n", "line 3: no frame c.png"),
        ("sensor_image,pose_z\n,1\n", "line 2: no frame (empty)"),
        ("sensor_image,pose_z\na.png,1\nb.png,1\na.png,2\n", "line 4: a.png is in line 2 already"),
    ],
)
def test_mistakes_are_one_line_with_row_and_column(tmp_path: Path, text: str, expected: str) -> None:
    table = write(tmp_path, text)
    with pytest.raises(TableError) as caught:
        read_targets(table, tmp_path)
    assert str(caught.value).startswith(str(table))
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_tables(tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"none\.csv: cannot be read"):
        read_targets(tmp_path / "none.csv", tmp_path)
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe")
    with pytest.raises(TableError, match="not a text file"):
        read_targets(tmp_path / "picture.csv", tmp_path)
    with pytest.raises(TableError, match="no such folder"):
        read_targets(write(tmp_path, "sensor_image\n"), tmp_path / "none")


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


def test_forces_along_the_surface_and_torque_are_truth_too() -> None:
    gauge = {"force_n": "3", "force_x_n": "-1", "force_y_n": "0.5", "torque_z_nmm": "7"}
    values = targets_of_capture("a.mcap", [row(**gauge), row()]).values
    for name, text in gauge.items():
        np.testing.assert_array_equal(values[name], [float(text), np.nan])


def test_a_capture_without_a_gauge_has_no_force() -> None:
    assert "force_n" not in targets_of_capture("a.mcap", [row(), row()]).values


def test_a_cell_without_a_number_is_named() -> None:
    with pytest.raises(TableError, match=r"a\.mcap#7, column pose_z: 'deep' is not a number"):
        targets_of_capture("press", [row(pose_z="deep")])


def test_joined_tables_keep_the_values_of_their_parts() -> None:
    both = join(
        [targets_of_capture("a", [row()]), targets_of_capture("b", [row(tool="sphere", force_n="1")])]
    )
    assert len(both) == 2
    np.testing.assert_array_equal(both.values["force_n"], [np.nan, 1.0])
    assert both.where == "a, b"


def test_numbers_that_no_fingertip_gives_and_columns_that_nobody_reads(tmp_path: Path) -> None:
    (tmp_path / "a.png").touch()
    table = write(tmp_path, "sensor_image,pose_z,posez\na.png,1e300,1\n")
    with pytest.raises(TableError, match=r"line 2, column pose_z: 1e\+300 mm is not possible"):
        read_targets(table, tmp_path)
    table = write(tmp_path, "sensor_image,pose_z\na.png,0.0025\n")  # metres
    with pytest.raises(TableError, match=r"pose_z never exceeds 0\.05 mm; its unit is mm"):
        read_targets(table, tmp_path)
    table = write(tmp_path, "sensor_image,pose_z,posez\na.png,2.5,1\n")
    assert read_targets(table, tmp_path).unread == ("posez",)
