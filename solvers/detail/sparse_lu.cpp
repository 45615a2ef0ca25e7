#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/solvers/detail/linear_solver.hpp>
#include <limits>
#include <vector>
#ifdef DIRACSTEP_WITH_KLU
#include <klu.h>
#else
#include <Eigen/SparseLU>
#include <diracstep/core/numerics/sparse_columns.hpp>
#endif

namespace diracstep::detail {

namespace {

#ifdef DIRACSTEP_WITH_KLU

/// KLU with AMD ordering and without block triangular form: on saddle-point matrices the latter pairs rows
/// with multiplier columns and keeps tiny pivots.  The ordering is made once; a factorisation reuses the
/// pivots of the one before until its reciprocal condition falls far below that of the last fresh one.
/// Rows are scaled where pivots are chosen and nowhere else: with given pivots it changes round-off alone,
/// and takes two fifths of the time.
class Klu final : public LinearSolver {
 public:
  /// The pattern outlives it.
  explicit Klu(const SparsityPattern& pattern) : pattern_(pattern), fresh_values_(pattern.nonzeros()) {
    klu_defaults(&common_);
    common_.btf = 0;
    common_.ordering = 0;
    common_.tol = 0.1;
    symbolic_ = klu_analyze(pattern.rows(), starts(), rows(), &common_);
    if (symbolic_ == nullptr) throw Error("KLU could not analyse the pattern of the Jacobian");
  }
  Klu(const Klu&) = delete;
  Klu& operator=(const Klu&) = delete;
  ~Klu() override {
    klu_free_numeric(&numeric_, &common_);
    klu_free_symbolic(&symbolic_, &common_);
  }

  bool factor(const double* values) override {
    if (numeric_ != nullptr && refactor(values) && common_.rcond > 1e-3 * fresh_rcond_) return true;
    return factor_afresh(values);
  }

  void solve(double* b) override { klu_solve(symbolic_, numeric_, pattern_.rows(), 1, b, &common_); }

  void reset() override { klu_free_numeric(&numeric_, &common_); }

  /// The pivots are those of the matrix that was last factored afresh.
  void save(Snapshot& to) const override {
    to.put("pivots chosen", numeric_ != nullptr);
    if (numeric_ != nullptr) to.put("matrix of the pivots", fresh_values_);
  }
  void restore(SnapshotReader& from) override {
    reset();
    if (!from.flag("pivots chosen")) return;
    Vector values(fresh_values_.size());
    from.read("matrix of the pivots", values);
    factor_afresh(values.data());
  }

  bool holds(const double* values) const override {
    return numeric_ != nullptr && fresh_values_ == Eigen::Map<const Vector>(values, fresh_values_.size());
  }

  const char* name() const override { return "KLU"; }

 private:
  static constexpr int no_scaling = -1, by_largest_of_row = 2;

  // KLU takes its input as mutable but only reads it.
  // NOLINTBEGIN(cppcoreguidelines-pro-type-const-cast)
  int* starts() const { return const_cast<int*>(pattern_.column_starts().data()); }
  int* rows() const { return const_cast<int*>(pattern_.row_indices().data()); }
  static double* input(const double* values) { return const_cast<double*>(values); }
  // NOLINTEND(cppcoreguidelines-pro-type-const-cast)

  /// With the pivots there are; false where one vanishes.
  bool refactor(const double* values) {
    common_.scale = no_scaling;
    return klu_refactor(starts(), rows(), input(values), symbolic_, numeric_, &common_) != 0 &&
           pivots_exist();
  }

  /// The least pivot beside the largest, as klu_rcond() has it, in a third of its time.
  bool pivots_exist() {
    const auto* const pivots = static_cast<const double*>(numeric_->Udiag);
    Strands least, largest{}, zero{};
    least.fill(HUGE_VAL);
    for_each_in_strands(pattern_.rows(), [&](std::size_t s, Eigen::Index k) {
      const double pivot = std::abs(pivots[k]);
      least[s] = std::min(least[s], pivot);
      largest[s] = std::max(largest[s], pivot);
      zero[s] += 0.0 * pivot;
    });
    common_.rcond = *std::ranges::min_element(least) / *std::ranges::max_element(largest);
    return common_.rcond > 0.0 && std::ranges::all_of(zero, [](double of) { return of == 0.0; });
  }

  bool factor_afresh(const double* values) {
    klu_free_numeric(&numeric_, &common_);
    common_.scale = by_largest_of_row;
    fresh_values_ = Eigen::Map<const Vector>(values, fresh_values_.size());
    equilibrate();
    numeric_ = klu_factor(starts(), rows(), fresh_values_.data(), symbolic_, &common_);
    const bool regular = numeric_ != nullptr && pivots_are_regular();
    fresh_values_ = Eigen::Map<const Vector>(values, fresh_values_.size());
    if (!regular || !refactor(values)) {
      reset();  // such pivots serve no other matrix
      return false;
    }
    fresh_rcond_ = common_.rcond;
    return true;
  }

  /// Divides rows and columns of fresh_values_ by the roots of their largest entries, until these are near 1
  /// (Ruiz, A scaling algorithm to equilibrate both rows and columns norms in matrices, RAL-TR-2001-034).
  void equilibrate() {
    constexpr int rounds = 4;
    Vector of_row(pattern_.rows());
    for (int round = 0; round < rounds; ++round) {
      of_row.setZero();
      for (int e = 0; e < pattern_.nonzeros(); ++e)
        of_row[rows()[e]] = std::max(of_row[rows()[e]], std::abs(fresh_values_[e]));
      for (int j = 0; j < pattern_.rows(); ++j) {
        double of_column = 0.0;
        for (int e = starts()[j]; e < starts()[j + 1]; ++e)
          of_column = std::max(of_column, std::abs(fresh_values_[e]));
        for (int e = starts()[j]; e < starts()[j + 1] && of_column > 0.0; ++e)
          if (fresh_values_[e] != 0.0)
            fresh_values_[e] /= std::sqrt(of_column) * std::sqrt(of_row[rows()[e]]);
      }
    }
  }

  /// Whether no pivot is round-off beside its column of the scaled matrix.
  bool pivots_are_regular() const {
    constexpr double round_off = 8.0 * std::numeric_limits<double>::epsilon();
    const auto* const pivots = static_cast<const double*>(numeric_->Udiag);
    for (int k = 0; k < pattern_.rows(); ++k) {
      const int column = symbolic_->Q[k];
      double largest = 0.0;
      for (int e = starts()[column]; e < starts()[column + 1]; ++e)
        largest = std::max(largest, std::abs(fresh_values_[e]) / numeric_->Rs[numeric_->Pinv[rows()[e]]]);
      if (!(std::abs(pivots[k]) > round_off * largest)) return false;
    }
    return true;
  }

  const SparsityPattern& pattern_;
  klu_common common_{};
  klu_symbolic* symbolic_ = nullptr;
  klu_numeric* numeric_ = nullptr;
  Vector fresh_values_;  ///< what the pivots in use were chosen for
  double fresh_rcond_ = 0.0;
};

#else

/// Up to so many unknowns full matrices take less time than the general sparse ones of Eigen.
constexpr int largest_full = 200;

/// A sparse matrix written into a full one.
class FullLu final : public LinearSolver {
 public:
  explicit FullLu(const SparsityPattern& pattern)
      : pattern_(pattern),
        full_(Columns::Zero(pattern.rows(), pattern.rows())),
        lu_(make_dense_lu(pattern.rows())) {}

  bool factor(const double* values) override {
    const auto starts = pattern_.column_starts(), rows = pattern_.row_indices();
    for (std::size_t j = 0; j + 1 < starts.size(); ++j)
      for (int e = starts[j]; e < starts[j + 1]; ++e)
        full_(rows[static_cast<std::size_t>(e)], static_cast<Eigen::Index>(j)) = values[e];
    return lu_->factor(full_.data());
  }
  void solve(double* b) override { lu_->solve(b); }
  const char* name() const override { return lu_->name(); }

 private:
  const SparsityPattern& pattern_;
  Columns full_;
  std::unique_ptr<LinearSolver> lu_;
};

/// Eigen's sparse LU, some ten times slower than KLU; it chooses its pivots anew each time and allocates.
class EigenLu final : public LinearSolver {
 public:
  explicit EigenLu(const SparsityPattern& pattern) : pattern_(pattern) {
    const Vector any = Vector::Ones(pattern.nonzeros());
    lu_.analyzePattern(matrix(any.data()));
  }

  bool factor(const double* values) override {
    lu_.factorize(matrix(values));
    return lu_.info() == Eigen::Success;
  }
  void solve(double* b) override {
    Eigen::Map<Vector> column(b, pattern_.rows());
    column = lu_.solve(column).eval();
  }
  const char* name() const override { return "sparse LU of Eigen"; }

 private:
  using Matrix = Eigen::SparseMatrix<double>;
  Matrix matrix(const double* values) const { return sparse_map(pattern_, values); }

  const SparsityPattern& pattern_;
  Eigen::SparseLU<Matrix, Eigen::COLAMDOrdering<int>> lu_;
};

#endif

}  // namespace

std::unique_ptr<LinearSolver> make_sparse_lu(const SparsityPattern& pattern) {
#ifdef DIRACSTEP_WITH_KLU
  return std::make_unique<Klu>(pattern);
#else
  if (pattern.rows() <= largest_full) return std::make_unique<FullLu>(pattern);
  return std::make_unique<EigenLu>(pattern);
#endif
}

}  // namespace diracstep::detail
