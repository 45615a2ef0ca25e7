#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/adaptive/force_polynomial.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <limits>
#include <numbers>

namespace diracstep {

namespace {

constexpr int nodes = 12;             // of a polynomial
constexpr double negligible = 1e-5;   // part of the error asked for, also where the motion amplifies it
constexpr double counts = 0.02;       // part of the error asked for that the forces missed may make up
constexpr double read_error = 1e-11;  // relative, of F and of its polynomial
constexpr double next_point = 0.125;  // ratio of the distances of points that approach an end
constexpr double epsilon = std::numeric_limits<double>::epsilon();

/// Chebyshev points of (−1, 1) and the weights of their barycentric formula.
struct ChebyshevPoints {
  std::array<double, nodes> x{}, weight{};
  ChebyshevPoints() {
    for (int k = 0; k < nodes; ++k) {
      const double angle = (2.0 * k + 1.0) * std::numbers::pi / (2.0 * nodes);
      x[static_cast<std::size_t>(k)] = std::cos(angle);
      weight[static_cast<std::size_t>(k)] = (k % 2 == 0 ? 1.0 : -1.0) * std::sin(angle);
    }
  }
  /// out = values · l(x), the polynomial through the columns of `values`.
  void interpolate(const Columns& values, double at, Vector& out) const {
    Eigen::Matrix<double, nodes, 1> w;
    for (int k = 0; k < nodes; ++k) {
      const auto i = static_cast<std::size_t>(k);
      if (at == x[i]) return void(out = values.col(k));
      w[k] = weight[i] / (at - x[i]);
    }
    w /= w.sum();
    out.resize(values.rows());
    for (Eigen::Index r = 0; r < values.rows(); ++r) out[r] = values.row(r).dot(w);
  }
};
const ChebyshevPoints chebyshev;

}  // namespace

ForcePolynomial::ForcePolynomial(const Scene& scene, double error)
    : scene_(scene),
      error_(error),
      n_(scene.dimension()),
      m_(scene.rows()),
      rows_(scene.constraints, scene.dimension()),
      smooth_(!scene.force && !scene.kinks && scene.stepped_function().structure().autonomous &&
              std::ranges::all_of(scene.constraints, [](const auto& rows) { return rows->workless(); })),
      external_(Vector::Zero(n_)),
      value_(Vector::Zero(2 * n_ + m_)),
      other_(value_),
      samples_(Columns::Zero(2 * n_ + m_, nodes)) {}

double ForcePolynomial::closest(double t) const {
  return 8.0 * epsilon * std::max(std::abs(t), 0.01 * span_);
}

/// F at a time and the point of the path of another.
void ForcePolynomial::read(const PathCubic& path, double place, double t, VectorRef f) {
  ++readings_;
  path.at(place, q_, v_);
  path.momentum_at(place, p_);
  scene_.force_and_momentum(t, q_, v_, p_, f.head(n_), f.segment(n_, n_));
  if (scene_.force) {
    scene_.force->value(t, q_, v_, external_);
    f.head(n_) += external_;
  }
  if (m_ == 0) return;
  rows_.evaluate(t, q_);
  rows_.velocity_residual(v_, f.tail(m_));
}

/// What may be missed of each component of F: a part of the largest momentum for ∂L/∂v, the same over the
/// time of the motion for forces, and for rows a part of the largest |A v| and |b|.
void ForcePolynomial::find_scales(const std::vector<PathPoint>& path) {
  span_ = std::abs(path.back().time - path.front().time);
  readings_ = 0;
  rounding_.setZero(n_);
  counted_to_.reset();
  double force = 0.0, momentum = 0.0;
  Vector row_terms = Vector::Zero(m_), terms(m_), noise = Vector::Zero(2 * n_ + m_);
  for (std::size_t k = 0; k + 1 < path.size(); ++k) {
    const PathCubic cubic{path[k], path[k + 1]};
    if (std::abs(cubic.end() - cubic.begin()) <= 4.0 * closest(cubic.end())) continue;
    const double t = 0.5 * (cubic.begin() + cubic.end());
    // From one side alone it would be the jump of a force that switches here.
    read(cubic, t + closest(t), other_);
    read(cubic, t - closest(t), value_);
    const Vector ahead = other_, behind = value_;
    read(cubic, t, value_);
    noise = noise.cwiseMax((value_ - ahead).cwiseAbs().cwiseMin((value_ - behind).cwiseAbs()));
    force += max_norm(value_.head(n_)) * std::abs(cubic.end() - cubic.begin()) /
             span_;  // the mean: pulses are high
    momentum = std::max(momentum, max_norm(value_.segment(n_, n_)));
    if (m_ == 0) continue;
    terms = value_.tail(m_).cwiseAbs();
    rows_.pattern().multiply_add(rows_.coefficients().cwiseAbs().eval().data(), v_.cwiseAbs().eval().data(),
                                 terms.data());
    row_terms = row_terms.cwiseMax(terms);
  }
  momentum = std::max(momentum, 0.01 * force * span_);  // of a scene without masses, or at rest so far
  if (!(momentum > 0.0)) momentum = 1.0;
  const double part = counts * error_;
  allowed_.resize(2 * n_ + m_);
  weights_.resize(2 * n_ + m_);
  allowed_.head(n_).setConstant(std::max(part * momentum / span_, read_error * force));
  allowed_.segment(n_, n_).setConstant(std::max(part, read_error) * momentum);
  weights_.head(n_).setConstant(1.0 / momentum);
  weights_.segment(n_, n_).setConstant(1.0 / (momentum * span_));
  for (Eigen::Index r = 0; r < m_; ++r) {
    const double scale = size_or_one(row_terms[r]);
    allowed_[2 * n_ + r] = std::max(part, read_error) * scale;
    weights_[2 * n_ + r] = 1.0 / (scale * span_);
  }
  for (Eigen::Index i = 0; i < allowed_.size(); ++i)
    if (noise[i] < HUGE_VAL) allowed_[i] = std::max(allowed_[i], 30.0 * noise[i]);
}

double ForcePolynomial::fit(const PathCubic& path, double a, double b, long points,
                            const std::vector<double>& known) {
  const double middle = middle_ = 0.5 * (a + b), half = half_ = 0.5 * (b - a);
  for (int k = 0; k < nodes; ++k)
    read(path, middle + half * chebyshev.x[static_cast<std::size_t>(k)], samples_.col(k));
  // What rounding of F and of t leaves of F here, whatever is asked for.
  const double rounding = 2.0 * std::numeric_limits<double>::epsilon() * std::abs(middle);
  local_ = read_error * samples_.cwiseAbs().rowwise().maxCoeff();
  for (std::size_t k = 0; k + 1 < chebyshev.x.size(); ++k) {
    const double apart = std::abs(half) * (chebyshev.x[k] - chebyshev.x[k + 1]);
    const auto i = static_cast<Eigen::Index>(k);
    local_ = local_.cwiseMax(rounding / apart * (samples_.col(i) - samples_.col(i + 1)).cwiseAbs());
  }
  for (Eigen::Index i = 0; i < local_.size(); ++i)
    local_[i] = std::max(allowed_[i], std::isfinite(local_[i]) ? local_[i] : 0.0);
  double worst = 0.0;
  const auto compare = [&](double t) {
    if (!((t - a) * (b - t) > 0.0)) return;
    read(path, t, value_);
    chebyshev.interpolate(samples_, (t - middle) / half, other_);
    other_ = (other_ - value_).cwiseAbs();
    double excess = 0.0;
    for (Eigen::Index i = 0; i < other_.size(); ++i)
      if (!(other_[i] <= local_[i]))
        excess = std::max(excess, std::isfinite(other_[i]) ? other_[i] / local_[i] : HUGE_VAL);
    worst = std::max(worst, excess);
  };
  double place = 0.5;
  for (long k = 0; k < points; ++k) {
    compare(a + place * (b - a));
    place += std::numbers::phi - 1.0;
    if (place >= 1.0) place -= 1.0;
  }
  for (double s = 0.02; s * std::abs(b - a) > closest(b); s *= next_point) {
    compare(a + s * (b - a));
    compare(b - s * (b - a));
    if (smooth_ && points < 16) break;  // of very many steps
  }
  for (std::size_t k = 0; k < known.size(); ++k) {
    const double t = known[k], next = k + 1 < known.size() ? known[k + 1] : b;
    compare(t - 2.0 * closest(t));
    compare(t + 2.0 * closest(t));
    compare(0.5 * (t + next));
  }
  return worst;
}

void ForcePolynomial::count_rounding(const PathCubic& path) {
  const double deviation = epsilon * std::abs(middle_) / std::sqrt(12.0);  // of a rounded time
  const auto time = [&](int k) { return middle_ + half_ * chebyshev.x[static_cast<std::size_t>(k)]; };
  Vector squares = Vector::Zero(n_);
  for (int k = 1; k < nodes; ++k) squares += (samples_.col(k) - samples_.col(k - 1)).head(n_).cwiseAbs2();
  // Of that, what the motion brings does not count: it is read where the stages are, whatever the time.
  const auto add_at_rest = [&](int k, double t) {
    read(path, time(k), t, value_);
    squares += (samples_.col(k) - value_).head(n_).cwiseAbs2();
  };
  if (part_of_momentum(rounding_ + deviation * deviation * squares) > negligible * error_) {
    squares.setZero();
    for (int k = 1; k < nodes; ++k) add_at_rest(k, time(k - 1));
  }
  if (counted_to_) add_at_rest(nodes - 1, *counted_to_);
  counted_to_ = time(0);
  rounding_ += deviation * deviation * squares;
}

double ForcePolynomial::rounding() const { return part_of_momentum(rounding_); }

double ForcePolynomial::part_of_momentum(const Vector& squares) const {
  return (squares.cwiseSqrt().array() * weights_.head(n_).array()).maxCoeff();
}

double ForcePolynomial::miss(const PathCubic& path, double t) {
  read(path, t, value_);
  chebyshev.interpolate(samples_, (t - middle_) / half_, other_);
  return ((other_ - value_).array().abs() * weights_.array()).maxCoeff();
}

bool ForcePolynomial::jumps(const PathCubic& before, const PathCubic& after) {
  const double t = before.end(), gap = std::copysign(closest(t), t - before.begin());
  read(before, t - gap, value_);
  const Vector left = value_;
  read(after, t + gap, value_);
  return ((left - value_).array().abs() > 100.0 * allowed_.array()).any();
}

}  // namespace diracstep
