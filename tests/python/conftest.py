import os

import pytest

os.environ.setdefault("MPLBACKEND", "Agg")

import diracstep as ds  # noqa: E402

# The tests want none of these warnings where they do not ask for them.
WARNINGS = (ds.Doubt, ds.Interrupted, ds.CallbackCost)


@pytest.fixture(autouse=True)
def no_unexpected_warning(recwarn):
    yield
    unexpected = [str(seen.message) for seen in recwarn if issubclass(seen.category, WARNINGS)]
    assert not unexpected


@pytest.fixture
def spring():
    return ds.Scene(["x"], lambda q, v, k: v.x**2 / 2 - k * q.x**2 / 2, parameters={"k": 1.0}, q=[1.0], until=6.0, step=0.1,
                    name="spring", invariants={"total": lambda q, v, k: v.x**2 / 2 + k * q.x**2 / 2})


@pytest.fixture
def skate():
    return ds.load("knife_edge")


@pytest.fixture
def plugin():
    return os.environ["DIRACSTEP_TEST_PLUGINS"] + "/galerkin.so"
