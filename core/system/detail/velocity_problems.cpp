#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/kernel_basis.hpp>
#include <diracstep/core/numerics/monotone_newton.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/core/system/kernel_motions.hpp>
#include <diracstep/core/system/rows_along_motions.hpp>
#include <limits>

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

ByForceVelocityProblem::ByForceVelocityProblem(const Scene& scene, const FirstOrderMotions& motions)
    : MomentumVelocityProblem(scene), point_(scene, motions), rows_(scene.constraints, n_) {
  const auto inert = static_cast<int>(motions.u.cols());
  if (inert > 0) blocks_.push_back({"momentum", inert});
  blocks_.push_back({"force", n_ - inert});
  if (m_ > 0) blocks_.push_back({"velocity", m_});
}

double ByForceVelocityProblem::unit() const { return size_or_one(max_norm(point_.mass_here())); }

void ByForceVelocityProblem::residual(ConstVectorRef x, VectorRef f) {
  point_.evaluate(t_, q_, x.head(n_), Vector::Zero(m_));
  const Columns &w = point_.motions().w, &u = point_.motions().u;
  Vector momentum = p_;
  if (m_ > 0) {
    rows_.evaluate(t_, q_);
    rows_.add_annihilator(unit() * x.tail(m_), momentum);
  }
  f.head(u.cols()) = u.transpose() * (point_.momentum() - momentum);
  f.segment(u.cols(), w.cols()) = -w.transpose() * point_.force();
  f.tail(m_) = point_.row_residual();
  // By the terms at the guess and here: those in between may be the currents of diodes far beyond any.
  std::size_t b = 0;
  const auto raise = [&](double terms) {
    if (blocks_[b].scale == smallest_scale) first_.at(b) = scale_of(terms);
    blocks_[b].scale = std::max(first_.at(b), scale_of(terms));
    ++b;
  };
  if (u.cols() > 0) raise(std::max({max_norm(p_), max_norm(momentum), max_norm(point_.momentum())}));
  raise(max_norm(w.transpose().cwiseAbs() * point_.force().cwiseAbs()));
  if (m_ > 0) raise(max_norm(x.head(n_)));
}

void ByForceVelocityProblem::jacobian(ConstVectorRef x, VectorRef values) {
  point_.evaluate(t_, q_, x.head(n_), Vector::Zero(m_));
  point_.differentiate();
  const Columns &w = point_.motions().w, &u = point_.motions().u;
  const Eigen::Index inert = u.cols();
  auto j = values.reshaped(n_ + m_, n_ + m_);
  j.setZero();
  j.topLeftCorner(inert, n_) = u.transpose() * point_.mass();
  j.topRightCorner(inert, m_) = -unit() * u.transpose() * point_.rows().transpose();
  j.block(inert, 0, w.cols(), n_) = -w.transpose() * point_.force_by_v();
  j.bottomLeftCorner(m_, n_) = point_.rows();
}

bool ByForceVelocityProblem::holds(ConstVectorRef v) {
  constexpr double round_off = 4.0 * std::numeric_limits<double>::epsilon(), solved = 1e-9;
  Vector x = Vector::Zero(size()), f(size());
  x.head(n_) = v;
  residual(x, f);
  if (!f.allFinite()) return false;
  const std::size_t forces = point_.motions().u.cols() > 0 ? 1 : 0;
  Eigen::Index first = 0;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const double part = b < forces ? round_off : solved;
    if (max_norm(f.segment(first, blocks_[b].rows)) > part * blocks_[b].scale) return false;
    first += blocks_[b].rows;
  }
  return true;
}

std::string ByForceVelocityProblem::solve_from_afar(Vector& x) {
  Vector left(size()), slopes(size() * size());
  const auto residual_at = [&](const Vector& at) {
    residual(at, left);
    return left;
  };
  const auto jacobian_at = [&](const Vector& at) -> Columns {
    jacobian(at, slopes);
    return slopes.reshaped(size(), size());
  };
  return solve_monotonically(residual_at, jacobian_at, x).failure;
}

Vector ByForceVelocityProblem::forces(ConstVectorRef v) {
  point_.evaluate(t_, q_, v, Vector::Zero(m_));
  point_.differentiate();
  const Columns &w = point_.motions().w, &u = point_.motions().u;
  const Eigen::Index inert = u.cols();
  const double mass = unit();
  Columns matrix = Columns::Zero(n_ + m_, n_ + m_);
  matrix.topLeftCorner(inert, n_) = u.transpose() * point_.mass() / mass;
  matrix.topRightCorner(inert, m_) = -u.transpose() * point_.rows().transpose();
  matrix.block(inert, 0, n_ - inert, n_) = w.transpose();
  matrix.bottomLeftCorner(m_, n_) = point_.rows();
  Vector right = Vector::Zero(n_ + m_);
  right.head(inert) = u.transpose() * (point_.force() - point_.momentum_rate()) / mass;
  right.tail(m_) = -(point_.row_by_q() * v + point_.row_by_t());
  return mass * matrix.partialPivLu().solve(right).tail(m_);
}

std::unique_ptr<MomentumVelocityProblem> velocity_problem(const Scene& scene,
                                                          const FirstOrderMotions& motions) {
  if (!motions.levels.empty()) return std::make_unique<LevelledVelocityProblem>(scene, motions);
  if (motions.hide_equations()) return std::make_unique<KernelVelocityProblem>(scene, motions);
  if (motions.by_force) return std::make_unique<ByForceVelocityProblem>(scene, motions);
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
  return balanced_kernel_basis(values.reshaped(n + m, n + m), motions.hide_equations() ? 1e-7 : regular_to);
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
