"""Window centroids: against truth, and against the Cramer-Rao bound."""

from dataclasses import replace

import numpy as np
import pytest

from edge.pins import CentroidRefiner
from edge.types import Array, Image
from tests.support.pins_rendered import cramer_rao_px, draw, expose, hexagon, known_rest

pytestmark = pytest.mark.kernels

SIZE = (300, 300)
# radius, blur, brightness, ground, noise
DISCS = [
    (2.8, 0.6, 90, 60, 2), (3.0, 1.2, 60, 110, 2), (5.3, 0.8, 110, 27, 2), (6.0, 1.2, 110, 27, 4),
    (9.5, 1.0, 120, 60, 2), (20.0, 1.4, 120, 60, 2),
]  # fmt: skip


def plain(brightness: float, noise: float = 1.0) -> tuple[Array, CentroidRefiner]:
    """Places of 37 pins, and their refiner."""
    truth = hexagon(3, 22.0, (150.0, 150.0))
    return truth, CentroidRefiner(known_rest(truth, 6.0, 0.9, brightness, noise, 22.0, SIZE))


@pytest.mark.parametrize(("radius", "blur", "brightness", "ground", "noise"), DISCS)
def test_noise_is_near_the_bound_and_matches_sigma(
    radius: float, blur: float, brightness: float, ground: float, noise: float
) -> None:
    pitch, size = 3.8 * radius, (640, 640) if radius > 10 else SIZE
    truth = hexagon(3, pitch, (size[0] / 2, size[1] / 2))
    clean = draw(size, truth, radius, blur, brightness, ground)
    refiner = CentroidRefiner(known_rest(truth, radius, blur, brightness, noise, pitch, size))
    rng = np.random.default_rng(2)
    errors, normal = [], []
    for _ in range(40):
        start = truth + rng.uniform(-0.4, 0.4, truth.shape) * radius
        pins = refiner.refine(expose(clean, noise, rng), start)
        errors.append(pins.xy_img - truth)
        normal.append(errors[-1] / pins.sigma_px[:, None])
    spread = np.std(errors)
    assert not np.isnan(spread)  # nothing lost
    # 1.2 for well separated pins; small crowded ones have few pixels of background
    assert spread < (1.25 if radius > 5 else 1.6) * cramer_rao_px(radius, blur, brightness, noise)
    assert 0.6 < np.std(normal) < 1.25
    assert np.abs(np.mean(errors, axis=(0, 1))).max() < 0.01


def test_the_result_does_not_depend_on_where_the_window_started() -> None:
    truth, refiner = plain(120)
    image = expose(draw(SIZE, truth, 6.0, 0.9, 120, 30), 0.0, np.random.default_rng(0))
    rng = np.random.default_rng(3)
    answers = [refiner.refine(image, truth + rng.uniform(-3, 3, truth.shape)).xy_img for _ in range(10)]
    assert np.ptp(answers, axis=0).max() < 0.02
    assert np.abs(answers[0] - truth).max() < 0.02


def test_a_slope_of_the_background_causes_no_bias() -> None:
    """A reflection's flank, one level a pixel: a centroid over its ring's mean would be off by 0.2 px."""
    truth, refiner = plain(80)
    clean = draw(SIZE, truth, 6.0, 0.9, 80, 20) + 0.8 * np.abs(np.arange(300) - 150.0)[None, :]
    pins = refiner.refine(expose(clean, 1.0, np.random.default_rng(4)), truth)
    away = np.abs(truth[:, 0] - 150.0) > 10  # not on the crease
    assert np.abs((pins.xy_img - truth)[away]).max() < 0.06


@pytest.mark.parametrize("gain", [0.5, 2.0])
def test_gain_of_two_is_followed(gain: float) -> None:
    truth, refiner = plain(60)
    image = expose(gain * draw(SIZE, truth, 6.0, 0.9, 60, 30), 1.0, np.random.default_rng(5))
    assert np.abs(refiner.refine(image, truth).xy_img - truth).max() < 0.1


def test_missing_and_covered_pins_are_lost_and_half_hidden_ones_less_certain() -> None:
    truth, refiner = plain(120, noise=2.0)
    clean = draw(SIZE, np.delete(truth, 5, axis=0), 6.0, 0.9, 120, 30)
    x, y = truth[20]
    clean[round(y) - 15 : round(y) + 16, round(x) - 15 : round(x) + 16] = 255  # glare fills the window
    x, y = truth[30]
    clean[round(y) - 9 : round(y) + 10, round(x) - 9 : round(x)] = 30  # left half hidden
    pins = refiner.refine(expose(clean, 2.0, np.random.default_rng(6)), truth)
    assert np.isnan(pins.xy_img[[5, 20]]).all()
    assert np.isnan(pins.sigma_px[[5, 20]]).all()
    error = np.hypot(*(pins.xy_img[30] - truth[30]))
    assert np.isnan(error) or error < 3.5 * pins.sigma_px[30]
    assert np.isnan(error) or pins.sigma_px[30] > 5 * np.nanmedian(pins.sigma_px)


def test_pins_that_the_border_cuts_keep_their_place() -> None:
    truth = np.array(
        [[3.2, 60.0], [60.0, 2.1], [60.0, 60.0], [116.3, 60.0], [60.0, 116.6], [25.0, 25.0], [90.0, 90.0]]
    )
    image = expose(draw((120, 120), truth, 6.0, 0.9, 120, 30), 2.0, np.random.default_rng(8))
    rest = known_rest(truth, 6.0, 0.9, 120, 2.0, 30.0, (120, 120))
    pins = CentroidRefiner(rest).refine(image, truth + np.array([0.5, -0.6]))
    assert np.abs(pins.xy_img - truth).max() < 0.2
    assert pins.sigma_px[:2].min() > pins.sigma_px[2]


def test_pins_with_a_glint_keep_their_place_wherever_they_were_predicted() -> None:
    rng = np.random.default_rng(9)
    truth = hexagon(3, 19.0, (150.0, 150.0))
    glints = draw(SIZE, truth + np.array([0.0, 1.2]), 1.5, 1.0, -160, 0)
    image = expose(draw(SIZE, truth, 6.0, 1.4, 100, 60) + glints, 1.0, rng)
    refiner = CentroidRefiner(known_rest(truth, 6.0, 1.4, 100, 1.0, 19.0, SIZE))
    starts = truth + rng.uniform(-1, 1, (8, *truth.shape))
    places = np.array([refiner.refine(image, start).xy_img for start in starts])
    assert np.hypot(*np.moveaxis(places - np.median(places, axis=0), -1, 0)).max() < 0.8
    assert np.hypot(*np.moveaxis(places - truth, -1, 0)).max() < 0.5


def scattered(bits: int, dark: bool, zoom: int = 1) -> tuple[CentroidRefiner, Image, Array]:
    """Pins of five radii, some cut by the border, half of them poorly predicted: refiner, image, predictions.

    One has no pin near it, one is beyond the image, one is NaN. All is `zoom` times as large.
    """
    rng = np.random.default_rng(11)
    columns, rows = np.arange(4.0, 240, 26), np.arange(5.0, 160, 26)
    truth = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)[2:]
    truth = zoom * (truth + rng.uniform(-2, 2, truth.shape))
    scale, size = 2 ** (bits - 8), (240 * zoom, 160 * zoom)
    rest = known_rest(truth, 6.0 * zoom, 0.9 * zoom, 120.0 * scale, 2.0 * scale, 26.0 * zoom, size)
    radius: Array = zoom * 6.0 * 1.05 ** rng.integers(-2, 3, len(truth)).astype(np.float64)
    rest = replace(rest, pins=replace(rest.pins, radius_px=radius), pattern=replace(rest.pattern, dark=dark))
    clean = scale * (draw(size, truth[1:], 6.0 * zoom, 0.9 * zoom, 120, 30) + np.linspace(0, 48, size[0]))
    image = expose(clean, 2.0 * scale, rng, bits)
    predicted = truth + zoom * rng.uniform(-2, 2, truth.shape) * (rng.random((len(truth), 1)) < 0.5)
    predicted[3:5] = [[-50.0, 1e9], [np.nan, 20.0]]
    return CentroidRefiner(rest), 2**bits - 1 - image if dark else image, predicted


@pytest.mark.parametrize("zoom", [1, 4])
@pytest.mark.parametrize(("bits", "dark"), [(8, False), (8, True), (12, False), (16, True)])
def test_pins_of_all_radii_are_found_from_poor_predictions(bits: int, dark: bool, zoom: int) -> None:
    """Each by steps of its own, so a pin's answer does not depend on those that are read with it."""
    refiner, image, predicted = scattered(bits, dark, zoom)
    together = refiner.refine(image, predicted)
    slow = refiner.refine(image.astype(np.uint16), predicted)  # pixel by pixel
    np.testing.assert_allclose(slow.xy_img, together.xy_img, rtol=1e-9)
    np.testing.assert_allclose(slow.sigma_px, together.sigma_px, rtol=1e-9)
    for few in (np.arange(len(predicted)) % 3 == 0, np.arange(len(predicted)) > 40):
        alone = refiner.refine(image, np.where(few[:, None], predicted, np.nan))
        seen = few & ~np.isnan(together.xy_img[:, 0])
        assert seen.sum() > 10
        np.testing.assert_array_equal(alone.xy_img[seen], together.xy_img[seen])
        np.testing.assert_array_equal(alone.sigma_px[seen], together.sigma_px[seen])
        assert np.isnan(alone.xy_img[~few]).all()


@pytest.mark.parametrize("layout", ["cropped", "flipped", "transposed", "repeated"])
def test_images_of_any_layout_are_read(layout: str) -> None:
    refiner, image, predicted = scattered(8, dark=False)
    expected = refiner.refine(image, predicted).xy_img
    views = {
        "cropped": np.pad(image, 5)[5:-5, 5:-5],
        "flipped": np.ascontiguousarray(image[::-1, ::-1])[::-1, ::-1],
        "transposed": np.asfortranarray(image),
        "repeated": np.broadcast_to(image[:1], image.shape),
    }
    view = np.asarray(views[layout], np.uint8)
    assert np.shares_memory(view, views[layout])
    if layout == "repeated":  # all rows are the same memory
        expected = refiner.refine(np.ascontiguousarray(view), predicted).xy_img
    np.testing.assert_array_equal(refiner.refine(view, predicted).xy_img, expected)


def test_windows_whose_copies_would_end_beyond_the_image_are_read_pixel_by_pixel() -> None:
    """Of each row 32 bytes are copied, here of 19: those of the last window would end beyond the last row."""
    truth = np.array([[9.3, 50.2]])
    rest = known_rest(truth, 5.0, 0.9, 120, 2.0, 26.0, (19, 60))
    image = expose(draw((19, 60), truth, 5.0, 0.9, 120, 30), 2.0, np.random.default_rng(8))
    wider = np.zeros((100, 59), np.uint8)
    wider[:60, :19] = image
    narrow, wide = (CentroidRefiner(rest).refine(shown, truth) for shown in (image, wider))
    np.testing.assert_allclose(narrow.xy_img, wide.xy_img, rtol=1e-12)
    np.testing.assert_allclose(narrow.sigma_px, wide.sigma_px, rtol=1e-9)
    assert np.abs(wide.xy_img - truth).max() < 0.15
