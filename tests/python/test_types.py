"""The annotations of the package, by mypy where it is installed."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "python" / "diracstep"


def test_annotations_agree(tmp_path):
    if not importlib.util.find_spec("mypy"):
        pytest.skip("not checked: mypy is missing")
    done = subprocess.run([sys.executable, "-m", "mypy", "--ignore-missing-imports", "--cache-dir", str(tmp_path), str(PACKAGE)],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_every_public_name_is_documented():
    import diracstep as ds

    def public(owner):
        return [getattr(owner, name) for name in vars(owner) if not name.startswith("_")]

    missing = [name for name in ds.__all__ if callable(getattr(ds, name)) and not (getattr(ds, name).__doc__ or "").strip()]
    for cls in (ds.Scene, ds.Points, ds.Run, ds.BoundaryMotion, ds.ControlledMotion, ds.Integrator, ds.Ensemble, ds.Study, ds.Equilibrium, ds.Fit, ds.SolvedStart):
        missing += [f"{cls.__name__}.{member.__name__}" for member in public(cls)
                    if callable(member) and not (member.__doc__ or "").strip()]
    assert not missing
