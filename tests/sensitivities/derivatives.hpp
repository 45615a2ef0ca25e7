#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/sensitivities/sensitivities.hpp>
#include <functional>

#include "combinations.hpp"
#include "stepping.hpp"

/// Derivatives of a motion by differences, to hold the exact ones against.
namespace diracstep::testing {

/// A point to start from; p is any momentum of its class.
struct StartPoint {
  Vector q, p, v;
};

inline StartPoint start_of(const Integrator& integrator) {
  return {integrator.position(), integrator.momentum(), integrator.velocity_estimate()};
}

/// (q, v, projected p) after so many steps from a point; v is left out where L is linear in v.
inline Vector end_of_steps(Integrator& integrator, const StartPoint& from, long steps) {
  integrator.reset();
  integrator.restart(integrator.scene().start.time, from.q, from.p, from.v);
  for (long k = 0; k < steps; ++k) {
    const StepReport report = integrator.step();
    EXPECT_TRUE(report.ok()) << report.failure;
  }
  Sample end;
  EXPECT_TRUE(integrator.sample(Momentum::projected, end).ok());
  if (integrator.scene().lagrangian->structure().phase_space()) return join(end.q, end.p);
  return join(join(end.q, end.v), end.p);
}

/// df(s)/ds at 0 by central differences of sixth order.
inline Vector difference(const std::function<Vector(double)>& f, double s = 4e-3) {
  return (45.0 * (f(s) - f(-s)) - 9.0 * (f(2.0 * s) - f(-2.0 * s)) + (f(3.0 * s) - f(-3.0 * s))) / (60.0 * s);
}

inline Vector stacked(const ReadDirections& read, int column) {
  const Vector q = read.q.col(column), p = read.p.col(column);
  if (read.v.size() == 0) return join(q, p);
  return join(join(q, read.v.col(column)), p);
}

/// A vector of size 1 without a special direction.
inline Vector some_vector(int size, double phase) {
  Vector x(size);
  for (int i = 0; i < size; ++i) x[i] = std::sin(phase + 1.7 * i * i + 0.9 * i);
  return x;
}

}  // namespace diracstep::testing
