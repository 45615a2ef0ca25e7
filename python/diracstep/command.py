"""Verbs of the command ``diracstep`` on a scene: what needs references, baselines or searches that libdiracstep does not have.

The scene goes there as its file's text; answers come as JSON.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Mapping, Sequence

import numpy as np

from .arrays import real, table
from .errors import Doubt, Failure, Misuse

if TYPE_CHECKING:
    from .scene import Scene


def _command() -> str:
    given = os.environ.get("DIRACSTEP_COMMAND") or shutil.which("diracstep")
    if not given:
        raise ImportError("this is done by the command diracstep (Debian package diracstep), which was not found; "
                          "DIRACSTEP_COMMAND may give its path")
    return given


class Verbs:
    """Calls verbs of the command for one scene, in a folder that is there for the time of a ``with``."""

    def __init__(self, scene: Scene) -> None:
        if scene._callbacks is not None:
            raise Misuse("this needs a scene of formulas, not of callbacks")
        self._scene = scene
        self._folder = tempfile.TemporaryDirectory()
        self.folder = Path(self._folder.name)
        self.name = self._where()

    def _where(self) -> str:
        """A scene of the catalogue by its name, others as a file; one that reads further files stays where it is."""
        given, text = self._scene._again["name"], self._scene._again["text"]
        if text is None:
            return str(Path(given).resolve()) if self._scene.text is not None else given
        file = self.folder / f"{self._scene.name}.toml"
        file.write_text(text, encoding="utf-8")
        return str(file)

    def __enter__(self) -> Verbs:
        return self

    def __exit__(self, *_: Any) -> None:
        self._folder.cleanup()

    def call(self, verb: str, *arguments: str, scene: bool = True) -> dict[str, Any]:
        """The document that a verb gives; ``scene``: whether it takes the scene and its parameters."""
        call = [_command(), verb, *([self.name] if scene else []), *arguments, "--json"]
        if scene:
            for name, value in self._scene._changes.items():
                call += ["--set", f"{name}={value!r}"]
        if self._scene._again["drop_redundant"] and verb != "fit":
            call += ["--drop-redundant"]
        for plugin in self._scene._again["plugins"]:
            call += ["--plugin", os.fspath(plugin)]
        done = subprocess.run(call, capture_output=True, text=True, check=False)
        if done.returncode == 2:
            raise Misuse(_told(done.stderr))
        if done.returncode == 3:
            warnings.warn(f"{self._scene.name}: {_told(done.stderr)}", Doubt, stacklevel=4)
        elif done.returncode != 0:
            raise Failure(_told(done.stderr))
        return json.loads(done.stdout)

    def tolerances(self) -> list[str]:
        return [text for name, value in self._scene._tolerances.items() for text in ("--tolerance", f"{name}={value!r}")]


def _told(text: str) -> str:
    return "\n".join(line.removeprefix("diracstep: ") for line in text.strip().splitlines())


class Report:
    """What a verb of the command found: ``document`` is its JSON."""

    def __init__(self, title: str, document: dict[str, Any]) -> None:
        self.document = document
        self._title = title

    def __repr__(self) -> str:
        return f"<{self._title}>"


class Equilibrium(Report):
    """Where a scene rests or moves steadily, and its small motions there.

    q, v: n numbers.  lambda_: forces of the rows.  eigenvalues: complex, 1/time, those of a pair once.
    """

    def __init__(self, scene: Scene, document: dict[str, Any]) -> None:
        super().__init__(f"equilibrium of {scene.name}", document)
        self.q, self.v = (np.array(list(document[what].values())) for what in ("q", "v"))
        self.lambda_ = np.array(list(document["lambda"].values()))
        self.eigenvalues = np.array([complex(*mode["eigenvalue"]) for mode in document["modes"]])


class SolvedStart(Report):
    """The start that runs take, guesses moved onto the rows.

    q, v, p, acceleration: n numbers.  lambda_: forces of the rows.  origin: of each value of q and v, "given", "guess" …
    """

    def __init__(self, scene: Scene, document: dict[str, Any]) -> None:
        super().__init__(f"start of {scene.name}", document)
        self.q, self.v, self.p, self.acceleration = (
            np.array(list((document[what] or {}).values()), dtype=float) for what in ("q", "v", "p", "acceleration"))
        self.lambda_ = np.array(list(document["lambda"].values()))
        self.origin: dict[str, dict[str, str]] = document["origin"]


class Fit(Report):
    """Parameters that fit data best: ``parameters`` and the half widths of their confidence intervals, by name."""

    def __init__(self, scene: Scene, document: dict[str, Any]) -> None:
        super().__init__(f"fit of {scene.name}", document)
        found = document["parameters"]
        self.parameters: dict[str, float] = {name: entry["value"] for name, entry in found.items()}
        self.intervals: dict[str, float] = {
            name: np.inf if entry["interval"] is None else entry["interval"] for name, entry in found.items()}
        self.covariance = np.array(document["covariance"], dtype=float)
        self.converged: bool = document["converged"]


def fit(scene: Scene, data: Any, parameters: Sequence[str], start: Mapping[str, float], sigma: Mapping[str, float],
        options: Sequence[str]) -> Fit:
    with Verbs(scene) as verbs:
        file = str(data) if isinstance(data, (str, os.PathLike)) else _data_file(verbs.folder, data)
        pairs = [text for option, values in (("--from", start), ("--sigma", sigma)) for name, value in values.items()
                 for text in (option, f"{name}={real(value, name)!r}")]
        return Fit(scene, verbs.call("fit", file, "--parameters", ",".join(parameters), *pairs, *options))


def _data_file(folder: Path, data: Mapping[str, Any]) -> str:
    """A file of columns by name, of which t is one; NaN stands for what was not measured."""
    names = list(data)
    columns = [np.asarray(data[name], dtype=float) for name in names]
    if "t" not in names or any(column.shape != columns[0].shape or column.ndim != 1 for column in columns):
        raise Misuse("data needs columns of one length, 't' among them")
    lines = [",".join(names)]
    lines += [",".join("" if np.isnan(value) else repr(float(value)) for value in row) for row in zip(*columns)]
    file = folder / "data.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(file)


def sweep(scene: Scene, grid: Mapping[str, Sequence[float]], record: Sequence[str], extrema: Sequence[str],
          events: Sequence[str], settings: Mapping[str, Any], out: str | os.PathLike[str] | None, threads: int) -> np.ndarray:
    with Verbs(scene) as verbs:
        lines = [f"scene = {json.dumps(_local(verbs))}"]
        lines += [f"{name} = {json.dumps(value)}" for name, value in settings.items() if value is not None]
        lines += ["[set]", *(f"{json.dumps(name)} = {value!r}" for name, value in scene._changes.items() if name not in grid)]
        lines += ["[grid]"]
        for name, values in grid.items():
            numbers = table(values, (len(values),), name).tolist()
            lines.append(f"{json.dumps(name)} = {json.dumps(numbers)}")
        lines += ["[record]", f"values = {json.dumps(list(record))}", f"extrema = {json.dumps(list(extrema))}",
                  f"events = {json.dumps(list(events))}"]
        file = verbs.folder / "sweep.toml"
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
        where = Path(out) if out is not None else verbs.folder / "out"
        verbs.call("sweep", str(file), "--out", str(where), "--threads", str(threads), *verbs.tolerances(), scene=False)
        return np.load(where / "results.npy")


def _local(verbs: Verbs) -> str:
    """The scene beside the file of a sweep."""
    path = Path(verbs.name)
    if path.suffix not in (".toml", ".cir"):
        return verbs.name
    if path.parent != verbs.folder:
        raise Misuse("a sweep from Python needs a scene of the catalogue, of text or of functions; for one of a file write a "
                     "sweep's file beside it (diracstep sweep)")
    return path.name
