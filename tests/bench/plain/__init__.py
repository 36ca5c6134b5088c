"""The features of `edge.features` in plain NumPy: the same method, written for reading, slow. The oracle."""

from tests.bench.plain.extract import FeatureExtractor

__all__ = ["FeatureExtractor"]
