"""Runs of the whole catalogue beside those of the command: the same method, steps, bits, doubts and events."""

import json
import os
import subprocess
import warnings
from pathlib import Path

import numpy as np
import pytest

import diracstep as ds

SCENES = sorted((Path(__file__).parents[2] / "examples" / "scenes").glob("*.toml"))


def of_command(scene, *options):
    done = subprocess.run([os.environ["DIRACSTEP_COMMAND"], "run", str(scene), "--json", "--out", "run.csv", "--every", "7", *options],
                          capture_output=True, text=True)
    assert done.stdout, done.stderr
    return json.loads(done.stdout)


def quietly(scene, **options):
    """The run, also where it is doubted or fails."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ds.Doubt)
        try:
            return scene.run(**options)
        except ds.Failure as failure:
            return failure.run


def assert_same(run, theirs):
    assert run.statistics.method == theirs["method"] and run.statistics.order == theirs["order"]
    assert run.statistics.steps == theirs["steps"]
    assert run.t[-1] == theirs["end"]["t"] and run.energy[-1] == theirs["end"]["energy"]
    for what, columns in (("q", run.q), ("v", run.v), ("p", run.p)):
        assert np.array_equal(columns[-1], [theirs["end"][what][name] for name in run.scene.coordinates], equal_nan=True), what
    assert np.array_equal(run.lambda_[-1], [theirs["end"]["lambda"][name] for name in run.scene.rows])
    assert {name: run[name][-1] for name in run.scene.outputs} == theirs["outputs"]
    assert run.stopped == theirs["stopped"] and run.doubt == (theirs["doubt"] or "")
    assert [(event.name, event.t) for event in run.events] == [(event["name"], event["t"]) for event in theirs["events"]]
    for ours, event in zip(run.events, theirs["events"]):
        assert list(ours.q) == list(event["q"].values()) and list(ours.v) == list(event["v"].values())
        assert (ours.after_q is None) == ("after" not in event)
        if ours.after_q is not None:
            assert list(ours.after_v) == list(event["after"]["v"].values())
        assert event.get("impulse") is None or event["impulse"] == ours.impulse


@pytest.mark.parametrize("name", list(ds.catalogue))
def test_a_run_without_options_is_that_of_the_command(name):
    scene = ds.load(name)
    span = scene.until - scene.start_time
    # large scenes, and long motions, take a part of their time
    until = scene.until if abs(span / scene.step) * len(scene.coordinates) < 3000 else scene.start_time + 0.1 * span
    assert_same(quietly(scene, until=until, every=7), of_command(name, "--end", repr(until)))


@pytest.mark.parametrize("file", SCENES, ids=lambda path: path.stem)
def test_a_run_of_an_example_is_that_of_the_command(file):
    assert_same(quietly(ds.load(file), every=7), of_command(file))
