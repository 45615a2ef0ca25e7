#include <algorithm>
#include <cmath>
#include <diracstep/core/system/sign_changes.hpp>
#include <diracstep/scene_format/loader/loaded_function.hpp>
#include <diracstep/scene_format/loader/scene_kinks.hpp>
#include <limits>
#include <mutex>
#include <numbers>
#include <set>

namespace diracstep {

using namespace scene_compiler;

namespace {

constexpr long samples = 4000, most_samples = 400'000;
constexpr double most_values = 4e6;  // of all events at all samples
constexpr std::size_t most_instants = 100'000;
constexpr double round_off = 4.0 * std::numeric_limits<double>::epsilon();

/// A function of the time alone, or of the motion as well, with one value for each row.
class Values {
 public:
  Values(const LoadedScenePtr& scene, const SceneFunction& function)
      : function_(scene, function), rows_(static_cast<Eigen::Index>(function_.row_names().size())) {}

  Eigen::Index rows() const { return rows_; }
  const std::vector<std::string>& names() const { return function_.row_names(); }
  Vector at(double t) const {
    Vector values(rows_);
    evaluate(t, nullptr, nullptr, values.data());
    return values;
  }
  void evaluate(double t, const double* q, const double* v, double* out) const {
    std::fill_n(out, rows_, 0.0);
    KernelCall call{0, nullptr, nullptr, nullptr, nullptr, {q, v, nullptr}, nullptr, {out, nullptr, nullptr},
                    t, 0.0};
    function_.run(0, call);
  }

 private:
  LoadedFunction function_;
  Eigen::Index rows_;
};

class FileKinks final : public Kinks {
 public:
  FileKinks(const LoadedScenePtr& scene, Values kinks, Values ramps)
      : Kinks(kinds(kinks, ramps), joined(kinks, ramps)),
        kinks_(std::move(kinks)),
        ramps_(std::move(ramps)),
        events_(scene, scene->program->kinks.events),
        widths_(scene, scene->program->kinks.widths),
        phase_rates_(scene, scene->program->kinks.phase_rates),
        knots_(scene->program->kinks.knots) {}

  void evaluate(double t, ConstVectorRef q, ConstVectorRef v, VectorRef g) const override {
    kinks_.evaluate(t, q.data(), v.data(), g.data());
    ramps_.evaluate(t, q.data(), v.data(), g.data() + kinks_.rows());
  }

  /// The integrators of a run look at the same times one after the other: what was found last is kept.
  std::vector<Instant> instants(double first, double last) const override {
    if (first > last) std::swap(first, last);
    const std::lock_guard<std::mutex> lock(access_);
    const auto known = std::ranges::find_if(
        known_, [&](const Look& look) { return look.first == first && look.last == last; });
    if (known != known_.end()) return known->found;
    if (known_.size() == most_known) known_.erase(known_.begin());
    return known_.emplace_back(Look{first, last, found_instants(first, last)}).found;
  }

 private:
  struct Look {
    double first, last;
    std::vector<Instant> found;
  };
  static constexpr std::size_t most_known = 8;

  std::vector<Instant> found_instants(double first, double last) const {
    std::vector<Instant> found;
    if (!(last > first)) return found;
    if (events_.rows() > 0) look_for_events(first, last, found);
    for (auto knot = knots_.lower_bound(first); knot != knots_.end() && *knot <= last; ++knot)
      if (found.size() < most_instants) found.push_back({*knot, 0.0});
    std::ranges::sort(found, {}, [](const Instant& i) { return std::pair(i.time, i.width); });
    const auto same = [](const Instant& a, const Instant& b) {
      return std::abs(a.time - b.time) <= 16.0 * round_off * std::abs(a.time) && a.width == b.width;
    };
    found.erase(std::unique(found.begin(), found.end(), same), found.end());
    return found;
  }

  void look_for_events(double first, double last, std::vector<Instant>& found) const {
    const auto changes = [&](Eigen::Index r, double a, double b) {
      if (found.size() < most_instants) add(found, r, zero(r, a, events_.at(a)[r], b, events_.at(b)[r]));
    };
    const auto values = [this](double t, Vector& g) { g = events_.at(t); };
    SignChanges(events_.rows(), values, changes).look(first, last, sample_count(first, last), true);
  }
  static std::vector<Kind> kinds(const Values& kinks, const Values& ramps) {
    std::vector<Kind> kinds(static_cast<std::size_t>(kinks.rows()), Kind::kink);
    kinds.resize(kinds.size() + static_cast<std::size_t>(ramps.rows()), Kind::ramp);
    return kinds;
  }
  static std::vector<std::string> joined(const Values& kinks, const Values& ramps) {
    std::vector<std::string> names = kinks.names();
    names.insert(names.end(), ramps.names().begin(), ramps.names().end());
    return names;
  }

  /// Eight for each half turn of the fastest phase.
  long sample_count(double first, double last) const {
    double fastest = 0.0;
    for (int k = 0; k <= 16 && phase_rates_.rows() > 0; ++k)
      fastest =
          std::max(fastest, phase_rates_.at(first + (last - first) * k / 16.0).lpNorm<Eigen::Infinity>());
    const double wanted = std::isfinite(fastest) ? 8.0 * fastest * (last - first) / std::numbers::pi : 0.0;
    const double most = most_values / static_cast<double>(events_.rows());
    return std::max(
        2L, static_cast<long>(std::min({std::max(wanted, double{samples}), most, double{most_samples}})));
  }

  /// Where event r changes its sign between a and b, to round-off of that time: a step that begins there is
  /// not to find it again.
  double zero(Eigen::Index r, double a, double at_a, double b, double at_b) const {
    const int before = sign_of(at_a);
    const auto passed = [&](double t) { return sign_of(events_.at(t)[r]) != before; };
    const double guess = a + (b - a) * (at_a / (at_a - at_b));  // exact where the event is affine in t
    const double margin = round_off * std::abs(guess);
    if (guess > a && guess < b && !passed(guess - margin) && passed(guess + margin)) return guess;
    for (int i = 0; i < 200 && b - a > round_off * std::max(std::abs(a), std::abs(b)); ++i) {
      const double middle = a + (b - a) / 2.0;
      (passed(middle) ? b : a) = middle;
    }
    return b;
  }

  void add(std::vector<Instant>& found, Eigen::Index r, double time) const {
    const double width = widths_.at(time)[r];
    if (std::isfinite(width)) found.push_back({time, width});
  }

  Values kinks_, ramps_, events_, widths_, phase_rates_;
  const std::set<double>& knots_;  ///< of the program, which the functions above keep
  mutable std::mutex access_;      ///< to known_
  mutable std::vector<Look> known_;
};

}  // namespace

std::shared_ptr<const Kinks> file_kinks(const LoadedScenePtr& scene) {
  const KinkProgram& program = scene->program->kinks;
  Values kinks(scene, program.kinks), ramps(scene, program.ramps);
  if (kinks.rows() == 0 && ramps.rows() == 0 && program.events.groups.empty() && program.knots.empty())
    return nullptr;
  return std::make_shared<FileKinks>(scene, std::move(kinks), std::move(ramps));
}

}  // namespace diracstep
