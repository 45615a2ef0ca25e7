"""Stepping by hand."""

import numpy as np
import pytest

import diracstep as ds


def test_steps_and_states(skate):
    integrator = skate.integrator(method="type1/gl:3", step=0.1)
    integrator.step(10)
    state = integrator.state()
    run = skate.run(method="type1/gl:3", step=0.1, steps=10)
    assert state.t == pytest.approx(1.0) and np.array_equal(state.q, run.q[-1]) and np.array_equal(state.lambda_, run.lambda_[-1])
    assert integrator.statistics.steps == 10
    integrator.step(size=0.05)
    assert integrator.time == pytest.approx(1.05)
    integrator.step(size=-0.05)
    assert np.allclose(integrator.state().q, state.q, atol=1e-13)


def test_snapshots_go_on_with_the_same_bits(skate):
    integrator = skate.integrator(step=0.1)
    integrator.step(5)
    saved = integrator.save()
    integrator.step(5)
    first = integrator.state().q
    integrator.restore(saved)
    integrator.step(5)
    assert np.array_equal(integrator.state().q, first)
    other = skate.integrator(step=0.1)
    other.restore(saved)
    other.step(5)
    assert np.array_equal(other.state().q, first)
    for wrong in (b"", b"nothing", saved[:-1], bytes(len(saved)), "text"):
        with pytest.raises(ds.Misuse):
            other.restore(wrong)
    with pytest.raises(ds.Misuse, match="diff|method|field|snapshot"):
        skate.integrator(step=0.1, method="type1/midpoint").restore(saved)


def test_snapshots_of_other_steps_and_parameters_are_refused():
    scene = ds.load("knife_edge")
    saved = scene.integrator(step=0.1).save()
    with pytest.raises(ds.Misuse, match="steps of 0.1; this integrator takes 0.05"):
        scene.integrator(step=0.05).restore(saved)
    with pytest.raises(ds.Misuse, match="of m = 1; this scene has m = 2"):
        ds.load("knife_edge", m=2.0).integrator(step=0.1).restore(saved)
    with pytest.raises(ds.Misuse, match="push"):
        scene.integrator(step=0.1, pushed=True).restore(saved)


def test_snapshots_hold_the_push(skate):
    integrator = skate.integrator(step=0.1, pushed=True)
    integrator.push([0.3, 0.1, 0.2])
    integrator.step(2)
    saved = integrator.save()
    integrator.step(5)
    other = skate.integrator(step=0.1, pushed=True)
    other.restore(saved)
    other.step(5)
    assert np.array_equal(other.state().q, integrator.state().q)


def test_many_steps_are_those_of_one_call_each(skate):
    one, many = skate.integrator(step=0.1), skate.integrator(step=0.1)
    for _ in range(300):
        one.step()
    many.step(300)
    assert np.array_equal(one.state().q, many.state().q)
    assert many.statistics.steps == 300


def test_starts_of_ones_own(skate):
    integrator = skate.integrator(step=0.1)
    integrator.reset(q=[1, 2, 0], v={"x": 1.0})
    state = integrator.state()
    assert list(state.q) == [1, 2, 0] and list(state.v) == [1, 0, 0]
    with pytest.raises(ds.Misuse, match="blade"):
        integrator.reset(q=[0, 0, 0], v=[0, 1, 0])
    integrator.reset()
    assert np.array_equal(integrator.state().q, skate.start_q)


def test_a_push_acts_like_a_force():
    cart = ds.Scene(["x"], lambda v: v.x**2, until=10.0, step=0.5)
    integrator = cart.integrator(pushed=True)
    integrator.step(2)
    integrator.push([3.0])
    integrator.step(2)
    assert integrator.state().q[0] == pytest.approx(0.75, abs=1e-13)
    integrator.push({"x": 0.0})
    for wrong in ([1.0, 2.0], [np.nan], ["a"], [1j]):
        with pytest.raises(ds.Misuse):
            integrator.push(wrong)
    with pytest.raises(ds.Misuse, match="pushed"):
        cart.integrator().push([1.0])


@pytest.mark.parametrize("call, words", [
    (lambda i: i.step(-1), "at least 0"), (lambda i: i.step(1.5), "whole number"), (lambda i: i.step(size=0.0), "step"),
    (lambda i: i.step(size=np.nan), "finite"), (lambda i: i.state("other"), "projected"),
    (lambda i: i.reset(q=[0.0]), r"shape \(1,\)"), (lambda i: i.reset(q=np.zeros((3, 1))), "shape"),
    (lambda i: i.reset(q=np.zeros(3, dtype=complex)), "complex128"), (lambda i: i.reset(q=np.zeros(3, dtype=object)), "object"),
    (lambda i: i.reset(q=["a", "b", "c"]), "real numbers"), (lambda i: i.reset(t=np.inf), "finite"),
    (lambda i: i.reset(q=[0, np.nan, 0]), r"q\[1\] is nan"), (lambda i: i.reset(q=np.zeros(3, dtype=np.longdouble)), "128"),
])
def test_misuse_is_named(skate, call, words):
    with pytest.raises(ds.Misuse, match=words):
        call(skate.integrator(step=0.1))


def test_arrays_of_other_kinds_are_copied_and_never_written(skate):
    integrator = skate.integrator(step=0.1)
    wanted = [0.25, 0.5, 0.0]
    frozen = np.array(wanted)
    frozen.flags.writeable = False
    strided = np.zeros(6)
    strided[::2] = wanted
    for q in (frozen, strided[::2], np.array(wanted, dtype=np.float32), np.array(wanted)[::-1][::-1], np.asfortranarray([wanted])[0]):
        integrator.reset(q=q, v=[0, 0, 1])
        assert np.array_equal(integrator.state().q, wanted)
        assert np.array_equal(q, wanted)


def test_a_failed_step_leaves_the_state():
    falling = ds.Scene(["x"], lambda q, v: v.x**2 / 2 + 1 / q.x**2, q=[1.0], until=3.0, step=0.05)
    integrator = falling.integrator()
    with pytest.raises(ds.Failure, match="t = "):
        integrator.step(1000)
    with pytest.warns(ds.Doubt, match="the step is too large"):
        state = integrator.state()
    assert np.isfinite(state.q).all() and state.t > 0
