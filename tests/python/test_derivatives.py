"""Derivatives of a motion: Integrator.jacobian and Integrator.gradient."""

import numpy as np
import pytest

import diracstep as ds


def test_derivatives_are_those_of_differences():
    def end(a):
        integrator = ds.load("chaplygin_sleigh", a=a).integrator(method="type1/gl:2", step=0.1)
        integrator.step(20)
        return integrator.state()

    found = ds.load("chaplygin_sleigh").integrator(method="type1/gl:2", step=0.1).jacobian(20, ["a"])
    assert found.inputs == ("x(0)", "y(0)", "th(0)", "v_x(0)", "v_y(0)", "v_th(0)", "a")
    assert found.q.shape == (3, 7)
    above, below = end(0.2 + 1e-4), end(0.2 - 1e-4)
    for name in "qvp":
        difference = (getattr(above, name) - getattr(below, name)) / 2e-4
        assert np.allclose(getattr(found, name)[:, 6], difference, atol=1e-6)
    assert np.allclose(found.q[:2, :2], np.eye(2), atol=1e-13)  # the motion does not depend on where it starts


def test_the_gradient_is_the_transpose():
    scene = ds.load("chaplygin_sleigh")
    found = scene.integrator(method="type1/gl:2", step=0.1).jacobian(20, ["m", "a"])
    weights = {"q": np.array([1.0, -2.0, 0.5]), "v": {"th": 3.0}}
    expected = weights["q"] @ found.q + 3.0 * found.v[2]
    given = scene.integrator(method="type1/gl:2", step=0.1).gradient(20, weights, ["m", "a"])
    assert np.allclose(np.concatenate([given.q, given.v, list(given.parameters.values())]), expected, atol=1e-11)

    integrator = scene.integrator(method="type1/gl:2", step=0.1)
    square = integrator.gradient(20, lambda end: {"q": 2.0 * end.q}, ["m"])  # of |q|²
    assert np.isclose(square.parameters["m"], 2.0 * integrator.state().q @ found.q[:, 6], atol=1e-11)


def test_what_cannot_be_differentiated_is_refused():
    scene = ds.load("chaplygin_sleigh")
    with pytest.raises(ds.Misuse, match="no parameter 'mass'"):
        scene.integrator(step=0.1).jacobian(3, ["mass"])
    with pytest.raises(ds.Misuse, match="steps"):
        scene.integrator(step=0.1).jacobian(0)
    with pytest.raises(ZeroDivisionError):
        scene.integrator(step=0.1).gradient(3, lambda end: {"q": 1 // 0})
    with pytest.raises(ds.Misuse, match="pushed"):
        scene.integrator(step=0.1, pushed=True).jacobian(3)
