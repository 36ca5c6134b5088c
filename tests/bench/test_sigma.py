"""The tables of `tests.bench sigma`, on errors whose share within sigma is known."""

import numpy as np

from tests.bench.sigma import DEPTH, SHEAR, whole_table


def test_normal_errors_are_within_sigma_as_often_as_they_should() -> None:
    rng = np.random.default_rng(0)
    n = 3000
    names = (DEPTH, *SHEAR)
    truth = {name: rng.uniform(0.0, 5.0, n) for name in names}
    sigmas = {name: rng.uniform(0.1, 0.5, n) for name in names}
    values = {name: truth[name] + sigmas[name] * rng.normal(size=n) for name in names}
    for row in whole_table(truth, values, sigmas):
        name, one, two, *by, correlation = map(str, row.values())
        assert name in names
        assert abs(float(one) - 68.3) < 4
        assert abs(float(two) - 95.4) < 2
        assert all(abs(float(share) - 68.3) < 7 for share in ", ".join(by).split(", "))
        assert float(correlation) > 0.3
