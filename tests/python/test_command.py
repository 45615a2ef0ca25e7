"""Verbs that the command does: sweep, study."""

import tempfile

import numpy as np
import pytest

import diracstep as ds


def test_a_sweep_is_a_table(spring, tmp_path):
    table = spring.sweep({"k": [1.0, 4.0], "start.x": np.array([1.0, 2.0, 3.0])}, ["x", "v_x"], extrema=["x"], until=1.0, step=0.01)
    assert len(table) == 6 and {"k", "x", "v_x"} <= set(table.dtype.names)
    assert table["x"] == pytest.approx(table["start.x"] * np.cos(np.sqrt(table["k"])), abs=1e-9)
    kept = tmp_path / "sweep"
    first = ds.load("pendulum_cartesian").sweep({"g": [5.0, 10.0]}, ["y"], until=0.5, out=kept)
    assert np.array_equal(first, ds.load("pendulum_cartesian").sweep({"g": [5.0, 10.0]}, ["y"], until=0.5, out=kept))
    with pytest.raises(ds.Misuse, match="'m'") as told:
        spring.sweep({"m": [1.0]}, ["x"])
    assert tempfile.gettempdir() not in str(told.value)
    assert set(table["status"]) == {"ok"}


def test_a_sweep_takes_tables_and_draws(spring, tmp_path):
    table = spring.sweep(table={"k": [1.0, 4.0], "start.x": [2.0, 3.0]}, record=["x"], until=1.0, step=0.01, out=tmp_path / "kept")
    assert table["x"] == pytest.approx([2 * np.cos(1.0), 3 * np.cos(2.0)], abs=1e-9)
    again = spring.sweep(table={"k": [1.0, 4.0], "start.x": [2.0, 3.0]}, record=["x"], until=1.0, step=0.01, out=tmp_path / "kept")
    assert np.array_equal(again, table)  # continued, although the files of the sweep lay elsewhere
    with pytest.raises(ds.Misuse, match="another sweep"):
        spring.sweep(table={"k": [1.0, 5.0], "start.x": [2.0, 3.0]}, record=["x"], until=1.0, step=0.01, out=tmp_path / "kept")
    for laws in ("random", "sobol"):
        drawn = spring.sweep(record=["x"], until=1.0, step=0.01, count=16, seed=3, derivatives=["d(x)/d(k)"],
                             **{laws: {"k": ("log_uniform", 1.0, 4.0)}})
        roots = np.sqrt(drawn["k"])
        assert drawn["x"] == pytest.approx(np.cos(roots), abs=1e-9) and 1.0 <= drawn["k"].min() < 1.5 < drawn["k"].max() <= 4.0
        assert drawn["d(x)/d(k)"] == pytest.approx(-np.sin(roots) / roots / 2, abs=1e-8)
    for wrong, words in (({"random": {"k": ("gauss", 1, 2)}, "count": 2}, "log_uniform"), ({"sobol": {"k": ("normal", 1, 2)}}, "count"),
                         ({"table": {"k": [1.0], "start.x": [1.0, 2.0]}}, "one length"), ({}, "nothing varies"),
                         ({"grid": {"k": 1.0}}, "a list of numbers"), ({"grid": ["k"]}, "a dictionary")):
        with pytest.raises(ds.Misuse, match=words):
            spring.sweep(record=["x"], **wrong)


def test_sweeps_of_scenes_and_sweeps_that_are_files(spring, tmp_path, monkeypatch):
    (tmp_path / "scene.toml").write_text(spring.text)
    (tmp_path / "sweep.toml").write_text('scene = "scene.toml"\nend = 1.0\nstep = 0.01\n[grid]\nk = [1, 4]\n[record]\nvalues = ["x"]\n')
    table = ds.sweep(tmp_path / "sweep.toml", out=tmp_path / "out")
    assert table["x"] == pytest.approx(np.cos([1.0, 2.0]), abs=1e-9) and (tmp_path / "out" / "report.html").exists()
    monkeypatch.chdir(tmp_path)
    scene = ds.load("scene.toml")
    monkeypatch.chdir("/")
    assert np.array_equal(scene.sweep({"k": [1.0, 4.0]}, ["x"], until=1.0, step=0.01), table)
    with pytest.raises(ds.Misuse, match="cannot be read"):
        ds.sweep("none.toml")


def test_a_sweep_of_which_all_fail_says_why(spring):
    with pytest.raises(ds.Failure, match="every member failed, the first one: unknown method 'typo'"):
        spring.sweep({"k": [1.0, 4.0]}, ["x"], until=1.0, method="typo")


def test_a_scene_with_files_of_its_own_stays_where_it_is(tmp_path):
    (tmp_path / "table.csv").write_text("t,u\n0,0\n1,2\n")
    file = tmp_path / "driven.toml"
    file.write_text('name = "driven"\nlagrangian = "v_x^2/2"\n[coordinates]\nx = {}\n[inputs]\nu = { file = "table.csv", column = "u" }\n'
                    '[force]\nx = "u"\n[span]\nend = 1.0\nstep = 0.1\n')
    scene = ds.load(file)
    assert len(scene.study(methods=["type1/midpoint"], steps=[0.1], ida=False, erk=False, budget=0.01).rows) >= 1


def test_callbacks_are_refused():
    with pytest.warns(ds.CallbackCost):
        scene = ds.Scene(["x"], lambda q, v: v[0] ** 2 / 2, callback=True)
    with pytest.raises(ds.Misuse, match="callbacks"):
        scene.sweep({"x": [1.0]}, ["x"])


def test_a_start_by_names():
    scene = ds.Scene(["x", "y"], lambda q, v: v @ v / 2, start={"x": 1.0, "v_y": 0.5})
    assert list(scene.start_q) == [1.0, 0.0] and list(scene.start_v) == [0.0, 0.5]
    with pytest.raises(ds.Misuse, match="no coordinate 'z'"):
        ds.Scene(["x"], lambda v: v @ v / 2, start={"z": 1.0})
    with pytest.raises(ds.Misuse, match="goes with no q"):
        ds.Scene(["x"], lambda v: v @ v / 2, q=[1.0], start={"x": 1.0})
