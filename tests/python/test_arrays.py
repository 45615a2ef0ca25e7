"""Arrays of every kind: those that hold the numbers needed are taken, wherever they lie in memory; all others are Misuse."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

import diracstep as ds

DTYPES = st.one_of(arrays_of.floating_dtypes(), arrays_of.integer_dtypes(), arrays_of.boolean_dtypes(), arrays_of.complex_number_dtypes(),
                   arrays_of.unicode_string_dtypes(max_len=3), st.just(np.dtype(object)))
ARRAYS = DTYPES.flatmap(lambda dtype: arrays_of.arrays(
    dtype, st.one_of(st.just((2,)), arrays_of.array_shapes(max_dims=3, max_side=3, min_side=0)),
    **({"elements": st.integers(-3, 3)} if dtype.kind == "O" else {})))
LAYOUTS = st.sampled_from(["as it is", "reversed", "strided", "Fortran", "read-only"])


def laid_out(array, layout):
    if layout == "reversed":
        return array[::-1].copy()[::-1]
    if layout == "strided":
        wide = np.zeros((*array.shape[:-1], 2 * array.shape[-1]), dtype=array.dtype)
        wide[..., ::2] = array
        return wide[..., ::2]
    if layout == "Fortran":
        return np.asfortranarray(array)
    array = array.copy()
    array.flags.writeable = layout != "read-only"
    return array


def fits(array, shape):
    return (array.shape == shape and array.dtype.kind in "fiub" and array.dtype.itemsize <= 8
            and bool(np.isfinite(array.astype(float)).all()))


@pytest.fixture(scope="module")
def free():
    return ds.Scene(["x", "y"], lambda v: v @ v / 2, until=1.0, step=0.5)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(array=ARRAYS, layout=LAYOUTS)
def test_a_start_is_taken_or_refused(free, array, layout):
    given_array = laid_out(array, layout)
    before = given_array.copy()
    integrator = free.integrator()
    if fits(array, (2,)):
        integrator.reset(q=given_array, v=[0, 0])
        assert np.array_equal(integrator.state().q, array.astype(float))
    else:
        with pytest.raises(ds.Misuse, match="^q"):
            integrator.reset(q=given_array, v=[0, 0])
    assert np.array_equal(given_array, before) or not np.array_equal(before, before)  # NaN


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(array=ARRAYS, layout=LAYOUTS)
def test_starts_of_an_ensemble_are_taken_or_refused(free, array, layout):
    given_array = laid_out(array, layout)
    if fits(array, (len(array), 2)) and np.abs(array.astype(float)).max(initial=0.0) < 1e100:
        assert np.array_equal(free.ensemble(given_array, steps=1).q, array.astype(float))
    elif not fits(array, (len(array), 2)):
        with pytest.raises(ds.Misuse, match="^q"):
            free.ensemble(given_array, steps=1)
