#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <diracstep/core/steps/matrix_form.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <sstream>
#include <vector>

namespace diracstep {

namespace {

constexpr int smallest_sparse = 12, largest_full = 2000;
constexpr double max_filled = 0.5;

/// Filled part of L + U of a matrix on the saddle-point pattern, eliminated in AMD's order down its diagonal:
/// counted on a positive definite matrix of the same pattern.
double filled_part(const Scene& scene) {
  const int n = scene.dimension(), size = n + scene.rows();
  std::vector<Eigen::Triplet<double>> entries;
  const auto add = [&](const SparsityPattern& pattern, int first_row) {
    for (const auto& [row, column] : pattern.entries()) {
      entries.emplace_back(first_row + row, column, -1.0);
      entries.emplace_back(column, first_row + row, -1.0);
    }
  };
  add(scene.stepped_function().pattern(), 0);
  if (scene.force) add(scene.force->pattern(), 0);
  add(ConstraintDistribution(scene.constraints, n).pattern(), n);
  for (int i = 0; i < size; ++i) entries.emplace_back(i, i, 4.0 * size);
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end(), [](double a, double b) { return std::max(a, b); });
  const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factors(matrix);
  const auto lower = static_cast<double>(factors.matrixL().nestedExpression().nonZeros());
  return (2.0 * lower - size) / (static_cast<double>(size) * size);
}

}  // namespace

MatrixForm matrix_form(const Scene& scene, int limit) {
  const int size = scene.dimension() + scene.rows();
  std::ostringstream reason;
  if (limit >= 0) {
    reason << "full ones were asked for up to " << limit << " coordinates and rows";
    return {size <= limit, reason.str()};
  }
  if (size < smallest_sparse) {
    reason << "fewer than " << smallest_sparse << " coordinates and rows";
    return {true, reason.str()};
  }
  if (size > largest_full) {
    reason << "more than " << largest_full << " coordinates and rows";
    return {false, reason.str()};
  }
  const double filled = filled_part(scene);
  reason << "the factors fill " << std::lround(100.0 * filled) << " % of a full matrix, "
         << (filled > max_filled ? "more than " : "no more than ") << std::lround(100.0 * max_filled) << " %";
  return {filled > max_filled, reason.str()};
}

}  // namespace diracstep
