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
  if (size > largest_small) return std::make_unique<DenseLu>(size);
  const auto length = static_cast<std::size_t>(size);
  return make.at(length <= largest_fixed ? length : 0)(size);
}

std::unique_ptr<LinearSolver> make_linear_solver(const SparsityPattern& pattern) {
  return pattern.is_dense() ? make_dense_lu(pattern.rows()) : make_sparse_lu(pattern);
}

}  // namespace diracstep::detail
