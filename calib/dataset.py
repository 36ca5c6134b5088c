"""Frames with known truth, wherever they are: a table beside a folder of images, or captures.

    TARGETS.csv --frames DIR [--rest IMAGE]    one table, one folder, one image of the untouched tip;
                                               without it the rest frame is estimated from the frames
    A.mcap [B.mcap ...]                        captures of `calib capture`: their own rest frames and tables

A data set is a list of parts, each with its own rest frame: the camera may have moved between two captures,
and motion counts from the rest frame of the same capture.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calib.capture import read_capture, read_rows
from calib.errors import CaptureError, TableError
from calib.extract import Extract, extract, read_like
from calib.fit import tip_of
from calib.targets import Targets, join, read_targets, targets_of_capture
from calib.unloaded import load_of, unloaded
from edge.calibration import Calibration
from edge.errors import CalibrationError, NoPins
from edge.geometry.parts import of_parts, parts_of, stack
from edge.params import PARAMS as RUNTIME
from edge.rest.choice import aligned, choose_rest
from edge.rest.symmetry import symmetry_of
from edge.rest.tare import TareParams
from edge.rest.tip_match import match_tip
from edge.sources.files import read_image
from edge.sources.region import region_named
from edge.types import Complex, Frame, Image, Lens, Region, Rest, Tracks
from hostlink.cli_types import counted

RECORDING = ".mcap"
RESTS_MAX = 10  # images of the untouched tip that are averaged
CANDIDATES_MAX = 256  # frames of which the least deformed is chosen: 80 MB at 640x480, a minute of one core


@dataclass(frozen=True, slots=True)
class RestGroup:
    """Frames that share a rest frame.

    rows  of the table, unchanged (captures; else empty)
    """

    rest: Rest
    targets: Targets
    frames: Callable[[], Iterable[Path | Image]]
    rows: tuple[dict[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Dataset:
    """Everything to fit to, or to evaluate on.

    rest_message  how the rest frame was found from the frames; "": it was given
    estimated     whether no frame shows it
    """

    parts: tuple[RestGroup, ...]
    rest_message: str = ""
    estimated: bool = False

    @property
    def rest(self) -> Rest:
        return self.parts[0].rest

    @property
    def targets(self) -> Targets:
        return join([part.targets for part in self.parts])

    @property
    def rows(self) -> list[dict[str, str]]:
        return [row for part in self.parts for row in part.rows]

    def __len__(self) -> int:
        return sum(len(part.targets) for part in self.parts)

    @property
    def touched_rests(self) -> list[tuple[str, str]]:
        """Where a rest frame that was photographed does not look untouched, and why."""
        if self.estimated:
            return []
        found = [(part.targets.where, symmetry_of(part.rest)) for part in self.parts]
        return [(where, symmetry.message) for where, symmetry in found if symmetry.in_contact]

    def seen_by(self, calibration: Calibration) -> Dataset:
        """The same data with the rest pins in the calibration's order, which replace a chosen rest frame.

        Raises  CalibrationError: the frames show another tip
        """
        seen = aligned if self.rest_message else _of_tip
        rests = [seen(calibration, p.rest) for p in self.parts]
        return self._with(rests).read_as(calibration.rest.pattern.on_surface)

    def read_as(self, on_surface: bool) -> Dataset:
        """The same data of a skin with dots on its surface, or with pins."""
        patterns = [replace(p.rest.pattern, on_surface=on_surface) for p in self.parts]
        return self._with([replace(p.rest, pattern=q) for p, q in zip(self.parts, patterns, strict=True)])

    def views(self) -> list[Dataset]:
        """The data of each view of the skin by itself, as mirrors show it; of the only one as it is."""
        views = zip(*(parts_of(part.rest) for part in self.parts), strict=True)
        return [self._with([own for _, own in view]) for view in views]

    def _with(self, rests: Sequence[Rest]) -> Dataset:
        parts = [replace(p, rest=rest) for p, rest in zip(self.parts, rests, strict=True)]
        return replace(self, parts=tuple(parts))

    def extract(self, pool: Executor, on_done: Callable[[int], None] = lambda n: None) -> Extract:
        """The edge's results for them; see `calib.extract.extract`."""
        return stack([extract(p.rest, p.frames(), pool, on_done) for p in self.parts])


def open_dataset(
    tables: Sequence[Path],
    folder: Path | None,
    rest_image: Path | None,
    lens: Lens | None = None,
    region: str = "",
) -> Dataset:
    """Open a table with its frames, or captures.

    region  that shows the skin, as in a source's address; "": all of the images
    Raises  TableError, CaptureError: one line with file, row and column; SourceError: no such region
    """
    camera = _Camera(lens, region)
    captures = [path for path in tables if path.suffix == RECORDING]
    if captures:
        if len(captures) < len(tables):
            table = next(path for path in tables if path not in captures)
            raise TableError(f"{table} and {captures[0]}: either one table or captures, not both")
        if folder is not None or rest_image is not None:
            raise TableError(f"{captures[0]}: a capture has its own frames; omit --frames and --rest")
        parts = tuple(_capture(path, camera) for path in captures)
        for path, part in zip(captures[1:], parts[1:], strict=True):
            _must_be_same_tip(captures[0], parts[0].rest, path, part.rest)
        return Dataset(parts)
    if len(tables) > 1:
        raise TableError(f"{tables[1]}: one table at a time; only captures ({RECORDING}) can be joined")
    if folder is None:
        raise TableError(f"{tables[0]}: a table needs --frames DIR, the folder of its pictures")
    targets = read_targets(tables[0], folder)
    if rest_image is None or str(rest_image) == "auto":
        return _without_rest(tables[0], targets, camera)
    rest = _rest([read_image(rest_image)], rest_image, camera)
    return Dataset((RestGroup(rest, targets, lambda: camera.frames(targets, rest)),))


@dataclass(slots=True)
class _Camera:
    """What is known of how the frames were taken: the lens, and the region as in a source's address."""

    lens: Lens | None
    region: str

    def tare(self, where: Path, image: Image) -> TareParams:
        """How the rest frame of images like this one is taken. Raises SourceError: no such region."""
        height, width = image.shape[:2]
        return TareParams(lens=self.lens, region=region_named(str(where), (width, height), self.region))

    def rest(self, where: Path, images: Sequence[Image]) -> Rest:
        """Raises NoPins, SourceError."""
        tare = self.tare(where, images[0])
        return tare.take([_within(image, tare.region) for image in images])

    def frames(self, targets: Targets, rest: Rest) -> Iterable[Path | Image]:
        """A table's frames: as files, of which a region leaves nothing out."""
        return self.images(targets, rest) if self.region else targets.frames

    def images(self, targets: Targets, rest: Rest) -> Iterator[Image]:
        region = region_named(targets.where, rest.pattern.size_px, self.region)
        return (_within(read_like(path, rest), region) for path in targets.frames)


def _within(image: Image, region: Region | None) -> Image:
    return Frame(image, 0, 0).within(region).image


def _without_rest(table: Path, targets: Targets, camera: _Camera) -> Dataset:
    """The data with a rest frame from the table's frames without load, or from what all were without it."""
    load = load_of(targets.values)
    # Exactly 0 where there is such a frame: a load below it may be one that is counted the other way.
    none = None if load is None else (load == 0 if (load == 0).any() else load <= 0)
    without_load = [] if none is None else np.flatnonzero(none)[:RESTS_MAX].tolist()
    try:
        if without_load:
            rest = camera.rest(table, [read_image(targets.frames[k]) for k in without_load])
            message = f"of {counted(len(without_load), 'frame')} that the table says are without load"
        else:
            rest, message = _estimated(table, targets, camera)
    except NoPins as error:
        raise TableError(f"{table}: {error}; give --rest an image of the untouched tip") from None
    part = RestGroup(rest, targets, lambda: camera.frames(targets, rest))
    return Dataset((part,), message, estimated=not without_load)


def _estimated(table: Path, targets: Targets, camera: _Camera) -> tuple[Rest, str]:
    """Rest frame of frames of which the table says no one is untouched, or says nothing. Raises NoPins."""
    some = range(0, len(targets), max(1, -(-len(targets) // CANDIDATES_MAX)))
    images = [read_image(targets.frames[k]) for k in some]
    tare = camera.tare(table, images[0])
    choice = choose_rest([_within(image, tare.region) for image in images], tare)
    name = targets.frames[some[choice.index]].name
    frames = [own for _, own in parts_of(choice.rest)]
    found = [unloaded(own, camera.images(targets, own), targets.values) for own in frames]
    rests = [rest for rest in found if rest is not None]
    if len(rests) < len(found):
        return choice.rest, f"{name}: {choice.message}"
    rest = rests[0] if len(rests) == 1 else of_parts(rests, choice.rest.pattern)
    return rest, f"the pins of {name}, at their places in {len(targets)} frames extrapolated to no load"


def _capture(path: Path, camera: _Camera) -> RestGroup:
    rows = read_rows(path)
    samples = tuple(row for row in rows if row["role"] != "rest")
    if not samples:
        raise CaptureError(f"{path.with_suffix('.csv')}: no rows but rest frames; nothing to learn from")
    rests: list[Image] = []
    for frame, row in read_capture(path):
        if row["role"] != "rest" or len(rests) == RESTS_MAX:
            break
        rests.append(frame.image)
    if not rests:
        raise CaptureError(f"{path}: does not begin with frames of the untouched tip (role rest)")

    region = camera.tare(path, rests[0]).region

    def frames() -> Iterator[Image]:
        for frame, row in read_capture(path):
            if row["role"] != "rest":
                yield frame.within(region).image

    return RestGroup(_rest(rests, path, camera), targets_of_capture(str(path), samples), frames, samples)


def _rest(images: Sequence[Image], where: Path, camera: _Camera) -> Rest:
    try:
        return camera.rest(where, images)
    except NoPins as error:
        raise TableError(f"{where}: {error}; an image of the untouched tip is needed") from None


def _must_be_same_tip(first: Path, rest: Rest, path: Path, other: Rest) -> None:
    try:
        _of_tip(tip_of(rest), other)
    except CalibrationError as error:
        raise TableError(f"{path}: shows another tip than {first}: {error}") from None


def _of_tip(calibration: Calibration, rest: Rest) -> Rest:
    """The rest frame in the order of a calibration's pins. Raises CalibrationError: another tip, a touch."""
    matched, tracks = match_tip(calibration, rest)
    if matched.since is None:
        _check_deformation(calibration.rest, tracks)
    return matched


def _check_deformation(made_with: Rest, tracks: Tracks) -> None:
    """Raises CalibrationError: no common shift, rotation and zoom explains the pins' places."""
    residuals: list[Complex] = []
    for rows, _ in parts_of(made_with):
        seen = rows[tracks.seen[rows]]
        z, w = made_with.xy_img[seen] @ (1, 1j), tracks.xy_img[seen] @ (1, 1j)
        design = np.column_stack([z, np.ones_like(z)])
        residuals.append(w - design @ np.linalg.lstsq(design, w, rcond=None)[0])
    deformation = float(np.quantile(np.abs(np.concatenate(residuals)), 0.95))
    deformation_max = RUNTIME.still_pitches * made_with.pattern.pitch_px
    if deformation > deformation_max:
        raise CalibrationError(
            f"the pattern of pins is deformed by {deformation:.1f} px against the calibration's (limit "
            f"{deformation_max:.1f}): something touches the tip, or it is another tip"
        )
