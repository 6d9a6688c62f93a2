import numpy as np
import pytest

from dvca_sumo.geometry import randomness
from dvca_sumo.geometry.randomness import key_of, normals, uniforms

WORD = 2**64 - 1
KEYS = np.arange(20_000)


def test_the_same_key_gives_the_same_draws_also_in_other_company() -> None:
    together = uniforms(7, 3, 11, [5, 6, 7], 4)
    np.testing.assert_array_equal(uniforms(7, 3, 11, [6], 4)[0], together[1])
    np.testing.assert_array_equal(uniforms(7, 3, 11, [7, 5], 4), together[[2, 0]])
    np.testing.assert_array_equal(normals(7, 3, 11, [6], 4)[0], normals(7, 3, 11, [5, 6, 7], 4)[1])


def test_more_draws_of_a_key_begin_with_the_same_ones() -> None:
    np.testing.assert_array_equal(uniforms(7, 3, 11, [5], 9)[:, :4], uniforms(7, 3, 11, [5], 4))


def test_draws_are_the_same_on_every_machine() -> None:
    assert uniforms(42, 1, 2, [3], 2)[0].tolist() == [0.5543828504727022, 0.6288823390205138]


@pytest.mark.parametrize("other", [(8, 3, 11, 5), (7, 4, 11, 5), (7, 3, 12, 5), (7, 3, 11, 6)])
def test_any_other_part_of_the_key_gives_other_draws(other: tuple[int, int, int, int]) -> None:
    seed, stream, index, key = other
    assert not np.isin(uniforms(seed, stream, index, [key], 8), uniforms(7, 3, 11, [5], 8)).any()


def test_the_largest_draw_is_less_than_one() -> None:
    """As the middle of the last of 2^53 steps it would be rounded up."""
    root = randomness._mixed(7)
    for part in (3, 11):
        root = randomness._mixed((root + randomness._GOLDEN & WORD) ^ part)
    row = unmixed(unmixed(WORD) - randomness._GOLDEN & WORD)  # whose first draw has all bits
    key = row ^ (root + randomness._GOLDEN & WORD)
    assert uniforms(7, 3, 11, [key], 1)[0].tolist() == [1.0 - 2.0**-53]
    assert normals(7, 3, 11, [key], 2).all()


def unmixed(word: int) -> int:
    """What SplitMix64's finalizer makes this word of."""
    word ^= word >> 31 ^ word >> 62
    word = word * pow(0x94D049BB133111EB, -1, 2**64) & WORD
    word ^= word >> 27 ^ word >> 54
    word = word * pow(0xBF58476D1CE4E5B9, -1, 2**64) & WORD
    return word ^ word >> 30 ^ word >> 60


def test_uniform_draws_fill_the_open_unit_interval_evenly() -> None:
    draws = uniforms(1, 2, 3, KEYS, 5)
    assert draws.shape == (20_000, 5)
    assert draws.min() > 0.0
    assert draws.max() < 1.0
    counts, _ = np.histogram(draws, bins=20, range=(0.0, 1.0))
    expected = draws.size / 20
    assert ((counts - expected) ** 2 / expected).sum() < 45.3  # chi-squared, 19 degrees of freedom, 99.9 %


@pytest.mark.parametrize("count", [1, 2, 5])
def test_normal_draws_have_normal_moments(count: int) -> None:
    draws = normals(1, 2, 3, KEYS, count)
    assert draws.shape == (20_000, count)
    error = 1.0 / np.sqrt(draws.size)
    assert abs(draws.mean()) < 4.0 * error
    assert abs(draws.var() - 1.0) < 4.0 * np.sqrt(2.0) * error
    assert abs((draws**3).mean()) < 4.0 * np.sqrt(15.0) * error
    assert abs((draws**4).mean() - 3.0) < 4.0 * np.sqrt(96.0) * error


def test_draws_of_neighbouring_keys_indices_streams_and_seeds_are_uncorrelated() -> None:
    base = normals(1, 2, 3, KEYS, 4)
    limit = 4.0 / np.sqrt(len(KEYS))
    for neighbour in (normals(1, 2, 3, KEYS + 1, 4), normals(1, 2, 4, KEYS, 4), normals(1, 3, 3, KEYS, 4)):
        assert np.abs(np.corrcoef(base.T, neighbour.T)[:4, 4:]).max() < limit
    within = np.corrcoef(base.T) - np.eye(4)
    assert np.abs(within).max() < limit


def test_draws_of_one_object_over_time_are_uncorrelated() -> None:
    over_time = np.array([normals(1, 2, index, [5], 1)[0, 0] for index in range(4000)])
    assert abs(np.corrcoef(over_time[1:], over_time[:-1])[0, 1]) < 4.0 / np.sqrt(4000)


def test_names_have_stable_keys_of_their_own() -> None:
    assert key_of("person:ped") == 1984973771
    names = [f"flow.{number}" for number in range(2000)]
    assert len({key_of(name) for name in names}) == len(names)


def test_seed_and_stream_do_not_change_places() -> None:
    assert uniforms(7, 3, 0, [1], 1) != uniforms(3, 7, 0, [1], 1)
