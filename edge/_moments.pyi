import numpy as np
from numpy.typing import NDArray

from edge.types import Array

#: Column of the input, knots (m, 2) by rising input, sigma.
Curve = tuple[int, Array, float]
#: Terms (n, longest) as columns of (inputs, conjugates, 1); weights (2 n) and spread (rows, 2 n), complex as
#: pairs; valid (outputs, 2); sigma (outputs,).
Polynomial = tuple[NDArray[np.int32], Array, Array, Array, Array]

class Models:
    """Curves and polynomials of the same complex inputs, evaluated together.

    inputs  how many there are
    models  in the order of their outputs
    Raises  ValueError: arrays that do not belong together, an input that there is not
    """

    def __new__(cls, inputs: int, models: tuple[Curve | Polynomial, ...]) -> Models: ...
    def run(self, inputs: Array, out: Array, /) -> None:
        """Writes value, sigma and whether the model is out of its range (0 or 1), of every output.

        inputs   (rows, 2 k), complex as pairs
        out      (rows, outputs, 3), written
        Raises   ValueError: wrong sizes
        """
