#include <Eigen/LU>
#include <cmath>
#include <diracstep/core/errors.hpp>
#include <diracstep/solvers/detail/linear_solver.hpp>
#include <limits>
#include <stdexcept>
#ifdef DIRACSTEP_WITH_KLU
#include <klu.h>
#endif

namespace diracstep::detail {

namespace {

class DenseLu final : public LinearSolver {
 public:
  explicit DenseLu(int size) : lu_(size), permuted_(size) {}

  bool factor(const double* values) override {
    const Eigen::Map<const Eigen::MatrixXd> matrix(values, permuted_.size(), permuted_.size());
    lu_.compute(matrix);
    const auto pivots = lu_.matrixLU().diagonal();
    const double round_off = std::numeric_limits<double>::epsilon() * static_cast<double>(pivots.size());
    for (Eigen::Index k = 0; k < pivots.size(); ++k)
      if (!(std::abs(pivots[k]) > round_off * matrix.col(k).lpNorm<Eigen::Infinity>())) return false;
    return true;
  }

  void solve(double* b) override {
    Eigen::Map<Eigen::VectorXd> column(b, permuted_.size());
    permuted_.noalias() = lu_.permutationP() * column;  // in place Eigen would allocate
    lu_.matrixLU().triangularView<Eigen::UnitLower>().solveInPlace(permuted_);
    lu_.matrixLU().triangularView<Eigen::Upper>().solveInPlace(permuted_);
    column = permuted_;
  }

  const char* name() const override { return "dense LU"; }

 private:
  Eigen::PartialPivLU<Eigen::MatrixXd> lu_;
  Eigen::VectorXd permuted_;
};

#ifdef DIRACSTEP_WITH_KLU

/// KLU with AMD ordering and without block triangular form: on saddle-point matrices the latter pairs rows
/// with multiplier columns and keeps tiny pivots.  The ordering is made once; a factorisation reuses the
/// pivots of the one before until its reciprocal condition falls far below that of the last fresh one.
class Klu final : public LinearSolver {
 public:
  explicit Klu(const SparsityPattern& pattern)
      : starts_(pattern.column_starts().begin(), pattern.column_starts().end()),
        rows_(pattern.row_indices().begin(), pattern.row_indices().end()),
        size_(pattern.rows()),
        fresh_values_(pattern.nonzeros()) {
    klu_defaults(&common_);
    common_.btf = 0;
    common_.ordering = 0;
    common_.tol = 0.1;
    symbolic_ = klu_analyze(size_, starts_.data(), rows_.data(), &common_);
    if (symbolic_ == nullptr) throw std::runtime_error("KLU could not analyse the pattern of the Jacobian");
  }
  Klu(const Klu&) = delete;
  Klu& operator=(const Klu&) = delete;
  ~Klu() override {
    klu_free_numeric(&numeric_, &common_);
    klu_free_symbolic(&symbolic_, &common_);
  }

  bool factor(const double* values) override {
    // KLU takes its input as mutable but only reads it.
    auto* const input = const_cast<double*>(values);  // NOLINT(cppcoreguidelines-pro-type-const-cast)
    if (numeric_ != nullptr &&
        klu_refactor(starts_.data(), rows_.data(), input, symbolic_, numeric_, &common_) &&
        klu_rcond(symbolic_, numeric_, &common_) && common_.rcond > 1e-3 * fresh_rcond_)
      return true;
    return factor_afresh(values);
  }

  void solve(double* b) override { klu_solve(symbolic_, numeric_, size_, 1, b, &common_); }

  void reset() override { klu_free_numeric(&numeric_, &common_); }

  /// The pivots are those of the matrix that was last factored afresh.
  void save(Snapshot& to) const override {
    to.put(numeric_ != nullptr ? 1.0 : 0.0);
    if (numeric_ != nullptr) to.put(fresh_values_);
  }
  void restore(Snapshot& from) override {
    reset();
    if (from.whole_number(1) == 0) return;
    from.read(fresh_values_);
    factor_afresh(fresh_values_.data());
  }

  const char* name() const override { return "KLU"; }

 private:
  bool factor_afresh(const double* values) {
    auto* const input = const_cast<double*>(values);  // NOLINT(cppcoreguidelines-pro-type-const-cast)
    fresh_values_ = Eigen::Map<const Vector>(values, fresh_values_.size());
    klu_free_numeric(&numeric_, &common_);
    numeric_ = klu_factor(starts_.data(), rows_.data(), input, symbolic_, &common_);
    if (numeric_ == nullptr || !klu_rcond(symbolic_, numeric_, &common_)) return false;
    fresh_rcond_ = common_.rcond;
    return fresh_rcond_ > std::numeric_limits<double>::epsilon();
  }

  std::vector<int> starts_;
  std::vector<int> rows_;
  int size_;
  klu_common common_{};
  klu_symbolic* symbolic_ = nullptr;
  klu_numeric* numeric_ = nullptr;
  Vector fresh_values_;  ///< what the pivots in use were chosen for
  double fresh_rcond_ = 0.0;
};

#endif

}  // namespace

std::unique_ptr<LinearSolver> make_linear_solver(const SparsityPattern& pattern) {
  if (pattern.is_dense()) return std::make_unique<DenseLu>(pattern.rows());
#ifdef DIRACSTEP_WITH_KLU
  return std::make_unique<Klu>(pattern);
#else
  throw Misuse("this build has no KLU, so sparse systems cannot be solved; raise dense_limit to " +
               std::to_string(pattern.rows()) + " or build with DIRACSTEP_WITH_KLU=ON");
#endif
}

}  // namespace diracstep::detail
