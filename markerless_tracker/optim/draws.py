"""Random generators keyed by seed, stamp and stage, independent of all other draws."""

import zlib

import numpy as np


def keyed_generator(seed: int, stamp_ns: int, stage: str) -> np.random.Generator:
    """The generator of one stage of one frame: the same key gives the same draws.

    Skipped frames, retries and thread counts do not matter, since no draw depends on an earlier
    frame's.
    """
    key = [seed & 0xFFFFFFFFFFFFFFFF, stamp_ns & 0xFFFFFFFFFFFFFFFF, zlib.crc32(stage.encode())]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(key)))
