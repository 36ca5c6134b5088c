"""Golden frames: the encoding of samples, for every implementation of the other end.

`frames.json` holds samples with their 64-byte frame, classic parts, serial bytes and detail segments.
It changes only with the wire's version: `python -m tests.vectors` writes it anew.
"""
