#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/validation/laws/derivative_examination.hpp>
#include <numbers>
#include <optional>
#include <utility>

namespace diracstep {

namespace {

constexpr double derivative_tolerance = 1e-5;  // of a derivative against differences, relative

/// Numbers in (-1, 1) without a pattern that a formula could share; the same in every run.
Vector direction(Eigen::Index n, double shift) {
  Vector d(n);
  for (Eigen::Index i = 0; i < n; ++i)
    d[i] = std::sin(shift + std::numbers::phi * static_cast<double>((i + 1) % 9973) * 3.7);
  return d;
}

/// The largest difference of two columns in relation to the size of the terms.
struct Deviation {
  double largest = 0.0;
  void add(const Vector& exact, const Vector& differences, double noise) {
    const double size =
        std::max(exact.size() == 0 ? 0.0 : exact.lpNorm<Eigen::Infinity>(), noise / derivative_tolerance);
    if (exact.size() == 0) return;
    const double off = (exact - differences).lpNorm<Eigen::Infinity>();
    largest = std::max(largest, std::isfinite(off) ? off / std::max(size, 1e-300) : HUGE_VAL);
  }
};

/// (g(+δ) − g(−δ))/2δ with Richardson's step towards order 4, and the round-off in it.
template <class G>
Vector difference(const G& g, double delta, double& noise) {
  const Vector wide = (g(delta) - g(-delta)) / (2.0 * delta),
               narrow = (g(delta / 2.0) - g(-delta / 2.0)) / delta;
  const Vector here = g(0.0);
  noise = here.size() == 0 ? 0.0 : 100.0 * 2.2e-16 * here.lpNorm<Eigen::Infinity>() / delta;
  return (4.0 * narrow - wide) / 3.0;
}

/// A point and a direction through it, along which differences of size delta are taken.
struct Line {
  double t;
  Vector x, y, dx, dy;
  double delta = 0.0;
  const Space* space = nullptr;  ///< null in R^n

  /// x + s dx, or x τ(s dx).
  Vector position(double s) const { return moved(space, x, s * dx); }
};

Vector one(double value) { return Vector::Constant(1, value); }

Vector product(const SparsityPattern& pattern, const Vector& values, const Vector& x,
               bool transposed = false) {
  Vector y = Vector::Zero(transposed ? pattern.columns() : pattern.rows());
  if (transposed)
    pattern.transposed_multiply_add(values.data(), x.data(), y.data());
  else
    pattern.multiply_add(values.data(), x.data(), y.data());
  return y;
}

void examine_phase(const PhaseFunction& f, const Line& line, Deviation& gradient, Deviation& hessian) {
  const Eigen::Index n = line.dx.size();
  double noise = 0.0;
  const auto value = [&](double s) { return one(f.value(line.t, line.position(s), line.y + s * line.dy)); };
  const auto slopes = [&](double s, double shift) {
    Vector both(2 * n), fx(n), fy(n);
    f.gradient(line.t + shift, line.position(s), line.y + s * line.dy, fx, fy);
    both << fx, fy;
    return both;
  };
  const Vector here = slopes(0.0, 0.0);
  Vector differences = difference(value, line.delta, noise);
  gradient.add(one(here.head(n).dot(line.dx) + here.tail(n).dot(line.dy)), differences, noise);

  Vector fxx(f.pattern().nonzeros()), fxy = fxx, fyy = fxx, change(2 * n), rate(n);
  f.hessian(line.t, line.x, line.y, fxx, fxy, fyy);
  change.head(n) = product(f.pattern(), fxx, line.dx) + product(f.pattern(), fxy, line.dy);
  change.tail(n) = product(f.pattern(), fxy, line.dx, true) + product(f.pattern(), fyy, line.dy);
  differences = difference([&](double s) { return slopes(s, 0.0); }, line.delta, noise);
  hessian.add(change, differences, noise);

  f.gradient_rate(line.t, line.x, line.y, rate);
  differences = difference([&](double s) { return Vector(slopes(0.0, s).tail(n)); }, line.delta, noise);
  hessian.add(rate, differences, noise);
}

void examine_rows(const ConstraintRows& rows, const Line& line, Deviation& first, Deviation& second) {
  const int m = rows.rows();
  const Vector w = line.y, lambda = direction(m, 0.4);
  double noise = 0.0;
  const double scale = 0.7;  // s in ∂(A w + s b)/∂q
  const auto coefficients = [&](double t, const Vector& q) {
    std::pair<Vector, Vector> ab{Vector(rows.pattern().nonzeros()), Vector(m)};
    rows.coefficients(t, q, ab.first, ab.second);
    return ab;
  };
  const auto contracted = [&](double t, const Vector& q, double s) {
    const auto [a, b] = coefficients(t, q);
    return Vector(product(rows.pattern(), a, w) + s * b);
  };
  const auto [a, b] = coefficients(line.t, line.x);
  if (rows.holonomic()) {
    const auto phi = [&](double t, double s) {
      Vector values(m);
      rows.position(t, line.position(s), values);
      return values;
    };
    Vector differences = difference([&](double s) { return phi(line.t, s); }, line.delta, noise);
    first.add(product(rows.pattern(), a, line.dx), differences, noise);
    differences = difference([&](double s) { return phi(line.t + s, 0.0); }, line.delta, noise);
    first.add(b, differences, noise);
  }
  Vector d(rows.pattern().nonzeros()), rate(m), curvature(rows.curvature_pattern().nonzeros());
  rows.derivative(line.t, line.x, w, scale, d);
  Vector differences =
      difference([&](double s) { return contracted(line.t, line.position(s), scale); }, line.delta, noise);
  second.add(product(rows.pattern(), d, line.dx), differences, noise);
  rows.time_derivative(line.t, line.x, w, rate);
  differences = difference([&](double s) { return contracted(line.t + s, line.x, 1.0); }, line.delta, noise);
  second.add(rate, differences, noise);
  rows.annihilator_derivative(line.t, line.x, lambda, curvature);
  differences = difference(
      [&](double s) {
        return product(rows.pattern(), coefficients(line.t, line.position(s)).first, lambda, true);
      },
      line.delta, noise);
  second.add(product(rows.curvature_pattern(), curvature, line.dx), differences, noise);
}

void examine_force(const Force& force, const Line& line, Deviation& deviation) {
  double noise = 0.0;
  const auto value = [&](double s) {
    Vector f(line.dx.size());
    force.value(line.t, line.position(s), line.y + s * line.dy, f);
    return f;
  };
  Vector fq(force.pattern().nonzeros()), fv = fq;
  force.derivatives(line.t, line.x, line.y, fq, fv);
  const Vector differences = difference(value, line.delta, noise);
  deviation.add(product(force.pattern(), fq, line.dx) + product(force.pattern(), fv, line.dy), differences,
                noise);
}

/// Deviations of all functions along one line.
struct Deviations {
  Deviation l1, l2, h1, h2, a1, a2, f;

  std::array<Deviation*, 7> all() { return {&l1, &l2, &h1, &h2, &a1, &a2, &f}; }
};

Deviations deviations(const Scene& scene, const Line& line) {
  Deviations d;
  if (scene.lagrangian) examine_phase(*scene.lagrangian, line, d.l1, d.l2);
  if (scene.hamiltonian) examine_phase(*scene.hamiltonian, line, d.h1, d.h2);
  for (const auto& rows : scene.constraints) examine_rows(*rows, line, d.a1, d.a2);
  if (scene.force) examine_force(*scene.force, line, d.f);
  return d;
}

/// Whether no switching function changes its sign, and no ramp much, where the differences are taken.
bool smooth_along(const Kinks& kinks, const Line& line) {
  constexpr double flat = 20.0, straight = 0.1;  // of the argument of a ramp
  constexpr double near = 10.0;  // in differences: powers such as max(0, y)^2.5 have none of high order there
  const auto at = [&](double s, double shift) {
    Vector g(kinks.count());
    kinks.evaluate(line.t + shift, line.position(s), line.y + s * line.dy, g);
    return g;
  };
  const Vector here = at(0.0, 0.0);
  for (const double s : {-near * line.delta, near * line.delta})
    for (const Vector& there : {at(s, 0.0), at(0.0, s)})
      for (Eigen::Index k = 0; k < here.size(); ++k) {
        const bool crossed = !(here[k] * there[k] > 0.0);
        if (kinks.kinds()[static_cast<std::size_t>(k)] == Kinks::Kind::kink) {
          if (crossed && here[k] != there[k]) return false;
        } else if (std::abs(here[k] - there[k]) > straight &&
                   (crossed || std::min(std::abs(here[k]), std::abs(there[k])) < flat)) {
          return false;
        }
      }
  return true;
}

/// The line moved to one side of a kink that it crosses; nothing where no side is found near it.
std::optional<Line> on_one_side(const Scene& scene, Line line) {
  if (!scene.kinks || scene.kinks->count() == 0) return line;
  for (int attempt = 0; attempt < 8; ++attempt) {
    if (smooth_along(*scene.kinks, line)) return line;
    const double away = 25.0 * line.delta * static_cast<double>(1 << attempt);
    line.x += away * line.dx;
    line.y += away * line.dy;
    line.t += away;
  }
  return std::nullopt;
}

/// The smallest deviations of several sizes of differences, into the largest of all lines.
void examine_line(const Scene& scene, Line line, bool may_be_undefined, Deviations& largest) {
  Deviations best;
  bool any = false;
  for (const double delta : {1e-4, 1e-3, 1e-5, 1e-6}) {
    line.delta = delta;
    const auto side = on_one_side(scene, line);
    if (!side) continue;
    Deviations found = deviations(scene, *side);
    const auto to = best.all(), from = found.all();
    bool agree = true;
    for (std::size_t k = 0; k < to.size(); ++k) {
      to[k]->largest = any ? std::min(to[k]->largest, from[k]->largest) : from[k]->largest;
      agree = agree && to[k]->largest <= derivative_tolerance;
    }
    any = true;
    if (agree) break;
  }
  const auto to = largest.all(), from = best.all();
  for (std::size_t k = 0; k < to.size(); ++k)
    if (!may_be_undefined || std::isfinite(from[k]->largest))
      to[k]->largest = std::max(to[k]->largest, from[k]->largest);
}

struct Place {
  Line line;
  bool may_be_undefined;  ///< it is no point of the motion
};

/// Lines through the points, through others near them, and through some farther off.
std::vector<Place> places(const Scene& scene, const std::vector<ExaminedPoint>& points) {
  std::vector<Place> all;
  for (const ExaminedPoint& point : points) {
    const Eigen::Index n = point.y.size();
    const double q_size = std::max(point.q.lpNorm<Eigen::Infinity>(), 1e-2);
    const double y_size = std::max(point.y.lpNorm<Eigen::Infinity>(), 1e-2);
    const Vector a = direction(n, 0.1), b = direction(n, 1.3);
    const auto add = [&](double q_off, double y_off, bool may_be_undefined) {
      const Line here{point.t, point.q,          point.y + y_off * y_size * a, q_size * b, y_size * b,
                      0.0,     scene.space.get()};
      Line line = here;
      line.x = here.position(q_off);
      line.dx = q_size * a;
      all.push_back({line, may_be_undefined});
    };
    add(0.0, 0.1, false);
    add(1e-2, 0.11, false);
    add(1.0, 10.0, true);
  }
  return all;
}

Finding finding(const std::string& what, const Deviation& deviation) {
  if (!std::isfinite(deviation.largest))
    return {
        what, false,
        "not finite where the values are: a derivative leaves the range of numbers, as that of 1/(1 + "
        "exp(u)) does above u = 709, for which (1 - tanh(u/2))/2 can be written, or is infinite, as that of "
        "sqrt(u) and of u^p with p < 1 at u = 0, also in max(0, u)^p, for which if(u > 0, u^p, 0) can"};
  return {what, deviation.largest <= derivative_tolerance,
          fmt::format("differs from differences by {:.1e}, allowed {:.0e}", deviation.largest,
                      derivative_tolerance)};
}

std::vector<ExaminedPoint> with_start(const Scene& scene, const std::vector<ExaminedPoint>& motion) {
  std::vector<ExaminedPoint> points{
      {scene.start.time, scene.start.q, scene.start.v.size() > 0 ? scene.start.v : scene.start.p}};
  points.insert(points.end(), motion.begin(), motion.end());
  return points;
}

}  // namespace

std::vector<Finding> examine_derivatives(const Scene& scene, const std::vector<ExaminedPoint>& motion) {
  Deviations d;
  for (const Place& place : places(scene, with_start(scene, motion)))
    examine_line(scene, place.line, place.may_be_undefined, d);
  std::vector<Finding> findings;
  if (scene.lagrangian) {
    findings.push_back(finding("first derivatives of L", d.l1));
    findings.push_back(finding("second derivatives of L", d.l2));
  }
  if (scene.hamiltonian) {
    findings.push_back(finding("first derivatives of H", d.h1));
    findings.push_back(finding("second derivatives of H", d.h2));
  }
  if (!scene.constraints.empty()) {
    findings.push_back(finding("first derivatives of the rows", d.a1));
    findings.push_back(finding("second derivatives of the rows", d.a2));
  }
  if (scene.force) findings.push_back(finding("derivatives of the force", d.f));
  return findings;
}

Finding examine_legendre_transform(const Scene& scene, const std::vector<ExaminedPoint>& motion) {
  constexpr double allowed = 1e-8;
  double largest = 0.0;
  const Eigen::Index n = scene.dimension();
  const auto relative = [](const Vector& a, const Vector& b) {
    const double size = std::max(a.lpNorm<Eigen::Infinity>(), b.lpNorm<Eigen::Infinity>());
    const double off = (a - b).lpNorm<Eigen::Infinity>();
    return off == 0.0 ? 0.0 : std::isfinite(off) ? off / size : HUGE_VAL;
  };
  for (const Place& place : places(scene, with_start(scene, motion))) {
    const auto& [t, q, v, dx, dy, delta, space] = place.line;
    Vector lq(n), p(n), hq(n), hp(n);
    scene.lagrangian->gradient(t, q, v, lq, p);
    scene.hamiltonian->gradient(t, q, p, hq, hp);
    const bool defined = lq.allFinite() && p.allFinite() && hq.allFinite() && hp.allFinite();
    if (!defined && place.may_be_undefined) continue;
    largest = std::max({largest, relative(hp, v), relative(-hq, lq)});
  }
  return {"H is the Legendre transform of L", largest <= allowed,
          fmt::format("∂H/∂p differs from v, or ∂H/∂q from −∂L/∂q, by {:.1e}, allowed {:.0e}{}", largest,
                      allowed, largest <= allowed ? "" : "; leave one of the two out")};
}

}  // namespace diracstep
