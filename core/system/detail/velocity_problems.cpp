#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/kernel_basis.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/core/system/kernel_motions.hpp>
#include <diracstep/core/system/rows_along_motions.hpp>

namespace diracstep {

FirstOrderVelocityProblem::FirstOrderVelocityProblem(const Scene& scene, const FirstOrderMotions& motions)
    : MomentumVelocityProblem(scene), point_(scene, motions) {
  const auto inert = static_cast<int>(motions.u.cols());
  if (inert > 0) blocks_.push_back({"momentum", inert});
  blocks_.push_back({"force", n_ - inert});
  if (m_ > 0) blocks_.push_back({"velocity", m_});
}

MomentumVelocityProblem::MomentumVelocityProblem(const Scene& scene)
    : n_(scene.dimension()), m_(scene.rows()), pattern_(SparsityPattern::dense(n_ + m_, n_ + m_)) {}

void MomentumVelocityProblem::begin(double t, ConstVectorRef q, ConstVectorRef p) {
  t_ = t;
  q_ = q;
  p_ = p;
  for (ResidualBlock& block : blocks_) block.scale = smallest_scale;
}

void FirstOrderVelocityProblem::begin(double t, ConstVectorRef q, ConstVectorRef p) {
  MomentumVelocityProblem::begin(t, q, p);
  if (m_ == 0 || !point_.motions().by_force) return;
  const Vector none = Vector::Zero(n_);
  point_.evaluate(t, q, none, Vector::Zero(m_));
  const Columns forms = point_.rows_here(), &w = point_.motions().w;
  const Columns along = w.transpose() * forms.transpose();
  p_ += forms.transpose() *
        along.completeOrthogonalDecomposition().solve(w.transpose() * (point_.momentum() - p));
}

void FirstOrderVelocityProblem::residual(ConstVectorRef x, VectorRef f) {
  point_.evaluate(t_, q_, x.head(n_), x.tail(m_));
  const Columns &w = point_.motions().w, &u = point_.motions().u;
  f.head(u.cols()) = u.transpose() * (point_.momentum() - p_);
  f.segment(u.cols(), w.cols()) = w.transpose() * (point_.momentum_rate() - point_.force());
  f.tail(m_) = point_.row_residual();
  std::size_t b = 0;
  const auto raise = [&](double terms) {
    if (std::isfinite(terms)) blocks_[b].scale = scale_of(terms);
    ++b;
  };
  if (u.cols() > 0) raise(std::max(max_norm(p_), max_norm(point_.momentum())));
  raise(std::max(max_norm(point_.momentum_rate()), max_norm(point_.force())));
  if (m_ > 0) raise(max_norm(x.head(n_)));
}

void FirstOrderVelocityProblem::jacobian(ConstVectorRef x, VectorRef values) {
  point_.evaluate(t_, q_, x.head(n_), x.tail(m_));
  point_.differentiate();
  const Columns &w = point_.motions().w, &u = point_.motions().u;
  const Eigen::Index inert = u.cols();
  auto j = values.reshaped(n_ + m_, n_ + m_);
  j.setZero();
  j.topLeftCorner(inert, n_) = u.transpose() * point_.mass();
  j.block(inert, 0, w.cols(), n_) = w.transpose() * (point_.momentum_by_q() - point_.force_by_v());
  j.block(inert, n_, w.cols(), m_) = -w.transpose() * point_.rows().transpose();
  j.bottomLeftCorner(m_, n_) = point_.rows();
}

std::unique_ptr<MomentumVelocityProblem> velocity_problem(const Scene& scene,
                                                          const FirstOrderMotions& motions) {
  if (!motions.levels.empty()) return std::make_unique<LevelledVelocityProblem>(scene, motions);
  if (motions.hide_equations()) return std::make_unique<KernelVelocityProblem>(scene, motions);
  return std::make_unique<FirstOrderVelocityProblem>(scene, motions);
}

Columns open_directions(const Scene& scene, const FirstOrderMotions& motions) {
  const int n = scene.dimension(), m = scene.rows();
  const Start& start = scene.start;
  const auto problem = velocity_problem(scene, motions);
  Vector x = Vector::Zero(n + m), values((n + m) * (n + m)), lq(n), p(n);
  scene.lagrangian->gradient(start.time, start.q, start.v, lq, p);
  x.head(n) = start.v;
  problem->begin(start.time, start.q, p);
  problem->jacobian(x, values);
  if (!values.allFinite()) return Columns(n + m, 0);  // the step says so itself
  Columns matrix = values.reshaped(n + m, n + m);
  for (Eigen::Index r = 0; r < matrix.rows(); ++r)
    matrix.row(r) /= size_or_one(max_norm(matrix.row(r).transpose()));
  return kernel_basis(matrix, motions.hide_equations() ? 1e-7 : regular_to);
}

void require_determined(const Scene& scene, const FirstOrderMotions& motions) {
  const int n = scene.dimension(), m = scene.rows();
  const Start& start = scene.start;
  if (start.q.size() != scene.storage_size() || start.v.size() != n) return;  // told by require_consistent
  if (n + m > most_coordinates_of_first_order)
    throw Misuse(
        "scene '" + scene.name + "': rows and forces on motions of first order take full matrices, and " +
        "it has more than " + std::to_string(most_coordinates_of_first_order) + " coordinates and rows");
  if (!motions.contradiction.empty())
    throw Misuse("scene '" + scene.name +
                 "': its Lagrangian has motions of first order, and no point near the start is on all of its "
                 "equations of motion, rows and time derivatives of them: off most is " +
                 motions.contradiction + "; do rows, or multipliers as coordinates, contradict each other?");
  const Columns open = motions.open.cols() > 0 ? motions.open : open_directions(scene, motions);
  if (open.cols() == 0) return;
  std::string velocities, forces;
  for (Eigen::Index k = 0; k < open.cols(); ++k) {
    Vector direction = open.col(k) / max_norm(open.col(k));
    const Vector whole = direction.array().round();
    direction = ((direction - whole).array().abs() < 1e-8).select(whole, direction);
    Eigen::Index first = 0;
    while (direction[first] == 0.0) ++first;
    if (direction[first] < 0.0) direction = -direction;
    const std::string along = motion_along(scene, direction.head(n));
    if (!along.empty()) velocities += (velocities.empty() ? "'" : ", '") + along + "'";
    for (int r = 0; r < m; ++r)
      if (direction[n + r] != 0.0) forces += (forces.empty() ? "" : ", ") + row_label(scene.constraints, r);
  }
  std::string what = velocities.empty() ? "" : "the velocity along " + velocities;
  if (!forces.empty()) what += (what.empty() ? "" : ", ") + std::string("the force of ") + forces;
  throw Misuse("scene '" + scene.name +
               "': its Lagrangian has motions of first order, whose equations together with the rows do not "
               "determine at the start: " +
               what + "; with up to " + std::to_string(most_levels) +
               " time derivatives of them nothing else does: is a term missing in L, or is a row, or a "
               "multiplier as a coordinate, there twice?");
}

}  // namespace diracstep
