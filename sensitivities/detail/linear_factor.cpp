#include <algorithm>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/sensitivities/detail/linear_factor.hpp>
#include <span>
#include <vector>
#ifdef DIRACSTEP_WITH_KLU
#include <klu.h>
#else
#include <Eigen/SparseLU>
#endif

namespace diracstep::sensitivity {

namespace {

[[noreturn]] void fail_singular() {
  throw Error("the Jacobian of a step is singular or not finite: the motion has no derivative there");
}

}  // namespace

void LinearFactor<Columns>::compute(const Columns& matrix) {
  factors_.compute(matrix);
  const auto pivots = factors_.matrixLU().diagonal();
  if (!pivots.allFinite() || (pivots.array() == 0.0).any()) fail_singular();
}
void LinearFactor<Columns>::solve(Columns& right) const { right = factors_.solve(right); }
void LinearFactor<Columns>::solve_transposed(Columns& right) const {
  right = factors_.transpose().solve(right);
}

#ifdef DIRACSTEP_WITH_KLU

struct LinearFactor<Sparse>::Factors {
  Factors() { klu_defaults(&common); }
  Factors(const Factors&) = delete;
  Factors& operator=(const Factors&) = delete;
  ~Factors() { clear(); }
  void clear() {
    klu_free_numeric(&numeric, &common);
    klu_free_symbolic(&symbolic, &common);
  }
  /// The ordering is that of the pattern, which is the same from step to step.
  void analyse(const Sparse& matrix, int* starts, int* rows) {
    if (symbolic != nullptr && std::ranges::equal(known_starts, std::span(starts, matrix.outerSize() + 1)) &&
        std::ranges::equal(known_rows, std::span(rows, matrix.nonZeros())))
      return;
    clear();
    known_starts.assign(starts, starts + matrix.outerSize() + 1);
    known_rows.assign(rows, rows + matrix.nonZeros());
    size = static_cast<int>(matrix.rows());
    symbolic = klu_analyze(size, starts, rows, &common);
    if (symbolic == nullptr) fail_singular();
  }

  /// With the pivots of the matrix before, which mostly serve the next step as well; false where entries grow
  /// by them far more than they did then.
  bool factor_again(int* starts, int* rows, double* values) {
    if (numeric == nullptr || klu_refactor(starts, rows, values, symbolic, numeric, &common) == 0 ||
        common.status != KLU_OK || klu_rgrowth(starts, rows, values, symbolic, numeric, &common) == 0)
      return false;
    return common.rgrowth >= least_part * growth;
  }
  void factor(int* starts, int* rows, double* values) {
    klu_free_numeric(&numeric, &common);
    numeric = klu_factor(starts, rows, values, symbolic, &common);
    if (numeric == nullptr || common.status != KLU_OK) fail_singular();
    growth = klu_rgrowth(starts, rows, values, symbolic, numeric, &common) != 0 ? common.rgrowth : 1.0;
  }

  static constexpr double least_part = 0.1;
  double growth = 1.0;  ///< the reciprocal pivot growth of the last full factorisation
  mutable klu_common common{};
  klu_symbolic* symbolic = nullptr;
  klu_numeric* numeric = nullptr;
  int size = 0;
  std::vector<int> known_starts, known_rows;
};

void LinearFactor<Sparse>::compute(const Sparse& matrix) {
  Factors& f = *factors_;
  auto* const starts = const_cast<int*>(matrix.outerIndexPtr());  // KLU reads them only
  auto* const rows = const_cast<int*>(matrix.innerIndexPtr());
  auto* const values = const_cast<double*>(matrix.valuePtr());
  f.analyse(matrix, starts, rows);
  if (!f.factor_again(starts, rows, values)) f.factor(starts, rows, values);
}
void LinearFactor<Sparse>::solve(Columns& right) const {
  const Factors& f = *factors_;
  klu_solve(f.symbolic, f.numeric, f.size, static_cast<int>(right.cols()), right.data(), &f.common);
}
void LinearFactor<Sparse>::solve_transposed(Columns& right) const {
  const Factors& f = *factors_;
  klu_tsolve(f.symbolic, f.numeric, f.size, static_cast<int>(right.cols()), right.data(), &f.common);
}

#else

struct LinearFactor<Sparse>::Factors {
  mutable Eigen::SparseLU<Sparse> lu;
};

void LinearFactor<Sparse>::compute(const Sparse& matrix) {
  factors_->lu.compute(matrix);
  if (factors_->lu.info() != Eigen::Success) fail_singular();
}
void LinearFactor<Sparse>::solve(Columns& right) const { right = factors_->lu.solve(right).eval(); }
void LinearFactor<Sparse>::solve_transposed(Columns& right) const {
  right = factors_->lu.transpose().solve(right).eval();
}

#endif

LinearFactor<Sparse>::LinearFactor() : factors_(std::make_unique<Factors>()) {}
LinearFactor<Sparse>::LinearFactor(LinearFactor&&) noexcept = default;
LinearFactor<Sparse>& LinearFactor<Sparse>::operator=(LinearFactor&&) noexcept = default;
LinearFactor<Sparse>::~LinearFactor() = default;

}  // namespace diracstep::sensitivity
