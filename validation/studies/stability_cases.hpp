#pragma once

#include <diracstep/validation/studies/stability_study.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// The stiff and extreme cases, group by group:
///
///   stiff_spring_pendulum  k = 1e2 … 1e12 at the natural step, hω = 0.1 … 1e4, and at a fifth of it;
///                          from 1e8 on the reference is the rigid pendulum, approached as g/k
///   the same as a row      with compliance 1/k, k = 1e2 … 1e14 and ∞, at twice the natural step
///   fput                   ω = 50 … 5e4; watched for the energy and its adiabatic invariant, the energy of
///   the
///                          stiff springs Σ (v_z² + ω² z²)/2
///   flyball_governor       steps 5e-3 … 1e-4 over its stiff dampers; the energy must not grow
///   kepler_e099            fixed steps through the pericentre, where the rate is 200 times faster
///   n_four_bar             through poses where constraints are redundant; watched for leaving the branch
///                          on which all uprights are parallel
///   near a flat pose       n_four_bar started 1e-1 … 1e-12 before such a pose, and in it
///   near a collision       Kepler started at a pericentre of 1e-2 … 1e-8
///   mass ratio             knife edge, torn masses, double pendulum with ratios 1e-12 … 1e12
///   rows scaled            rows multiplied by 1e-8, 1e8
///   redundant constraints  a row given twice: refused, and run with the second one dropped
///   steps scaled           1e-12 … 1e2 times the natural step
///
/// `full` adds cases in between, longer times and runs of 1e7 steps.
std::vector<StabilityCase> stability_cases(bool full);

/// A scene at its natural step up to its own end; watched for the energy unless a force acts on it, and for
/// the invariants its file states.
StabilityCase stability_case(const CatalogueScene& scene);

}  // namespace diracstep
