#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/lu.hpp>
#include <diracstep/core/numerics/small_lu.hpp>
#include <diracstep/solvers/detail/linear_solver.hpp>
#include <limits>
#include <utility>
#include <vector>

namespace diracstep::detail {

namespace {

template <int N>
class FullLu final : public LinearSolver {
 public:
  explicit FullLu(int size) : lu_(size) {}
  bool factor(const double* values) override { return lu_.factor(values); }
  void solve(double* b) override { lu_.solve(b); }
  const char* name() const override { return "dense LU"; }

 private:
  SmallLu<N> lu_;
};

class DenseLu final : public LinearSolver {
 public:
  explicit DenseLu(int size) : lu_(size), solution_(size) {}

  bool factor(const double* values) override {
    const Eigen::Map<const Eigen::MatrixXd> matrix(values, solution_.size(), solution_.size());
    lu_.compute(matrix);
    const auto pivots = lu_.matrixLU().diagonal();
    const double round_off = std::numeric_limits<double>::epsilon() * static_cast<double>(pivots.size());
    for (Eigen::Index k = 0; k < pivots.size(); ++k)
      if (!(std::abs(pivots[k]) > round_off * matrix.col(k).lpNorm<Eigen::Infinity>())) return false;
    return true;
  }

  void solve(double* b) override {
    Eigen::Map<Eigen::VectorXd> column(b, solution_.size());
    solve_into(lu_, column, solution_);
    column = solution_;
  }

  const char* name() const override { return "dense LU"; }

 private:
  Eigen::PartialPivLU<Eigen::MatrixXd> lu_;
  Eigen::VectorXd solution_;
};

/// A matrix whose elimination meets a zero pivot is tried once more with rows and columns scaled so that
/// their entries are about 1: a mass of 1e-20 beside rows of a constraint is no singularity.
class Scaled final : public LinearSolver {
 public:
  Scaled(std::unique_ptr<LinearSolver> lu, int size) : lu_(std::move(lu)), size_(size) {}

  bool factor(const double* values) override {
    scaled_ = false;
    if (lu_->factor(values)) return true;
    scaled_ = scale(values) && lu_->factor(matrix_.data());
    return scaled_;
  }

  void solve(double* b) override {
    if (scaled_)
      for (int i = 0; i < size_; ++i) b[i] *= rows_[i];
    lu_->solve(b);
    if (scaled_)
      for (int i = 0; i < size_; ++i) b[i] *= columns_[i];
  }

  const char* name() const override { return lu_->name(); }

 private:
  static constexpr int sweeps = 8;

  /// Rows and columns in turn by the mean of their smallest and largest entries, in powers of two; false
  /// where that leaves all as it is.
  bool scale(const double* values) {
    matrix_ = Eigen::Map<const Eigen::MatrixXd>(values, size_, size_);
    if (!matrix_.allFinite()) return false;
    rows_ = columns_ = Eigen::VectorXd::Ones(size_);
    bool changed = false;
    const auto scale_all = [&](auto lines, Eigen::VectorXd& scales) {
      Eigen::Index i = 0;
      for (auto line : lines) {
        double smallest = HUGE_VAL, largest = 0.0;
        for (const double entry : line) {
          if (entry == 0.0) continue;
          smallest = std::min(smallest, std::abs(entry));
          largest = std::max(largest, std::abs(entry));
        }
        if (largest > 0.0) {
          const double factor = std::exp2(-std::round(0.5 * (std::log2(smallest) + std::log2(largest))));
          line *= factor;
          scales[i] *= factor;
          changed = changed || factor != 1.0;
        }
        ++i;
      }
    };
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      scale_all(matrix_.rowwise(), rows_);
      scale_all(matrix_.colwise(), columns_);
    }
    return changed;
  }

  std::unique_ptr<LinearSolver> lu_;
  int size_;
  Eigen::MatrixXd matrix_;
  Eigen::VectorXd rows_, columns_;
  bool scaled_ = false;
};

/// Up to this size plain loops are faster than Eigen's blocks.
constexpr int largest_small = 32;
constexpr std::size_t largest_fixed = 16;

template <int N>
std::unique_ptr<LinearSolver> small_lu(int size) {
  return std::make_unique<FullLu<N>>(size);
}

template <std::size_t... N>
constexpr auto small_lu_of_each_size(std::index_sequence<N...>) {
  return std::array{&small_lu<static_cast<int>(N)>...};
}

}  // namespace

std::unique_ptr<LinearSolver> make_dense_lu(int size) {
  static constexpr auto make = small_lu_of_each_size(std::make_index_sequence<largest_fixed + 1>());
  const auto length = static_cast<std::size_t>(size);
  std::unique_ptr<LinearSolver> lu;
  if (size > largest_small)
    lu = std::make_unique<DenseLu>(size);
  else
    lu = make.at(length <= largest_fixed ? length : 0)(size);
  return std::make_unique<Scaled>(std::move(lu), size);
}

std::unique_ptr<LinearSolver> make_linear_solver(const SparsityPattern& pattern) {
  return pattern.is_dense() ? make_dense_lu(pattern.rows()) : make_sparse_lu(pattern);
}

}  // namespace diracstep::detail
