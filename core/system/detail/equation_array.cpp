#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/detail/equation_array.hpp>
#include <limits>
#include <utility>

namespace diracstep {

namespace {

constexpr double smooth_to = 1e-13, smooth_enough = 5e-12;

/// Σ_i c(i,k) f(i), i from −r to r: the coefficient of x^k of the polynomial through these values, in
/// extended precision (B. Fornberg, Math. Comp. 51, 1988).
Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic> coefficient_weights(int r, int most) {
  using Long = long double;
  const int count = 2 * r + 1;
  Eigen::Matrix<Long, Eigen::Dynamic, Eigen::Dynamic> c(count, most + 1);
  c.setZero();
  const auto at = [r](int i) { return static_cast<Long>(i - r); };
  c(0, 0) = 1.0L;
  Long before = 1.0L;
  for (int i = 1; i < count; ++i) {
    Long product = 1.0L;
    for (int j = 0; j < i; ++j) {
      const Long apart = at(i) - at(j);
      product *= apart;
      if (j == i - 1) {
        for (int k = std::min(i, most); k >= 0; --k)
          c(i, k) = before / product * ((k > 0 ? c(j, k - 1) : 0.0L) - at(j) * c(j, k));
      }
      for (int k = std::min(i, most); k >= 0; --k)
        c(j, k) = (at(i) * c(j, k) - (k > 0 ? c(j, k - 1) : 0.0L)) / apart;
    }
    before = product;
  }
  return c;
}

/// Those in units of the reach, r points.
Columns weights_of(int half, int most) {
  auto c = coefficient_weights(half, most);
  for (int k = 0; k <= most; ++k) c.col(k) *= std::pow(static_cast<long double>(half), k);
  Columns weights = c.cast<double>();
  weights.col(0) = Vector::Unit(2 * half + 1, half);
  return weights;
}

Vector tail_of(int half, const Columns& weights) {
  Vector fewer = Vector::Zero(weights.rows());
  fewer.segment(1, weights.rows() - 2) =
      (static_cast<long double>(half) * coefficient_weights(half - 1, 1).col(1)).cast<double>();
  return weights.col(1) - fewer;
}

}  // namespace

EquationArray::EquationArray(const Scene& scene, std::vector<int> inert, int orders)
    : scene_(scene),
      inert_(std::move(inert)),
      n_(scene.dimension()),
      m_(scene.rows()),
      orders_(orders),
      half_(5 + orders),
      points_(2 * half_ + 1),
      constraints_(scene_.constraints, n_),
      weights_(weights_of(half_, orders + 1)),
      tail_(tail_of(half_, weights_)),
      l_(*scene_.lagrangian),
      equations_(n_, points_),
      row_rates_(m_, points_),
      values_(rows()),
      force_(n_),
      row_values_(m_) {
  at_.f.resize(n_);
  at_.along.resize(constraints_.pattern().nonzeros());
  at_.row_rate.resize(m_);
  const auto size = [this](Columns& of, int nonzeros) { of.setZero(nonzeros, points_); };
  const int of_l = scene_.lagrangian->pattern().nonzeros(), of_rows = constraints_.pattern().nonzeros(),
            of_force = scene_.force ? scene_.force->pattern().nonzeros() : 0;
  for (Columns* of : {&samples_.vv, &samples_.qv, &samples_.qq}) size(*of, of_l);
  for (Columns* of : {&samples_.fq, &samples_.fv}) size(*of, of_force);
  for (Columns* of : {&samples_.a, &samples_.rq}) size(*of, of_rows);
  for (const auto& block : scene_.constraints)
    samples_.curvature.emplace_back(block->curvature_pattern().nonzeros(), points_);
}

void EquationArray::take(int point, double s, double t, ConstVectorRef z, ConstVectorRef w,
                         bool derivatives) {
  Vector &q = at_.q, &v = at_.v, &a = at_.a, &lambda = at_.lambda, &rate = at_.rate, &force = at_.force;
  q = z.head(n_);
  for (Vector* column : {&v, &a, &rate}) column->setZero(n_);
  lambda.setZero(m_);
  double power = 1.0, lower = 0.0;  // s^j and s^(j-1)
  for (int j = 0; j <= orders_ + 1; ++j) {
    const auto vj = w.segment((n_ + m_) * j, n_);
    v += power * vj;
    q += reach_ * power * s / (j + 1) * vj;
    a += j * lower / reach_ * vj;
    if (j <= orders_) lambda += power * w.segment((n_ + m_) * j + n_, m_);
    lower = power;
    power *= s;
  }
  t += reach_ * s;
  const Lagrangian& lagrangian = *scene_.lagrangian;
  const SparsityPattern& pattern = lagrangian.pattern();
  l_.take_first(lagrangian, t, q, v);
  if (!constant_hessian_known_) l_.take_second(lagrangian, t, q, v);
  constant_hessian_known_ = lagrangian.structure().quadratic;
  force = l_.q;
  if (!lagrangian.structure().autonomous) lagrangian.gradient_rate(t, q, v, rate);
  pattern.transposed_multiply_add(l_.qv.data(), v.data(), rate.data());
  pattern.multiply_add(l_.vv.data(), a.data(), rate.data());
  if (scene_.force) {
    scene_.force->value(t, q, v, at_.f);
    force += at_.f;
  }
  if (m_ > 0) {
    constraints_.evaluate(t, q);
    constraints_.add_annihilator(lambda, force);
    Vector &along = at_.along, &row_rate = at_.row_rate;
    constraints_.distribution().derivative(t, q, v, 1.0, along);
    constraints_.distribution().time_derivative(t, q, v, row_rate);
    row_terms_ = std::max(row_terms_, reach_ * max_norm(row_rate));
    constraints_.pattern().multiply_add(along.data(), v.data(), row_rate.data());
    constraints_.pattern().multiply_add(constraints_.coefficients().data(), a.data(), row_rate.data());
    row_rates_.col(point) = row_rate;
    row_terms_ = std::max({row_terms_, max_norm(constraints_.coefficients()) * max_norm(v),
                           reach_ * max_norm(constraints_.coefficients()) * max_norm(a),
                           reach_ * max_norm(along) * max_norm(v)});
    if (point == half_) constraints_.velocity_residual(v, row_values_);
    if (derivatives) {
      samples_.a.col(point) = constraints_.coefficients();
      samples_.rq.col(point) = along;
    }
  }
  equations_.col(point) = reach_ * (rate - force);
  terms_ = std::max({terms_, reach_ * max_norm(rate), reach_ * max_norm(force)});
  if (point == half_) {
    momentum_ = l_.v;
    force_ = force;
    velocity_ = v;
  }
  if (!derivatives) return;
  samples_.vv.col(point) = l_.vv;
  samples_.qv.col(point) = l_.qv;
  samples_.qq.col(point) = l_.qq;
  if (scene_.force) scene_.force->derivatives(t, q, v, samples_.fq.col(point), samples_.fv.col(point));
  Eigen::Index row = 0;
  for (std::size_t b = 0; b < scene_.constraints.size(); ++b) {
    const ConstraintRows& block = *scene_.constraints[b];
    block.annihilator_derivative(t, q, lambda.segment(row, block.rows()), samples_.curvature[b].col(point));
    row += block.rows();
  }
}

void EquationArray::evaluate(double t, ConstVectorRef z, ConstVectorRef w, bool derivatives) {
  terms_ = row_terms_ = 0.0;
  for (int k = 0; k < points_; ++k) take(k, static_cast<double>(k - half_) / half_, t, z, w, derivatives);
  const Columns motion = equations_ * weights_.leftCols(orders_ + 1),
                rates = row_rates_ * weights_.leftCols(orders_ + 1);
  values_.head(inert_count()) = Vector(momentum_(inert_)) - z.tail(inert_count());
  terms_ = std::max({terms_, max_norm(momentum_), max_norm(z.tail(inert_count()))});
  for (int k = 0; k <= orders_; ++k) {
    values_.segment(place_of_row(k), m_) = k == 0 ? row_values_ : Vector(reach_ / k * rates.col(k - 1));
    values_.segment(place_of_motion(k), n_) = motion.col(k);
  }
  if (derivatives) assemble();
}

void EquationArray::assemble() {
  const SparsityPattern &of_l = scene_.lagrangian->pattern(), &of_rows = constraints_.pattern();
  std::vector<Columns> m, b, fv, fq, a, rq;  // coefficients of ∂²L/∂v², ∂²L/∂v∂q, the force by v and q, …
  for (int k = 0; k <= orders_ + 1; ++k) {
    const auto weights = weights_.col(k);
    m.push_back(of_l.full(Vector(samples_.vv * weights)));
    const Columns qv = of_l.full(Vector(samples_.qv * weights));
    b.emplace_back(qv.transpose());
    fv.push_back(qv);
    fq.push_back(of_l.full(Vector(samples_.qq * weights)));
    if (scene_.force) {
      fq.back() += scene_.force->pattern().full(Vector(samples_.fq * weights));
      fv.back() += scene_.force->pattern().full(Vector(samples_.fv * weights));
    }
    for (std::size_t at = 0; at < scene_.constraints.size(); ++at)
      fq.back() += scene_.constraints[at]->curvature_pattern().full(Vector(samples_.curvature[at] * weights));
    a.push_back(of_rows.full(Vector(samples_.a * weights)));
    rq.push_back(of_rows.full(Vector(samples_.rq * weights)));
  }
  const int inert = inert_count();
  by_unknowns_.setZero(rows(), unknowns());
  by_state_.setZero(rows(), states());
  by_unknowns_.topLeftCorner(inert, n_) = m[0](inert_, Eigen::all);
  by_state_.topLeftCorner(inert, n_) = b[0](inert_, Eigen::all);
  by_state_.topRightCorner(inert, inert).diagonal().setConstant(-1.0);
  const auto of = [](const std::vector<Columns>& x, int k) -> const Columns& {
    return x[static_cast<std::size_t>(k)];
  };
  for (int k = 0; k <= orders_; ++k) {
    by_state_.block(place_of_motion(k), 0, n_, n_) = (k + 1) * of(b, k + 1) - reach_ * of(fq, k);
    by_state_.block(place_of_row(k), 0, m_, n_) = of(rq, k);
    for (int j = 0; j <= k + 1; ++j) {
      const double integral = reach_ / (j + 1);
      auto motion = by_unknowns_.block(place_of_motion(k), (n_ + m_) * j, n_, n_);
      motion = (k + 1) * of(m, k + 1 - j);
      if (j > k) continue;
      motion += (k + 1) * integral * of(b, k - j) - reach_ * of(fv, k - j);
      if (j < k) motion -= reach_ * integral * of(fq, k - j - 1);
      by_unknowns_.block(place_of_motion(k), (n_ + m_) * j + n_, n_, m_) = -reach_ * of(a, k - j).transpose();
      auto row = by_unknowns_.block(place_of_row(k), (n_ + m_) * j, m_, n_);
      row = of(a, k - j);
      if (j < k) row += integral * of(rq, k - j - 1);
    }
  }
  force_by_q_ = fq[0];
  force_by_v_ = fv[0];
  rows_ = a[0];
}

Vector EquationArray::rate() const {
  Vector g(states());
  g << velocity_, Vector(force_(inert_));
  return g;
}

Columns EquationArray::rate_by_state() const {
  Columns by = Columns::Zero(states(), states());
  by.bottomLeftCorner(inert_count(), n_) = force_by_q_(inert_, Eigen::all);
  return by;
}

Columns EquationArray::rate_by_leading() const {
  Columns by = Columns::Zero(states(), n_ + m_);
  by.topLeftCorner(n_, n_).setIdentity();
  by.bottomLeftCorner(inert_count(), n_) = force_by_v_(inert_, Eigen::all);
  by.bottomRightCorner(inert_count(), m_) = rows_.transpose()(inert_, Eigen::all);
  return by;
}

Vector EquationArray::round_off() const {
  Vector sizes(rows());
  sizes.head(inert_count()).setConstant(terms_);
  for (int k = 0; k <= orders_; ++k) {
    const double of_rates = k == 0 ? 1.0 : weights_.col(k - 1).lpNorm<1>() / k;
    sizes.segment(place_of_row(k), m_).setConstant(of_rates * row_terms_);
    sizes.segment(place_of_motion(k), n_).setConstant(weights_.col(k).lpNorm<1>() * terms_);
  }
  return sizes;
}

double EquationArray::roughness() const {
  const double of_motion = max_norm(equations_ * tail_) / scale_of(terms_),
               of_rows = m_ > 0 ? reach_ * max_norm(row_rates_ * tail_) / scale_of(row_terms_) : 0.0;
  const double rough = std::max(of_motion, of_rows);
  return std::isfinite(rough) ? rough : std::numeric_limits<double>::infinity();
}

bool EquationArray::smooth() const { return roughness() <= smooth_enough; }

void EquationArray::take_reach(double reach, Vector& w) {
  double factor = 1.0;
  for (int j = 0; j <= orders_ + 1; ++j) {
    w.segment((n_ + m_) * j, j <= orders_ ? n_ + m_ : n_) *= factor;
    factor *= reach / reach_;
  }
  reach_ = reach;
}

double EquationArray::rest_speed(ConstVectorRef z) const {
  const double by_velocity = max_norm(by_unknowns_.block(place_of_motion(0), 0, n_, n_)),
               by_position = max_norm(by_state_.block(place_of_motion(0), 0, n_, n_)),
               speed = size_or_one(max_norm(z.head(n_))) * by_position / by_velocity;
  return std::isfinite(speed) ? speed : 0.0;
}

void EquationArray::choose_reach(double t, ConstVectorRef z, Vector& w) {
  constexpr int most_halvings = 14;
  evaluate(t, z, w, true);
  const double speed = max_norm(w.head(n_)), size = size_or_one(max_norm(z.head(n_))),
               time = speed > part_of_rest_speed * rest_speed(z) ? size / speed : 1.0;
  double least = std::numeric_limits<double>::infinity(), best = time, reach = time;
  for (int k = 0; k <= most_halvings && !(least <= smooth_to); ++k, reach /= 2.0) {
    take_reach(reach, w);
    evaluate(t, z, w, false);
    if (const double rough = roughness(); rough < least) {
      least = rough;
      best = reach;
    }
  }
  take_reach(best, w);
}

}  // namespace diracstep
