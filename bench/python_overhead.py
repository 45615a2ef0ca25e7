#!/usr/bin/env python3
"""What Python adds: to a run of many steps, to a single call, to an ensemble; and SciPy's solve_ivp on the same scene.

    DIRACSTEP_LIBRARY=build/release/c_interface/libdiracstep.so PYTHONPATH=python /usr/bin/python3 bench/python_overhead.py [STEPS]

Each figure is the smallest processor time, of all threads, of several repetitions, taken in turns: other programs on the machine
lengthen it little.  The time of C++ is that of the same run by one call of
libdiracstep into arrays that exist already: no Python runs in it.
"""

import ctypes
import sys
import time

import numpy as np

import diracstep as ds
from diracstep import _library as c
from diracstep.points import Points

REPEATS = 7


def seconds(action):
    start = time.process_time()
    action()
    return time.process_time() - start


def best(*actions):
    """The smallest time of each, taken in turns."""
    times = [[seconds(action) for action in actions] for _ in range(REPEATS)]
    return [min(column) for column in zip(*times)]


def run_in_c(scene, steps, step, method):
    """One run by the library alone, prepared beforehand."""
    course = c.Course(steps=steps, every=1)
    points = Points(scene._widths, steps + 2)
    for array in points.arrays.values():
        array.fill(0.0)  # pages of memory are there
    integrator = scene.integrator(method=method, step=step)

    def run():
        integrator.reset()
        c.check(c.lib.run(integrator._handle, ctypes.byref(course), points.reference()))

    return run


def measure_run(scene, steps, step, method):
    in_c, in_python = best(run_in_c(scene, steps, step, method), lambda: scene.run(method=method, step=step, steps=steps))
    print(f"run of {steps} steps of {scene.name}, {method}: {in_c:.4f} s in C++, {in_python:.4f} s from Python, "
          f"{100 * (in_python / in_c - 1):+.1f} %")


def measure_calls(scene, step, method):
    integrator = scene.integrator(method=method, step=step)
    count = 20000

    def empty():
        for _ in range(count):
            integrator.step(0)

    def loop():
        for _ in range(count):
            pass

    called, looped = best(empty, loop)
    print(f"call of integrator.step(): {1e6 * (called - looped) / count:.2f} us beside the step itself")


def measure_ensemble(scene):
    starts = np.tile(scene.start_q, (1000, 1))
    one, = best(lambda: scene.ensemble(starts, until=scene.start_time + 20 * scene.step, step=scene.step))
    print(f"ensemble of 1000 starts, 20 steps each, of all threads: {one:.4f} s")


def kepler_rates(t, state):
    x, y, vx, vy = state
    r3 = (x * x + y * y) ** 1.5
    return [vx, vy, -x / r3, -y / r3]


def measure_scipy(end=100.0):
    try:
        from scipy.integrate import solve_ivp
    except ImportError:
        print("not measured: SciPy is not installed")
        return
    e = 0.6
    kepler = ds.Scene(["x", "y"], lambda q, v: v @ v / 2 + 1 / ds.sqrt(q.x**2 + q.y**2), q=[1 - e, 0.0],
                      v=[0.0, np.sqrt((1 + e) / (1 - e))], until=end, step=0.05, name="kepler")
    true = kepler.run(error=1e-12, max_time=120, every=10**6).q[-1]
    start = np.concatenate([kepler.start_q, kepler.start_v])
    print(f"Kepler orbit, e = {e}, to t = {end:g}: error of the position, time")

    def show(name, run):
        ends = []
        taken, = best(lambda: ends.append(run()))
        print(f"  {name:32s} {np.abs(ends[-1] - true).max():8.1e}  {1e3 * taken:8.2f} ms")

    for method, rtols in (("DOP853", (1e-6, 1e-9, 1e-12)), ("Radau", (1e-5, 1e-8))):
        for rtol in rtols:
            show(f"solve_ivp {method}, rtol {rtol:g}",
                 lambda: solve_ivp(kepler_rates, (0, end), start, method=method, rtol=rtol, atol=rtol).y[:2, -1])
    for method, eps in (("type1/gl:3", 0.3), ("type1/gl:4", 0.3), ("type1/gl:4", 0.1), ("type1/gl:6", 0.2)):
        show(f"diracstep {method}, eps {eps:g}", lambda: kepler.run(method=method, eps=eps).q[-1])


def main():
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    for name, method in (("knife_edge", "type1/gl:3"), ("kepler_e06", "type1/midpoint")):
        scene = ds.load(name)
        measure_run(scene, steps, scene.step, method)
    measure_calls(ds.load("knife_edge"), 0.1, "type1/gl:3")
    measure_ensemble(ds.load("knife_edge"))
    measure_scipy()


if __name__ == "__main__":
    main()
