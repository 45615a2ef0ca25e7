"""Verbs of the command ``diracstep`` on a scene: what needs references and baselines that libdiracstep does not have, and sweeps.

The scene goes there as its file's text; answers come as JSON.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Iterator, Mapping, Sequence

import numpy as np

from ._library import call_interruptibly
from .arrays import path, real, table, texts, whole
from .errors import Doubt, Failure, Misuse, spelled
from .options import refuse, stop_flag

if TYPE_CHECKING:
    from .scene import Scene


def _command() -> str:
    given = os.environ.get("DIRACSTEP_COMMAND") or shutil.which("diracstep")
    if not given:
        raise ImportError("this is done by the command diracstep (Debian package diracstep), which was not found; "
                          "DIRACSTEP_COMMAND may give its path")
    return given


_PATIENCE = 5.0  # seconds for the command to keep what it has


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

    def beside(self) -> str:
        """The scene for a file in the folder: a sweep is continued by a file of the same text, though the folder is another."""
        path = Path(self.name)
        return path.name if path.parent == self.folder else self.name

    def __enter__(self) -> Verbs:
        return self

    def __exit__(self, *_: Any) -> None:
        self._folder.cleanup()

    def call(self, verb: str, *arguments: str, scene: bool = True) -> dict[str, Any]:
        """The document that a verb gives; ``scene``: whether it takes the scene and its parameters."""
        call = [*([self.name] if scene else []), *arguments]
        if scene:
            for name, value in self._scene._changes.items():
                call += ["--set", f"{name}={value!r}"]
        if self._scene._again["drop_redundant"]:
            call += ["--drop-redundant"]
        return call_command(verb, call, self._scene._again["plugins"], self._scene.name, self.folder)

    def tolerances(self) -> list[str]:
        return [text for name, value in self._scene._tolerances.items() for text in ("--tolerance", f"{name}={value!r}")]


def call_command(verb: str, arguments: Sequence[str], plugins: Sequence[str], name: str, folder: Path | None = None) -> Any:
    """The document that a verb gives; ``name`` stands before a doubt, and paths in ``folder``, which nobody will find, are shown
    without it."""
    loaded = [text for plugin in plugins for text in ("--plugin", os.fspath(plugin))]
    status, out, said = _ended([_command(), verb, *arguments, *loaded, "--json"])
    told = _told(said if folder is None else said.replace(f"{folder}{os.sep}", ""))
    if status == 2:
        raise Misuse(told)
    if status == 3:
        warnings.warn(f"{name}: {told}", Doubt, stacklevel=5)
    elif status != 0:
        raise Failure(told)
    return json.loads(out)


def _ended(words: Sequence[str]) -> tuple[int, str, str]:
    """Status, output and messages of a process.  Ctrl-C is passed on to it, in a notebook too, whose processes the signal does not
    come to, so that it keeps what it has; KeyboardInterrupt is raised where it has ended."""
    stop, ended = stop_flag(), []

    def call() -> int:
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", errors="backslashreplace") as process:
            told = 0.0
            while not ended:
                try:
                    out, said = process.communicate(timeout=0.05)
                    ended.append((process.returncode, out, said))
                except subprocess.TimeoutExpired:
                    if stop.value and not told:  # twice within 0.1 s, from the terminal too, is once for the command
                        process.send_signal(signal.SIGINT)
                        told = time.monotonic()
                    elif told and time.monotonic() > told + _PATIENCE:
                        process.kill()
        return 0

    call_interruptibly(call, stop)
    if stop.value:
        raise KeyboardInterrupt(_told(ended[0][2]))
    return ended[0]


def _told(text: str) -> str:
    """What the command says, without the lines on its version and machine that some verbs begin with."""
    lines = [line.removeprefix("diracstep: ") for line in text.strip().splitlines()]
    heading = [index for index, line in enumerate(lines[:6]) if line.startswith("system: ")]
    return spelled("\n".join(lines[heading[0] + 1:] if heading else lines))


def sweep(scene: Scene, varied: Varied, recorded: Mapping[str, Sequence[str]], settings: Mapping[str, Any],
          out: str | os.PathLike[str] | None, threads: int) -> np.ndarray:
    with Verbs(scene) as verbs:
        lines = [f"scene = {json.dumps(verbs.beside())}"]
        lines += [f"{name} = {json.dumps(value)}" for name, value in settings.items() if value is not None]
        lines += varied.lines(verbs.folder, scene._changes)
        lines += ["[record]", *(f"{what} = {json.dumps(texts(names, _ARGUMENT.get(what, what)))}" for what, names in recorded.items())]
        file = verbs.folder / "sweep.toml"
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
        where = Path(path(out, "out")) if out is not None else verbs.folder / "out"
        with _reasons_told(where):
            verbs.call("sweep", str(file), "--out", str(where), "--threads", str(threads), *verbs.tolerances(), scene=False)
        return _results(where)


@contextmanager
def _reasons_told(folder: Path) -> Iterator[None]:
    """A sweep of which every member fails says why the first did."""
    try:
        yield
    except Failure as failure:
        if str(failure) or not (folder / "results.csv").exists():
            raise
        with open(folder / "results.csv", encoding="utf-8", newline="") as file:
            first = next(csv.DictReader(file), {})
        raise Failure(f"every member failed, the first one: {first.get('reason', '')}") from None


def _results(folder: Path) -> np.ndarray:
    """The table of a sweep, its texts as those of Python."""
    results = np.load(folder / "results.npy")
    kinds = [(name, results.dtype[name]) for name in results.dtype.names]
    return results.astype([(name, f"U{kind.itemsize}" if kind.kind == "S" else kind) for name, kind in kinds])


_ARGUMENT = {"values": "record"}  # of what is recorded, where the file has another name


class Varied:
    """What differs from member to member of a sweep, as the tables of its file."""

    def __init__(self, grid: Mapping[str, Any], table: Mapping[str, Any], random: Mapping[str, Sequence[Any]],
                 sobol: Mapping[str, Sequence[Any]], count: int | None, seed: int) -> None:
        for what, given in (("grid", grid), ("table", table), ("random", random), ("sobol", sobol)):
            if not isinstance(given, Mapping):
                raise Misuse(f"{what} is {given!r}; a dictionary by name of a parameter, \"start.x\" or \"start.v_x\" is needed")
            texts(list(given), f"the names of {what}")
        if not (grid or table or random or sobol):
            raise Misuse("nothing varies: a sweep needs grid, table, random or sobol")
        if (random or sobol) and count is None:
            raise Misuse("random and sobol need count, the number of draws")
        if not (random or sobol):
            refuse({"count": count, "seed": seed or None}, ("count", "seed"), "it is of draws, which random or sobol ask for")
        self._grid = {name: _column(values, name) for name, values in grid.items()}
        self._table = {name: _column(values, name) for name, values in table.items()}
        if len({len(values) for values in self._table.values()}) > 1:
            raise Misuse("table needs columns of one length; there are " +
                         ", ".join(f"{name} of {len(values)}" for name, values in self._table.items()))
        self._draws = {what: [_law(name, law) for name, law in laws.items()]
                       for what, laws in (("random", random), ("sobol", sobol)) if laws}
        self._count = whole(count, "count", 1) if self._draws else 0
        self._seed = whole(seed, "seed")

    def lines(self, folder: Path, changes: Mapping[str, float]) -> list[str]:
        """Lines of the file of a sweep, a table written into its folder; ``changes``: parameters of all members."""
        lines = []
        if self._table:
            columns = [",".join(self._table), *(",".join(map(repr, row)) for row in zip(*self._table.values()))]
            (folder / "members.csv").write_text("\n".join(columns) + "\n", encoding="utf-8")
            lines += ['table = "members.csv"']
        names = {*self._grid, *self._table, *(name for laws in self._draws.values() for name, _ in laws)}
        lines += ["[set]", *(f"{json.dumps(name)} = {value!r}" for name, value in changes.items() if name not in names)]
        if self._grid:
            lines += ["[grid]", *(f"{json.dumps(name)} = {json.dumps(values)}" for name, values in self._grid.items())]
        for what, laws in self._draws.items():
            lines += [f"[{what}]", f"count = {self._count}", f"seed = {self._seed}", f"[{what}.of]"]
            lines += [f"{json.dumps(name)} = {law}" for name, law in laws]
        return lines


def _column(values: Any, name: str) -> list[float]:
    if np.ndim(values) != 1 or not np.size(values):
        raise Misuse(f"{name} is {values!r}; a list of numbers is needed")
    return table(values, (np.size(values),), name).tolist()


def _law(name: str, law: Sequence[Any]) -> tuple[str, str]:
    """The name and its law, ("uniform", 0.5, 2.0), as the file of a sweep writes it."""
    if not isinstance(law, (list, tuple)) or len(law) != 3 or law[0] not in ("uniform", "log_uniform", "normal"):
        raise Misuse(f"{name} is drawn by {law!r}; (\"uniform\", from, to), (\"log_uniform\", from, to) or "
                     "(\"normal\", mean, deviation) is needed")
    return name, "{ " + f"{law[0]} = [{real(law[1], name)!r}, {real(law[2], name)!r}]" + " }"


def sweep_of_file(file: str | os.PathLike[str], *, out: str | os.PathLike[str] | None = None, threads: int = 0,
                  plugins: Sequence[str] = ()) -> np.ndarray:
    """Runs the file of a sweep: a structured array with a row for each member.

    out: a folder to keep, which a further call continues; it holds the reasons of members that failed (``results.csv``) and a
    page (``report.html``).  threads: 0: one for each processor.  Made by ``diracstep sweep``.
    """
    with tempfile.TemporaryDirectory() as folder:
        file, where = path(file, "file"), Path(path(out, "out")) if out is not None else Path(folder) / "out"
        with _reasons_told(where):
            call_command("sweep", [file, "--out", str(where), "--threads", str(whole(threads, "threads"))], plugins,
                         file)
        return _results(where)
