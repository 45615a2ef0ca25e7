"""DiracStep: structure-preserving time stepping of mechanical and electrical systems with constraints::

    import diracstep as ds

    skate = ds.load("knife_edge")
    run = skate.run(step=0.1, until=10)
    run["x"], run.energy, run.plot("x", "y")

Scenes come from files (``load``), from text (``parse``), from the ``catalogue``, or from Python functions that are traced once
(``Scene``).  Columns are NumPy arrays in the order of ``scene.coordinates``; units are those of the scene.
"""

from __future__ import annotations

from ._library import version
from .catalogue import catalogue, load, methods, parse
from .callbacks import GeneratingFunction
from .command import sweep_of_file as sweep
from .ends import BoundaryMotion, ControlledMotion
from .equilibria import Equilibrium, SolvedStart
from .errors import CallbackCost, Doubt, Error, Failure, Interrupted, Misuse
from .fits import Fit
from .integrator import Gradient, Integrator, Jacobian, State
from .run import Ensemble, Event, Points, Run, Search, Statistics
from .scene import Scene
from .study import Study
from .symbols import (acos, acosh, asin, asinh, atan, atan2, atanh, cos, cosh, exp, log, maximum, minimum, pi, sign, sin, sinh, sqrt,
                      tan, tanh)

__version__ = version()

__all__ = ["BoundaryMotion", "CallbackCost", "ControlledMotion", "Doubt", "Ensemble", "Equilibrium", "Error", "Event",
           "Failure", "Fit", "GeneratingFunction", "Gradient", "Integrator", "Interrupted", "Jacobian", "Misuse",
           "Points", "Run", "Scene", "Search", "SolvedStart", "State", "Statistics", "Study", "acos", "acosh", "asin",
           "asinh", "atan", "atan2", "atanh", "catalogue", "cos", "cosh", "exp", "load", "log", "maximum", "methods",
           "minimum", "parse", "pi", "sign", "sin", "sinh", "sqrt", "sweep", "tan", "tanh", "version"]
