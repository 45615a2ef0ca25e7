#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/hamiltonian_point.hpp>
#include <sstream>

namespace diracstep {

HamiltonianPointProblem::HamiltonianPointProblem(const Scene& scene, bool dense)
    : scene_(scene),
      n_(scene.dimension()),
      m_(scene.rows()),
      q_(Vector::Zero(scene.storage_size())),
      rows_(scene.constraints, n_),
      hq_(Vector::Zero(n_)),
      hp_(hq_),
      response_(scene.hamiltonian->pattern(), false, rows_.pattern(), true),
      own_(Vector::Zero(n_ + m_)),
      layout_(n_ + m_, n_ + m_),
      last_x_(own_),
      sizes_(own_),
      largest_(own_),
      row_scales_(n_ + m_) {
  for (Vector* values : {&hqq_, &hqp_, &hpp_}) values->setZero(hamiltonian().pattern().nonzeros());
  response_values_.setZero(response_.pattern().nonzeros());
  layout_.add(SparsityPattern::diagonal(n_), 0, 0);
  layout_.add(response_.pattern(), 0, n_);
  layout_.add(rows_.pattern(), n_, 0);
  pattern_ = layout_.assemble(dense);
  blocks_.push_back({"velocity", n_});
  if (m_ > 0) blocks_.push_back({"constraint", m_});
}

void HamiltonianPointProblem::move_to(double t, ConstVectorRef q) {
  t_ = t;
  q_ = q;
  rows_.evaluate(t, q);
}

void HamiltonianPointProblem::assemble(VectorRef& values) {
  values.setZero();
  for (const int place : layout_.positions(0)) values[place] = 1.0;
  response_.multiply(hpp_.data(), rows_.coefficients().data(), response_values_.data());
  layout_.add_to(values.data(), 1, -1.0, response_values_.data());
  layout_.add_to(values.data(), 2, 1.0, rows_.coefficients().data());
}

void HamiltonianPointProblem::raise_scales(double terms, ConstVectorRef x) {
  last_x_ = x;
  if (std::isfinite(terms)) blocks_[0].scale = std::max(blocks_[0].scale, scale_of(terms));
  if (m_ == 0) return;
  const double velocity = max_norm(rows_.coefficients()) * max_norm(x.head(n_)) + max_norm(rows_.offsets());
  if (std::isfinite(velocity)) blocks_[1].scale = std::max(blocks_[1].scale, scale_of(velocity));
}

/// Beside the right-hand sides ∂²H/∂p² Aᵀ, as it was last taken, and A times both parts of x.
const double* HamiltonianPointProblem::scales_of_unsolved_rows(ConstVectorRef f, double level) {
  if (RowScales::solved(f.data(), own_.data(), n_ + m_, level)) return nullptr;
  sizes_ = own_ + last_x_.cwiseAbs();
  sizes_.tail(m_) = own_.tail(m_);
  largest_.setZero();
  const double fastest = hamiltonian().structure().quadratic ? 0.0 : max_norm(last_x_.head(n_));
  largest_.head(n_).setConstant(fastest);
  response_.pattern().for_each(
      [&](Eigen::Index e, int r, int c) { sizes_[r] += std::abs(response_values_[e] * last_x_[n_ + c]); });
  rows_.pattern().for_each([&](Eigen::Index e, int r, int c) {
    sizes_[n_ + r] += std::abs(rows_.coefficients()[e] * last_x_[c]);
    largest_[n_ + r] += std::abs(rows_.coefficients()[e]) * fastest;
  });
  row_scales_.set(0, sizes_.head(n_), largest_.head(n_), blocks_[0].scale);
  if (m_ > 0) row_scales_.set(n_, sizes_.tail(m_), largest_.tail(m_), blocks_[1].scale);
  return row_scales_.unsolved(f, level);
}

void HamiltonianVelocityProblem::begin(double t, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v) {
  move_to(t, q);
  p_ = p;
  take_first(p);
  own_.head(n_) = hp_.cwiseAbs();
  own_.tail(m_) = rows_.offsets().cwiseAbs();
  for (std::size_t b = 0; b < (m_ > 0 ? 2U : 1U); ++b) set_scale(b, smallest_scale);
  Vector x = Vector::Zero(n_ + m_);
  x.head(n_) = v;
  raise_scales(max_norm(hp_), x);
}

void HamiltonianVelocityProblem::project(ConstVectorRef x, Vector& p) const {
  p = p_;
  rows_.add_annihilator(x.tail(m_), p);
}

void HamiltonianVelocityProblem::residual(ConstVectorRef x, VectorRef f) {
  project(x, projected_);
  take_first(projected_);
  f.head(n_) = x.head(n_) - hp_;
  raise_scales(max_norm(hp_), x);
  if (m_ > 0) rows_.velocity_residual(x.head(n_), f.tail(m_));
}

void HamiltonianVelocityProblem::jacobian(ConstVectorRef x, VectorRef values) {
  project(x, projected_);
  take_second(projected_);
  assemble(values);
}

void HamiltonianAccelerationProblem::begin(double t, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v) {
  move_to(t, q);
  take_first(p);
  take_second(p);
  Vector known = -hq_, force(n_);
  if (scene_.force) {
    scene_.force->value(t, q, v, force);
    known += force;
  }
  known_acceleration_.resize(n_);
  hamiltonian().gradient_rate(t, q, p, known_acceleration_);
  hamiltonian().pattern().transposed_multiply_add(hqp_.data(), v.data(), known_acceleration_.data());
  hamiltonian().pattern().multiply_add(hpp_.data(), known.data(), known_acceleration_.data());
  known_rate_.setZero(m_);
  row_derivative_.resize(rows_.pattern().nonzeros());
  rows_.distribution().time_derivative(t, q, v, known_rate_);
  rows_.distribution().derivative(t, q, v, 1.0, row_derivative_);
  rows_.pattern().multiply_add(row_derivative_.data(), Vector(v).data(), known_rate_.data());
  own_.head(n_) = known_acceleration_.cwiseAbs();
  own_.tail(m_) = known_rate_.cwiseAbs();
  set_scale(0, scale_of(max_norm(known_acceleration_)));
  if (m_ > 0)
    set_scale(
        1, scale_of(max_norm(known_rate_) + max_norm(rows_.coefficients()) * max_norm(known_acceleration_)));
}

void HamiltonianAccelerationProblem::residual(ConstVectorRef x, VectorRef f) {
  f.head(n_).setZero();
  response_.multiply(hpp_.data(), rows_.coefficients().data(), response_values_.data());
  response_.pattern().multiply_add(response_values_.data(), x.data() + n_, f.data());
  raise_scales(std::max(max_norm(f.head(n_)), max_norm(x.head(n_))), x);
  f.head(n_) = x.head(n_) - f.head(n_) - known_acceleration_;
  if (m_ == 0) return;
  f.tail(m_) = known_rate_;
  rows_.pattern().multiply_add(rows_.coefficients().data(), x.data(), f.data() + n_);
}

void HamiltonianAccelerationProblem::jacobian(ConstVectorRef, VectorRef values) { assemble(values); }

namespace {

constexpr int most_rows_to_test = 1000;

/// A ∂²H/∂p² Aᵀ at a point, each row and column in units of its largest entry.
Columns response_of_rows(const Scene& scene, double t, const Vector& q, const Vector& p) {
  const Hamiltonian& h = *scene.hamiltonian;
  Vector hqq(h.pattern().nonzeros()), hqp = hqq, hpp = hqq;
  h.hessian(t, q, p, hqq, hqp, hpp);
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  rows.evaluate(t, q);
  const Columns a = rows.pattern().full(rows.coefficients());
  Columns response = a * h.pattern().full(hpp) * a.transpose();
  Vector units(response.rows());
  for (Eigen::Index r = 0; r < units.size(); ++r)
    units[r] = 1.0 / std::sqrt(size_or_one(max_norm(response.row(r).transpose())));
  return units.asDiagonal() * response * units.asDiagonal();
}

}  // namespace

void require_regular_rows(const Scene& scene) {
  const Start& start = scene.start;
  const int n = scene.dimension(), m = scene.rows();
  if (m == 0 || m > most_rows_to_test || n > most_rows_to_test) return;
  if (start.q.size() != scene.storage_size() || start.p.size() != n) return;  // told by require_consistent
  Eigen::FullPivLU<Columns> lu;
  lu.setThreshold(1e-12);
  Columns response = response_of_rows(scene, start.time, start.q, start.p);
  if (!response.allFinite() || lu.compute(response).isInvertible()) return;
  const Columns directions = lu.kernel();
  Vector q = start.q, p = start.p;
  for (Eigen::Index i = 0; i < n; ++i) {  // a point near the start that shares no special position with it
    q[i] += 1e-2 * size_or_one(max_norm(start.q)) * std::sin(1.0 + 1.7 * static_cast<double>(i));
    p[i] += 1e-2 * size_or_one(max_norm(start.p)) * std::cos(0.3 + 2.3 * static_cast<double>(i));
  }
  response = response_of_rows(scene, start.time, q, p);
  if (!response.allFinite() || lu.compute(response).isInvertible()) return;
  std::ostringstream text;
  text.precision(4);
  for (Eigen::Index k = 0; k < directions.cols(); ++k) {
    const Vector direction = directions.col(k) / max_norm(directions.col(k));
    for (Eigen::Index r = 0; r < m; ++r) {
      if (std::abs(direction[r]) < 1e-8) continue;
      text << (text.str().empty() ? "" : ", ") << row_label(scene.constraints, static_cast<int>(r));
    }
  }
  throw Misuse("scene '" + scene.name +
               "': the Hamiltonian is degenerate along the rows: A ∂²H/∂p² Aᵀ is singular, so the force of " +
               text.str() +
               " changes no velocity in it and cannot keep it; rows are kept where H is not linear in the "
               "momenta along their one-forms");
}

}  // namespace diracstep
