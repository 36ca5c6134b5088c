from edge.types import Array, Index

def run(
    inputs: Array, terms: Index, weights: Array, spread: Array, scratch: Array
) -> tuple[float, float, float]:
    """Real and imaginary part of the polynomial, and |L psi|^2; complex numbers as pairs."""
