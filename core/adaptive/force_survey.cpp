#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/adaptive/force_survey.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <numbers>

namespace diracstep {

namespace {

constexpr int nodes = 12;  // of a polynomial
constexpr long points_of_smooth = 2'000, all_points = 20'000, fewest_points = 2'000;
constexpr long most_parts = 3'000, most_readings = 2'000'000;  // the latter of a small scene
constexpr double counts = 0.02;       // part of the error asked for that the forces missed may make up
constexpr double read_error = 1e-11;  // relative, of F and of its polynomial
constexpr double widest_gap = 32.0;   // in closest times, at a jump
constexpr double next_point = 0.125;  // ratio of the distances of points that approach an end

/// So close to t two times count as one.
double closest(double t) {
  return 8.0 * std::numeric_limits<double>::epsilon() * std::max(std::abs(t), 1e-300);
}

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
    out.setZero(values.rows());
    double sum = 0.0;
    for (int k = 0; k < nodes; ++k) {
      const auto i = static_cast<std::size_t>(k);
      if (at == x[i]) return void(out = values.col(k));
      const double w = weight[i] / (at - x[i]);
      out += w * values.col(k);
      sum += w;
    }
    out /= sum;
  }
};
const ChebyshevPoints chebyshev;

}  // namespace

/// The cubic with the positions and velocities of two points.
struct ForceSurvey::Cubic {
  const PathPoint &from, &to;

  double begin() const { return from.time; }
  double end() const { return to.time; }
  void at(double t, Vector& q, Vector& v) const {
    const double h = end() - begin(), s = (t - begin()) / h, r = 1.0 - s;
    q = (1.0 + 2.0 * s) * r * r * from.q + s * r * r * h * from.v + s * s * (1.0 + 2.0 * r) * to.q -
        s * s * r * h * to.v;
    v = 6.0 * s * r / h * (to.q - from.q) + r * (1.0 - 3.0 * s) * from.v + s * (3.0 * s - 2.0) * to.v;
  }
};

ForceSurvey::ForceSurvey(const Scene& scene, double error)
    : scene_(scene),
      error_(error),
      n_(scene.dimension()),
      m_(scene.rows()),
      rows_(scene.constraints, scene.dimension()),
      smooth_(!scene.force && !scene.kinks && scene.lagrangian->structure().autonomous &&
              std::ranges::all_of(scene.constraints, [](const auto& rows) { return rows->workless(); })),
      external_(Vector::Zero(n_)),
      value_(Vector::Zero(2 * n_ + m_)),
      other_(value_),
      samples_(Columns::Zero(2 * n_ + m_, nodes)) {
  if (scene.kinks) switches_ = before_ = Vector::Zero(scene.kinks->count());
}

void ForceSurvey::read(const Cubic& path, double t, VectorRef f) {
  ++readings_;
  path.at(t, q_, v_);
  scene_.lagrangian->gradient(t, q_, v_, f.head(n_), f.segment(n_, n_));
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
void ForceSurvey::find_scales(const std::vector<PathPoint>& path) {
  double force = 0.0, momentum = 0.0;
  Vector row_terms = Vector::Zero(m_), terms(m_), noise = Vector::Zero(2 * n_ + m_);
  for (std::size_t k = 0; k + 1 < path.size(); ++k) {
    const Cubic cubic{path[k], path[k + 1]};
    if (std::abs(cubic.end() - cubic.begin()) <= closest(cubic.end())) continue;
    const double t = 0.5 * (cubic.begin() + cubic.end());
    read(cubic, t + closest(t), other_);
    read(cubic, t, value_);
    noise = noise.cwiseMax((value_ - other_).cwiseAbs());
    force = std::max(force, max_norm(value_.head(n_)));
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
    const double scale = usable_scale(row_terms[r]);
    allowed_[2 * n_ + r] = std::max(part, read_error) * scale;
    weights_[2 * n_ + r] = 1.0 / (scale * span_);
  }
  for (Eigen::Index i = 0; i < allowed_.size(); ++i)
    if (noise[i] < HUGE_VAL) allowed_[i] = std::max(allowed_[i], 30.0 * noise[i]);
}

/// Compares the polynomial of F on (a, b) with F at `points` points between, at others that approach both
/// ends, and at known times.
ForceSurvey::Fit ForceSurvey::fit(const Cubic& path, double a, double b, long points,
                                  const std::vector<double>& known) {
  const double middle = 0.5 * (a + b), half = 0.5 * (b - a);
  for (int k = 0; k < nodes; ++k)
    read(path, middle + half * chebyshev.x[static_cast<std::size_t>(k)], samples_.col(k));
  // What rounding of F and of t leaves of F here, whatever is asked for.
  const double rounding = 2.0 * std::numeric_limits<double>::epsilon() * std::abs(middle);
  local_ = 1e-13 * samples_.cwiseAbs().rowwise().maxCoeff();
  for (int k = 0; k + 1 < nodes; ++k) {
    const double apart = std::abs(half) * (chebyshev.x[static_cast<std::size_t>(k)] -
                                           chebyshev.x[static_cast<std::size_t>(k + 1)]);
    local_ = local_.cwiseMax(rounding / apart * (samples_.col(k) - samples_.col(k + 1)).cwiseAbs());
  }
  for (Eigen::Index i = 0; i < local_.size(); ++i)
    local_[i] = std::max(allowed_[i], std::isfinite(local_[i]) ? local_[i] : 0.0);
  Fit worst;
  const auto compare = [&](double t) {
    if (!((t - a) * (b - t) > 0.0)) return;
    read(path, t, value_);
    chebyshev.interpolate(samples_, (t - middle) / half, other_);
    other_ = (other_ - value_).cwiseAbs();
    double excess = 0.0;
    for (Eigen::Index i = 0; i < other_.size(); ++i)
      if (!(other_[i] <= local_[i]))
        excess = std::max(excess, std::isfinite(other_[i]) ? other_[i] / local_[i] : HUGE_VAL);
    if (excess <= worst.excess) return;
    worst = {excess, t, (other_.array() * weights_.array()).maxCoeff()};
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

/// Where a switching function whose sign at `a` is given has changed its sign in (a, b].
double ForceSurvey::crossing(const Cubic& path, double a, double b, int number, bool sign) {
  while (std::abs(b - a) > 0.25 * closest(b)) {
    const double t = 0.5 * (a + b);
    if (t == a || t == b) break;
    path.at(t, q_, v_);
    scene_.kinks->evaluate(t, q_, v_, switches_);
    (std::signbit(switches_[number]) == sign ? a : b) = t;
  }
  return b;
}

void ForceSurvey::crossings(const Cubic& path, double a, double b, std::vector<double>& times) {
  constexpr int looks = 16;
  const auto at = [&](double t) {
    path.at(t, q_, v_);
    scene_.kinks->evaluate(t, q_, v_, switches_);
  };
  at(a);
  before_ = switches_;
  double last = a;
  for (int k = 1; k <= looks; ++k) {
    const double t = k == looks ? b : a + k * (b - a) / looks;
    at(t);
    const Vector now = switches_;
    for (int j = 0; j < scene_.kinks->count(); ++j)
      if (std::signbit(now[j]) != std::signbit(before_[j]))
        times.push_back(crossing(path, last, t, j, std::signbit(before_[j])));
    before_ = now;
    last = t;
  }
}

/// Times in (a, b) where the scene's formulas show that F may change fast, in the order of the motion.
std::vector<double> ForceSurvey::known_times(const Cubic& path, double a, double b) {
  std::vector<double> times;
  if (!scene_.kinks) return times;
  if (scene_.kinks->count() > 0) crossings(path, a, b, times);
  for (const auto& [time, width] : instants_)
    for (const double off : {0.0, -6.0, 6.0, -1.0, 1.0})
      if (off == 0.0 || width < std::abs(b - a)) times.push_back(time + off * width);
  std::erase_if(times, [&](double t) { return !((t - a) * (b - t) > 0.0); });
  std::ranges::sort(times);
  if (b < a) std::ranges::reverse(times);
  const auto same = [](double s, double t) { return std::abs(t - s) <= closest(t); };
  times.erase(std::unique(times.begin(), times.end(), same), times.end());
  return times;
}

/// The smallest part of (a, b) that bisection leads to whose polynomial misses F while those of both its
/// halves do not; a few units of round-off wide where F jumps.
std::pair<double, double> ForceSurvey::narrow(const Cubic& path, double a, double b) {
  while (std::abs(b - a) > closest(b)) {
    const double middle = 0.5 * (a + b);
    const Fit left = fit(path, a, middle, 8, {}), right = fit(path, middle, b, 8, {});
    if (left.excess <= 1.0 && right.excess <= 1.0) break;
    (left.excess > right.excess ? b : a) = middle;
  }
  return {a, b};
}

/// Divides (a, b), whose polynomial misses F, into parts that do not.
void ForceSurvey::divide(const Cubic& path, double a, double b, const std::vector<double>& known,
                         ForceSurveyReport& report) {
  std::vector<std::pair<double, double>> cuts;  // ends of parts, and beginnings of those that follow
  for (const double t : known) {
    const double gap = std::copysign(closest(t), b - a);
    if ((t - a) / gap > 2.0 && (b - t) / gap > 2.0) cuts.emplace_back(t - gap, t + gap);
  }
  if (cuts.empty()) {
    const auto [low, high] = narrow(path, a, b);
    const double middle = 0.5 * (low + high), width = std::abs(high - low);
    if (width <= widest_gap * closest(b))
      cuts.emplace_back(low, high);
    else if (width < std::abs(b - a) / 64.0)
      cuts.emplace_back(middle, middle);
    else
      cuts.emplace_back(0.5 * (a + b), 0.5 * (a + b));
  }
  double from = a;
  cuts.emplace_back(b, b);
  for (const auto& [to, next] : cuts) {
    const double part_from = from;
    from = next;
    if (!((to - part_from) * (b - a) > 0.0)) continue;
    if (++parts_ > most_parts || readings_ > most_readings / std::max(1L, static_cast<long>(n_ + m_) / 16)) {
      report.followed = false;
      return;
    }
    const long points =
        std::max(8L, static_cast<long>(static_cast<double>(points_) * std::abs(to - part_from) / span_));
    const Fit part = fit(path, part_from, to, points, {});
    if (part.excess > 1.0 && std::abs(to - part_from) > widest_gap * closest(to))
      divide(path, part_from, to, {}, report);
    else
      report.stretches.push_back({part_from, to});
    if (!report.followed) return;
  }
}

/// Whether F is not the same on both sides of a point.
bool ForceSurvey::jumps(const Cubic& before, const Cubic& after) {
  const double t = before.end(), gap = std::copysign(closest(t), t - before.begin());
  read(before, t - gap, value_);
  const Vector left = value_;
  read(after, t + gap, value_);
  return ((left - value_).array().abs() > 100.0 * allowed_.array()).any();
}

/// Adds what the polynomial of (a, b) misses of F in its parts: the difference in the middle of each times
/// its length.
void ForceSurvey::count_missed(const Cubic& path, double a, double b, std::size_t first,
                               ForceSurveyReport& report) {
  fit(path, a, b, 0, {});
  const Columns samples = samples_;
  double missed = 0.0, most = 0.0, time = a;
  for (std::size_t k = first; k < report.stretches.size(); ++k) {
    const double from = report.stretches[k].begin, to = report.stretches[k].end, t = 0.5 * (from + to);
    read(path, t, value_);
    chebyshev.interpolate(samples, (2.0 * t - a - b) / (b - a), other_);
    const double here = ((other_ - value_).array().abs() * weights_.array()).maxCoeff() * std::abs(to - from);
    missed += here;
    if (here > most) {
      most = here;
      time = t;
    }
  }
  if (!report.followed) missed = HUGE_VAL;
  if (most > most_missed_) {
    most_missed_ = most;
    report.time = time;
  }
  report.missed += missed;
}

void ForceSurvey::examine(const Cubic& path, double a, double b, ForceSurveyReport& report) {
  const std::vector<double> known = known_times(path, a, b);
  const auto share = static_cast<double>(points_) * std::abs(b - a) / span_;
  if (fit(path, a, b, std::max(4L, static_cast<long>(share)), known).excess <= 1.0) {
    if (whole_)
      report.stretches.back().end = b;
    else
      report.stretches.push_back({a, b});
    whole_ = true;
    return;
  }
  const std::size_t first = report.stretches.size();
  whole_ = false;
  divide(path, a, b, known, report);
  count_missed(path, a, b, first, report);
}

ForceSurveyReport ForceSurvey::along(const std::vector<PathPoint>& path, long parts) {
  ForceSurveyReport report;
  const double start = path.front().time, end = path.back().time;
  span_ = std::abs(end - start);
  points_ = smooth_ ? points_of_smooth
                    : std::max(fewest_points, all_points / std::max(1L, static_cast<long>(n_ + m_) / 4));
  parts_ = readings_ = 0;
  most_missed_ = 0.0;
  whole_ = false;
  if (scene_.kinks) instants_ = scene_.kinks->instants(std::min(start, end), std::max(start, end));
  find_scales(path);
  double gap = 0.0;  // at the beginning of the next step
  for (std::size_t k = 0; k + 1 < path.size() && report.followed; ++k) {
    const Cubic cubic{path[k], path[k + 1]};
    const double a = cubic.begin(), b = cubic.end();
    if (std::abs(b - a) <= (2.0 + widest_gap) * closest(b)) {
      whole_ = false;
      continue;
    }
    const std::size_t first = report.stretches.size();
    for (long part = 0; part < parts && report.followed; ++part) {
      const double from = static_cast<double>(part) / static_cast<double>(parts),
                   to = static_cast<double>(part + 1) / static_cast<double>(parts);
      examine(cubic, part == 0 ? a : a + from * (b - a), part + 1 == parts ? b : a + to * (b - a), report);
    }
    if (gap != 0.0 && first < report.stretches.size()) report.stretches[first].begin += gap;
    gap = 0.0;
    if (!report.followed || k + 2 >= path.size()) continue;
    const Cubic next{path[k + 1], path[k + 2]};
    if (std::abs(next.end() - b) <= (2.0 + widest_gap) * closest(b) || !jumps(cubic, next)) continue;
    gap = std::copysign(closest(b), b - a);
    report.stretches.back().end -= gap;
    whole_ = false;
    report.missed = HUGE_VAL;
    report.time = b;
  }
  return report;
}

}  // namespace diracstep
