"""Whether a rest frame shows the tip that a calibration belongs to, and which pin is which.

A camera that was taken out and put back shifts and rotates all pins alike, a little. The residual after the
best common shift, rotation and zoom is deformation: a touch, or another tip.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from edge.calibration import Calibration
from edge.errors import CalibrationError
from edge.geometry.neighbours import nearest_of
from edge.geometry.parts import one_part, own_pins, parts_of, pins_joined, tracks_joined
from edge.params import PARAMS as RUNTIME
from edge.pins import CentroidRefiner
from edge.tracking import Tracker
from edge.types import Array, Image, Lens, Pins, Rest, Tracks

#: Share of the pins of each of two rest frames of the same tip that the other has too.
SHARED_MIN = RUNTIME.most_rel


def match_tip(calibration: Calibration, rest: Rest) -> tuple[Rest, Tracks]:
    """As `match_rest`; motion counts from the calibration's own pins, if these were estimated."""
    made_with = calibration.rest
    matched, tracks = match_rest(made_with, rest)
    if calibration.content.sensor.estimated:
        xy = moved_onto(made_with, tracks)
        off, left = (np.nanmean((tracks.xy_img - places) ** 2) for places in (made_with.xy_img, xy))
        if off < 2.0 * left:  # a move that explains less than it leaves is the estimate's error
            xy = made_with.xy_img
        since = replace(made_with, pins=replace(matched.pins, xy_img=xy))  # The noise is that of now.
        matched = replace(matched, since=one_part(since, np.arange(len(xy), dtype=np.int32)))
    return matched, tracks


def moved_onto(made_with: Rest, tracks: Tracks) -> Array:
    """(n, 2) px, a calibration's pins where this camera would see them, shifted and turned together."""
    z, w = made_with.xy_img @ (1, 1j), tracks.xy_img @ (1, 1j)
    best = tracks.seen
    # A zoom is not fitted: a touch, or an error of the estimate, makes one rather than a camera.
    for _ in range(5):
        from_middle = z - z[best].mean()
        turn = np.vdot(from_middle[best], w[best])
        at = from_middle * turn / abs(turn) + w[best].mean()
        off = np.where(tracks.seen, np.abs(w - at), np.inf)
        best = off <= np.median(off[tracks.seen])
    return np.column_stack([at.real, at.imag])


def match_rest(made_with: Rest, rest: Rest) -> tuple[Rest, Tracks]:
    """The rest frame with row i being pin i of the one that a calibration was made with, touched or not.

    Returns  the rest frame, in the views of that one, and where its pins were found: NaN where they were not
    Raises   CalibrationError: another image size, another tip, another mounting
    """
    (width, height), (now_width, now_height) = made_with.pattern.size_px, rest.pattern.size_px
    if (width, height) != (now_width, now_height):
        raise CalibrationError(
            f"the calibration was made at {width}x{height}, the images are {now_width}x{now_height}: "
            "give the calibration of this tip, or set the camera to that size"
        )
    _check_lens(made_with.pattern.lens, rest.pattern.lens)
    tracks = identified(made_with, rest.pins)
    _check_counts(tracks, len(made_with), len(rest))
    _check_shift(made_with, tracks)
    seen = tracks.seen
    moved = tracks.xy_img - made_with.xy_img
    # A pin that was not found is put where the calibration's pin would have moved with the others.
    xy = np.where(seen[:, None], tracks.xy_img, made_with.xy_img + np.nanmedian(moved, axis=0))
    sigma = np.where(seen, tracks.sigma_px, made_with.pattern.pin_radius_px)
    # Brightness is that of the present images; a pin that was not found gets the median.
    nearest = nearest_of(rest.xy_img, xy)[1][:, 0]
    brightness = np.where(seen, rest.pins.brightness[nearest], np.median(rest.pins.brightness))
    views = tuple(
        rest.pattern if rest.part is None else rest.views[np.bincount(rest.part[nearest[rows]]).argmax()]
        for rows, _ in parts_of(made_with)
    )
    pins = Pins(xy, sigma, made_with.pins.radius_px, brightness)
    return Rest(pins, rest.pattern, made_with.part, views if made_with.part is not None else ()), tracks


def identified(reference: Rest, pins: Pins) -> Tracks:
    """Which of some pins are those of a rest frame, each view by itself; as certain as the least certain."""
    parts = parts_of(reference)
    found = [Tracker(own).identify(own_pins(pins, own)) for _, own in parts]
    return tracks_joined([rows for rows, _ in parts], found)


def near_rest(rest: Rest, image: Image) -> Pins:
    """What an image shows where each pin is at rest, each view read by its own light; NaN: nothing."""
    parts = parts_of(rest)
    found = [CentroidRefiner(own).refine(image, own.xy_img) for _, own in parts]
    return pins_joined([rows for rows, _ in parts], found)


def as_followed(rest: Rest, images: Sequence[Image]) -> Rest:
    """The rest frame with its pins where these images, which it is of, show them if they are followed.

    A whole image that is searched shows them up to .05 px apart from there, with their sizes of that day.
    """
    xy = np.array([near_rest(rest, image).xy_img for image in images])
    seen = np.isfinite(xy).all(axis=(0, 2))
    xy = np.where(seen[:, None], np.median(xy, axis=0), rest.xy_img)
    return replace(rest, pins=replace(rest.pins, xy_img=xy))


def _check_lens(made_with: Lens | None, now: Lens | None) -> None:
    """Raises CalibrationError: the pins' places are not those behind the same lens."""
    if made_with == now:
        return
    if made_with is None:
        raise CalibrationError("the calibration was made without a lens: omit ?lens= in the source's address")
    how = "none is given" if now is None else "another one is given"
    raise CalibrationError(
        f"the calibration was made with a lens (focal length {made_with.focal_px[0]:.1f} px), {how}: "
        "give its file as ?lens=FILE in the source's address"
    )


def _check_counts(tracks: Tracks, known_n: int, seen_n: int) -> None:
    """Raises CalibrationError: the pins of one are not those of the other."""
    found_n = tracks.n_seen
    if tracks.confidence < Tracks.LOW_CONFIDENCE or found_n < SHARED_MIN * known_n:
        raise CalibrationError(
            f"the calibration belongs to another tip: {found_n} of its {known_n} pins were found"
        )
    if found_n < SHARED_MIN * seen_n:
        raise CalibrationError(
            f"the calibration has {known_n} pins, the camera sees {seen_n}: "
            "its file lacks pins of this tip, or belongs to another one; fit it again"
        )


def _check_shift(made_with: Rest, tracks: Tracks) -> None:
    """Raises CalibrationError: the pins are not where the calibration has them."""
    moved = (tracks.xy_img - made_with.xy_img)[tracks.seen]
    # A pin more than half a pitch off is nearer to its neighbour's place.
    shift, shift_max = float(np.median(np.hypot(*moved.T))), 0.5 * made_with.pattern.pitch_px
    if shift > shift_max:
        raise CalibrationError(
            f"the pins are {shift:.2f} px from where the calibration has them (limit {shift_max:.2f}): "
            "the camera was moved, something touches the tip, or it is another tip"
        )
