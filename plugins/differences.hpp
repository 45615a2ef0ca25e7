#pragma once

#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <functional>
#include <vector>

/// Derivatives by central differences of sixth order,  f' ≈ [45 Δ₁ − 9 Δ₂ + Δ₃] / (60 δ)  with
/// Δ_k = f(x + kδ) − f(x − kδ) and δ about 2e-3 of the variable, or of 1 where that is larger.  Exact up to
/// round-off for polynomials of degree 6; the round-off is about 1e-13 of the terms of f.
namespace diracstep {

/// g_i = ∂f/∂x_i of a scalar function.
void gradient_by_differences(const std::function<double(ConstVectorRef)>& f, ConstVectorRef x, VectorRef g);

/// df/dt of a column f(t, out).
void rate_by_differences(const std::function<void(double, VectorRef)>& f, double t, VectorRef rate);

/// ∂f/∂x of columns on a known pattern.  Columns of the pattern that share no row are differenced together
/// (Curtis, Powell, Reid 1974), so a sparse derivative takes few evaluations.
class JacobianByDifferences {
 public:
  explicit JacobianByDifferences(SparsityPattern pattern);

  const SparsityPattern& pattern() const { return pattern_; }
  std::size_t groups() const { return groups_.size(); }

  /// values = ∂f/∂x on pattern(); `f(x, out)` writes pattern().rows() numbers.
  void evaluate(const std::function<void(ConstVectorRef, VectorRef)>& f, ConstVectorRef x,
                VectorRef values) const;

 private:
  SparsityPattern pattern_;
  std::vector<std::vector<int>> groups_;
};

}  // namespace diracstep
