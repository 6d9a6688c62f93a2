"""Results do not depend on how many threads numpy's linear algebra was given."""

import os
import subprocess
import sys

import pytest

PRODUCT = """
values = numpy.random.default_rng(1).normal(size=(600, 2503))
print(hashlib.md5((values[:, :3] @ values[:3]).tobytes()).hexdigest())
"""


@pytest.mark.parametrize("imports", ["import hashlib, numpy, dvca_sumo", "import hashlib, dvca_sumo, numpy"])
def test_products_are_the_same_to_the_last_bit_however_many_threads_are_asked_for(imports: str) -> None:
    alone, several = (_printed(f"{imports}{PRODUCT}", threads) for threads in ("1", "2"))
    assert alone == several


def _printed(program: str, threads: str) -> str:
    """What a program prints that starts with so many threads for linear algebra."""
    done = subprocess.run(  # noqa: S603 our own program
        [sys.executable, "-c", program],
        check=True,
        capture_output=True,
        text=True,
        env=os.environ | {"OPENBLAS_NUM_THREADS": threads},
    )
    return done.stdout
