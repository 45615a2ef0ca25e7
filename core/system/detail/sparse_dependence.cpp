#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/sparse_columns.hpp>
#include <diracstep/core/system/detail/sparse_dependence.hpp>
#include <string>

namespace diracstep {

namespace {

constexpr int smallest_part = 100;

Eigen::SparseMatrix<double> sparse_one_forms(const ConstraintsAtPoint& rows) {
  Eigen::SparseMatrix<double> one_forms = sparse_map(rows.pattern(), rows.coefficients().data()).transpose();
  for (Eigen::Index r = 0; r < one_forms.cols(); ++r)
    if (const double size = one_forms.col(r).norm(); size > 0.0) one_forms.col(r) /= size;
  return one_forms;
}

/// Throws Misuse before memory is taken where the Gram matrix would be too large: each coordinate fills the
/// products of all rows that it is in.
void require_few_products(const Eigen::SparseMatrix<double>& one_forms) {
  constexpr double most = 5e7;
  Vector rows = Vector::Zero(one_forms.rows());
  for (Eigen::Index c = 0; c < one_forms.outerSize(); ++c)
    for (Eigen::SparseMatrix<double>::InnerIterator entry(one_forms, c); entry; ++entry)
      rows[entry.row()] += 1.0;
  if (rows.squaredNorm() > most)
    throw Misuse("too many rows share a coordinate, " + std::to_string(std::lround(rows.maxCoeff())) +
                 " of them: whether some are redundant cannot be decided");
}

/// The pivots of the Gram matrix are squared distances from the columns before.  The shift keeps those that
/// vanish from dividing, and 1e-12 is what round-off leaves to be told from zero.
template <class Ordering>
std::vector<int> dependent_sparse_columns(const Eigen::SparseMatrix<double>& one_forms, double tolerance) {
  require_few_products(one_forms);
  const Eigen::SparseMatrix<double> products = one_forms.transpose() * one_forms;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower, Ordering> factors;
  factors.setShift(1e-14);
  factors.compute(products);
  const Vector pivots = factors.vectorD();
  const auto& inverse = factors.permutationPinv().indices();  // empty where the order is the natural one
  std::vector<int> dependent;
  for (Eigen::Index k = 0; k < pivots.size(); ++k)
    if (!(pivots[k] > std::max(tolerance * tolerance, 1e-12)))
      dependent.push_back(inverse.size() > 0 ? inverse[k] : static_cast<int>(k));
  return dependent;
}

/// The same, with a part of the columns at a time beside those found independent before: where there are more
/// than coordinates, most of them depend on others.
std::vector<int> dependent_in_parts(const Eigen::SparseMatrix<double>& one_forms, double tolerance) {
  const int part = std::max(static_cast<int>(one_forms.rows()), smallest_part);
  const int count = static_cast<int>(one_forms.cols());
  std::vector<int> independent, dependent;
  for (int first = 0; first < count; first += part) {
    std::vector<int> columns = independent;
    for (int c = first; c < std::min(first + part, count); ++c) columns.push_back(c);
    std::vector<bool> left_out(columns.size(), false);
    for (const int k :
         dependent_sparse_columns<Eigen::AMDOrdering<int>>(columns_at(one_forms, columns), tolerance)) {
      left_out[static_cast<std::size_t>(k)] = true;
      dependent.push_back(columns[static_cast<std::size_t>(k)]);
    }
    independent.clear();
    for (std::size_t k = 0; k < columns.size(); ++k)
      if (!left_out[k]) independent.push_back(columns[k]);
  }
  return dependent;
}

/// Those of `others` that depend on the columns `kept` and on each other.  In the order of the file, `kept`
/// first, the factors may fill up; they are bounded before memory is taken.
std::vector<int> dependent_beside(const Eigen::SparseMatrix<double>& one_forms, const std::vector<int>& kept,
                                  const std::vector<int>& others, double tolerance) {
  constexpr double most = 5e7;
  const auto count = static_cast<double>(others.size());
  if (count * (static_cast<double>(kept.size()) + count) > most)
    throw Misuse("holonomic rows are combinations of rows on velocities, among " +
                 std::to_string(kept.size() + others.size()) +
                 " of them: leave the latter out, which say nothing beside the former");
  std::vector<int> ordered = kept;
  ordered.insert(ordered.end(), others.begin(), others.end());
  std::vector<int> dependent;
  for (const int k :
       dependent_sparse_columns<Eigen::NaturalOrdering<int>>(columns_at(one_forms, ordered), tolerance))
    dependent.push_back(ordered[static_cast<std::size_t>(k)]);
  return dependent;
}

}  // namespace

std::vector<int> dependent_sparse_rows(const ConstraintsAtPoint& rows, const RowKinds& kinds,
                                       double tolerance) {
  const Eigen::SparseMatrix<double> one_forms = sparse_one_forms(rows);
  const std::vector<int>&holonomic = kinds[0], &others = kinds[1];
  std::vector<int> all = dependent_in_parts(one_forms, tolerance);
  const auto is_holonomic = [&](int row) { return std::ranges::binary_search(holonomic, row); };
  if (others.empty() || std::ranges::none_of(all, is_holonomic)) return all;
  std::vector<int> dependent, kept = holonomic;
  for (const int k : dependent_in_parts(columns_at(one_forms, holonomic), tolerance))
    dependent.push_back(holonomic[static_cast<std::size_t>(k)]);
  std::ranges::sort(dependent);
  std::erase_if(kept, [&](int row) { return std::ranges::binary_search(dependent, row); });
  if (std::ranges::count_if(all, is_holonomic) == std::ssize(dependent)) return all;
  const std::vector<int> beside = dependent_beside(one_forms, kept, others, tolerance);
  dependent.insert(dependent.end(), beside.begin(), beside.end());
  return dependent;
}

}  // namespace diracstep
