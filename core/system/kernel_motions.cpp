#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/kernel_basis.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/detail/poses.hpp>
#include <diracstep/core/system/kernel_motions.hpp>
#include <diracstep/core/system/rows_along_motions.hpp>
#include <sstream>
#include <utility>

namespace diracstep {

namespace {

constexpr int most_with_hidden_equations = 200;
constexpr double difference = 1e-5;  ///< of central differences, in relation to what is varied
constexpr double no_dependence = 1e-8, regular_along_rows = 1e-11;

Eigen::Index count(const std::vector<int>& places) { return static_cast<Eigen::Index>(places.size()); }

/// Tells those equations with entries beside their size from hidden ones.
void keep_if_none(const Columns& derivatives, double size, Eigen::Index first, std::vector<bool>& hidden) {
  for (Eigen::Index i = 0; i < derivatives.rows(); ++i)
    if (max_norm(derivatives.row(i)) > no_dependence * size)
      hidden[static_cast<std::size_t>(first + i)] = false;
}

}  // namespace

void divide_coordinates(const Columns& mass, FirstOrderMotions& motions) {
  Eigen::ColPivHouseholderQR<Columns> qr;
  qr.setThreshold(1e-11);
  qr.compute(mass);
  const auto& order = qr.colsPermutation().indices();
  for (Eigen::Index k = 0; k < mass.cols(); ++k)
    (k < qr.rank() ? motions.inert : motions.along).push_back(order[k]);
  std::ranges::sort(motions.inert);
  std::ranges::sort(motions.along);
}

FirstOrderMotions kernel_motions(const Scene& scene, bool first_order) {
  const Eigen::Index n = scene.dimension(), m = scene.rows();
  if (n + m > most_with_hidden_equations) return {};
  FirstOrderMotions motions;
  Columns w;
  bool moves = false, holds_velocities = false;
  for (const double phase : {0.8, 1.9}) {
    const Start at = near_start(scene.start, phase);
    LagrangianDerivatives l(*scene.lagrangian);
    l.take_second(*scene.lagrangian, at.time, at.q, at.v);
    const Columns mass = scene.lagrangian->pattern().full(l.vv);
    if (!mass.allFinite()) return {};
    const bool first = w.size() == 0;
    if (first) {
      divide_coordinates(mass, motions);
      if (motions.along.empty()) return {};
      motions.hidden.assign(motions.along.size() + static_cast<std::size_t>(m), true);
    }
    KernelPoint point(scene, motions);
    point.evaluate(at.time, at.q, at.v, Vector::Zero(m));
    point.differentiate();
    const Columns& here = point.kernel();
    // W spans the kernel here too, or the rank has changed.
    if (!here.allFinite() || max_norm(mass * here) > 1e-9 * max_norm(mass) * max_norm(here)) return {};
    moves = moves || (!first && max_norm(here - w) > 1e-9 * max_norm(w));
    w = here;
    const double size = point.terms() / size_or_one(max_norm(at.v));
    const Columns allowed =
        m == 0 ? Columns(Columns::Identity(n, n)) : kernel_basis(point.full().rows(), regular_along_rows);
    if (kernel_basis(mass * allowed, regular_along_rows).cols() == 0) return {};  // regular along the rows
    keep_if_none(point.along_by_v() * w, size, 0, motions.hidden);
    keep_if_none(point.along_by_lambda(), max_norm(point.full().rows()), 0, motions.hidden);
    keep_if_none(point.full().rows() * w, max_norm(point.full().rows()), w.cols(), motions.hidden);
    for (Eigen::Index k = 0; k < w.cols(); ++k)
      if (motions.hidden[static_cast<std::size_t>(k)] &&
          max_norm(point.along_by_v().row(k) * allowed) > no_dependence * size)
        holds_velocities = true;
  }
  const bool hides = std::ranges::find(motions.hidden, true) != motions.hidden.end();
  if (!moves && !holds_velocities && !(first_order && hides)) return {};
  motions.w = w;
  motions.u = Columns(Columns::Identity(n, n))(Eigen::all, motions.inert);
  return motions;
}

Vector KernelPoint::inert(ConstVectorRef x) const { return x(motions_.inert); }

Vector KernelPoint::along_at(FirstOrderPoint& point, Columns& w, double& terms) const {
  const Columns mass = point.mass_here();
  const auto &a = motions_.along, &i = motions_.inert;
  w.setZero(mass.rows(), count(a));
  w(a, Eigen::all).setIdentity();
  if (!i.empty()) w(i, Eigen::all) = -Columns(Columns(mass(i, i)).partialPivLu().solve(Columns(mass(i, a))));
  terms = max_norm(w) * std::max(max_norm(point.momentum_rate()), max_norm(point.force()));
  return w.transpose() * (point.momentum_rate() - point.force());
}

void KernelPoint::evaluate(double t, ConstVectorRef q, ConstVectorRef v, ConstVectorRef lambda) {
  t_ = t;
  q_ = q;
  v_ = v;
  lambda_ = lambda;
  point_.evaluate(t, q, v, lambda);
  along_ = along_at(point_, w_, terms_);
}

void KernelPoint::differentiate() {
  point_.differentiate();
  Columns w;
  double terms = 0.0;
  const auto derivative = [&](const Vector& x, bool of_q, Columns& by) {
    by.resize(along_.size(), x.size());
    const double d = difference * size_or_one(max_norm(x));
    for (Eigen::Index j = 0; j < x.size(); ++j) {
      for (const double side : {1.0, -1.0}) {
        Vector there = x;
        there[j] += side * d;
        beside_.evaluate(t_, of_q ? there : q_, of_q ? v_ : there, lambda_);
        const Vector e = along_at(beside_, w, terms);
        by.col(j) = side > 0.0 ? e : Vector((by.col(j) - e) / (2.0 * d));
      }
    }
  };
  derivative(q_, true, by_q_);
  derivative(v_, false, by_v_);
}

/// dv/dt but for a multiple of W, which no hidden equation asks for.
Vector KernelPoint::acceleration() const {
  const auto& i = motions_.inert;
  Vector a = Vector::Zero(v_.size());
  if (i.empty()) return a;
  const Columns mass = point_.mass();
  a(i) = Vector(Columns(mass(i, i)).partialPivLu().solve(inert(point_.force() - point_.momentum_rate())));
  return a;
}

Vector KernelPoint::hidden_rates(double& resolved) {
  constexpr std::array weights{4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0};  // of order 8
  constexpr double part = 0.02;
  const Vector a = acceleration();
  const auto time_of = [](const Vector& x, const Vector& rate) {
    return max_norm(rate) > 0.0 ? size_or_one(max_norm(x)) / max_norm(rate) : HUGE_VAL;
  };
  double width = part * std::min(time_of(q_, v_), time_of(v_, a));
  if (!std::isfinite(width)) width = part;
  resolved = width;
  Vector rate = Vector::Zero(along_.size());
  Columns w;
  double terms = 0.0;
  for (std::size_t k = 0; k < weights.size(); ++k)
    for (const double side : {1.0, -1.0}) {
      const double ahead = side * width * static_cast<double>(k + 1);
      beside_.evaluate(t_ + ahead, q_ + ahead * v_, v_ + ahead * a, lambda_);
      rate += side * weights.at(k) / width * along_at(beside_, w, terms);
    }
  Vector rows(point_.row_residual().size());
  if (rows.size() > 0) rows = point_.rows() * a + point_.row_by_q() * v_ + point_.row_by_t();
  std::vector<double> all;
  for (std::size_t k = 0; k < motions_.hidden.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    if (motions_.hidden[k]) all.push_back(at < rate.size() ? rate[at] : rows[at - rate.size()]);
  }
  return Eigen::Map<const Vector>(all.data(), std::ssize(all));
}

KernelVelocityProblem::KernelVelocityProblem(const Scene& scene, const FirstOrderMotions& motions)
    : MomentumVelocityProblem(scene), inert_(static_cast<int>(motions.inert.size())), point_(scene, motions) {
  const auto hidden = static_cast<int>(std::ranges::count(motions.hidden, true));
  if (inert_ > 0) blocks_.push_back({"momentum", inert_});
  if (n_ + m_ > inert_ + hidden) blocks_.push_back({"force and velocity", n_ + m_ - inert_ - hidden});
  if (hidden > 0) blocks_.push_back({"rate of hidden equations", hidden});
}

void KernelVelocityProblem::residual(ConstVectorRef x, VectorRef f) {
  point_.evaluate(t_, q_, x.head(n_), x.tail(m_));
  point_.take_matrices();
  const Eigen::Index along = point_.along().size();
  f.head(inert_) = point_.inert(point_.full().momentum() - p_);
  Eigen::Index row = inert_;
  for (Eigen::Index k = 0; k < along + m_; ++k)
    if (!point_.motions().hidden[static_cast<std::size_t>(k)])
      f[row++] = k < along ? point_.along()[k] : point_.full().row_residual()[k - along];
  double resolved = 1.0;
  f.tail(f.size() - row) = point_.hidden_rates(resolved);
  const double velocity = m_ > 0 ? max_norm(x.head(n_)) : 0.0, forms = max_norm(point_.full().rows());
  std::size_t b = 0;
  const auto raise = [&](bool present, double terms) {
    if (present && std::isfinite(terms)) blocks_[b].scale = scale_of(terms);
    if (present) ++b;
  };
  raise(inert_ > 0, std::max(max_norm(p_), max_norm(point_.full().momentum())));
  raise(row > inert_, std::max(point_.terms(), velocity * forms));
  raise(f.size() > row, std::max(point_.terms(), velocity * forms) / resolved);
}

void KernelVelocityProblem::jacobian(ConstVectorRef x, VectorRef values) {
  auto j = values.reshaped(n_ + m_, n_ + m_);
  Vector there = x, ahead(x.size()), behind(x.size());
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const double d = difference * size_or_one(max_norm(k < n_ ? x.head(n_) : x.tail(m_)));
    there[k] = x[k] + d;
    residual(there, ahead);
    there[k] = x[k] - d;
    residual(there, behind);
    there[k] = x[k];
    j.col(k) = (ahead - behind) / (2.0 * d);
  }
}

void require_on_hidden(const Scene& scene, const FirstOrderMotions& motions) {
  if (!motions.levels.empty()) return require_on_levels(scene, motions);
  const Start& start = scene.start;
  KernelPoint point(scene, motions);
  point.evaluate(start.time, start.q, start.v, Vector::Zero(scene.rows()));
  for (Eigen::Index k = 0; k < point.along().size(); ++k) {
    if (!motions.hidden[static_cast<std::size_t>(k)] ||
        std::abs(point.along()[k]) <= 1e-10 * scale_of(point.terms()))
      continue;
    std::ostringstream reason;
    reason << "violates the equation of motion along '" << motion_along(scene, point.kernel().col(k))
           << "', which holds no acceleration, by " << point.along()[k] << " of terms as large as "
           << point.terms();
    throw InconsistentStart(scene.name, reason.str(), InconsistentStart::Of::position);
  }
}

}  // namespace diracstep
