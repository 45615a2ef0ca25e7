#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <memory>
#include <string>
#include <vector>

#include "scenes.hpp"

/// Every constraint class with every kind of step and of matrix.
namespace diracstep::testing {

using ScenePointer = std::shared_ptr<const Scene>;

inline Integrator integrator_for(const ScenePointer& scene, const IntegratorOptions& options) {
  return {scene, Registry::with_built_ins(), kinsol(), options};
}

/// Methods that differ in how a step is made: implicit, explicit where L allows, with inner columns, with
/// stages, composed of itself and of a pair.
inline const std::vector<IntegratorOptions>& every_kind_of_step() {
  static const std::vector<IntegratorOptions> kinds{
      {.method = "type1/midpoint", .step = 0.05},
      {.method = "type1/trapezoidal", .step = 0.05},
      {.method = "type3/legendre(type1/midpoint)", .step = 0.05},
      {.method = "type1/gl:2", .step = 0.05},
      {.method = "type1/midpoint", .order = 4, .step = 0.05},
      {.method = "type2/euler", .order = 2, .step = 0.05},
  };
  return kinds;
}

inline std::string describe(const ScenePointer& scene, const IntegratorOptions& options) {
  return scene->name + ", " + options.method + ", order " + std::to_string(options.order) + ", dense limit " +
         std::to_string(options.dense_limit);
}

/// Calls check(scene, options) for every constraint class, kind of step, and kind of matrix.
template <class Check>
void for_every_combination(Check check) {
  for (const auto& scene : every_constraint_class())
    for (IntegratorOptions options : every_kind_of_step())
      for (const int limit : {40, 0}) {
        options.dense_limit = limit;
        SCOPED_TRACE(describe(scene, options));
        check(scene, options);
      }
}

inline bool same_bits(const Sample& a, const Sample& b) {
  return a.time == b.time && a.q == b.q && a.v == b.v && a.p == b.p && a.lambda == b.lambda &&
         a.energy == b.energy;
}

inline bool same_bits(const std::vector<Sample>& a, const std::vector<Sample>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const Sample& x, const Sample& y) { return same_bits(x, y); });
}

}  // namespace diracstep::testing
