"""Interrupts, threads, memory."""

import gc
import os
import resource
import signal
import threading
import time

import numpy as np
import pytest

import diracstep as ds


def interrupt_soon(delay=0.2):
    timer = threading.Timer(delay, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    return timer


def test_ctrl_c_ends_a_run_and_keeps_what_is_computed(skate):
    timer = interrupt_soon()
    with pytest.warns(ds.Interrupted, match="interrupted at t = "):
        run = skate.run(steps=10**9, every=1000, step=0.01)
    timer.join()
    assert run.interrupted and 2 <= len(run) < 10**6 and np.isfinite(run.q).all()
    assert np.all(np.diff(run.t) > 0)
    assert not skate.run(steps=10, step=0.01).interrupted  # the next one is not affected


def test_ctrl_c_ends_a_run_through_events():
    clock = ds.parse('name = "clock"\nlagrangian = "v_x^2/2"\n[coordinates]\nx = {}\n[start]\nv_x = 1\n[span]\nend = 1\nstep = 0.01\n'
                     '[[events]]\nname = "turn"\nevery = 1.0\nset = { v_x = "-v_x" }\n')
    timer = interrupt_soon()
    with pytest.warns(ds.Interrupted, match="interrupted at t = "):
        run = clock.run(steps=10**9, every=1000)
    timer.join()
    assert run.interrupted and not run.stopped and len(run) >= 2 and run.events and np.abs(run["x"]).max() < 1.001


def test_ctrl_c_ends_many_steps_by_hand(skate):
    integrator = skate.integrator(step=0.01)
    timer = interrupt_soon()
    with pytest.raises(KeyboardInterrupt):
        integrator.step(10**9)
    timer.join()
    assert 0 < integrator.statistics.steps < 10**9
    integrator.step()


def test_ctrl_c_ends_a_search_and_an_ensemble(skate):
    timer = interrupt_soon()
    with pytest.warns(ds.Interrupted):
        run = ds.load("chaotic_quartic").run(error=1e-13, until=3000.0, max_time=60.0)
    timer.join()
    assert run.interrupted
    timer = interrupt_soon()
    starts = np.zeros((200_000, 3))
    with pytest.raises(KeyboardInterrupt):
        skate.ensemble(starts, until=100.0, step=0.01)
    timer.join()


def test_ctrl_c_at_any_moment_ends_the_call_and_harms_nothing(skate):
    starts = np.zeros((20_000, 3))
    for delay in np.linspace(0.0, 0.03, 16):
        with pytest.raises(KeyboardInterrupt):
            interrupt_soon(delay)
            skate.ensemble(starts.copy(), until=100.0, step=0.01)
        for thread in threading.enumerate():
            if thread.name == "diracstep" and thread.ident is not None:
                thread.join(10.0)
                assert not thread.is_alive()


def test_the_interpreter_runs_beside_a_run(skate):
    ticks = []
    done = threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    other = threading.Thread(target=tick)
    other.start()
    skate.run(steps=40_000, every=40_000, step=0.01)
    done.set()
    other.join()
    assert len(ticks) > 20


def test_threads_share_a_scene_and_take_turns_with_an_integrator(skate):
    expected = skate.run(steps=200, step=0.05).q[-1]
    integrator = skate.integrator(step=0.05)
    failures = []

    def work():
        try:
            for _ in range(5):
                assert np.array_equal(skate.run(steps=200, step=0.05).q[-1], expected)
                integrator.step(20)
                integrator.state()
                with pytest.raises(ds.Misuse, match="type9/mine"):
                    skate.run(method="type9/mine")
        except BaseException as error:  # noqa: BLE001
            failures.append(error)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    assert integrator.statistics.steps == 4 * 5 * 20


def test_an_integrator_outlives_its_scene_and_a_run_both():
    integrator = ds.load("knife_edge").integrator(step=0.1)
    gc.collect()
    integrator.step(3)
    run = ds.load("knife_edge").run(steps=3, step=0.1)
    gc.collect()
    assert np.array_equal(run.q[-1], integrator.state().q)


def memory():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="not checked: memory in use is read from /proc")
def test_nothing_is_leaked():
    def work():
        for _ in range(30):
            scene = ds.Scene(["x"], lambda q, v: v.x**2 / 2 - q.x**2 / 2, q=[1.0], until=1.0)
            run = scene.run(steps=2000, step=0.01)
            assert run.t.nbytes > 10_000
            integrator = scene.integrator(step=0.1)
            integrator.restore(integrator.save())
            with pytest.raises(ds.Misuse):
                scene.run(method="none")
            scene.ensemble(np.ones((10, 1)))
        gc.collect()

    work()
    before = memory()
    for _ in range(3):
        work()
    assert memory() - before < 4_000_000  # 90 scenes and runs of 112 kB each would be 10 MB


def test_progress_is_shown_where_it_is_asked_for(skate, capfd):
    skate.run(steps=60_000, every=100, step=0.01, progress=True)
    told = capfd.readouterr().err
    assert "%" in told or "tqdm" in told
    skate.run(steps=10_000, every=100, step=0.01, progress=False)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("derivatives", [lambda integrator: integrator.gradient(10**7, {"q": [1.0, 0.0, 0.0]}),
                                         lambda integrator: integrator.jacobian(10**7)])
def test_ctrl_c_ends_derivatives(derivatives):
    integrator = ds.load("chaplygin_sleigh").integrator(method="type1/gl:2", step=1e-3)
    timer, begin = interrupt_soon(), time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        derivatives(integrator)
    timer.join()
    assert time.perf_counter() - begin < 10.0 and integrator.time > 0.0
    integrator.reset()
    assert np.isfinite(integrator.gradient(3, {"q": [1.0, 0.0, 0.0]}).q).all()


def test_ctrl_c_ends_an_equilibrium_by_full_matrices():
    chain = ds.load("hanging_chain", N=200)
    timer, begin = interrupt_soon(0.3), time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        chain.equilibrium()
    timer.join()
    assert time.monotonic() - begin < 3.0
    assert ds.load("hanging_chain", N=2).equilibrium().modes.shape == (2, 4)


def test_ctrl_c_comes_to_the_command_which_keeps_what_it_has(skate, tmp_path):
    timer, begin = interrupt_soon(1.0), time.monotonic()  # of this process alone, as in a notebook
    with pytest.raises(KeyboardInterrupt, match="finished blocks are kept"):
        skate.sweep({"g_sin_alpha": list(np.linspace(0.5, 0.6, 10))}, ["x"], until=4000.0, step=0.001, out=tmp_path / "out")
    timer.join()
    assert time.monotonic() - begin < 6.0 and (tmp_path / "out" / "sweep.json").exists()
