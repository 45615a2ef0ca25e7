#pragma once

/// All that a program needs to state a scene and step it: Lagrangians, Hamiltonians, rows and forces from
/// formulas, the integrator, runs and their checks, the solver, and Error, which every exception of the
/// library derives from.
///
/// Beside it stand headers for what not every program needs: core/adaptive/ (steps of varying size, an error
/// asked for), core/runs/ensemble.hpp (many starts over threads), core/dirac/ (the discrete Dirac structures
/// themselves), and those of the plugins, scene files and studies.
#include <diracstep/version.h>

#include <diracstep/constraints/discrete.hpp>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/interconnection.hpp>
#include <diracstep/constraints/kirchhoff.hpp>
#include <diracstep/constraints/linear.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/on_space.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
