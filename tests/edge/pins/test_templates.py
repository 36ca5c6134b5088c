"""Templates of a pin: what is kept of them, and that a table with wrong spans is refused."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from edge.pins.centroids import CentroidKernel
from edge.pins.params import PARAMS
from edge.pins.templates import PHASES, TemplateSet, templates_of
from edge.types import Index
from tests.support.refusals import refused

pytestmark = pytest.mark.kernels

RADII = (3.0, 5.5, 9.0)
LIMITS = {
    "steps_max": PARAMS.steps_max, "near_phases": PARAMS.near_phases,
    "share_min": PARAMS.pin_share_min,
    "reach_px": 10.0, "clash_px": 4.0, "noise": 1.0, "spare_bits": 0.0,
}  # fmt: skip


def kernel(templates: TemplateSet) -> CentroidKernel:
    return CentroidKernel(templates, np.zeros(1, np.int32), np.ones(1), LIMITS)


def planes(made: TemplateSet, kind: int) -> tuple[NDArray[np.int16], NDArray[np.int8]]:
    """d, tx, ty of each phase of a kind, (16, 3, plane), and its u, v."""
    plane, first, first_uv = made.plane[kind], made.first[kind], made.first_uv[kind]
    values = made.values[first : first + 3 * plane * PHASES**2].reshape(-1, 3, plane)
    return values, made.uv[first_uv : first_uv + 2 * plane].reshape(2, plane)


@pytest.mark.parametrize("kind", range(len(RADII)))
def test_the_support_is_a_circle_kept_row_after_row(kind: int) -> None:
    made = templates_of(RADII, 0.9, 24.0)
    spans = made.spans[kind]
    u = np.concatenate([np.arange(n) + column for column, _, n in spans])
    v = np.concatenate([np.full(n, row) for _, row, n in spans])
    values, uv = planes(made, kind)
    np.testing.assert_array_equal(uv[:, : len(u)], [u, v])
    assert not uv[:, len(u) :].any()
    assert not values[:, :, len(u) :].any()
    support2 = (u**2 + v**2).max()
    side = np.arange(-made.half[kind], made.half[kind] + 1)
    assert len(u) == np.count_nonzero(side[:, None] ** 2 + side**2 <= support2)


@pytest.mark.parametrize("kind", range(len(RADII)))
def test_a_level_that_all_pixels_share_changes_no_sum(kind: int) -> None:
    made = templates_of(RADII, 0.9, 20.0)
    values, uv = planes(made, kind)
    assert not values.astype(np.int64).sum(axis=2).any()
    assert not uv.astype(np.int64).sum(axis=1).any()


def with_spans(made: TemplateSet, spans: Index) -> TemplateSet:
    return replace(made, spans=(spans, *made.spans[1:]))


def test_spans_beyond_their_window_are_refused() -> None:
    made = templates_of(RADII, 0.9, 24.0)
    kernel(made)
    spans, half = made.spans[0], made.half[0]
    long, left, down, gap = (spans.copy() for _ in range(4))
    long[0, 2] = 2 * half + 2
    left[0, 0] = -half - 1
    down[:, 1] += half
    gap[-1, 1] += 1
    for bad in (long, left, down, gap):
        refused("spans of a template", kernel, with_spans(made, bad.astype(np.int32)))
    refused("too short", kernel, replace(made, plane=(made.plane[0] - 32, *made.plane[1:])))
