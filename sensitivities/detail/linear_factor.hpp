#pragma once

#include <Eigen/LU>
#include <diracstep/sensitivities/detail/matrices.hpp>
#include <memory>

namespace diracstep::sensitivity {

/// The factors of a square matrix, for itself and its transpose.  Both solves are in place, for several
/// columns; compute() throws Error where the matrix is singular or not finite.
template <class Matrix>
class LinearFactor;

template <>
class LinearFactor<Columns> {
 public:
  void compute(const Columns& matrix);
  void solve(Columns& right) const;
  void solve_transposed(Columns& right) const;

 private:
  Eigen::PartialPivLU<Columns> factors_;
};

/// By KLU, or by Eigen's SparseLU where the library is built without it.
template <>
class LinearFactor<Sparse> {
 public:
  LinearFactor();
  LinearFactor(LinearFactor&&) noexcept;
  LinearFactor& operator=(LinearFactor&&) noexcept;
  ~LinearFactor();
  void compute(const Sparse& matrix);
  void solve(Columns& right) const;
  void solve_transposed(Columns& right) const;

 private:
  struct Factors;
  std::unique_ptr<Factors> factors_;
};

}  // namespace diracstep::sensitivity
