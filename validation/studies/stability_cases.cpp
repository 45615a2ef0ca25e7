#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/runs/energy_check.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/validation/references/scaled_rows.hpp>
#include <diracstep/validation/studies/stability_cases.hpp>
#include <memory>

namespace diracstep {

namespace {

using Cases = std::vector<StabilityCase>;

/// The entry with its scene changed; its reference stays.
template <class Change>
CatalogueScene changed(CatalogueScene entry, Change change) {
  auto scene = std::make_shared<Scene>(*completed(entry.scene));
  change(*scene);
  entry.scene = scene;
  return entry;
}

double start_energy(const Scene& scene) { return scene.energy(scene.start); }

WatchedQuantity energy_watch(const std::shared_ptr<const Scene>& scene, double scale) {
  return {.name = "energy",
          .at = [scene](double t, ConstVectorRef q, ConstVectorRef v) { return scene->energy(t, q, v); },
          .scale = scale};
}

/// The size of the energies at the start: |E|, |p·v|/2, and at rest at E = 0 the work |q|∞ |∂L/∂q|∞.
double energy_size(const Scene& scene) {
  const auto& [t, q, v, p] = scene.start;
  Vector force(q.size()), momentum(q.size());
  scene.lagrangian->gradient(t, q, v, force, momentum);
  double size = std::max(std::abs(start_energy(scene)), 0.5 * std::abs(momentum.dot(v)));
  if (size == 0.0) size = q.lpNorm<Eigen::Infinity>() * force.lpNorm<Eigen::Infinity>();
  return size > 0.0 ? size : 1.0;
}

WatchedQuantity invariant_watch(const Invariant& invariant, const Start& start) {
  constexpr double zero = 1e-12;  // an invariant of about zero has no size of its own
  const double size = std::abs(invariant.at(start.time, start.q, start.v));
  return {.name = invariant.name, .at = invariant.at, .scale = size > zero ? size : 1.0};
}

/// A case on a scene over `steps` natural steps times `factor`, watched for the energy.
StabilityCase over_steps(const std::string& group, double value, std::string name, CatalogueScene entry,
                         double energy_scale, double factor, long steps) {
  const double start = entry.scene->start.time, step = entry.natural_step * factor;
  StabilityCase that{.group = group, .value = value, .name = std::move(name), .scene = std::move(entry)};
  that.step = step;
  that.t_end = start + step * static_cast<double>(steps);
  that.watches = {energy_watch(completed(that.scene.scene), energy_scale)};
  return that;
}

/// From 1e8 on the reference is the rigid pendulum.
CatalogueScene spring_pendulum(int decade) {
  CatalogueScene entry = make_scene("stiff_spring_pendulum", {{"k", std::pow(10.0, decade)}});
  if (decade < 8) return entry;
  entry.reference = make_scene("pendulum_cartesian", {{"g", 9.81}}).reference;
  entry.reference.how = "the rigid pendulum, approached as g/k";
  entry.reference.self_error = 9.81 / std::pow(10.0, decade);
  return entry;
}

void add_stiff_springs(Cases& cases, bool full) {
  for (int decade = 2; decade <= 12; decade += full ? 1 : 2)
    cases.push_back(over_steps("stiff_spring_pendulum, k", std::pow(10.0, decade),
                               fmt::format("stiff_spring_pendulum k=1e{}", decade), spring_pendulum(decade),
                               9.81, 1.0, 1000));
  for (const int decade : {8, 10, 12})
    cases.push_back(over_steps("stiff_spring_pendulum at a fifth of its step, k", std::pow(10.0, decade),
                               fmt::format("stiff_spring_pendulum k=1e{} h/5", decade),
                               spring_pendulum(decade), 9.81, 0.2, 5000));
}

/// The spring as a row with compliance 1/k, whose force is an unknown; at k = ∞ it is the rigid pendulum.
CatalogueScene compliant_pendulum(double k) {
  constexpr const char* text = R"toml(name = "stiff_spring_pendulum_row"
lagrangian = "(v_x^2 + v_y^2)/2 - 9.81*y"
[coordinates]
x = {}
y = {}
[parameters]
compliance = 1e-4
[[rows]]
name = "spring"
equation = "sqrt(x^2 + y^2) - 1 = 0"
compliance = "compliance"
[start]
x = 1
[span]
end = 10
step = 0.01
)toml";
  CatalogueScene entry = scene_from_text("stiff_spring_pendulum_row.toml", text, {{"compliance", 1.0 / k}});
  const bool rigid = !(k < 1e8);
  const Reference plain = rigid ? make_scene("pendulum_cartesian", {{"g", 9.81}}).reference
                                : make_scene("stiff_spring_pendulum", {{"k", k}}).reference;
  const Eigen::Index n = entry.scene->dimension();  // with the extension of the spring behind x and y
  entry.reference = plain;
  entry.reference.at = [plain, n, rigid](double time) -> std::optional<ReferencePoint> {
    const auto known = plain.at ? plain.at(time) : std::nullopt;
    if (!known) return std::nullopt;
    ReferencePoint point{Vector::Zero(n), Vector::Zero(n)};
    point.q.head(2) = known->q.head(2);
    point.v.head(2) = known->v.head(2);
    const double length = known->q.head(2).norm();  // the extension of the spring
    if (!rigid) point.q[2] = length - 1.0;
    if (!rigid) point.v[2] = known->q.head(2).dot(known->v.head(2)) / length;
    return point;
  };
  if (rigid) {
    entry.reference.how = "the rigid pendulum, approached as g/k";
    entry.reference.self_error = 9.81 / k;
  }
  return entry;
}

void add_compliant_springs(Cases& cases, bool full) {
  const auto add = [&](double k, const std::string& text) {
    cases.push_back(over_steps("stiff_spring_pendulum as a row with compliance 1/k, k", k,
                               "stiff_spring_pendulum row k=" + text, compliant_pendulum(k), 9.81, 2.0, 500));
  };
  for (int decade = 2; decade <= 14; decade += full ? 1 : 2)
    add(std::pow(10.0, decade), fmt::format("1e{}", decade));
  add(HUGE_VAL, "inf");
}

void add_fput(Cases& cases, bool full) {
  for (const double om : {50.0, 500.0, 5e3, 5e4}) {
    StabilityCase that = over_steps("fput, om", om, fmt::format("fput om={:g}", om),
                                    make_scene("fput", {{"om", om}}), 2.0, 1.0, full ? 100'000 : 10'000);
    that.watches.push_back({.name = "energy of the stiff springs",
                            .at =
                                [om](double, ConstVectorRef q, ConstVectorRef v) {
                                  return 0.5 * (v.tail(3).squaredNorm() + om * om * q.tail(3).squaredNorm());
                                },
                            .bound = 1.0});
    cases.push_back(std::move(that));
  }
}

void add_governor(Cases& cases) {
  for (const double step : {5e-3, 1e-3, 1e-4}) {
    const CatalogueScene entry = make_scene("flyball_governor");
    StabilityCase that =
        over_steps("flyball_governor, step", step, fmt::format("flyball_governor h={:g}", step), entry, 200.0,
                   step / entry.natural_step, std::lround(1.0 / step));
    that.watches.front().only_up = true;
    that.watches.push_back(invariant_watch(entry.invariants.front(), entry.scene->start));
    cases.push_back(std::move(that));
  }
}

void add_kepler(Cases& cases, bool full) {
  for (const double step : {1e-3, 1e-4, 1e-5}) {
    if (step < 1e-4 && !full) continue;
    const CatalogueScene entry = make_scene("kepler_e099");
    StabilityCase that = over_steps("kepler_e099, step", step, fmt::format("kepler_e099 h={:g}", step), entry,
                                    0.5, step / entry.natural_step, std::lround(20.0 / step));
    that.watches.push_back(invariant_watch(entry.invariants.front(), entry.scene->start));
    cases.push_back(std::move(that));
  }
}

/// Largest distance of n_four_bar from the shape in which all uprights are parallel; its coordinates are
/// x_0, y_0, x_1, y_1, …
WatchedQuantity parallel_watch() {
  return {.name = "uprights not parallel",
          .at =
              [](double, ConstVectorRef q, ConstVectorRef) {
                double away = 0.0;
                for (Eigen::Index j = 1; 2 * j < q.size(); ++j)
                  away = std::max({away, std::abs(q[2 * j] - static_cast<double>(j) - q[0]),
                                   std::abs(q[2 * j + 1] - q[1])});
                return away;
              },
          .bound = 1e-3};
}

StabilityCase four_bar(const std::string& group, double value, const std::string& name,
                       const CatalogueScene& entry, double step, double t_end) {
  StabilityCase that{
      .group = group, .value = value, .name = name, .scene = entry, .step = step, .t_end = t_end};
  that.watches = {energy_watch(completed(entry.scene), std::abs(start_energy(*entry.scene))),
                  parallel_watch()};
  return that;
}

void add_four_bars(Cases& cases, bool full) {
  for (const double step : {0.01, 0.005, 0.002})
    cases.push_back(four_bar("n_four_bar, step", step, fmt::format("n_four_bar h={:g}", step),
                             make_scene("n_four_bar"), step, full ? 100.0 : 10.0));
}

/// When the uprights of n_four_bar first lie flat.
double time_of_flat_pose(const CatalogueScene& entry) {
  double upright = 0.0, below = 1.0;
  while (below - upright > 1e-16) {
    const double middle = 0.5 * (upright + below);
    if (middle == upright || middle == below) break;
    (entry.reference.at(middle)->q[3] > 0.0 ? upright : below) = middle;
  }
  return upright;
}

void add_starts_near_flat_poses(Cases& cases, bool full) {
  const CatalogueScene whole = make_scene("n_four_bar");
  const double flat = time_of_flat_pose(whole);
  const double rate = whole.reference.at(flat)->v.lpNorm<Eigen::Infinity>();
  const std::vector<double> quick{1e-1, 1e-4, 1e-8, 1e-12, 0.0};
  const std::vector<double> all{1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12, 0.0};
  for (const double angle : full ? all : quick) {
    const double start = flat - angle / rate;
    const CatalogueScene entry = changed(whole, [&](Scene& scene) {
      const ReferencePoint point = *whole.reference.at(start);
      scene.start = {start, point.q, point.v};
    });
    cases.push_back(four_bar("n_four_bar, start before a flat pose", angle,
                             fmt::format("n_four_bar {:g} before flat", angle), entry, 0.01, start + 1.0));
  }
}

void add_collisions(Cases& cases) {
  for (const double distance : {1e-2, 1e-4, 1e-6, 1e-8}) {
    const CatalogueScene entry = make_scene("kepler_e099", {{"e", 1.0 - distance}});
    cases.push_back(over_steps("kepler, start at a pericentre", distance,
                               fmt::format("kepler from pericentre {:g}", distance), entry, 0.5, 1.0, 3000));
  }
}

void add_mass_ratios(Cases& cases) {
  for (const double ratio : {1e-12, 1e-6, 1e6, 1e12}) {
    cases.push_back(over_steps("knife_edge, mass ratio", ratio, fmt::format("knife_edge m/J={:g}", ratio),
                               make_scene("knife_edge", {{"m", ratio}}), 0.5 + 0.25 * ratio, 0.2, 200));
    const CatalogueScene torn = make_scene("mass_spring_torn", {{"m3", ratio}});
    cases.push_back(over_steps("mass_spring_torn, mass ratio", ratio,
                               fmt::format("mass_spring_torn m3/m1={:g}", ratio), torn,
                               std::abs(start_energy(*torn.scene)), 1.0, 1000));
    cases.push_back(
        over_steps("double_pendulum, mass ratio", ratio, fmt::format("double_pendulum m2/m1={:g}", ratio),
                   make_scene("double_pendulum", {{"m2", ratio}}), 9.81 * (2.0 + 5.0 * ratio), 0.2, 1000));
  }
}

/// Scenes with a reference for every time, and the size of their energies.
struct Measured {
  std::string scene;
  double energy;
};
const std::vector<Measured> constrained{
    {"pendulum_cartesian", 13.75}, {"knife_edge", 0.5}, {"n_four_bar", 60.0}};
const std::vector<Measured> of_each_kind{
    {"pendulum_cartesian", 13.75}, {"knife_edge", 0.5}, {"kepler_e06", 0.5}};
const std::vector<Measured> long_lived{
    {"pendulum_cartesian", 13.75}, {"contact_oscillator", 1.0}, {"kepler_e06", 0.5}};

void add_scaled_rows(Cases& cases) {
  for (const auto& [name, energy] : constrained)
    for (const double factor : {1e-8, 1e-4, 1e4, 1e8}) {
      const CatalogueScene entry = changed(make_scene(name), [&](Scene& scene) {
        for (auto& rows : scene.constraints) rows = scaled_rows(rows, factor, "");
      });
      cases.push_back(over_steps(name + ", rows scaled", factor, fmt::format("{} rows*{:g}", name, factor),
                                 entry, energy, 0.2, 485));
    }
}

void add_redundant_rows(Cases& cases) {
  for (const auto& [name, energy] : constrained)
    for (const bool refused : {true, false}) {
      const CatalogueScene entry = changed(make_scene(name), [refused](Scene& scene) {
        scene.constraints.push_back(scaled_rows(scene.constraints.front(), 3.0, ", again"));
        scene.refuse_redundant_rows = refused;
      });
      cases.push_back(over_steps(name + ", rows given twice", refused ? 0.0 : 1.0,
                                 name + (refused ? " row twice, refused" : " row twice"), entry, energy, 0.2,
                                 485));
    }
}

void add_scaled_steps(Cases& cases, bool full) {
  for (const auto& [name, energy] : of_each_kind)
    for (int decade = -12; decade <= 2; decade += full || decade >= 0 ? 1 : 3) {
      const CatalogueScene entry = make_scene(name);
      const long steps = decade <= 0 ? 970 : decade == 1 ? 97 : 49;
      cases.push_back(over_steps(name + ", step over the natural one", std::pow(10.0, decade),
                                 fmt::format("{} step*1e{}", name, decade), entry, energy,
                                 std::pow(10.0, decade), steps));
    }
}

void add_long_runs(Cases& cases) {
  for (const auto& [name, energy] : long_lived) {
    const CatalogueScene entry = make_scene(name);
    cases.push_back(over_steps(name + ", steps", 1e7, name + " 1e7 steps", entry, energy, 1.0, 10'000'000));
  }
}

}  // namespace

std::vector<StabilityCase> stability_cases(bool full) {
  Cases cases;
  add_stiff_springs(cases, full);
  add_compliant_springs(cases, full);
  add_fput(cases, full);
  add_governor(cases);
  add_kepler(cases, full);
  add_four_bars(cases, full);
  add_starts_near_flat_poses(cases, full);
  add_collisions(cases);
  add_mass_ratios(cases);
  add_scaled_rows(cases);
  add_redundant_rows(cases);
  add_scaled_steps(cases, full);
  if (full) add_long_runs(cases);
  return cases;
}

StabilityCase stability_case(const CatalogueScene& entry) {
  const auto scene = with_lagrangian(*entry.scene);
  StabilityCase that{.group = scene->name, .value = 1.0, .name = scene->name, .scene = entry};
  that.step = entry.natural_step;
  that.t_end = entry.t_end;
  if (keeps_energy(*scene)) that.watches.push_back(energy_watch(scene, energy_size(*scene)));
  for (const Invariant& invariant : entry.invariants)
    if (invariant.name != "energy") that.watches.push_back(invariant_watch(invariant, scene->start));
  return that;
}

}  // namespace diracstep
