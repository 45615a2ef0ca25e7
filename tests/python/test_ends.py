"""Motions between two ends, periodic ones, and controls of least cost."""

import json
import os
import signal
import subprocess
import threading

import numpy as np
import pytest

import diracstep as ds
from diracstep import _library

TRANSFER = {"start": {"x": 1.0, "y": 0.0}, "to": {"x": -0.3, "y": 1.1}, "until": 2.1}
PUSHED = """
name = "pushed"
lagrangian = "v_x^2/2"
coordinates = { x = {} }
start = { x = 1 }
span = { end = 1, step = 0.05 }
[parameters]
u = { value = 0, min = -100, max = 100 }
[force]
x = "u"
[control]
parameters = ["u"]
cost = "u^2"
"""
needs_ipopt = pytest.mark.skipif(not _library.lib.can_control(), reason="the library was built without Ipopt")


def command(*arguments):
    done = subprocess.run([os.environ["DIRACSTEP_COMMAND"], *arguments, "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_motion_between_two_places_is_that_of_the_command():
    kepler = ds.load("kepler_e06")
    found = kepler.boundary(**TRANSFER)
    theirs = command("boundary", "kepler_e06", "--from", "x=1", "y=0", "--to", "x=-0.3", "y=1.1", "--end", "2.1")
    assert len(found) == theirs["steps"] + 1 and found.method == theirs["method"]
    assert found.action == theirs["action"]["value"]
    assert np.array_equal(found.v[0], list(theirs["start"]["v"].values()))
    assert np.array_equal(found.action_hessian, theirs["action"]["hessian"])
    assert np.allclose(found.action_gradient, [*-found.p[0], *found.p[-1]], atol=1e-12)
    assert np.allclose(found.q[-1], [-0.3, 1.1], atol=1e-13) and np.ptp(found.energy) < 1e-7
    assert not found.doubt and not found.no_action


def test_the_start_that_is_found_leads_to_the_end():
    kepler = ds.load("kepler_e06")
    found = kepler.boundary([-0.3, 1.1], start=[1.0, 0.0], until=2.1, method="type1/gl:3", step=0.05)
    integrator = kepler.integrator(method="type1/gl:3", step=0.05, until=2.1)
    integrator.reset(found.q[0], found.v[0])
    integrator.step(len(found) - 1)
    assert np.allclose(integrator.state().q, [-0.3, 1.1], atol=1e-11)


def test_rows_hold_and_their_forces_are_not_known():
    pendulum = ds.load("pendulum_cartesian")
    run = pendulum.run(method="type1/gl:3", step=0.05, until=0.7)
    found = pendulum.boundary(run.q[-1], until=0.7, method="type1/gl:3", step=0.05, guess=run)
    assert np.allclose(found.q, run.q, atol=1e-9)
    assert np.isnan(found.lambda_).all() and found.lambda_.shape == run.lambda_.shape
    assert found.action is not None and found.action_hessian is None


def test_a_periodic_orbit_has_multipliers():
    found = ds.load("lotka_volterra_2d").boundary(periodic=True, until=5.0, step=0.1)
    assert np.allclose(found.q[0], found.q[-1], atol=1e-11) and found.free_directions == 1
    assert found.multipliers.shape == (2,) and np.allclose(found.multipliers, 1.0, atol=1e-4)
    assert found.action is None and "linear in v" in found.no_action


def test_arrays_that_lie_otherwise_in_memory_are_guesses_too():
    kepler = ds.load("kepler_e06")
    found = kepler.boundary(**TRANSFER)
    other = {"t": np.repeat(found.t, 2)[::2], "q": np.asfortranarray(found.q), "v": np.repeat(found.v, 2, axis=1)[:, ::2]}
    for array in other.values():
        array.flags.writeable = False
    again = kepler.boundary(**TRANSFER, guess=other)
    assert again.iterations <= 2 and np.allclose(again.q, found.q, atol=1e-12)


@pytest.mark.parametrize("given, message", [
    ({"to": {"z": 1.0}}, "'z' is no coordinate"),
    ({"to": {"x": np.nan, "y": 0.0}}, "x of to is nan; a finite number"),
    ({"to": [1.0]}, r"to has shape \(1,\); \(2,\) is needed"),
    ({"to": "x=1"}, "to is 'x=1'; a dictionary of numbers by name, or a place"),
    ({"to": {"x": 1.0}}, "4 conditions .* 3 are given"),
    ({}, "nothing is asked of the end"),
    ({"periodic": True, "to": {"x": 1.0}}, "periodic motion has all of both ends"),
    ({"periodic": 1}, "periodic is 1; True or False"),
    ({**TRANSFER, "until": np.inf}, "until is inf"),
    ({**TRANSFER, "adaptive": True}, "steps of one size"),
    ({**TRANSFER, "max_iterations": 0}, "max_iterations is 0"),
    ({**TRANSFER, "guess": 3}, "guess is int; a run"),
    ({**TRANSFER, "guess": {"t": [0.0, 1.0], "q": np.zeros((2, 2)), "v": np.zeros((1, 2))}}, "v of guess has shape"),
    ({**TRANSFER, "guess": {"t": [0.0, 0.0], "q": np.zeros((2, 2)), "v": np.zeros((2, 2))}}, "does not follow"),
    ({**TRANSFER, "guess": {"t": [0.0, 1.0], "q": np.zeros((2, 2)) * 1j, "v": np.zeros((2, 2))}}, "of type complex128"),
    ({**TRANSFER, "stepp": 0.1}, "no argument 'stepp'"),
])
def test_what_cannot_be_is_refused(given, message):
    with pytest.raises(ds.Misuse, match=message):
        ds.load("kepler_e06").boundary(**given)


def test_a_search_that_does_not_converge_gives_its_last_iterate():
    with pytest.raises(ds.Failure, match="iterations are used up") as caught:
        ds.load("kepler_e06").boundary(**TRANSFER, max_iterations=1)
    assert isinstance(caught.value.run, ds.BoundaryMotion) and len(caught.value.run) == 43


def test_steps_that_are_too_large_are_doubted():
    with pytest.warns(ds.Doubt, match="kepler_e06: "):
        found = ds.load("kepler_e06").boundary({"x": 0.5, "y": 0.5}, start={"x": 1.0, "y": 0.0}, until=3.0, step=0.5, method="type1/left")
    assert found.doubt


def test_threads_search_at_once():
    kepler, found = ds.load("kepler_e06"), {}
    alone = kepler.boundary(**TRANSFER)

    def search(k):
        found[k] = kepler.boundary(**TRANSFER)

    threads = [threading.Thread(target=search, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(found[k].q, alone.q) and found[k].action == alone.action for k in range(4))


@needs_ipopt
def test_controls_of_least_cost():
    found = ds.parse(PUSHED).control({"x": 0.0, "v_x": 0.0}, degree=1)
    assert np.isclose(found.cost, 12.0, atol=1e-7) and not found.doubt  # u = 12 t − 6
    assert found.control_names == ("u",) and found.controls.shape == (40, 1)
    assert np.allclose(found["u"], 12.0 * found.control_times - 6.0, atol=1e-5)
    assert np.isclose(found["x"][-1], 0.0, atol=1e-9) and len(found) == 21
    bounded = ds.parse(PUSHED).control({"x": 0.0, "v_x": 0.0}, at_least={"u": -4.5}, at_most={"u": 4.5, "x": np.inf})
    assert bounded.cost > 12.0 and np.abs(bounded.controls).max() <= 4.5
    with pytest.raises(KeyError):
        found["w"]


@needs_ipopt
@pytest.mark.parametrize("given, message", [
    ({}, "nothing is asked of the end"),
    ({"to": {"x": 0.0}, "at_most": {"w": 1.0}}, "'w' is neither a coordinate nor a control"),
    ({"to": {"x": 0.0}, "at_most": [1.0]}, r"at_most is \[1.0\]; a dictionary"),
    ({"to": {"x": 0.0}, "at_most": {"u": np.nan}}, "u of at_most is nan"),
    ({"to": {"x": 0.0}, "degree": -1}, "degree is -1"),
    ({"to": {"x": 0.0}, "tolerance": 0.0}, "tolerance is 0"),
])
def test_controls_that_cannot_be_are_refused(given, message):
    with pytest.raises(ds.Misuse, match=message):
        ds.parse(PUSHED).control(**given)


@needs_ipopt
def test_a_scene_without_controls_is_refused():
    with pytest.raises(ds.Misuse, match=r"\[control\]"):
        ds.load("kepler_e06").control({"x": 0.0})


@needs_ipopt
def test_threads_search_controls_at_once():
    scene, found = ds.parse(PUSHED), {}
    alone = scene.control({"x": 0.0, "v_x": 0.0}, degree=1, step=0.02)
    threads = [threading.Thread(target=lambda k=k: found.update({k: scene.control({"x": 0.0, "v_x": 0.0}, degree=1, step=0.02)}))
               for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(found[k].controls, alone.controls) for k in range(4))


@needs_ipopt
def test_ctrl_c_ends_a_search():
    scene = ds.parse(PUSHED)
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        for _ in range(10**6):
            scene.control({"x": 0.0, "v_x": 0.0}, degree=1, step=0.001, at_most={"u": 4.5})
    timer.join()


@pytest.mark.skipif(_library.lib.can_control(), reason="the library was built with Ipopt")
def test_without_ipopt_controls_are_refused():
    with pytest.raises(ds.Misuse, match="Ipopt"):
        ds.parse(PUSHED).control({"x": 0.0, "v_x": 0.0})
