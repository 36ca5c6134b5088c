"""Methods of `edge` in plain NumPy, readable and slow: oracles."""
