"""libdiracstep by ctypes: the structs and functions of c_interface/diracstep.h."""

from __future__ import annotations

import ctypes
import os
import sys
import threading
import time
from ctypes import (CFUNCTYPE, POINTER, Structure, byref, c_char_p, c_double, c_int, c_long, c_size_t, c_uint,
                    c_void_p)
from pathlib import Path
from typing import Any, Callable

from .errors import raised

VERSION = 8  # DIRACSTEP_VERSION_OF_C_INTERFACE
PLUGIN_VERSION = 1  # DIRACSTEP_PLUGIN_VERSION
FILE = "libdiracstep.so.0.1"

OK, FAILED, MISUSE, INTERRUPTED = range(4)
MOMENTA = {"projected": 0, "plus": 1, "minus": 2}
ABOUT, COORDINATES, ROWS, INVARIANTS, PARAMETERS, METHODS, RULES, SCENES, PLUGINS, OUTPUTS, INPUTS, EVENTS, POSITIONS = range(13)

Numbers = POINTER(c_double)


class Pattern(Structure):
    _fields_ = [("column_starts", POINTER(c_int)), ("row_indices", POINTER(c_int))]


# Columns go to callbacks as addresses: views of them are then made in half of the time.
VALUE = CFUNCTYPE(c_int, c_void_p, c_double, c_void_p, c_void_p, c_void_p)
POSITION = CFUNCTYPE(c_int, c_void_p, c_double, c_void_p, c_void_p)
COEFFICIENTS = CFUNCTYPE(c_int, c_void_p, c_double, c_void_p, c_void_p, c_void_p)


class Function(Structure):
    _fields_ = [("data", c_void_p), ("pattern", Pattern), ("structure", c_int), ("value", VALUE),
                ("gradient", c_void_p), ("hessian", c_void_p)]


class Rows(Structure):
    _fields_ = [("data", c_void_p), ("rows", c_int), ("holonomic", c_int), ("names", POINTER(c_char_p)),
                ("pattern", Pattern), ("position", POSITION), ("coefficients", COEFFICIENTS)]


class Force(Structure):
    _fields_ = [("data", c_void_p), ("pattern", Pattern), ("value", VALUE)]


class CallbackScene(Structure):
    _fields_ = [("name", c_char_p), ("description", c_char_p), ("dimension", c_int),
                ("coordinates", POINTER(c_char_p)), ("lagrangian", POINTER(Function)), ("row_blocks", c_int),
                ("rows", POINTER(POINTER(Rows))), ("force", POINTER(Force)), ("start_time", c_double),
                ("start_q", Numbers), ("start_v", Numbers), ("end_time", c_double), ("step", c_double)]


class Interval(Structure):
    _fields_ = [("start", c_double), ("size", c_double)]


SYSTEM_VALUE = CFUNCTYPE(c_int, c_void_p, c_double, Numbers, Numbers, Numbers)


class SystemFunction(Structure):
    _fields_ = [("data", c_void_p), ("pattern", Pattern), ("structure", c_int), ("value", SYSTEM_VALUE),
                ("gradient", c_void_p), ("hessian", c_void_p)]


class System(Structure):
    _fields_ = [("name", c_char_p), ("dimension", c_int), ("lagrangian", SystemFunction),
                ("hamiltonian", SystemFunction), ("start_time", c_double), ("start_q", Numbers),
                ("start_v", Numbers)]


GENERATING_VALUE = CFUNCTYPE(c_int, c_void_p, POINTER(System), Interval, c_void_p, c_void_p)


class GeneratingMethod(Structure):
    _fields_ = [("name", c_char_p), ("summary", c_char_p), ("type", c_int), ("order", c_int),
                ("constrained_order", c_int), ("flags", c_int), ("constraint_rule", c_char_p),
                ("adjoint", c_char_p), ("inner_columns", c_int), ("data", c_void_p), ("create", c_void_p),
                ("destroy", c_void_p), ("value", GENERATING_VALUE), ("gradient", c_void_p),
                ("hessian", c_void_p), ("guess_inner", c_void_p), ("error_text", c_void_p)]


class Plugin(Structure):
    _fields_ = [("version", c_uint), ("size", c_uint), ("name", c_char_p), ("description", c_char_p),
                ("methods", c_int), ("method", POINTER(POINTER(GeneratingMethod))), ("rules", c_int),
                ("rule", c_void_p), ("scenes", c_int), ("scene", c_void_p)]


class Parameter(Structure):
    _fields_ = [("name", c_char_p), ("value", c_double)]


class Source(Structure):
    _fields_ = [("name", c_char_p), ("text", c_char_p), ("callbacks", POINTER(CallbackScene)),
                ("parameters", c_int), ("parameter", POINTER(Parameter)), ("drop_redundant", c_int),
                ("plugins", c_int), ("plugin", POINTER(c_char_p)), ("linked", c_int),
                ("linked_plugin", POINTER(POINTER(Plugin))), ("tolerances", c_int), ("tolerance", POINTER(Parameter))]


class Facts(Structure):
    _fields_ = [("dimension", c_int), ("storage", c_int), ("rows", c_int), ("invariants", c_int), ("outputs", c_int), ("start_time", c_double),
                ("start_q", Numbers), ("start_v", Numbers), ("end_time", c_double), ("step", c_double)]


class Table(Structure):
    _fields_ = [("rows", c_int), ("columns", c_int), ("cells", POINTER(c_char_p))]

    def lines(self) -> list[tuple[str, ...]]:
        """The rows, copied."""
        width = self.columns
        if not width:
            return []
        cells = [decoded(self.cells[k]) for k in range(self.rows * width)]
        return [tuple(cells[k:k + width]) for k in range(0, len(cells), width)]


class Options(Structure):
    _fields_ = [("method", c_char_p), ("order", c_int), ("step", c_double), ("ends", c_int), ("end", c_double),
                ("rule", c_char_p), ("solver", c_char_p), ("jacobian", c_char_p), ("project_start", c_int),
                ("substeps", c_int), ("compensated_sums", c_int), ("pushed", c_int), ("fixed", c_int), ("eps", c_double),
                ("control", c_char_p), ("smallest_step", c_double), ("max_steps", c_long)]


class State(Structure):
    _fields_ = [("time", c_double), ("energy", c_double), ("q", c_void_p), ("v", c_void_p), ("p", c_void_p),
                ("lambda_", c_void_p), ("invariants", c_void_p), ("outputs", c_void_p)]


class Event(Structure):
    _fields_ = [("name", c_char_p), ("time", c_double), ("q", Numbers), ("v", Numbers), ("after_q", Numbers),
                ("after_v", Numbers), ("impulse", c_double)]


class Statistics(Structure):
    _fields_ = [("steps", c_long), ("solves", c_long), ("iterations", c_long), ("residuals", c_long),
                ("jacobians", c_long), ("retries", c_long), ("step", c_double), ("smallest", c_double),
                ("largest", c_double), ("resets", c_long), ("stopped", c_int), ("order", c_int), ("method", c_char_p)]


class Points(Structure):
    pass


ENLARGE = CFUNCTYPE(c_int, c_void_p, POINTER(Points))
Points._fields_ = [("room", c_long), ("count", c_long), ("t", c_void_p), ("q", c_void_p), ("v", c_void_p),
                   ("p", c_void_p), ("lambda_", c_void_p), ("invariants", c_void_p), ("outputs", c_void_p),
                   ("energy", c_void_p), ("enlarge", ENLARGE), ("data", c_void_p)]


class Course(Structure):
    _fields_ = [("steps", c_long), ("times", c_int), ("time", c_void_p), ("ends", c_int), ("end", c_double),
                ("every", c_long), ("momentum", c_int), ("stop", POINTER(c_int))]


class ErrorRequest(Structure):
    _fields_ = [("error", c_double), ("steps", c_int), ("max_solves", c_long), ("max_time", c_double)]


class Found(Structure):
    _fields_ = [("estimate", c_double), ("observed_order", c_double), ("step", c_double), ("order", c_int),
                ("varies", c_int), ("solves", c_long), ("method", c_char_p), ("reason", c_char_p),
                ("warning", c_char_p), ("runs", Table), ("stopped", c_int), ("events", c_long),
                ("event", POINTER(Event))]


class Rest(Structure):
    _fields_ = [("along", c_int), ("modes", c_int), ("nearby", c_int), ("near", c_double), ("stop", POINTER(c_int))]


class Equilibrium(Structure):
    _fields_ = [("time", c_double), ("iterations", c_int), ("q", Numbers), ("v", Numbers), ("lambda_", Numbers), ("modes", c_int),
                ("eigenvalue", Numbers), ("shape", Numbers), ("zeros", c_int), ("zeros_below", c_double),
                ("free_directions", c_int), ("free", Numbers), ("stability", c_char_p), ("near", c_double), ("variation", c_double),
                ("redundant_rows", c_int), ("positions", c_int), ("velocities", c_int),
                ("of_positions", Numbers), ("of_velocities", Numbers), ("drift", Numbers), ("mass", Numbers), ("damping", Numbers),
                ("stiffness", Numbers), ("doubt", c_char_p)]


class Data(Structure):
    _fields_ = [("file", c_char_p), ("columns", c_int), ("column", POINTER(c_char_p)), ("rows", c_long), ("time", c_void_p),
                ("value", c_void_p), ("sigmas", c_int), ("sigma", POINTER(Parameter)), ("parameters", c_int),
                ("parameter", POINTER(c_char_p)), ("starts", c_int), ("start", POINTER(Parameter)), ("confidence", c_double),
                ("max_motions", c_int), ("stop", POINTER(c_int))]


class Fitted(Structure):
    _fields_ = [("motions", c_int), ("measured", c_long), ("residual", c_double), ("value", Numbers), ("interval", Numbers),
                ("covariance", Numbers), ("ending", c_char_p), ("doubt", c_char_p)]


class Ensemble(Structure):
    _fields_ = [("members", c_int), ("time", c_void_p), ("q", c_void_p), ("v", c_void_p), ("steps", c_long),
                ("momentum", c_int), ("threads", c_int), ("stop", POINTER(c_int))]


COTANGENT = CFUNCTYPE(c_int, c_void_p, POINTER(State), Numbers, Numbers, Numbers)


class Derivatives(Structure):
    _fields_ = [("steps", c_long), ("parameters", c_int), ("parameter", POINTER(c_char_p)), ("q", c_void_p),
                ("v", c_void_p), ("p", c_void_p), ("by_parameters", c_void_p), ("cotangent", COTANGENT), ("data", c_void_p),
                ("stop", POINTER(c_int))]


class Ends(Structure):
    _fields_ = [("of_start", c_int), ("at_start", POINTER(Parameter)), ("of_end", c_int), ("at_end", POINTER(Parameter)),
                ("periodic", c_int), ("guesses", c_int), ("guess_time", c_void_p), ("guess_q", c_void_p), ("guess_v", c_void_p),
                ("max_iterations", c_int), ("stop", POINTER(c_int))]


class Boundary(Structure):
    _fields_ = [("iterations", c_int), ("correction", c_double), ("residual", c_double), ("method", c_char_p),
                ("doubt", c_char_p), ("other", c_char_p), ("no_action", c_char_p), ("action", c_double), ("gradient", Numbers),
                ("hessian", Numbers), ("free_directions", c_int), ("multipliers", c_int), ("multiplier", Numbers)]


class Control(Structure):
    _fields_ = [("of_least", c_int), ("least", POINTER(Parameter)), ("of_greatest", c_int), ("greatest", POINTER(Parameter)),
                ("degree", c_int), ("tolerance", c_double)]


class Controlled(Structure):
    _fields_ = [("iterations", c_int), ("cost", c_double), ("residual", c_double), ("end_of_run", c_double),
                ("method", c_char_p), ("doubt", c_char_p), ("controls", c_int), ("name", POINTER(c_char_p)),
                ("control_points", c_long), ("control_time", Numbers), ("control_value", Numbers)]


# Handles and columns go as plain addresses: a call then costs a fraction of a microsecond.
_PROTOTYPES: dict[str, tuple[Any, list[Any]]] = {
    "message": (c_char_p, []),
    "version": (c_char_p, []),
    "open": (c_int, [c_uint, POINTER(Source), POINTER(c_void_p)]),
    "close": (None, [c_void_p]),
    "read_facts": (c_int, [c_void_p, POINTER(Facts)]),
    "list": (c_int, [c_void_p, c_int, POINTER(Table)]),
    "create": (c_int, [c_void_p, POINTER(Options), POINTER(c_void_p)]),
    "destroy": (None, [c_void_p]),
    "plan": (c_int, [c_void_p, POINTER(Table)]),
    "step": (c_int, [c_void_p, c_long]),
    "step_by": (c_int, [c_void_p, c_double]),
    "push": (c_int, [c_void_p, c_void_p]),
    "read": (c_int, [c_void_p, c_int, POINTER(State)]),
    "time": (c_double, [c_void_p]),
    "reset": (c_int, [c_void_p, c_double, c_void_p, c_void_p]),
    "save": (c_int, [c_void_p, c_void_p, c_size_t, POINTER(c_size_t)]),
    "restore": (c_int, [c_void_p, c_char_p, c_size_t]),
    "doubt": (c_char_p, [c_void_p]),
    "read_statistics": (c_int, [c_void_p, POINTER(Statistics)]),
    "count_events": (c_long, [c_void_p]),
    "read_event": (c_int, [c_void_p, c_long, POINTER(Event)]),
    "differentiate": (c_int, [c_void_p, c_void_p, POINTER(Derivatives)]),
    "run": (c_int, [c_void_p, POINTER(Course), POINTER(Points)]),
    "expect": (c_long, [c_void_p, POINTER(Course)]),
    "solve": (c_int, [c_void_p, POINTER(Options), POINTER(Course), POINTER(ErrorRequest), POINTER(Points),
                      POINTER(Found)]),
    "solve_start": (c_int, [c_void_p, POINTER(State), c_void_p, POINTER(Table)]),
    "find_equilibrium": (c_int, [c_void_p, POINTER(Rest), POINTER(Equilibrium)]),
    "fit": (c_int, [c_void_p, POINTER(Options), POINTER(Data), POINTER(Fitted)]),
    "run_ensemble": (c_int, [c_void_p, POINTER(Options), POINTER(Ensemble), POINTER(Points), POINTER(Table)]),
    "solve_boundary": (c_int, [c_void_p, POINTER(Options), POINTER(Ends), POINTER(Points), POINTER(Boundary)]),
    "solve_control": (c_int, [c_void_p, POINTER(Options), POINTER(Ends), POINTER(Control), POINTER(Points),
                              POINTER(Controlled)]),
    "can_control": (c_int, []),
}


def _places() -> list[str]:
    """Where the library may be: as DIRACSTEP_LIBRARY says, else where the loader and Python look."""
    given = os.environ.get("DIRACSTEP_LIBRARY")
    if given:
        return [given]
    return [FILE, *(str(Path(prefix) / "lib" / FILE) for prefix in (sys.prefix, "/usr/local"))]


def _load() -> ctypes.CDLL:
    failures = []
    for place in _places():
        try:
            return ctypes.CDLL(place)
        except OSError as error:
            failures.append(f"{place}: {error}")
    raise ImportError("libdiracstep was not found; install it (Debian package libdiracstep0.1), or set DIRACSTEP_LIBRARY "
                      "to the path of libdiracstep.so\n  " + "\n  ".join(failures))


class _Functions:
    """The functions of the library, without their prefix."""

    def __init__(self, library: ctypes.CDLL) -> None:
        for name, (result, arguments) in _PROTOTYPES.items():
            try:
                function = library["diracstep_" + name]
            except AttributeError as error:
                raise ImportError(f"libdiracstep is of another version: it has no function diracstep_{name}") from error
            function.restype, function.argtypes = result, arguments
            setattr(self, name, function)

    def __getattr__(self, name: str) -> Any:  # for type checkers: what __init__ sets
        raise AttributeError(name)


lib = _Functions(_load())


def version() -> str:
    """The version of the library, "0.1.0"."""
    return decoded(lib.version())


def check(code: int) -> None:
    """Raises what a code stands for."""
    if code != OK:
        raise raised(code, decoded(lib.message()))


def encoded(text: str | None) -> bytes | None:
    """Bytes of a path that are no UTF-8, which Python's texts hold as surrogates, become themselves again."""
    return None if text is None else text.encode("utf-8", "surrogateescape")


def decoded(text: bytes | None) -> str:
    """Bytes that are no UTF-8, as paths and files may hold them, stand as \\xXX."""
    return (text or b"").decode("utf-8", "backslashreplace")


def lines_of(handle: int, what: int) -> list[tuple[str, ...]]:
    table = Table()
    check(lib.list(handle, what, byref(table)))
    return table.lines()


class KeptException:
    """The first exception of a Python function that the library called, which cannot pass through C."""

    def __init__(self) -> None:
        self.kept: BaseException | None = None

    def keep(self, exception: BaseException) -> int:
        """Keeps it; the code to return for it."""
        if self.kept is None:
            self.kept = exception
        return 1

    def take(self) -> BaseException | None:
        kept, self.kept = self.kept, None
        return kept


def call_interruptibly(call: Callable[[], int], stop: c_int, watch: Callable[[], None] | None = None,
                       patience: float | None = None) -> tuple[int, str]:
    """Makes a long call on a thread of its own and waits for it: the code, and the library's message.

    Ctrl-C sets the flag ``stop``, which ends the call; a second one is raised as usual, and then the call may outlive this
    function: ``call`` must keep all that it uses.  So does the first one ``patience`` seconds later, of a call that may take long
    to see the flag.  ``watch`` is called about ten times a second.
    """
    outcome: list[Any] = []
    # Thread.join takes a thread for ended where Ctrl-C comes in it (Python 3.11), and Event.wait may keep its lock then.
    running = threading.Lock()
    running.acquire()
    asked = 0.0

    def work() -> None:
        try:
            code = call()
            outcome.extend((code, decoded(lib.message()) if code != OK else ""))  # messages belong to the thread
        except BaseException as error:  # noqa: BLE001  of a callback's machinery: raised below, in the caller
            outcome.extend((error, ""))
        running.release()

    thread = threading.Thread(target=work, name="diracstep", daemon=True)
    try:
        thread.start()
        while not outcome:
            try:
                if not running.acquire(timeout=0.1) and watch is not None:
                    watch()
                if asked and patience is not None and time.monotonic() > asked + patience and not outcome:
                    raise KeyboardInterrupt
            except KeyboardInterrupt:
                if stop.value != 0:
                    raise
                asked = time.monotonic()
                stop.value = 1
    except BaseException:
        stop.value = 1  # the call must not go on by itself
        raise
    code, message = outcome
    if isinstance(code, BaseException):
        raise code
    return code, message
