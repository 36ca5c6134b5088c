"""`calib lens`: a lens measured with pictures of a checkerboard, by OpenCV's calibration."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np

from calib.commands.options import PATH, overwrite_option
from edge.errors import InputError
from edge.sources.files import read_image
from edge.types import Array, Lens
from hostlink.cli_exit import print_error
from hostlink.output_file import check_output, writing

#: A camera is determined by this number of views of a plane (Zhang 2000).
VIEWS_MIN = 3


def _corners_of_board(context: click.Context, option: click.Parameter, text: str) -> tuple[int, int]:
    """(9, 6) of "9x6"."""
    match = re.fullmatch(r"(\d{1,2})x(\d{1,2})", text)
    columns, rows = (int(n) for n in match.groups()) if match else (0, 0)
    if min(columns, rows) < 3:
        message = f"{text!r} is no board; give its inner corners across and down, e.g. 9x6"
        raise click.BadParameter(message, context, option)
    return columns, rows


@click.command("lens")
@click.argument("images", nargs=-1, required=True, metavar="IMAGE...", type=PATH)
@click.option("-o", "--output", required=True, type=PATH, help="File to write (.toml).")
@click.option(
    "--board",
    callback=_corners_of_board,
    metavar="CORNERS",
    default="9x6",
    show_default=True,
    help="Inner corners across and down.",
)
@click.option(
    "--fisheye", is_flag=True, help="Fit a fisheye's model, for views of more than about 120 degrees."
)
@overwrite_option
def lens_command(
    images: Sequence[Path], output: Path, board: tuple[int, int], fisheye: bool, overwrite: bool
) -> None:
    """Measure a lens by IMAGEs of a checkerboard, for ?lens=FILE in a source's address.

    Take ten or more, at the size that the tip is filmed with and without the tip: the board in the middle, in
    each corner, and tilted. Its squares may be of any size.
    """
    check_output(output, (".toml",), images, overwrite)
    found, size_px = _corners(images, board)
    if len(found) < VIEWS_MIN:
        raise InputError(
            f"{len(found)} of {len(images)} images show all {board[0]}x{board[1]} inner corners of a board; "
            f"at least {VIEWS_MIN} are needed"
        )
    measured, rms_px = _fit(found, board, size_px, fisheye)
    heading = f"By {len(found)} pictures of a board of {board[0]}x{board[1]} corners, rms {rms_px:.3f} px."
    with writing(output, overwrite) as unfinished:
        unfinished.write_text(text_of(measured, heading), encoding="utf-8")
    click.echo(f"{output}: {measured.model}, {len(found)} pictures, corners fitted to {rms_px:.3f} px rms")


def text_of(lens: Lens, heading: str) -> str:
    """The file's text. heading: a comment, one line."""
    rows = [f"# {heading}", f'model = "{lens.model}"']
    rows += [f"{name} = {list(getattr(lens, name))}" for name in lens.__struct_fields__[1:]]
    return "\n".join(rows) + "\n"


def _corners(images: Sequence[Path], board: tuple[int, int]) -> tuple[list[Array], tuple[int, int]]:
    """(n, 2) px of the board's corners in each image that shows it; the images' size. Says which do not.

    Raises  SourceError: not an image; InputError: images of different size
    """
    found: list[Array] = []
    size_px = (0, 0)
    for path in images:
        image = read_image(path)
        height, width = image.shape
        if size_px not in ((0, 0), (width, height)):
            raise InputError(
                f"{path}: {width}x{height}, the ones before {size_px[0]}x{size_px[1]}; keep one size"
            )
        size_px = (width, height)
        scaled = image if image.dtype == np.uint8 else (image >> 8).astype(np.uint8)
        seen, corners = cv2.findChessboardCornersSB(scaled, board, flags=cv2.CALIB_CB_ACCURACY)
        if seen:
            found.append(np.asarray(corners, np.float64).reshape(-1, 2))
        else:
            print_error(f"{path}: no whole board of {board[0]}x{board[1]} inner corners; left out")
    return found, size_px


def _fit(
    found: Sequence[Array], board: tuple[int, int], size_px: tuple[int, int], fisheye: bool
) -> tuple[Lens, float]:
    """The lens, and the rms distance of the corners from where it has them, px. Raises InputError."""
    columns, rows = board
    flat = np.zeros((columns * rows, 1, 3))
    flat[:, 0, :2] = np.mgrid[:columns, :rows].T.reshape(-1, 2)
    points = [corners[:, None] for corners in found]
    fits: Any = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2  # before OpenCV 5, since
    flags = fits.CALIB_RECOMPUTE_EXTRINSIC | fits.CALIB_FIX_SKEW
    wide, narrow = (np.eye(3), np.zeros(4)), (np.eye(3), np.zeros(5))
    n = len(points)
    try:
        if fisheye:
            fit = cv2.fisheye.calibrate([flat] * n, points, size_px, *wide, flags=flags)
        else:
            singles = [corners.astype(np.float32) for corners in points]
            fit = cv2.calibrateCamera([flat.astype(np.float32)] * n, singles, size_px, *narrow)
    except cv2.error:
        raise InputError(
            "the pictures determine no lens; take more, with the board tilted and in the corners"
        ) from None
    rms_px, matrix, distortion = fit[:3]
    return Lens(
        model="fisheye" if fisheye else "pinhole",
        size_px=size_px,
        focal_px=(float(matrix[0, 0]), float(matrix[1, 1])),
        centre_px=(float(matrix[0, 2]), float(matrix[1, 2])),
        distortion=tuple(float(k) for k in distortion.ravel()),
    ), float(rms_px)
