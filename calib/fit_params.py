"""The parameters of the fit. Evidence: docs/tuning.md, "Fit of a calibration"."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FitParams:
    """Assumptions and requirements of a fit."""

    rows_min: int = 12  # frames: with fewer a model cannot be distinguished from chance
    process_rows_min: int = 24  # frames: a process has a weight for each of 25 inputs
    known_rows_min: int = 6  # frames: with another tip's model few numbers are left to find
    rows_per_term: float = 1.5  # frames for each term: more terms would fit noise, ridge or not
    variation_min: float = 1e-3  # of a column, in its unit: below it the value was not varied
    roundness_min: float = 0.1  # smaller over larger variance of x and y: below it, one direction was tried
    explained_min: float = 0.1  # share of the held-out variance that a model must explain
    worse_max: float = 0.1  # of the best's mean square error: what a model that is as good may err more
    pin_noise: float = 0.003  # pitches: error of a pin's place in use, of each coordinate
    noise_draws: int = 4  # of that noise, for each frame
    folds: int = 10  # of the cross-validation
    knots: int = 12  # of the displacement curve
    spread_rows: int = 8  # directions of largest uncertainty that the file keeps


PARAMS = FitParams()
