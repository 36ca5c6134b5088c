"""Full-frame detection: on rendered and on real images."""

from dataclasses import fields, replace
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree
from skimage.data import coins

from edge.errors import NoPins
from edge.pins import CentroidRefiner, detect, learn, take_rest
from edge.pins.pattern import trend_of
from edge.pins.rest_frame import with_voted
from edge.sources import open_source
from edge.sources.files import read_image
from edge.types import Array, Frame, Image, Pins, Polarity
from tests.support.pins_rendered import draw, expose, hexagon


def missed_and_false(pins: Pins, truth: Array, within_px: float) -> tuple[int, int]:
    missed = cKDTree(pins.xy_img).query(truth)[0] > within_px
    false = cKDTree(truth).query(pins.xy_img)[0] > within_px
    return int(missed.sum()), int(false.sum())


# width, height, rings, pitch, radius, blur, light, ground, noise, bits
TIPS = {
    "331 pins, 640x480": (640, 480, 10, 20.0, 6.0, 0.9, 120, 40, 2.0, 8),
    "331 pins, 320x240": (320, 240, 10, 10.5, 2.8, 0.6, 90, 60, 2.0, 8),
    "127 pins, 1280x800": (1280, 800, 6, 55.0, 12.0, 1.6, 100, 30, 3.0, 8),
    "127 small dim pins": (640, 480, 6, 15.0, 3.0, 1.2, 30, 110, 2.0, 8),
    "331 pins, 12 bit": (640, 480, 10, 20.0, 6.0, 0.9, 1900, 600, 25.0, 12),
}


@pytest.mark.parametrize("tip", TIPS.values(), ids=TIPS.keys())
def test_finds_every_pin_and_nothing_else(tip: tuple[float, ...]) -> None:
    width, height, rings, pitch, radius, blur, light, ground, noise, bits = tip
    truth = hexagon(int(rings), pitch, (width / 2, height / 2))
    clean = draw((int(width), int(height)), truth, radius, blur, light, ground)
    image = expose(clean, noise, np.random.default_rng(1), int(bits))
    pattern, learnt = learn(image)
    assert pattern.pin_radius_px == pytest.approx(radius, rel=0.1)
    assert pattern.pitch_px == pytest.approx(pitch, rel=0.06)
    assert pattern.brightness == pytest.approx(light, rel=0.35)  # levels are of a smoothed image
    for pins in (detect(image, pattern), learnt):
        assert missed_and_false(pins, truth, 0.5) == (0, 0)


def test_glare_rim_specks_vignetting_and_gain_are_no_pins() -> None:
    """A realistic image of a tip: bright rim, LED spots on it, specks, dark corners; then half the light."""
    rng = np.random.default_rng(2)
    truth = hexagon(6, 26.0, (320.0, 240.0))
    clean = draw((640, 480), truth, 6.0, 1.0, 110.0, 30.0)
    y, x = np.mgrid[0:480, 0:640]
    r = np.hypot(x - 320, y - 240)
    clean *= 1.0 - 0.5 * (r / 320) ** 2
    clean += 220.0 / (1.0 + np.exp(-(r - 205.0) / 2.0))
    for angle in np.arange(6) * np.pi / 3 + 0.2:
        away = np.hypot(x - 320 - 196 * np.cos(angle), y - 240 - 196 * np.sin(angle))
        clean += 250.0 * np.exp(-0.5 * (away / 5) ** 2)
    specks = np.stack([320 + 186 * np.cos(np.arange(15.0)), 240 + 186 * np.sin(np.arange(15.0))], axis=1)
    clean += draw((640, 480), specks, 1.6, 0.6, 200.0, 0.0)
    image = expose(clean, 2.0, rng)
    pattern = learn(image)[0]
    assert missed_and_false(detect(image, pattern), truth, 1.0) == (0, 0)
    assert missed_and_false(detect(expose(0.5 * clean, 2.0, rng), pattern), truth, 1.0) == (0, 0)


def test_thresholded_image_with_merged_pins_and_specks() -> None:
    truth = hexagon(6, 24.0, (220.0, 220.0))
    truth[60] += 0.52 * (truth[61] - truth[60])  # the two merge into one white blob
    clean = draw((440, 440), truth, 6.0, 0.7, 200.0, 20.0)
    rng = np.random.default_rng(3)
    image = ((clean > 110) * 255).astype(np.uint8)
    angle = rng.uniform(0, 2 * np.pi, 80)
    y, x = np.rint(220 + 205 * np.stack([np.sin(angle), np.cos(angle)])).astype(int)
    image[y, x] = 255
    assert missed_and_false(learn(image)[1], truth, 2.0) == (0, 0)


def textures() -> dict[str, Image]:
    rng = np.random.default_rng(5)
    found: dict[str, Image] = {
        "black": np.zeros((480, 640), np.uint8),
        "white": np.full((480, 640), 255, np.uint8),
        "noise": np.clip(rng.normal(100, 20, (480, 640)), 0, 255).astype(np.uint8),
        "salt": ((rng.random((480, 640)) > 0.99) * 255).astype(np.uint8),
        "ramp": np.tile(np.linspace(0, 255, 640), (480, 1)).astype(np.uint8),
        "stripes": ((np.indices((480, 640))[1] // 8 % 2) * 255).astype(np.uint8),
        "one pixel": np.zeros((1, 1), np.uint8),
    }
    for sigma in (1, 2, 4):
        smooth = cv2.GaussianBlur(rng.normal(0, 1, (480, 640)), (0, 0), sigma)
        found[f"smooth noise {sigma}"] = np.clip(120 + 40 * smooth / smooth.std(), 0, 255).astype(np.uint8)
    found["noise, 16 bit"] = rng.normal(20000, 300, (480, 640)).astype(np.uint16)
    found["coins"] = coins()
    return found


@pytest.mark.parametrize(("name", "image"), textures().items())
def test_an_image_without_a_tip_raises_one_line(name: str, image: Image) -> None:
    with pytest.raises(NoPins) as caught:
        learn(image)
    assert "no pattern of pins" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_rest_has_the_same_rows_whatever_the_noise() -> None:
    truth = hexagon(6, 24.0, (220.0, 220.0))
    clean = draw((440, 440), truth, 6.0, 0.9, 120.0, 40.0)
    rng = np.random.default_rng
    rests = [take_rest([expose(clean, 3.0, rng(s + k)) for k in range(4)]) for s in (10, 20)]
    assert len(rests[0]) == len(rests[1]) == len(truth)
    assert np.abs(rests[0].xy_img - rests[1].xy_img).max() < 0.1
    assert rests[0].pattern.noise == pytest.approx(3.0, rel=0.2)
    for sizes in ([], [(4, 4), (5, 4)]):
        with pytest.raises(NoPins):
            take_rest([np.zeros(size, np.uint8) for size in sizes])


def test_rest_is_taken_from_the_images_in_which_nothing_moves() -> None:
    """Dark first images, a tip that is still being released, then five of it at rest."""
    truth = hexagon(6, 26.0, (320.0, 240.0))
    rng = np.random.default_rng(4)
    images: list[Image] = [np.zeros((480, 640), np.uint8)] * 2
    calm = draw((640, 480), truth, 6.0, 1.0, 110.0, 30.0)
    for shift in (9, 5, 2, 0, 0, 0, 0, 0):
        images.append(expose(np.roll(calm, shift, axis=1), 2.0, rng))
    pins = take_rest(images).pins
    assert missed_and_false(pins, truth, 0.2) == (0, 0)
    moving = take_rest(images[:4])
    assert missed_and_false(moving.pins, truth + np.array([9.0, 0.0]), 0.3) == (0, 0)


def test_noise_alone_keeps_no_image_from_a_rest_frame() -> None:
    truth = hexagon(6, 15.0, (160.0, 120.0))
    clean = draw((320, 240), truth, 3.0, 1.2, 60.0, 60.0)
    rest = take_rest([expose(clean, 15.0, np.random.default_rng(k)) for k in range(8)])
    assert missed_and_false(rest.pins, truth, 0.5) == (0, 0)
    off = cKDTree(truth).query(rest.xy_img)[0]
    assert np.sqrt(np.mean(np.square(off)) / 2) < 0.08  # of a single image it is 0.17 px


def test_a_reflection_on_a_pin_gives_no_second_pin() -> None:
    """A small bright spot on the edge of a large pin gives a maximum at its own scale."""
    truth = hexagon(6, 32.0, (320.0, 240.0))
    image = draw((640, 480), truth, 9.0, 1.0, 90.0, 30.0)
    spot = truth[40] + np.array([7.0, 0.0])
    image += draw((640, 480), spot[None], 5.0, 1.0, 100.0, 0.0)
    _, pins = learn(expose(image, 1.0, np.random.default_rng(5)))
    gap = cKDTree(pins.xy_img).query(pins.xy_img, k=2)[0][:, 1]
    assert gap.min() > 16.0
    assert len(pins) == len(truth)


@pytest.mark.parametrize("radius", [6.0, 9.0])
def test_pins_that_a_round_frame_cuts_are_found_by_their_arc(radius: float) -> None:
    """The tip moves behind the housing's rim: slivers of outermost pins are visible, and an arc of glare."""
    pitch, side = 3.4 * radius, 54 * radius
    rng = np.random.default_rng(6)
    truth = hexagon(6, pitch, (side / 2, side / 2))
    reach = np.hypot(*(truth - side / 2).T).max()
    y, x = np.mgrid[: int(side), : int(side)]
    frame = np.hypot(x - side / 2, y - side / 2) < reach + 1.5 * radius
    glare = np.array([[side / 2, side / 2 - reach - 2 * radius]])
    size = (int(side), int(side))
    fixed = draw(size, glare, radius, 0.9, 120, 0) * frame + 40

    def seen(pins: Array) -> Image:
        return expose(draw(size, pins, radius, 0.9, 120, 0) * frame + fixed, 2.0, rng)

    rest = take_rest([seen(truth)])
    assert len(rest) == rest.pattern.count == 127
    n_cut, normal = 0, []
    for angle in np.linspace(0, 6, 7):
        moved = truth + 1.0 * pitch * np.array([np.cos(angle), np.sin(angle)])
        pins = detect(seen(moved), rest.pattern)
        gap = cKDTree(moved).query(pins.xy_img)[0]
        assert gap.max() < 0.5 * radius  # neither the glare nor a sliver's own middle
        hidden = np.hypot(*(moved - side / 2).T) > reach + 1.4 * radius
        cut = cKDTree(moved[hidden]).query(pins.xy_img)[0] < 0.3 * radius
        n_cut += int(cut.sum())
        normal.extend(gap[cut] / np.sqrt(2) / pins.sigma_px[cut])
    assert n_cut >= 15
    assert np.sqrt(np.mean(np.square(normal))) < 1.5


@pytest.mark.parametrize("change", [{}, {"count": 500}, {"size_px": (320, 240)}, {"brightness": 2000.0}])
def test_an_earlier_pattern_finds_the_same_pins(frames: list[Frame], change: dict[str, Any]) -> None:
    like = replace(learn(frames[0].image)[0], **change)
    (_, known), (_, found) = (learn(frames[3].image, like=like) for like in (like, None))
    assert len(known) == len(found)
    assert cKDTree(known.xy_img).query(found.xy_img)[0].max() < (1e-9 if change else 0.05)


@pytest.mark.real
def test_real_grey_stills_show_331_pins_and_nothing_outside(real_dir: Path) -> None:
    files = sorted((real_dir / "tactip331_gray" / "frames").glob("*.png"))
    images = [read_image(file) for file in files[::5]]
    pattern = learn(images[0])[0]
    for image in images:
        for pins in (detect(image, pattern), learn(image)[1], learn(image, like=pattern)[1]):
            assert len(pins) == 331
            # the skin's border is 205 px from its middle, the outermost pins at most 185
            assert np.hypot(*(pins.xy_img - pattern.centre_img).T).max() < 190


VIDEOS = {"Movement4": (110, 135), "north": (80, 135), "west": (80, 135), "flatSkin": (260, 420)}


@pytest.mark.real
@pytest.mark.parametrize(("name", "count"), VIDEOS.items())
def test_the_rest_of_a_video_can_be_followed(real_dir: Path, name: str, count: tuple[int, int]) -> None:
    images = [frame.image for frame in islice(open_source(str(real_dir / "video" / f"{name}.avi")), 3)]
    rest = take_rest(images)
    assert count[0] <= len(rest) <= count[1]
    pins = CentroidRefiner(rest).refine(images[0], rest.xy_img)
    seen = ~np.isnan(pins.xy_img[:, 0])
    assert seen.mean() > 0.95
    assert np.median(np.hypot(*(pins.xy_img - rest.xy_img)[seen].T)) < 1.0


def dark_pins(glints: bool) -> Image:
    """Dark discs on a bright skin, each with a small reflection on it, like on a tip of another maker."""
    truth = hexagon(4, 34.0, (200.0, 200.0))
    picture = 200.0 - draw((400, 400), truth, 9.0, 1.0, 150, 0)
    if glints:
        picture += draw((400, 400), truth - 2.0, 2.2, 0.8, 90, 0)
    return expose(picture, 2.0, np.random.default_rng(11))


@pytest.mark.parametrize("glints", [False, True])
def test_dark_pins_are_found_without_their_reflections(glints: bool) -> None:
    truth = hexagon(4, 34.0, (200.0, 200.0))
    image = dark_pins(glints)
    for pattern in (learn(image)[0], take_rest([image, image]).pattern):
        assert pattern.dark
        assert missed_and_false(detect(image, pattern), truth, 0.5) == (0, 0)
    assert missed_and_false(learn(image)[1], truth, 0.5) == (0, 0)


def same_pins(a: Pins, b: Pins) -> bool:
    names = [f.name for f in fields(Pins)]
    return all(np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True) for name in names)


@pytest.mark.parametrize("bits", [8, 12])
@pytest.mark.parametrize("left_px", [220.0, 100.0])
def test_the_inverted_image_gives_the_same_to_the_last_bit(bits: int, left_px: float) -> None:
    """Pins, rest frame and windows; at the image's border too."""
    rng = np.random.default_rng(31)
    truth = hexagon(6, 24.0, (left_px, 220.0))
    full = 2**bits - 1
    clean = draw((440, 440), truth, 6.0, 0.9, 0.5 * full, 0.15 * full)
    images = [expose(clean, full / 128, rng, bits) for _ in range(3)]
    inverted: list[Image] = [~image for image in images]
    rest, other = take_rest(images), take_rest(inverted)
    assert (rest.pattern.dark, other.pattern.dark) == (False, True)
    assert same_pins(rest.pins, other.pins)
    assert same_pins(detect(images[0], rest.pattern), detect(inverted[0], other.pattern))
    a, b = CentroidRefiner(rest), CentroidRefiner(other)
    off = rest.xy_img + rng.uniform(-4.0, 4.0, rest.xy_img.shape)
    assert same_pins(a.refine(images[1], off), b.refine(inverted[1], off))


def test_only_the_given_polarity_is_searched_for() -> None:
    image = dark_pins(glints=False)
    assert learn(image, Polarity.DARK)[0].dark
    with pytest.raises(NoPins, match=r"bright ones: "):
        take_rest([image], Polarity.BRIGHT)


def test_dark_grid_under_uneven_coloured_light_that_the_border_cuts() -> None:
    """A square grid as wide as the image, lit from three sides: whole pins are found, halved ones not."""
    x, y = np.meshgrid(np.arange(18.0, 320.0, 31.6), np.arange(0.5, 240.0, 32.0))
    truth = np.stack([x.ravel(), y.ravel()], axis=1)
    dots = 1.0 - draw((320, 240), truth, 5.3, 1.0, 0.8, 0.0)
    v, u = np.mgrid[0:240, 0:320]
    light = np.stack([60 + 0.5 * v, 150 - 0.3 * v, 40 + 0.35 * u], axis=2)
    picture = expose(light * dots[:, :, None], 1.0, np.random.default_rng(6))
    assert missed_and_false(learn(picture)[1], truth[truth[:, 1] > 3.0], 0.5) == (0, 0)


def test_pins_too_large_for_a_window_are_refused_with_the_limit() -> None:
    truth = hexagon(2, 255.0, (720.0, 720.0))
    image = expose(draw((1440, 1440), truth, 66.0, 2.0, 120, 30), 2.0, np.random.default_rng(12))
    with pytest.raises(NoPins, match=r"radius.*smaller image"):
        take_rest([image])


def test_a_pin_that_half_of_the_images_show_is_taken_though_their_mean_lacks_it() -> None:
    rng = np.random.default_rng(41)
    truth = hexagon(4, 30.0, (160.0, 160.0))
    clean = draw((320, 320), truth, 6.0, 0.9, 110.0, 30.0)
    rest = take_rest([expose(clean, 1.0, rng) for _ in range(4)])
    greys = [expose(clean, 1.0, rng) for _ in range(4)]
    lacking = Pins(*(getattr(rest.pins, f.name)[5:] for f in fields(Pins)))
    pattern, pins = with_voted(greys, replace(rest.pattern, count=len(lacking)), lacking)
    assert pattern.count == len(pins) == len(truth)
    assert missed_and_false(pins, truth, 0.3) == (0, 0)
    others = truth[np.hypot(*(truth - rest.xy_img[0]).T) > 1.0]
    without = [expose(draw((320, 320), others, 6.0, 0.9, 110.0, 30.0), 1.0, rng) for _ in range(3)]
    assert len(with_voted([greys[0], *without], rest.pattern, lacking)[1]) == len(truth) - 1


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2])
def test_pins_on_one_line_are_refused(angle: float) -> None:
    along = np.array([np.cos(angle), np.sin(angle)])
    truth = 240.0 + 28.0 * (np.arange(14.0)[:, None] - 6.5) * along
    clean = draw((480, 480), truth, 6.0, 0.9, 120.0, 40.0)
    with pytest.raises(NoPins, match="14 pins are found, all on one line"):
        take_rest([expose(clean, 2.0, np.random.default_rng(3))])


@pytest.mark.parametrize(("away_px", "every"), [(6.0, 4), (8.0, 4), (4.6, 1), (6.0, 1), (7.0, 1)])
def test_a_marker_with_a_ghost_is_one_pin(away_px: float, every: int) -> None:
    """The lobes of some markers are spots of their own; or of all."""
    rng = np.random.default_rng(17)
    truth = hexagon(6, 20.0, (160.0, 160.0))
    ghosts = draw((320, 320), truth[::every] + np.array([away_px, 1.0]), 2.6, 0.7, 90.0, 0.0)
    clean = draw((320, 320), truth, 2.8, 0.7, 110.0, 30.0) + ghosts
    rest = take_rest([expose(clean, 1.0, rng) for _ in range(4)])
    assert len(rest) == rest.pattern.count == len(truth)
    assert rest.pattern.pitch_px == pytest.approx(20.0, rel=0.02)
    starts = rest.xy_img + rng.uniform(-2, 2, rest.xy_img.shape)
    later = CentroidRefiner(rest).refine(expose(clean, 1.0, rng), starts)
    assert np.hypot(*(later.xy_img - rest.xy_img).T).max() < 0.5  # no pin jumps to its other lobe


@pytest.mark.parametrize(("spokes", "ratio", "most_px"), [(18, 0.82, 7.0), (22, 0.86, 8.0), (14, 0.8, 11.0)])
def test_pins_of_any_size_along_a_tube_are_found(spokes: int, ratio: float, most_px: float) -> None:
    """From ring to ring inwards their size, distance and brightness fall by one ratio; two rings are half."""
    rng = np.random.default_rng(8)
    rings = [radius for radius in most_px * ratio ** np.arange(20) if radius > 2.2]
    spoke = np.exp(1j * (2 * np.pi * np.arange(spokes) / spokes + 0.1)).view(np.float64).reshape(-1, 2)
    truth, clean = [], np.full((480, 640), 50.0)
    for k, radius in enumerate(rings):
        at = 200.0 * radius / most_px * spoke[(k not in {3, 4}) | (spoke[:, 0] > 0.0)]
        truth.append(at + rng.uniform(-0.5, 0.5, at.shape) + np.array([320.0, 240.0]))
        clean += draw((640, 480), truth[-1], radius, 0.8, 60.0 + 5.0 * radius, 0.0)
    pins = take_rest([expose(clean, 2.0, rng)]).pins
    assert np.ptp(np.log(pins.radius_px)) > np.log(2.5)
    missed, false = missed_and_false(pins, np.concatenate(truth), 1.0)
    assert missed <= 0.05 * len(pins)
    assert false == 0


def test_pins_of_one_size_are_judged_without_a_trend() -> None:
    truth = hexagon(6, 24.0, (220.0, 220.0))
    rng = np.random.default_rng(9)
    radius, depth = np.exp(rng.normal(np.log(6.0), 0.1, len(truth))), rng.normal(90.0, 5.0, len(truth))
    assert not trend_of(truth, radius, depth, 6.0).explains
    steep = radius * np.exp(0.004 * (truth[:, 0] - 220.0))
    trend = trend_of(truth, steep, depth, 6.0)
    assert trend.explains
    assert np.log(trend.at(truth)[0]) == pytest.approx(0.004 * (truth[:, 0] - 220.0), abs=0.08)
