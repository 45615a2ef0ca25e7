#pragma once

#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/system/scene.hpp>
#include <diracstep/validation/references/reference_run.hpp>

namespace diracstep {

/// A scene as equations F(t, y, ẏ) = 0 for SUNDIALS IDA, y = (q, v, p, Λ, M): stored numbers of the
/// configuration, velocity, momentum, multipliers of all rows and of stabilised ones.
class ContinuousDae {
 public:
  virtual ~ContinuousDae() = default;
  virtual int size() const = 0;
  virtual const SparsityPattern& pattern() const = 0;
  virtual void residual(double t, ConstVectorRef y, ConstVectorRef rate, VectorRef f) = 0;
  /// ∂F/∂y + cj ∂F/∂ẏ on pattern().
  virtual void jacobian(double t, double cj, ConstVectorRef y, ConstVectorRef rate, VectorRef values) = 0;
};

/// How many unknowns such a system has.
int dae_unknowns(const Scene& scene, DaeFormulation formulation);

/// Whether φ = 0 and M are there: for holonomic rows, but in `velocity`.
bool stabilised(const ConstraintRows& rows, DaeFormulation formulation);

}  // namespace diracstep
