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


def test_a_run_is_differentiated_where_it_ends():
    scene = ds.load("chaplygin_sleigh")
    run = scene.run(method="type1/gl:2", step=0.1, until=2.0)
    found = run.jacobian(["a", "m"])
    reference = scene.integrator(method="type1/gl:2", step=0.1, until=2.0).jacobian(20, ["a", "m"])
    for name in "qvp":
        assert np.array_equal(getattr(found, name), getattr(reference, name))
    pushed = run.jvp(q=[1.0, 0.0, 0.2], v={"th": 2.0}, parameters={"a": -1.0})
    weights = {"q": np.array([0.5, 1.0, -1.0]), "p": np.array([0.0, 2.0, 1.0])}
    pulled = run.vjp(**weights, parameters=["a"])
    there = weights["q"] @ pushed["q"] + weights["p"] @ pushed["p"]
    back = pulled.q @ [1.0, 0.0, 0.2] + 2.0 * pulled.v[2] - pulled.parameters["a"]
    assert there == pytest.approx(back, abs=1e-11)  # (y, J x) = (Jᵀ y, x)
    square = run.gradient(lambda end: {"q": 2 * end.q}, ["a"])
    assert square.parameters["a"] == pytest.approx(2 * run.q[-1] @ found.q[:, 6], abs=1e-11)


def test_the_gradient_of_a_run_of_an_error_and_of_steps(spring):
    searched = spring.run(error=1e-8, adaptive=False, until=2.0)
    for run in (searched, spring.run(steps=20, step=0.1), spring.run(until=2.0)):
        slope = run.gradient({"q": [1.0]}, ["k"])
        assert slope.q[0] == pytest.approx(np.cos(2.0), abs=1e-6) and slope.v[0] == pytest.approx(np.sin(2.0), abs=1e-6)
        assert slope.parameters["k"] == pytest.approx(-np.sin(2.0), abs=1e-6)  # x = cos(√k t)


def test_runs_that_cannot_be_differentiated_say_so(spring):
    for run in (spring.run(adaptive=True), spring.run(at=[0.05, 1.0])):
        with pytest.raises(ds.Misuse, match="fixed size"):
            run.gradient({"q": [1.0]})
    with pytest.raises(ds.Misuse, match="no coordinate 'y'"):
        spring.run(steps=3).jvp(q={"y": 1.0})
    with pytest.raises(ds.Misuse, match="no parameter 'm'"):
        spring.run(steps=3).vjp(q=[1.0], parameters=["m"])


@pytest.mark.parametrize("scene, parameters, method, options", [
    ("pleiades", [], "type1/gl:4", {}),
    ("toda_200", [], "type1/gl:3", {}),  # sparse
    ("kepler_e06", [], "type1/gl:3", {}),
    ("chaplygin_sleigh", ["m", "a"], "type1/gl:3", {}),
    ("pendulum_cartesian", [], "type1/gl:4", {}),
    ("lc_circuit", [], "type1/gl:2", {}),
    ("ida_slider_crank", [], "type1/gl:3", {}),
    ("stiff_spring_pendulum", [], "type1/gl:3", {}),
    ("kepler_e06", [], "type1/trapezoidal", {"order": 4}),
    ("kepler_e06", [], "type1/midpoint", {}),
    ("kepler_e06", [], "type1/left", {}),
    ("double_pendulum", ["g"], "type1/trapezoidal", {}),
    ("double_pendulum", ["g"], "type2/euler", {}),
    ("double_pendulum", ["g"], "type3/euler", {"order": 2}),
    ("double_pendulum", [], "type4/legendre(type1/left)", {}),
    ("chaplygin_sleigh", ["m", "a"], "type1/midpoint", {}),
    ("kepler_e06", [], "damped/radau:3", {}),
])
def test_the_way_back_is_the_transpose_of_the_way_forward(scene, parameters, method, options):
    check_the_way_back(ds.load(scene), parameters, method, options)


@pytest.mark.parametrize("method", ["type1/gl:2", "type1/gl:4", "type1/trapezoidal", "damped/radau:2"])
def test_the_way_back_with_a_force_and_velocities_beside_positions(method):
    def lagrangian(q, v, k):
        near = sum((q[i + 1] - q[i])**2 for i in range(11))
        return v @ v / 2 - k * near / 2 - q[0]**4 + sum(q[i + 1] * q[i]**2 * v[i] for i in range(11)) / 5 + v[0]**2 * q[1]**2 / 9

    chain = ds.Scene([f"x{i}" for i in range(12)], lagrangian, parameters={"k": 2.0, "d": 0.3},
                     force=lambda q, v, d: [-d * v[i] * (1 + q[i]**2) for i in range(12)],
                     q=[0.1 * i for i in range(12)], v=[0.3 - 0.1 * i for i in range(12)], step=0.25)
    check_the_way_back(chain, ["k", "d"], method, {})


def check_the_way_back(scene, parameters, method, options):
    random = np.random.default_rng(3)
    n = len(scene.coordinates)
    weights = {name: random.standard_normal(n) for name in "qp"}
    options = {"method": method, "step": scene.step / 5, **options}
    forward = scene.integrator(**options).jacobian(6, parameters)
    back = scene.integrator(**options).gradient(6, weights, parameters)
    expected = weights["q"] @ forward.q + weights["p"] @ forward.p
    found = np.concatenate([back.q, back.v, list(back.parameters.values())])
    assert np.abs(found - expected).max() <= 1e-11 * max(1.0, np.abs(expected).max())
