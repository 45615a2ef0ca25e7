#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/errors.hpp>
#include <diracstep/solvers/detail/linear_solver.hpp>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>
#ifdef DIRACSTEP_WITH_KLU
#include <klu.h>
#endif

namespace diracstep::detail {

namespace {

constexpr int shortest_unrolled = 5;

/// Elimination by columns with row exchanges, for few unknowns: of fixed size N, or of any size for N = 0.
/// Multipliers that vanish, of which saddle-point matrices have many, are skipped.
template <int N>
class SmallLu final : public LinearSolver {
 public:
  explicit SmallLu(int size)
      : size_(size), lu_(static_cast<std::size_t>(size) * size), inverse_pivots_(size), exchanges_(size) {}

  bool factor(const double* values) override {
    const int n = size();
    std::copy_n(values, n * n, lu_.data());
    const double round_off = std::numeric_limits<double>::epsilon() * n;
    for (int k = 0; k < n; ++k) {
      double* const pivot_column = column(k);
      int pivot = k;
      for (int i = k + 1; i < n; ++i)
        if (std::abs(pivot_column[i]) > std::abs(pivot_column[pivot])) pivot = i;
      double largest = 0.0;
      for (int i = 0; i < n; ++i) largest = std::max(largest, std::abs(values[i + k * n]));
      if (!(std::abs(pivot_column[pivot]) > round_off * largest)) return false;
      exchanges_[static_cast<std::size_t>(k)] = pivot;
      if (pivot != k)
        for (int j = 0; j < n; ++j) std::swap(column(j)[k], column(j)[pivot]);
      const double inverse = inverse_pivots_[static_cast<std::size_t>(k)] = 1.0 / pivot_column[k];
      for (int i = k + 1; i < n; ++i) pivot_column[i] *= inverse;
      for (int j = k + 1; j < n; ++j) subtract(pivot_column, k, column(j)[k], column(j));
    }
    return true;
  }

  void solve(double* b) override {
    const int n = size();
    for (int k = 0; k < n; ++k) std::swap(b[k], b[exchanges_[static_cast<std::size_t>(k)]]);
    if constexpr (N >= shortest_unrolled) return substitute(b);
    for (int k = 0; k < n; ++k) subtract(column(k), k, b[k], b);
    for (int k = n - 1; k >= 0; --k) {
      b[k] *= inverse_pivots_[static_cast<std::size_t>(k)];
      for (int i = 0; i < k; ++i) b[i] -= column(k)[i] * b[k];
    }
  }

  const char* name() const override { return "dense LU"; }

 private:
  int size() const { return N > 0 ? N : size_; }
  double* column(int j) { return lu_.data() + static_cast<std::ptrdiff_t>(j) * size(); }

  /// Substitution with b in registers: each entry waits for the one before it, and where that goes through
  /// memory the waiting takes twice the time.
  void substitute(double* b) const {
    const double* const lu = lu_.data();
    const double* const inverse_pivots = inverse_pivots_.data();
    std::array<double, std::max(N, 1)> held;
    double* const x = held.data();
    std::copy_n(b, N, x);
#pragma GCC unroll 16
    for (int k = 0; k < N; ++k)
#pragma GCC unroll 16
      for (int i = k + 1; i < N; ++i) x[i] -= x[k] * lu[k * N + i];
#pragma GCC unroll 16
    for (int k = N - 1; k >= 0; --k) {
      x[k] *= inverse_pivots[k];
#pragma GCC unroll 16
      for (int i = 0; i < k; ++i) x[i] -= lu[k * N + i] * x[k];
    }
    std::copy_n(x, N, b);
  }

  /// to −= factor · from, below row k.
  void subtract(const double* from, int k, double factor, double* to) const {
    if (factor == 0.0) return;
    for (int i = k + 1; i < size(); ++i) to[i] -= factor * from[i];
  }

  int size_;
  std::vector<double> lu_, inverse_pivots_;
  std::vector<int> exchanges_;
};

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

  bool holds(const double* values) const override {
    return numeric_ != nullptr && fresh_values_ == Eigen::Map<const Vector>(values, fresh_values_.size());
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

/// Up to this size plain loops are faster than Eigen's blocks.
constexpr int largest_small = 32;
constexpr std::size_t largest_fixed = 16;

template <int N>
std::unique_ptr<LinearSolver> small_lu(int size) {
  return std::make_unique<SmallLu<N>>(size);
}

template <std::size_t... N>
constexpr auto small_lu_of_each_size(std::index_sequence<N...>) {
  return std::array{&small_lu<static_cast<int>(N)>...};
}

std::unique_ptr<LinearSolver> make_dense_lu(int size) {
  static constexpr auto make = small_lu_of_each_size(std::make_index_sequence<largest_fixed + 1>());
  if (size > largest_small) return std::make_unique<DenseLu>(size);
  const auto length = static_cast<std::size_t>(size);
  return make.at(length <= largest_fixed ? length : 0)(size);
}

}  // namespace

std::unique_ptr<LinearSolver> make_linear_solver(const SparsityPattern& pattern) {
  if (pattern.is_dense()) return make_dense_lu(pattern.rows());
#ifdef DIRACSTEP_WITH_KLU
  return std::make_unique<Klu>(pattern);
#else
  throw Misuse("this build has no KLU, so sparse systems cannot be solved; raise dense_limit to " +
               std::to_string(pattern.rows()) + " or build with DIRACSTEP_WITH_KLU=ON");
#endif
}

}  // namespace diracstep::detail
