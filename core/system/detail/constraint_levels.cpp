#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/detail/differenced.hpp>

namespace diracstep {

LevelledEquations::LevelledEquations(const Scene& scene, const FirstOrderMotions& motions)
    : scene_(scene),
      motions_(motions),
      holonomic_(only_holonomic(scene.constraints)),
      n_(scene.dimension()),
      m_(scene.rows()),
      inert_(static_cast<int>(motions.inert.size())),
      holonomic_count_(row_count(holonomic_)),
      point_(scene_, motions),
      forms_(holonomic_, scene.dimension()) {
  for (const ConstraintLevel& level : motions_.levels) hidden_count_ += static_cast<int>(level.left.size());
}

Vector LevelledEquations::state(ConstVectorRef q, ConstVectorRef p) const {
  Vector z(n_ + inert_);
  z << q, Vector(p(motions_.inert));
  return z;
}

/// K_0; rate_, momentum_ and terms_ with it.
Vector LevelledEquations::equations(double t, ConstVectorRef z, ConstVectorRef w) {
  point_.evaluate(t, z.head(n_), w.head(n_), w.tail(m_));
  momentum_ = point_.full().momentum();
  rate_.resize(n_ + inert_);
  rate_ << w.head(n_), point_.inert(point_.full().force());
  terms_ = std::max({point_.terms(), max_norm(z.tail(inert_)), max_norm(w.head(n_))});
  Vector all(n_ + m_);
  all << point_.inert(momentum_) - z.tail(inert_), point_.along(), point_.full().row_residual();
  return all;
}

Columns LevelledEquations::by_unknowns(std::size_t level, double t, const Vector& z, const Vector& w) {
  const bool affine = level == 0 && motions_.affine;  // exact over any distance
  const auto of = [&](const Vector& there) { return at(level, t, z, there); };
  return differenced(of, w, n_, affine ? 1.0 : 0.02, !affine);
}

/// N of a level.
Columns LevelledEquations::left_kernel(std::size_t level, double t, const Vector& z, const Vector& w) {
  const ConstraintLevel& of = motions_.levels[level];
  const Columns by_w = by_unknowns(level, t, z, w);
  const Columns kept = by_w(of.kept, of.by).transpose(), left = by_w(of.left, of.by).transpose();
  Columns kernel = Columns::Zero(std::ssize(of.left), n_ + m_);
  kernel(Eigen::all, of.kept) = -kept.partialPivLu().solve(left).transpose();
  kernel(Eigen::all, of.left).setIdentity();
  return kernel;
}

Vector LevelledEquations::at(std::size_t level, double t, ConstVectorRef z, ConstVectorRef w) {
  if (level == 0) return equations(t, z, w);
  const Vector z0 = z, w0 = w;
  const Columns kernel = left_kernel(level - 1, t, z0, w0);
  Vector all = at(level - 1, t, z0, w0);
  if (level > 1) equations(t, z0, w0);
  const Vector g = rate_;
  const auto time_of = [&](Eigen::Index first, Eigen::Index size) {
    const double rate = max_norm(g.segment(first, size));
    return rate > 0.0 ? size_or_one(max_norm(z0.segment(first, size))) / rate : 1.0;
  };
  const double width = 0.02 * std::min({1.0, time_of(0, n_), time_of(n_, inert_)});
  resolved_ = std::min(resolved_, width);
  const auto along = [&](double k) { return at(level - 1, t + k * width, z0 + k * width * g, w0); };
  const std::vector<int>& left = motions_.levels[level - 1].left;
  all(left) = Vector(kernel * central_difference(along) / width);
  return all;
}

Vector LevelledEquations::evaluate(double t, ConstVectorRef z, ConstVectorRef w) {
  resolved_ = 1.0;
  const Vector all = at(motions_.levels.size(), t, z, w);
  equations(t, z, w);
  Vector ordered(n_ + m_);
  ordered << all(motions_.levels.front().kept), all(motions_.levels.front().left);
  return ordered;
}

double LevelledEquations::rate_terms() const {
  constexpr double sum_of_terms = 8.0;  // of central differences, and of N
  return terms_ * std::pow(sum_of_terms / resolved_, std::ssize(motions_.levels));
}

Vector LevelledEquations::constraints(double t, ConstVectorRef z, ConstVectorRef w) {
  Vector all(constraint_count());
  Eigen::Index row = 0;
  for (const auto& block : holonomic_) {
    block->position(t, z.head(n_), all.segment(row, block->rows()));
    row += block->rows();
  }
  for (std::size_t level = 0; level < motions_.levels.size(); ++level) {
    const Vector values = at(level, t, z, w);
    for (const int r : motions_.levels[level].left) all[row++] = values[r];
  }
  return all;
}

Columns LevelledEquations::constraint_derivative(double t, ConstVectorRef z, ConstVectorRef w) {
  const Vector z0 = z, w0 = w;
  Columns by_z = Columns::Zero(constraint_count(), n_ + inert_);
  if (holonomic_count_ > 0) {
    forms_.evaluate(t, z0.head(n_));
    by_z.topLeftCorner(holonomic_count_, n_) = forms_.pattern().full(forms_.coefficients());
  }
  Eigen::Index row = holonomic_count_;
  for (std::size_t level = 0; level < motions_.levels.size(); ++level) {
    const Columns kernel = left_kernel(level, t, z0, w0);
    const auto of = [&](const Vector& there) { return at(level, t, there, w0); };
    by_z.middleRows(row, kernel.rows()) = kernel * differenced(of, z0, n_, 1e-4, false);
    row += kernel.rows();
  }
  return by_z;
}

std::string LevelledEquations::constraint_name(int number) const {
  int of_level = number - holonomic_count_;
  for (const ConstraintLevel& level : motions_.levels) {
    const int count = static_cast<int>(level.left.size());
    if (of_level >= count) {
      of_level -= count;
      continue;
    }
    const int row = level.left[static_cast<std::size_t>(of_level)];
    const auto coordinate = [&](const std::vector<int>& of, int k) {
      return "'" + scene_.coordinates[static_cast<std::size_t>(of[static_cast<std::size_t>(k)])] + "'";
    };
    if (row < inert_) return "the momentum of " + coordinate(motions_.inert, row);
    if (row < n_) return "the equation of motion along " + coordinate(motions_.along, row - inert_);
    return "the velocity in " + row_label(scene_.constraints, row - n_);
  }
  return row_label(holonomic_, number);
}

}  // namespace diracstep
