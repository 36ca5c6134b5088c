"""The fingertip's own computer: camera frames in, tactile features out on a bus."""
