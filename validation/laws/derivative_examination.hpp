#pragma once

#include <diracstep/core/system/scene.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// One thing that was looked at.
struct Finding {
  std::string what;
  bool passed = true;
  std::string detail;  ///< numbers; where it failed, what to do
};

/// A point of a motion; y is the velocity where the scene has a Lagrangian, else the momentum.
struct ExaminedPoint {
  double t;
  Vector q, y;
};

/// Every derivative of the scene's functions against central differences along a direction: gradients, second
/// derivatives, rates, of L or H, of the rows and of the force.  Taken at the start, at the points of
/// `motion`, near them, and around them at velocities ten times and positions twice as large where the
/// functions are defined there.  Where the scene says that a function has a kink on the way of the
/// differences, these are taken from one side of it.  Each difference has several step sizes, of which the
/// best agreement counts.  Agreement is to 1e-5 of the terms.
std::vector<Finding> examine_derivatives(const Scene& scene, const std::vector<ExaminedPoint>& motion = {});

/// Whether H, given beside L, is its Legendre transform up to a constant at the start and the points of
/// `motion`:
///   ∂H/∂p(t, q, p) = v,   ∂H/∂q(t, q, p) = −∂L/∂q(t, q, v)   at p = ∂L/∂v(t, q, v),   to 1e-8 of the terms.
Finding examine_legendre_transform(const Scene& scene, const std::vector<ExaminedPoint>& motion);

}  // namespace diracstep
