"""Starts, equilibria and parameters from data."""

from pathlib import Path

import numpy as np
import pytest

import diracstep as ds


def test_an_equilibrium_and_its_eigenvalues(spring):
    found = spring.with_parameters(k=4.0).equilibrium()
    assert found.q == pytest.approx([0.0], abs=1e-12) and not found.v.any()
    assert found.eigenvalues == pytest.approx([2.0j]) and found.modes == pytest.approx(np.ones((1, 1)))
    assert (found.mass, found.stiffness) == (pytest.approx(np.eye(1)), pytest.approx(4.0 * np.eye(1)))
    chain = ds.load("hanging_chain", N=3).equilibrium()
    assert chain.q[1::2] == pytest.approx(-np.arange(1, 4) / 3, abs=1e-10) and chain.lambda_.shape == (3,)
    assert chain.positions.shape == (6, 3) and chain.mass.shape == (3, 3) and chain.drift.shape == (6, 3)
    with pytest.raises(ds.Failure, match="no equilibrium"):
        ds.load("knife_edge").equilibrium()
    with pytest.raises(ds.Misuse, match="modes is 0"):
        spring.equilibrium(modes=0)
    with pytest.raises(ds.Misuse, match="along"):
        spring.equilibrium(along=1)


def test_directions_of_a_family():
    """A particle in a round valley: it rests anywhere on the circle."""
    found = ds.Scene(["x", "y"], lambda q, v: v @ v / 2 - (q @ q - 1) ** 2 / 4, q=[0.9, 0.0]).equilibrium()
    assert found.zeros == 2 and found.eigenvalues.imag == pytest.approx([np.sqrt(2.0)])
    assert found.free_directions == pytest.approx(np.array([[0.0, 1.0]]), abs=1e-9)


def test_rows_that_depend_on_their_surface_alone():
    """A pendulum on two rows for one circle, from where Newton's path ends: the search crashed."""
    found = ds.Scene(["x", "y"], lambda q, v: v @ v / 2 - 9.81 * q.y, rows=lambda q: [q @ q - 1, (q @ q - 1) * (2 + q.x)],
                     q=[1.0, 0.0]).equilibrium()
    assert found.q == pytest.approx([0.0, -1.0], abs=1e-9) and found.eigenvalues.imag == pytest.approx([np.sqrt(9.81)])
    assert found.lambda_ @ [1, 2] == pytest.approx(-9.81 / 2)  # the least that holds the weight: along (1, 2)
    bricard = ds.load(Path(__file__).parents[2] / "examples" / "scenes" / "bricard.toml").equilibrium()
    assert np.sin(bricard.q[::2]) == pytest.approx(np.ones(3)) and len(bricard.lambda_) == 5


def test_modes_of_several_coordinates_stand_in_rows():
    """Two unit masses between three springs: 1 and sqrt(3), in step and against each other."""
    found = ds.Scene(["x", "y"], lambda q, v: v @ v / 2 - (q.x**2 + (q.y - q.x)**2 + q.y**2) / 2, q=[0.1, 0.0]).equilibrium()
    assert sorted(found.eigenvalues.imag) == pytest.approx([1.0, np.sqrt(3.0)])
    order = np.argsort(found.eigenvalues.imag)
    assert found.modes[order] == pytest.approx(np.array([[1, 1], [1, -1]]) * np.sign(found.modes[order][:, :1].real), abs=1e-12)


def test_an_equilibrium_of_python_functions():
    with pytest.warns(ds.CallbackCost):
        scene = ds.Scene(["x"], lambda q, v: v[0] ** 2 / 2 - (q[0] - 1) ** 2, q=[0.5], callback=True)
    found = scene.equilibrium()
    assert found.q == pytest.approx([1.0], abs=1e-8) and found.eigenvalues == pytest.approx([np.sqrt(2) * 1j], abs=1e-5)


def test_what_changes_with_the_time_is_doubted():
    scene = ds.Scene(["x"], lambda q, v, t: v.x**2 / 2 - (1 + t) * q.x**2 / 2)
    with pytest.warns(ds.Doubt, match="change by"):
        assert "with the time" in scene.equilibrium().doubt


def test_the_start_that_runs_take(skate):
    start = skate.start()
    assert np.array_equal(start.q, skate.start_q) and np.array_equal(start.v, skate.start_v)
    assert start.acceleration[0] == pytest.approx(skate.parameters["g_sin_alpha"]) and start.origin["v_ph"] == "given"
    assert np.isnan(ds.load("lotka_volterra_2d").start().acceleration).all()  # L is linear in v
    guessed = ds.parse('name = "rod"\nlagrangian = "(v_x^2 + v_y^2)/2 - y"\n[coordinates]\nx = {}\ny = {}\n[[rows]]\nname = "rod"\n'
                       'equation = "x^2 + y^2 = 1"\n[start]\nx = 0.6\ny = -0.7\nguess = ["y"]\n[span]\nend = 1\nstep = 0.1\n').start()
    assert guessed.q == pytest.approx([0.6, -0.8]) and guessed.origin["y"] == "guess" and guessed.stated["y"] == -0.7


def test_a_fit_finds_planted_parameters(spring, tmp_path):
    run = spring.with_parameters(k=2.5).run(step=0.1)
    noise = np.random.default_rng(1).normal(0.0, 1e-3, len(run))
    data = {"t": run.t, "x": np.where(np.arange(len(run)) % 7 == 3, np.nan, run["x"] + noise), "v_x": run["v_x"]}
    found = spring.fit(data, ["k"], start={"k": 2.0}, sigma={"x": 1e-3, "v_x": 1e-3})
    assert abs(found.parameters["k"] - 2.5) < 2 * found.intervals["k"] < 1e-2 and found.scene.parameters == found.parameters
    assert found.covariance.shape == (1, 1)
    file = tmp_path / "data.csv"
    file.write_text("t,x\n" + "\n".join(f"{t!r},{x!r}" for t, x in zip(run.t.tolist(), run["x"].tolist())))
    assert spring.fit(file, ["k"]).parameters["k"] == pytest.approx(2.5, abs=1e-6)
    with pytest.warns(ds.Doubt, match="sigma"):
        spring.fit({"t": run.t, "x": run["x"] + 0.1}, ["k"], start={"k": 2.0}, sigma={"x": 1e-3})


@pytest.mark.parametrize("data, changes, words", [
    ({"x": [1.0]}, {}, "'t'"), ({"t": [1.0, 2.0], "x": [1.0]}, {}, "one length"), ({"t": [1.0], "x": ["1"]}, {}, "real numbers"),
    ({"t": [1.0], "x": [np.inf]}, {}, "infinite"), ({"t": [np.nan], "x": [1.0]}, {}, "its time"), (3, {}, "the path of a file"),
    ({"t": [1.0], "z": [1.0]}, {}, "'z' is no coordinate"), ({"t": [1.0]}, {}, "no column"), ("none.csv", {}, "none.csv"),
    ({"t": [1.0], "x": [1.0]}, {"parameters": ["m"]}, "'m'"), ({"t": [1.0], "x": [1.0]}, {"parameters": []}, "no parameter"),
    ({"t": [1.0], "x": [1.0]}, {"parameters": "k"}, "a list of texts"), ({"t": [1.0], "x": [1.0]}, {"start": {"m": 1.0}}, "'m'"),
    ({"t": [1.0], "x": [1.0]}, {"sigma": {"y": 1.0}}, "sigma: 'y'"), ({"t": [1.0], "x": [1.0]}, {"confidence": 95}, "confidence"),
    ({"t": [1.0, 2.0], "x": [1.0, 2.0]}, {"adaptive": True}, "one size"), ({"t": [1.0], "x": [1.0]}, {"colour": 1}, "'colour'"),
])
def test_what_cannot_be_fitted_is_refused_with_the_reason(spring, data, changes, words):
    with pytest.raises(ds.Misuse, match=words):
        spring.fit(data, **{"parameters": ["k"], **changes})


def test_a_fit_of_a_scene_that_is_no_file_is_refused(plugin):
    with pytest.warns(ds.CallbackCost):
        scene = ds.Scene(["x"], lambda q, v: v[0] ** 2 / 2, callback=True)
    with pytest.raises(ds.Misuse, match="not from a file"):
        scene.fit({"t": [1.0], "x": [1.0]}, ["k"])
