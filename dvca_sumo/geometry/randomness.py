"""Keyed random draws: the value depends on the key alone, never on how many draws came before.

A counterfactual run must differ from the factual one by its cause alone. With a running stream, one
skipped draw shifts every later one; with keyed draws nothing shifts. The mixing function is the
finalizer of SplitMix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators, 2014),
vectorised over keys: re-keying numpy's Philox costs as much for one object as this for all of them.
"""

import zlib

import numpy as np
import numpy.typing as npt

Words = npt.NDArray[np.uint64]

_GOLDEN = 0x9E3779B97F4A7C15
_WORD = 0xFFFFFFFFFFFFFFFF
_LARGEST = 1.0 - 2.0**-53  # the middle of the last of 2^53 steps itself would be rounded to 1


def _mix(words: Words) -> Words:
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return words ^ (words >> np.uint64(31))


def _mixed(word: int) -> int:
    word = ((word ^ (word >> 30)) * 0xBF58476D1CE4E5B9) & _WORD
    word = ((word ^ (word >> 27)) * 0x94D049BB133111EB) & _WORD
    return word ^ (word >> 31)


def key_of(name: str) -> int:
    """A stable 32-bit key of a name (an object id, a stream's purpose)."""
    return zlib.crc32(name.encode())


def uniforms(seed: int, stream: int, index: int, keys: npt.ArrayLike, count: int) -> npt.NDArray[np.float64]:
    """Draws in the open interval (0, 1), shape (len(keys), count).

    Row k depends on (seed, stream, index, keys[k]) alone.
    """
    root = _mixed(seed & _WORD)  # or seed and stream could change places
    for part in (stream, index):
        root = _mixed(((root + _GOLDEN) & _WORD) ^ (part & _WORD))
    rows = _mix(np.uint64((root + _GOLDEN) & _WORD) ^ np.atleast_1d(np.asarray(keys, dtype=np.uint64)))
    words = _mix(rows[:, None] + np.arange(1, count + 1, dtype=np.uint64) * np.uint64(_GOLDEN))
    return np.minimum(((words >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53, _LARGEST)


def normals(seed: int, stream: int, index: int, keys: npt.ArrayLike, count: int) -> npt.NDArray[np.float64]:
    """Standard normal draws, shape (len(keys), count), keyed as in `uniforms` (Box-Muller)."""
    half = (count + 1) // 2
    draws = uniforms(seed, stream, index, keys, 2 * half)
    radius = np.sqrt(-2.0 * np.log(draws[:, :half]))
    angle = 2.0 * np.pi * draws[:, half:]
    return np.concatenate([radius * np.cos(angle), radius * np.sin(angle)], axis=1)[:, :count]
