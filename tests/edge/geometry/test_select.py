"""Selection against sorting."""

import numpy as np
import pytest

from edge.geometry.select import kth_smallest

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("n", [1, 2, 3, 10, 331, 2000])
@pytest.mark.parametrize(
    "kind", ["random", "sorted", "reversed", "equal", "few", "signed zeros", "wide", "infinite", "neighbours"]
)
def test_the_kth_smallest_is_that_of_the_sorted_values(n: int, kind: str) -> None:
    rng = np.random.default_rng(n)
    values = {
        "random": rng.normal(size=n),
        "sorted": np.arange(n, dtype=np.float64),
        "reversed": np.arange(n, 0, -1, dtype=np.float64),
        "equal": np.ones(n),
        "few": rng.integers(0, 3, n).astype(np.float64),
        "signed zeros": np.where(rng.random(n) < 0.5, -0.0, 0.0),
        "wide": rng.choice([-1.0, 1.0], n) * np.exp(rng.uniform(-700, 700, n)),
        "infinite": np.where(rng.random(n) < 0.3, np.inf, np.where(rng.random(n) < 0.3, -np.inf, 1.0)),
        "neighbours": np.nextafter(1.0, rng.choice([0.0, 2.0], n)),
    }[kind]
    for k in {0, 1 % n, n // 2, n - 1}:
        assert kth_smallest(values.copy(), k) == np.sort(values)[k]
