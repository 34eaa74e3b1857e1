"""Vectors of eight numbers: compiled kernels compute what Python does, and write nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numba.core.errors import TypingError

from grebe.core.eights import WIDTH, eight, loaded, stored
from grebe.core.kernels import machine_code

NUMBERS = st.floats(-1e3, 1e3)
TABLES = arrays(np.float64, (3, WIDTH + 2), elements=NUMBERS)


def _mixed(rows, weight, out):
    """Apply every operation once, between two columns that stay unchanged."""
    one, other = loaded(rows, 0, 0), loaded(rows, 2, 2)
    unit = eight(1.0, 0.0, 0.0, weight, 0.0, 0.0, 0.0, 8.0)
    stored(weight * one + other - 2.0 * unit, out, 1, 1)


_compiled = machine_code(_mixed)


@given(TABLES, NUMBERS)
def test_compiled_and_interpreted_agree(rows, weight):
    out, other = np.full((3, WIDTH + 2), 7.0), np.full((3, WIDTH + 2), 7.0)
    _compiled(rows, weight, out)
    _mixed(rows, weight, other)
    assert out == pytest.approx(other, rel=1e-12, abs=1e-8)
    expected = weight * rows[0, :WIDTH] + rows[2, 2:]
    expected -= 2.0 * np.array([1.0, 0, 0, weight, 0, 0, 0, 8.0])
    assert out[1, 1:-1] == pytest.approx(expected, rel=1e-12, abs=1e-8)


def test_nothing_beside_the_row_is_written():
    out = np.full((3, WIDTH + 2), 7.0)
    _compiled(np.ones((3, WIDTH + 2)), 1.0, out)
    assert (out[[0, 2]] == 7.0).all()
    assert (out[1, [0, -1]] == 7.0).all()


def test_rows_of_a_view_are_read_where_they_lie():
    """A stage's rows are a view into the arrays of all stages."""
    stages = np.arange(4.0 * 3 * (WIDTH + 2)).reshape(4, 3, WIDTH + 2)
    out = np.zeros((3, WIDTH + 2))
    _compiled(stages[2], 1.0, out)
    assert out[1, 2] == stages[2, 0, 1] + stages[2, 2, 3]


READ_ONLY = np.ones((3, WIDTH + 2))
READ_ONLY.flags.writeable = False


@pytest.mark.parametrize(
    ("rows", "out"),
    [
        (np.ones((WIDTH + 2, 3)).T, np.ones((3, WIDTH + 2))),
        (np.ones((3, WIDTH + 2), dtype=np.float32), np.ones((3, WIDTH + 2))),
        (np.ones((3, WIDTH + 2), dtype=np.int64), np.ones((3, WIDTH + 2))),
        (np.ones((3, WIDTH + 2)), READ_ONLY),
    ],
    ids=["columns", "singles", "integers", "read-only"],
)
def test_what_is_no_table_of_doubles_in_rows_is_refused(rows, out):
    with pytest.raises(TypingError):
        _compiled(rows, 1.0, out)
