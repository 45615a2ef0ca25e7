"""Starts as they are solved, equilibria and steady motions."""

from __future__ import annotations

import ctypes
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import _library as c
from .arrays import flag, real, whole
from .errors import Doubt, spelled
from .integrator import State
from .options import stop_flag

if TYPE_CHECKING:
    from .scene import Scene


@dataclass(frozen=True, repr=False, eq=False)
class Equilibrium:
    """Where a scene rests or moves steadily, and its small motions there, δq = Re(mode · exp(eigenvalue · t)).

    The matrices are those of the linear equations on the degrees of freedom, δq = N y and δv = S u + D y with
    mass · u' + damping · u + stiffness · y = 0; None where modes are found by sparse matrices.  The arrays own their memory.
    """

    scene: Scene
    t: float
    q: np.ndarray  #: s numbers, of ``scene.positions``
    v: np.ndarray  #: n numbers; zeros at rest
    lambda_: np.ndarray  #: m numbers: forces of the rows, of redundant ones the least
    iterations: int
    eigenvalues: np.ndarray  #: k complex numbers, 1/time, of a pair the one with imaginary part above 0
    modes: np.ndarray  #: k × n, complex, a row for each eigenvalue, its largest component 1
    zeros: int  #: further eigenvalues, which are 0: motions that nothing draws back
    zeros_below: float  #: the fastest rate that may be behind one of them, 1/time; 0: none is
    free_directions: np.ndarray  #: f × n: in which it goes on as a family, the largest component 1 and 0 in the others
    stability: str  #: in words
    near: float | None  #: the number that the eigenvalues are nearest to; None where they are all
    variation: float  #: of the linear equations on the way to the end of the scene, relative to their size
    doubt: str  #: empty, or why the eigenvalues are not to be believed
    redundant_rows: int
    positions: np.ndarray | None  #: N, n × P
    velocities: np.ndarray | None  #: S, n × U
    drift: np.ndarray | None  #: D, n × P
    mass: np.ndarray | None  #: U × U
    damping: np.ndarray | None  #: U × U, gyroscopic terms in its antisymmetric part
    stiffness: np.ndarray | None  #: U × P

    def __repr__(self) -> str:
        what = "steady motion" if self.v.any() else "equilibrium"
        return f"<{what} of {self.scene.name}: {len(self.eigenvalues)} modes, {self.stability}{', doubted' if self.doubt else ''}>"


@dataclass(frozen=True, repr=False, eq=False)
class SolvedStart(State):
    """The start that runs take, with the arrays of ``State``: guesses moved onto the rows, p projected."""

    acceleration: np.ndarray  #: n numbers; NaN where L is linear in v
    origin: dict[str, str]  #: of each value, "x" or "v_x" ("p_x" of starts by momenta): "given", "guess", "rate", "left out"
    stated: dict[str, float]  #: the value in the scene's file, before it was moved

    def __repr__(self) -> str:
        return f"<start at t = {self.t:g}>"


def _numbers(address: ctypes._Pointer[ctypes.c_double], *shape: int) -> np.ndarray:
    """A copy of the library's numbers; there are none where one size is 0."""
    return np.ctypeslib.as_array(address, shape).copy() if address else np.empty(shape)


def equilibrium_of(scene: Scene, along: bool, modes: int | None, near: float | None) -> Equilibrium:
    wanted = c.Rest(along=int(flag(along, "along")), modes=0 if modes is None else whole(modes, "modes", 1, 1000))
    if near is not None:
        wanted.nearby, wanted.near = 1, real(near, "near")
    stop, told = stop_flag(), []
    wanted.stop = ctypes.pointer(stop)

    def call() -> int:
        found = c.Equilibrium()
        code = c.lib.find_equilibrium(scene._handle, ctypes.byref(wanted), ctypes.byref(found))
        if code == c.OK:
            told.append(_copied(scene, found))  # what it points to belongs to this thread
        return code

    code, message = c.call_interruptibly(call, stop, patience=0.5)
    if code == c.INTERRUPTED:
        raise KeyboardInterrupt(message)
    if code != c.OK:
        scene._raise(code, message)
    rest: Equilibrium = told[0]
    if rest.doubt:
        warnings.warn(f"{scene.name}: {rest.doubt}", Doubt, stacklevel=3)
    return rest


def _copied(scene: Scene, found: c.Equilibrium) -> Equilibrium:
    n, k, p, u = len(scene._coordinates), found.modes, found.positions, found.velocities
    full = bool(np.isnan(found.near))
    shapes = {"of_positions": (n, p), "of_velocities": (n, u), "drift": (n, p), "mass": (u, u), "damping": (u, u),
              "stiffness": (u, p)}
    matrices = {name.removeprefix("of_"): _numbers(getattr(found, name), *shape) if full else None
                for name, shape in shapes.items()}
    return Equilibrium(
        scene, found.time, _numbers(found.q, scene._widths["q"]), _numbers(found.v, n), _numbers(found.lambda_, len(scene._rows)),
        found.iterations, _numbers(found.eigenvalue, k, 2).view(complex).reshape(k), _numbers(found.shape, k, n, 2).view(complex).reshape(k, n),
        found.zeros, found.zeros_below, _numbers(found.free, found.free_directions, n), c.decoded(found.stability),
        None if full else found.near, found.variation, spelled(c.decoded(found.doubt)), found.redundant_rows, **matrices)


def start_of(scene: Scene) -> SolvedStart:
    columns = {name: np.empty(width) for name, width in scene._widths.items()}
    acceleration, origins = np.empty(len(scene._coordinates)), c.Table()
    read = c.State(**{name: array.ctypes.data for name, array in columns.items()})
    scene._check(c.lib.solve_start(scene._handle, ctypes.byref(read), acceleration.ctypes.data, ctypes.byref(origins)))
    lines = origins.lines()
    return SolvedStart(t=read.time, energy=read.energy, **columns, acceleration=acceleration,
                       origin={name: origin for name, origin, _ in lines},
                       stated={name: float(value) for name, _, value in lines if value})
