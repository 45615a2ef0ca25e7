#pragma once

#include <diracstep/core/system/scene.hpp>
#include <memory>

namespace diracstep {

/// The equations of ReducedEquations for L regular on Δ_Q, y = (q, v), with the numbers of coordinates and
/// rows known when they are compiled: as quick as they come from the derivatives of a scene.
class SizedEquations {
 public:
  virtual ~SizedEquations() = default;
  virtual int size() const = 0;
  /// ẏ at y; false where the linear system is singular.
  virtual bool rate(const double* y, double* rate) = 0;
};

/// Null where there are none: above 4 coordinates and 2 rows in one block, on spaces that are not R^n, with
/// forces, with L linear in v, and where L or the rows depend on time.
std::unique_ptr<SizedEquations> sized_equations(const Scene& scene);

}  // namespace diracstep
