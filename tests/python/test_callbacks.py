"""Python functions that the library calls."""

import numpy as np
import pytest

import diracstep as ds


def skate(**arguments):
    return ds.Scene(["x", "y", "a"], lambda q, v, g: v @ v / 2 + g * q[0], parameters={"g": 0.7},
                    rows=lambda q, v: [v[0] * np.sin(q[2]) - v[1] * np.cos(q[2])], v=[0, 0, 1.0], until=0.3, step=0.1, **arguments)


def moved(scene, method, steps, size):
    """A few steps without the checks of a run, which take some dozens more."""
    integrator = scene.integrator(method=method, step=size)
    integrator.step(steps, size=size)
    return integrator.state()


def test_callbacks_move_as_the_traced_formulas_do():
    with pytest.warns(ds.CallbackCost, match=r"a step takes .* called \d+ times"):
        called = skate(callback=True)
    one, other = moved(called, "type1/gl:2", 5, 0.1), moved(skate(), "type1/gl:2", 5, 0.1)
    assert np.allclose(one.q, other.q, atol=1e-8) and np.allclose(one.lambda_, other.lambda_, atol=1e-6)
    with pytest.raises(ds.Misuse, match="callbacks are fixed"):
        called.with_parameters(g=1.0)


def test_holonomic_rows_and_forces_may_be_callbacks():
    with pytest.warns(ds.CallbackCost):
        pendulum = ds.Scene(["x", "y"], lambda q, v: v @ v / 2 - 9.81 * q[1], rows=lambda q: [q @ q - 1.0], q=[1.0, 0.0],
                            force=lambda v, c: -c * v, parameters={"c": 0.1}, until=0.08, step=0.02, callback=True)
    end = moved(pendulum, "type1/midpoint", 4, 0.02)
    assert abs(np.hypot(*end.q) - 1.0) < 1e-7 and end.energy < -1e-6


def test_an_exception_of_a_callback_is_the_cause_of_the_failure():
    class Mine(Exception):
        pass

    def lagrangian(q, v, t):
        if t > 0.35:
            raise Mine("no further")
        return v @ v / 2

    with pytest.warns(ds.CallbackCost):
        scene = ds.Scene(["x"], lagrangian, v=[1.0], callback=True)
    with pytest.raises(ds.Failure, match="lagrangian.value returned error") as failure:
        scene.run(method="type1/midpoint")
    assert isinstance(failure.value.__cause__, Mine) and len(failure.value.run) >= 3


def test_a_generating_function_in_python():
    def trapezoidal(lagrangian, q0, q1, h, t):
        return h / 2 * (lagrangian(t, q0, (q1 - q0) / h) + lagrangian(t + h, q1, (q1 - q0) / h))

    mine = ds.GeneratingFunction("type1/my_trapezoidal", 2, trapezoidal, self_adjoint=True)
    scene = ds.load("double_pendulum", methods=[mine])
    one = scene.run(method="type1/my_trapezoidal", steps=2, step=0.01)
    other = scene.run(method="type1/trapezoidal", steps=2, step=0.01)
    assert np.allclose(one.q, other.q, atol=1e-7)
    with pytest.raises(ds.Misuse, match="type1/"):
        ds.GeneratingFunction("mine", 2, trapezoidal)


def test_columns_can_be_kept_and_not_be_written():
    seen = []

    def lagrangian(q, v):
        seen.append(q)
        return v @ v / 2 - q @ q / 2

    with pytest.warns(ds.CallbackCost):
        scene = ds.Scene(["x"], lagrangian, q=[0.8], callback=True)
    scene.run(steps=2, step=0.1, method="type1/midpoint")
    assert seen[0][0] == pytest.approx(0.8, rel=1e-2)

    def writing(q, v):
        energy = v @ v / 2 - q @ q / 2
        q[0] = 0.0
        return energy

    with pytest.raises(ds.Error), pytest.warns(ds.CallbackCost):
        ds.Scene(["x"], writing, q=[0.8], callback=True).run(steps=2, step=0.1)
