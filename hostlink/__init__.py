"""Decoder for voronoi-touch fingertips: bytes or CAN frames in, samples out."""
