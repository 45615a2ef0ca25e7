#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <diracstep/boundary_values/detail/newton.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <limits>

namespace diracstep::boundary {

namespace {

/// In parts of the sizes of each kind, the root of the mean square; infinite where a correction is no number.
/// Momenta and the multipliers at the end do not count: they follow from the rest, and may be zero to
/// round-off beside it.
double norm_of(const MotionEquations& equations, const Vector& correction, const Vector& sizes) {
  if (!correction.allFinite()) return std::numeric_limits<double>::infinity();
  double sum = 0.0;
  for (Eigen::Index i = 0; i < correction.size(); ++i) {
    const int kind = equations.kind()[static_cast<std::size_t>(i)];
    if (kind == momentum_kind || kind == multiplier_kind) continue;
    const double part = correction[i] / sizes[kind];
    sum += part * part;
  }
  return std::sqrt(sum / static_cast<double>(correction.size()));
}

/// With one step of refinement: sparse pivots are not the largest.
Columns refined(const sensitivity::LinearFactor<Sparse>& factor, const Sparse& matrix, const Columns& right) {
  Columns solution = right;
  factor.solve(solution);
  Columns left = right - matrix * solution;
  factor.solve(left);
  return solution + left;
}

constexpr double round_off = 1e-14;       // corrections that mean nothing
constexpr double near_round_off = 1e-10;  // from here on a correction that no longer falls is round-off
constexpr double smallest_damping = 1e-6;
constexpr double rank_tolerance = 1e-7;
constexpr double least_part_of_guess = 1e-2;

}  // namespace

Vector sizes_by_kind(const MotionEquations& equations, const Vector& u) {
  Vector sizes = Vector::Zero(kinds);
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    double& size = sizes[equations.kind()[static_cast<std::size_t>(i)]];
    size = std::max(size, std::abs(u[i]));
  }
  // Where all is at rest, what a motion over its places would have.
  const double rate = sizes[position_kind] / std::abs(equations.duration());
  for (const Kind kind : {velocity_kind, unknown_kind}) sizes[kind] = std::max(sizes[kind], rate);
  return (sizes.array() > 0.0).select(sizes, 1.0);
}

DeterminedEnds::DeterminedEnds(MotionEquations& equations, const Vector& u)
    : unknowns_(equations.unknowns()), motion_rows_(unknowns_ - equations.freedom()) {
  const MotionEquations::Jacobian j = equations.jacobian(u);
  const Columns slack = equations.slack(u);
  end_rows_ = static_cast<int>(j.ends.rows());
  sensitivity::BlockSum<Sparse> all(motion_rows_ + end_rows_, unknowns_ + slack.cols());
  all.add(0, 0, j.motion);
  all.add(motion_rows_, 0, j.ends);
  if (slack.cols() > 0) all.add(motion_rows_, unknowns_, Sparse(slack.sparseView()));
  matrix_ = all.result();
  factor_.compute(matrix_);
}

Vector DeterminedEnds::correction(const MotionEquations::Residual& r) const {
  Columns right(r.motion.size() + r.ends.size(), 1);
  right << -r.motion, -r.ends;
  factor_.solve(right);
  return right.col(0).head(unknowns_);
}

Columns DeterminedEnds::by_conditions(int count) const {
  Columns right = Columns::Zero(motion_rows_ + end_rows_, count);
  right.bottomRows(count).setIdentity();
  return refined(factor_, matrix_, right).topRows(unknowns_);
}

FamilyOfEnds::FamilyOfEnds(MotionEquations& equations, const Vector& u, const Vector& sizes, double power)
    : unknowns_(equations.unknowns()) {
  const MotionEquations::Jacobian j = equations.jacobian(u);
  const std::vector<int> start = equations.start_unknowns(), end = equations.end_unknowns();
  const int freedom = equations.freedom(), motion_rows = unknowns_ - freedom;
  sensitivity::BlockSum<Sparse> all(unknowns_, unknowns_);
  all.add(0, 0, j.motion);
  start_sizes_.resize(freedom);
  Columns right = Columns::Zero(unknowns_, freedom);
  for (int i = 0; i < freedom; ++i) {
    all.add_identity(motion_rows + i, start[static_cast<std::size_t>(i)], 1);
    start_sizes_[i] = sizes[equations.kind()[static_cast<std::size_t>(start[static_cast<std::size_t>(i)])]];
    right(motion_rows + i, i) = start_sizes_[i];
  }
  const Sparse matrix = all.result();
  factor_.compute(matrix);
  along_ = refined(factor_, matrix, right);
  ends_by_unknowns_ = j.ends;
  // Each equation in parts of its terms.
  row_sizes_ = Vector::Zero(j.ends.rows());
  for (int c = 0; c < j.ends.outerSize(); ++c)
    for (Sparse::InnerIterator e(j.ends, c); e; ++e)
      row_sizes_[e.row()] = std::max(
          row_sizes_[e.row()], std::abs(e.value()) * sizes[equations.kind()[static_cast<std::size_t>(c)]]);
  row_sizes_ = (row_sizes_.array() > 0.0).select(row_sizes_, 1.0);
  ends_ = row_sizes_.cwiseInverse().asDiagonal() * (j.ends * along_);
  start_rows_ = (j.ends * along_).topRows(equations.start_rows());
  const MotionEquations::Residual r = equations.residual(u);
  damping_ = std::pow(std::min(1.0, left(r, particular(r)).norm()), 0.5 * power);
  end_by_start_ = start_sizes_.cwiseInverse().asDiagonal() * along_(end, Eigen::all);
}

/// With the start held.
Columns FamilyOfEnds::particular(const MotionEquations::Residual& r) const {
  Columns column = Columns::Zero(unknowns_, 1);
  column.col(0).head(r.motion.size()) = -r.motion;
  factor_.solve(column);
  return column;
}

/// g, what the ends' equations lack then.
Vector FamilyOfEnds::left(const MotionEquations::Residual& r, const Columns& particular) const {
  return (r.ends + ends_by_unknowns_ * particular.col(0)).cwiseQuotient(row_sizes_);
}

Vector FamilyOfEnds::correction(const MotionEquations::Residual& r) const {
  const Columns held = particular(r);
  const Vector g = left(r, held);
  const Eigen::Index count = ends_.cols();
  Columns system(ends_.rows() + count, count);
  system << ends_, damping_ * Columns::Identity(count, count);
  Vector right = Vector::Zero(system.rows());
  right.head(g.size()) = -g;
  const Vector start = system.completeOrthogonalDecomposition().solve(right);
  return held.col(0) + along_ * start;
}

int FamilyOfEnds::free_directions() const {
  const Eigen::ColPivHouseholderQR<Columns> qr(ends_);
  // In parts of the terms that the conditions are made of: where all directions are free, nothing is left of
  // them but round-off.
  const double least = rank_tolerance * std::max(1.0, qr.maxPivot());
  const auto diagonal = qr.matrixQR().diagonal().cwiseAbs();
  return static_cast<int>(ends_.cols() - (diagonal.array() > least).count());
}

Columns FamilyOfEnds::transition() const {
  const Eigen::Index freedom = ends_.cols();
  if (start_rows_.rows() == 0) return end_by_start_;
  Eigen::ColPivHouseholderQR<Columns> rows(start_rows_.transpose());
  rows.setThreshold(rank_tolerance);
  const Columns q = rows.householderQ() * Columns::Identity(freedom, freedom);
  const Columns basis = q.rightCols(freedom - rows.rank());
  return basis.transpose() * end_by_start_ * basis;
}

NewtonReport newton(MotionEquations& equations, Vector& u, int max_iterations, const FactorEnds& factor,
                    const std::function<bool()>& go_on) {
  NewtonReport report;
  double damping = 1.0;
  // Where all comes to rest at zero, corrections are measured by the guess.
  const Vector least = least_part_of_guess * sizes_by_kind(equations, u);
  MotionEquations::Residual r = equations.residual(u);
  while (report.iterations < max_iterations) {
    if (go_on && !go_on()) {
      report.interrupted = true;
      report.failure = "interrupted after " + std::to_string(report.iterations) + " iterations";
      return report;
    }
    ++report.iterations;
    const Vector sizes = sizes_by_kind(equations, u).cwiseMax(least);
    std::unique_ptr<LinearisedEnds> linear;
    try {
      linear = factor(u, sizes);
    } catch (const Misuse&) {
      throw;
    } catch (const Error&) {
      report.failure = "its Jacobian is singular";
      return report;
    }
    const Vector correction = linear->correction(r);
    const double length = norm_of(equations, correction, sizes);
    report.correction = length;
    if (!std::isfinite(length)) {
      report.failure = "its Jacobian is singular or not finite";
      return report;
    }
    damping = length < near_round_off ? 1.0 : std::min(1.0, 4.0 * damping);
    for (;; damping *= 0.5) {
      if (go_on && !go_on()) {
        report.interrupted = true;
        report.failure = "interrupted after " + std::to_string(report.iterations) + " iterations";
        return report;
      }
      if (damping < smallest_damping) {
        report.failure = "no shorter step of it comes nearer to a solution";
        return report;
      }
      const Vector tried = u + damping * correction;
      const MotionEquations::Residual at_tried = equations.residual(tried);
      const double next = norm_of(equations, linear->correction(at_tried), sizes);
      const bool settled = length <= near_round_off && damping == 1.0 && next > 0.25 * length;
      if (length <= round_off || settled || next <= round_off) {
        if (next <= length) u = tried;
        report.converged = true;
        return report;
      }
      if (next > (1.0 - 0.25 * damping) * length) continue;
      u = tried;
      r = at_tried;
      break;
    }
  }
  report.failure = "its iterations are used up";
  return report;
}

}  // namespace diracstep::boundary
