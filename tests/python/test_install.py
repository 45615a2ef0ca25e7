"""The package as pip installs it from the source tree, and what it says of itself."""

import ctypes
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import diracstep as ds

ROOT = Path(__file__).parents[2]


def test_the_versions_agree():
    stated = re.search(r'^version = "(.*)"$', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.MULTILINE)
    assert stated[1] == ds.version() == ds.__version__


def test_the_structs_are_those_of_the_header():
    from diracstep import _library as c

    header = (ROOT / "c_interface" / "diracstep.h").read_text(encoding="utf-8")
    assert int(re.search(r"DIRACSTEP_VERSION_OF_C_INTERFACE (\d+)u", header)[1]) == c.VERSION
    header = re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)
    names = {"parameter": c.Parameter, "source": c.Source, "facts": c.Facts, "table": c.Table, "options": c.Options, "state": c.State,
             "statistics": c.Statistics, "points": c.Points, "course": c.Course, "error": c.ErrorRequest, "found": c.Found,
             "ensemble": c.Ensemble, "derivatives": c.Derivatives, "event": c.Event, "ends": c.Ends, "boundary": c.Boundary,
             "control": c.Control, "controlled": c.Controlled, "rest": c.Rest, "equilibrium": c.Equilibrium, "data": c.Data,
             "fitted": c.Fitted}
    assert set(names) == set(re.findall(r"typedef struct diracstep_(\w+) \{", header))
    for name, struct in names.items():
        body = re.search(r"typedef struct diracstep_%s \{(.*?)\n\}" % name, header, re.DOTALL)[1]
        fields = []
        for declaration in body.split(";")[:-1]:
            callback = re.search(r"\(\*(\w+)\)\(", declaration)
            fields += [callback[1]] if callback else re.findall(r"(\w+)\s*(?:,|$)", declaration.strip())
        assert [field for field, _ in struct._fields_] == [{"lambda": "lambda_"}.get(field, field) for field in fields], name
    declared = set(re.findall(r"DIRACSTEP_API [^;(]*[ *]diracstep_(\w+)\(", header))
    assert declared == set(c._PROTOTYPES)


def test_the_structs_of_the_julia_module_are_those_of_the_header():
    from diracstep import _library as c

    module = (ROOT / "julia" / "src" / "DiracStep.jl").read_text(encoding="utf-8")
    assert int(re.search(r"interface_version = Cuint\((\d+)\)", module)[1]) == c.VERSION
    kinds = {"Cint": ctypes.c_int, "Clong": ctypes.c_long, "Cdouble": ctypes.c_double, "Cstring": ctypes.c_char_p}
    names = {"Parameter": c.Parameter, "Source": c.Source, "Facts": c.Facts, "Options": c.Options, "Table": c.Table, "Points": c.Points,
             "ReadState": c.State, "Course": c.Course}
    declared = re.findall(r"^(?:mutable )?struct (\w+)\n(.*?)^end$", module, re.DOTALL | re.MULTILINE)
    assert set(names) <= {name for name, _ in declared}
    for name, body in declared:
        if name in names:
            fields = re.findall(r"^    (\w+)::(\w+)", body, re.MULTILINE)
            stated = [(field.rstrip("_"), kind) for field, kind in names[name]._fields_]
            assert [field.rstrip("_") for field, _ in fields] == [field for field, _ in stated], name
            for (field, julia), (_, kind) in zip(fields, stated):
                assert kinds.get(julia, kind) is kind, f"{name}.{field}"
                assert (julia == "Ptr") == (kind not in kinds.values()), f"{name}.{field}"


def test_pip_installs_the_package(tmp_path):
    has_tools = all(importlib.util.find_spec(name) for name in ("pip", "setuptools"))
    if not has_tools:
        pytest.skip("not checked: python3-pip or python3-setuptools is missing")
    source = tmp_path / "source"
    shutil.copytree(ROOT / "python", source / "python", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    shutil.copy(ROOT / "pyproject.toml", source)
    done = subprocess.run([sys.executable, "-m", "pip", "install", "-q", "--no-build-isolation", "--no-deps", "--no-index", "--target",
                           str(tmp_path / "site"), str(source)], capture_output=True, text=True)
    if done.returncode != 0 and "wheel" in done.stderr:
        pytest.skip("not checked: python3-wheel is missing")
    assert done.returncode == 0, done.stderr
    installed = {path.name for path in (tmp_path / "site" / "diracstep").iterdir() if path.suffix != ".pyc"}
    assert {"py.typed"} | {path.name for path in (ROOT / "python" / "diracstep").glob("*.py")} <= installed
    told = "import diracstep as ds; print(ds.__file__); run = ds.load('knife_edge').run(step=0.1, until=1); print(len(run))"
    used = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, cwd=tmp_path,
                          env={**os.environ, "PYTHONPATH": str(tmp_path / "site")})
    assert used.returncode == 0, used.stderr
    file, points = used.stdout.split()
    assert file.startswith(str(tmp_path / "site")) and points == "11"
