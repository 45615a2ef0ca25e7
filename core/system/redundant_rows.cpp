#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/poses.hpp>
#include <diracstep/core/system/detail/sparse_dependence.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <optional>
#include <utility>

namespace diracstep {

namespace {

constexpr int max_rows_in_full = 100;  // up to so many full matrices take less time

RowKinds kinds_of(const ConstraintBlocks& blocks) {
  RowKinds kinds;
  int row = 0;
  for (const auto& block : blocks)
    for (int r = 0; r < block->rows(); ++r) kinds[block->holonomic() ? 0 : 1].push_back(row++);
  return kinds;
}

/// dependent_columns, with those of holonomic rows among holonomic ones alone: a nonholonomic row may go
/// where a holonomic one makes the same demand of the velocities, which then still holds the place, and not
/// the other way.
std::vector<int> dependent_by_kind(const Columns& one_forms, const RowKinds& kinds, double tolerance) {
  const auto& [holonomic, others] = kinds;
  if (holonomic.empty() || others.empty()) return dependent_columns(one_forms, tolerance);
  std::vector<int> dependent, kept = holonomic;
  for (const int k : dependent_columns(one_forms(Eigen::all, holonomic), tolerance))
    dependent.push_back(holonomic[static_cast<std::size_t>(k)]);
  std::erase_if(kept, [&](int c) { return std::ranges::find(dependent, c) != dependent.end(); });
  const Eigen::HouseholderQR<Columns> first(one_forms(Eigen::all, kept));
  const Columns basis =
      first.householderQ() * Columns::Identity(one_forms.rows(), static_cast<Eigen::Index>(kept.size()));
  Columns rest = one_forms(Eigen::all, others);
  rest -= basis * (basis.transpose() * rest);
  const Eigen::ColPivHouseholderQR<Columns> qr(rest);
  const auto& order = qr.colsPermutation().indices();
  for (Eigen::Index k = 0; k < rest.cols(); ++k)  // in parts of the columns, which are of size 1
    if (k >= rest.rows() || !(std::abs(qr.matrixQR()(k, k)) > tolerance))
      dependent.push_back(others[static_cast<std::size_t>(order[k])]);
  return dependent;
}

/// Poses around the start fulfil the rows to about 1e-10, and what depends on others there to as much.
constexpr double pose_tolerance = 1e-7;

/// Where motions cross at the start, poses around it are farther than this from being singular; where rows
/// touch, poses are found to the square root of round-off only, and seem regular by so much.
constexpr double crossing = 1e-3;

/// One-forms at the start, and at poses around it that the rows allow.
std::vector<Columns> one_forms_around(const Scene& scene, const Start& start) {
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  const auto at = [&](const Vector& q) {
    rows.evaluate(start.time, q);
    return full_one_forms(rows);
  };
  std::vector<Columns> all{at(start.q)};
  const ConstraintBlocks holonomic = only_holonomic(scene.constraints);
  for (const double distance : {-0.3, -0.1, 0.1, 0.3}) {
    const auto pose = pose_near(scene.space.get(), holonomic, start.time,
                                moved_start(scene.space.get(), start, distance), {});
    if (!pose) continue;
    if (Columns there = at(*pose); there.allFinite()) all.push_back(std::move(there));
  }
  return all;
}

/// The smallest singular value of the columns that are left, over all poses.
double margin_without(const std::vector<int>& dropped, const std::vector<Columns>& poses) {
  double least = HUGE_VAL;
  for (const Columns& one_forms : poses) {
    Columns kept(one_forms.rows(), one_forms.cols() - static_cast<Eigen::Index>(dropped.size()));
    Eigen::Index k = 0;
    for (Eigen::Index c = 0; c < one_forms.cols(); ++c)
      if (std::ranges::find(dropped, c) == dropped.end()) kept.col(k++) = one_forms.col(c);
    if (kept.cols() == 0) continue;
    least = std::min(least, kept.jacobiSvd().singularValues().minCoeff());
  }
  return least;
}

/// Of the choices that each pose would make the one that suits all best.
std::vector<int> best_choice(std::vector<int> at_start, const std::vector<Columns>& poses,
                             const RowKinds& kinds, double tolerance) {
  constexpr double clearly = 2.0;
  double best = margin_without(at_start, poses);
  for (std::size_t k = 1; k < poses.size(); ++k) {
    std::vector<int> other = dependent_by_kind(poses[k], kinds, std::max(tolerance, pose_tolerance));
    if (other.size() != at_start.size()) continue;
    const double margin = margin_without(other, poses);
    if (margin <= clearly * best) continue;
    best = margin;
    at_start = std::move(other);
  }
  return at_start;
}

/// How far the rows of these blocks are from zero, in parts of their one-forms times a size of positions.
double distance_from(const ConstraintBlocks& holonomic, double t, const Vector& q, double position_size) {
  double largest = 0.0;
  for (const auto& block : holonomic) {
    Vector phi(block->rows()), a(block->pattern().nonzeros()), b(block->rows());
    block->position(t, q, phi);
    block->coefficients(t, q, a, b);
    const double size = a.lpNorm<Eigen::Infinity>() * position_size;
    largest = std::max(largest, phi.lpNorm<Eigen::Infinity>() / size);
  }
  return largest;
}

/// Whether all poses around the start that the other rows allow break the holonomic rows of these names.
bool broken_by_the_others(const Scene& scene, const Start& start, const std::vector<std::string>& dependent) {
  constexpr double met = 1e-7;
  const ConstraintBlocks others = only_holonomic(without_rows(scene, dependent)->constraints);
  std::vector<std::string> kept = scene.row_names();
  std::erase_if(
      kept, [&](const std::string& name) { return std::ranges::find(dependent, name) != dependent.end(); });
  const ConstraintBlocks these = only_holonomic(without_rows(scene, kept)->constraints);
  bool any = false;
  for (const double distance : {-0.1, -0.03, -0.01, 0.01, 0.03, 0.1}) {
    const Vector moved = moved_start(scene.space.get(), start, distance);
    const auto pose = pose_near(scene.space.get(), others, start.time, moved, {});
    if (!pose) continue;
    const double size = std::max(moved.lpNorm<Eigen::Infinity>(), pose->lpNorm<Eigen::Infinity>());
    if (distance_from(these, start.time, *pose, size) <= met) return false;
    any = true;
  }
  return any;
}

}  // namespace

Columns full_one_forms(const ConstraintsAtPoint& rows, const std::vector<int>& held) {
  Columns one_forms = rows.pattern().full(rows.coefficients()).transpose();
  for (const int i : held) one_forms.row(i).setZero();
  for (auto column : one_forms.colwise())
    if (const double size = column.norm(); size > 0.0) column /= size;
  return one_forms;
}

std::vector<int> dependent_columns(const Columns& one_forms, double tolerance) {
  Eigen::ColPivHouseholderQR<Columns> qr;
  qr.setThreshold(tolerance);
  qr.compute(one_forms);
  const auto& order = qr.colsPermutation().indices();
  return {order.data() + qr.rank(), order.data() + order.size()};
}

std::vector<std::string> redundant_rows(const Scene& scene, const Start& start, double tolerance) {
  if (scene.rows() == 0) return {};
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  rows.evaluate(start.time, start.q);
  const bool full = scene.rows() <= max_rows_in_full;
  const RowKinds kinds = kinds_of(scene.constraints);
  std::vector<int> numbers = full ? dependent_by_kind(full_one_forms(rows), kinds, tolerance)
                                  : dependent_sparse_rows(rows, kinds, tolerance);
  if (numbers.empty()) return {};
  if (full) numbers = best_choice(std::move(numbers), one_forms_around(scene, start), kinds, tolerance);
  const std::vector<std::string> names = scene.row_names();
  std::vector<std::string> dependent;
  for (const int r : numbers) dependent.push_back(names[static_cast<std::size_t>(r)]);
  std::ranges::sort(dependent);
  return dependent;
}

RowDependence row_dependence(const Scene& scene, const Start& start,
                             const std::vector<std::string>& dependent, double tolerance) {
  if (scene.rows() == 0 || scene.rows() > max_rows_in_full) return RowDependence::lasting;
  const std::vector<Columns> poses = one_forms_around(scene, start);
  const std::size_t here = dependent_columns(poses[0], tolerance).size();
  // All poses: one that was found from afar may lie on another branch of the rows, of another rank.
  const bool crosses =
      poses.size() > 1 && std::all_of(poses.begin() + 1, poses.end(), [&](const Columns& there) {
        return dependent_columns(there, std::max(tolerance, crossing)).size() < here;
      });
  if (crosses) return RowDependence::at_start_only;
  return broken_by_the_others(scene, start, dependent) ? RowDependence::touching : RowDependence::lasting;
}

const char* why_not_left_out(RowDependence dependence) {
  switch (dependence) {
    case RowDependence::at_start_only:
      return "not so at poses near it: the start is singular, move it";
    case RowDependence::touching:
      return "they only touch the others there, and without them other motions are possible: say what they "
             "mean by rows of another form";
    case RowDependence::lasting:
      break;
  }
  return "";
}

}  // namespace diracstep
