#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/growth_check.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <limits>
#include <sstream>

namespace diracstep {

namespace {

constexpr long most_steps_followed = 1000, parts_of_a_long_run = 40, fewest_steps_of_a_part = 40;
constexpr int most_followed = 12;  // coordinates and rows
constexpr long points_of_a_part = 8;
constexpr double growth_of_no_power = 1e4, too_uncertain = 0.02;
constexpr double steady_growth = 40.0, least_share = 0.6;  // of the mean of the logarithms

}  // namespace

Start beside(const Start& start, const Vector& position_sizes, const Vector& velocity_sizes) {
  Start moved = start;
  const auto distance = [](const Vector& sizes, Eigen::Index i) {
    return distance_beside * (sizes[i] > 0.0 ? sizes[i] : max_norm(sizes));
  };
  for (Eigen::Index i = 0; i < moved.q.size(); ++i)
    moved.q[i] += distance(position_sizes, i) * std::sin(1.0 + 1.7 * static_cast<double>(i));
  for (Eigen::Index i = 0; i < moved.v.size(); ++i)
    moved.v[i] += distance(velocity_sizes, i) * std::cos(0.4 + 1.3 * static_cast<double>(i));
  return moved;
}

GrowthCheck::GrowthCheck(const Integrator& integrator, long steps) : steps_(steps) {
  if (integrator.work().steps != 0 || steps < 1) return;
  const bool small = integrator.scene().dimension() + integrator.scene().rows() <= most_followed;
  if (small && steps <= most_steps_followed) {
    parts_.push_back({0, steps});
  } else {
    const long least = small ? std::min(most_steps_followed, steps / 4) : 0;
    const long length = std::max(least, steps / parts_of_a_long_run);
    if (length < fewest_steps_of_a_part) return;
    for (const long begin : {0L, steps / 2}) parts_.push_back({begin, length / points_of_a_part});
  }
  next_mark_ = 0;
}

void GrowthCheck::see(const Sample& point) {
  if (parts_.empty()) return;
  if (first_.size() == 0) first_ = point.q;
  way_ = std::max(way_, max_norm(point.q - first_));
  largest_momentum_ = std::max(largest_momentum_, max_norm(point.p));
  largest_velocity_ = std::max(largest_velocity_, max_norm(point.v));
}

/// Keeps the current point.
void GrowthCheck::mark(Integrator& integrator) {
  const auto wanted = static_cast<std::size_t>(parts_.size() == 1 ? 2 : points_of_a_part + 1);
  auto part = std::ranges::find_if(parts_, [&](const Part& it) { return it.points.size() < wanted; });
  next_mark_ = -1;
  part->points.emplace_back();
  if (!integrator.sample(Momentum::projected, part->points.back()).ok()) return parts_.clear();
  if (part->points.size() == wanted && ++part == parts_.end()) return;
  next_mark_ = part->begin + static_cast<long>(part->points.size()) * part->between;
}

/// How far a run from beside the first point of a part is from its other points, in parts of the motion;
/// empty where it cannot be followed.
std::vector<double> GrowthCheck::distances(Integrator& integrator, const Part& part) const {
  const Sample& first = part.points.front();
  try {
    Start other_start = beside({first.time, first.q, first.v, {}}, Vector::Constant(first.q.size(), way_),
                               Vector::Constant(first.v.size(), largest_velocity_));
    if (const auto& space = integrator.scene().space) other_start.q = space->normalised(other_start.q);
    integrator.reset(other_start);
  } catch (const Misuse&) {  // a point that nothing may be moved at
    return {};
  }
  std::vector<double> all;
  Sample other;
  const auto apart = [&](const Sample& here) {
    return std::max(max_norm(other.q - here.q) / way_, max_norm(other.p - here.p) / largest_momentum_);
  };
  if (!integrator.sample(Momentum::projected, other).ok()) return {};
  // Beside a coordinate that is heavy and at rest the momenta are far apart from the first.
  const double unit = std::max(1.0, apart(first) / distance_beside);
  for (std::size_t k = 1; k < part.points.size(); ++k) {
    for (long step = 0; step < part.between; ++step)
      if (!integrator.step().ok()) return {};
    if (!integrator.sample(Momentum::projected, other).ok()) return {};
    all.push_back(apart(part.points[k]) / unit);
  }
  return all;
}

double GrowthCheck::round_off() const {
  return std::numeric_limits<double>::epsilon() * std::sqrt(static_cast<double>(steps_));
}

void GrowthCheck::finish(Integrator& integrator, double local) {
  if (parts_.empty() || next_mark_ >= 0 || integrator.work().steps != steps_ || !(way_ > 0.0) ||
      !(largest_momentum_ > 0.0))
    return;
  const Snapshot state = integrator.save();
  std::vector<std::vector<double>> apart;
  for (const Part& part : parts_) {
    apart.push_back(distances(integrator, part));
    if (!apart.back().empty() && text_.empty()) judge(part, apart.back().back(), local);
  }
  integrator.restore(state);
  if (parts_.size() > 1 && text_.empty()) judge_whole(apart);
}

void GrowthCheck::judge(const Part& part, double apart, double local) {
  const double growth = apart / distance_beside, from_round_off = growth * round_off();
  const double uncertain = std::max(from_round_off, std::isfinite(local) ? growth * local : 0.0);
  if (!(growth > growth_of_no_power) || !(uncertain > too_uncertain)) return;
  std::ostringstream text;
  text.precision(2);
  text << "the motion amplifies errors by a factor of " << growth << (apart > 0.1 ? " or more" : "");
  if (part.begin > 0) text << " from t = " << part.points.front().time;
  text << " until t = " << part.points.back().time << ", found by a second run beside this one: "
       << (from_round_off > too_uncertain ? "round-off alone" : "the error of a step")
       << " becomes as large as " << std::min(100.0, 100.0 * uncertain)
       << " % of the motion, or more; a shorter run can be trusted";
  text_ = text.str();
}

/// By what both parts of a long run show.
void GrowthCheck::judge_whole(const std::vector<std::vector<double>>& apart) {
  double rate = HUGE_VAL;
  const double per_mark = static_cast<double>(steps_) / static_cast<double>(parts_.front().between);
  for (const std::vector<double>& distances : apart) {
    if (distances.size() != points_of_a_part) return;
    double least = HUGE_VAL;
    for (const std::size_t k : {3U, 5U, 7U})
      least = std::min(least, std::log(distances[k] / distances[k - 2]));
    const double whole = std::log(distances[7] / distances[1]);
    if (!(whole > std::log(steady_growth)) || !(least > least_share * whole / 3.0)) return;
    rate = std::min(rate, whole / 6.0);
  }
  const double growth = rate * per_mark;  // its logarithm
  if (!(growth + std::log(round_off()) > std::log(too_uncertain))) return;
  const std::vector<Sample>& points = parts_.front().points;
  std::ostringstream text;
  text.precision(2);
  text << "the motion amplifies errors by a factor of 10 in each "
       << std::log(10.0) / rate * std::abs(points[1].time - points[0].time)
       << " of t, found by second runs beside two parts of this one: round-off alone becomes as large as the "
          "motion before its end; a shorter run can be trusted";
  text_ = text.str();
}

}  // namespace diracstep
