"""Methods of `edge` in plain NumPy, written for reading, slow: oracles."""
