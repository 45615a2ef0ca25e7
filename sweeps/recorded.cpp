#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/names.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <diracstep/sweeps/recorded.hpp>
#include <limits>

namespace diracstep {

namespace {

constexpr double unmet = std::numeric_limits<double>::quiet_NaN();

std::vector<std::string> trajectory_columns(const CatalogueScene& entry) {
  std::vector<std::string> names = position_names(*entry.scene);
  for (const char* prefix : {"v_", "p_"})
    for (const std::string& name : entry.scene->coordinates) names.push_back(prefix + name);
  for (const std::string& name : entry.shown().row_names()) names.push_back("lambda_" + name);
  names.emplace_back("energy");
  for (const Invariant& invariant : entry.invariants) names.push_back("invariant_" + invariant.name);
  for (const Output& output : entry.outputs) names.push_back(output.name);
  return names;
}

/// Functions of the scene take momenta where it has no Lagrangian.
const Vector& second(const CatalogueScene& entry, const Sample& sample) {
  return entry.scene->lagrangian ? sample.v : sample.p;
}

}  // namespace

RecordedValue::RecordedValue(const CatalogueScene& entry, const std::string& name) : from_(From::energy) {
  const std::vector<std::string> names = trajectory_columns(entry);
  const auto found = std::ranges::find(names, name);
  if (found == names.end())
    throw Misuse(
        "[record]: the scene '" + entry.scene->name + "' has no '" + name + "'" + did_you_mean(name, names) +
        "; there are its coordinates x, v_x, p_x, lambda_ROW, energy, invariant_NAME and its outputs");
  auto at = static_cast<std::size_t>(found - names.begin());
  const auto n = static_cast<std::size_t>(entry.scene->dimension());
  const auto m = static_cast<std::size_t>(entry.shown().rows()),
             positions = static_cast<std::size_t>(entry.scene->storage_size());
  const std::pair<From, std::size_t> parts[] = {{From::position, positions},
                                                {From::velocity, n},
                                                {From::momentum, n},
                                                {From::force, m},
                                                {From::energy, 1},
                                                {From::invariant, entry.invariants.size()},
                                                {From::output, entry.outputs.size()}};
  for (const auto& [from, count] : parts) {
    if (at < count) {
      from_ = from;
      index_ = at;
      return;
    }
    at -= count;
  }
}

double RecordedValue::at(const CatalogueScene& entry, const Sample& of_run) const {
  Sample sample = of_run;
  if (from_ == From::force || from_ == From::output)
    sample.lambda = shown_forces(entry, sample.time, sample.q, sample.lambda);
  const auto i = static_cast<Eigen::Index>(index_);
  switch (from_) {
    case From::position:
      return sample.q[i];
    case From::velocity:
      return sample.v[i];
    case From::momentum:
      return sample.p[i];
    case From::force:
      return i < sample.lambda.size() ? sample.lambda[i] : unmet;
    case From::energy:
      return sample.energy;
    case From::invariant:
      return entry.invariants[index_].at(sample.time, sample.q, second(entry, sample));
    case From::output:
      return entry.outputs[index_].at(sample.point());
  }
  return unmet;
}

Recorded::Recorded(const Sweep& sweep, const CatalogueScene& entry) {
  for (const std::string& name : recorded_values(sweep, entry)) values_.emplace_back(entry, name);
  for (const std::string& name : sweep.extrema) extrema_.push_back({{entry, name}, HUGE_VAL, -HUGE_VAL});
  for (const std::string& name : sweep.events) {
    std::vector<std::string> known;
    for (const Event& event : entry.events) known.push_back(event.name);
    if (std::ranges::find(known, name) == known.end())
      throw Misuse("[record]: the scene '" + entry.scene->name + "' has no event '" + name + "'" +
                   did_you_mean(name, known));
    events_.push_back({name, unmet});
  }
}

void Recorded::see(const CatalogueScene& entry, const Sample& node) {
  for (Extremum& extremum : extrema_) {
    const double value = extremum.value.at(entry, node);
    extremum.least = std::min(extremum.least, value);
    extremum.most = std::max(extremum.most, value);
  }
}

void Recorded::see_event(const std::string& name, double time) {
  for (Met& event : events_) {
    if (event.name != name) continue;
    if (event.count++ == 0) event.first = time;
  }
}

std::vector<double> Recorded::numbers(const CatalogueScene& entry, const Sample& end) const {
  std::vector<double> all;
  for (const RecordedValue& value : values_) all.push_back(value.at(entry, end));
  for (const Extremum& extremum : extrema_) all.insert(all.end(), {extremum.least, extremum.most});
  for (const Met& event : events_) all.insert(all.end(), {event.first, static_cast<double>(event.count)});
  return all;
}

std::vector<std::string> recorded_values(const Sweep& sweep, const CatalogueScene& entry) {
  if (!sweep.values.empty() || !sweep.extrema.empty() || !sweep.events.empty() || !sweep.derivatives.empty())
    return sweep.values;
  std::vector<std::string> names = position_names(*entry.scene);
  for (const std::string& name : entry.scene->coordinates) names.push_back("v_" + name);
  return names;
}

std::vector<std::string> recorded_names(const Sweep& sweep) {
  std::vector<std::string> names = sweep.values;
  for (const std::string& name : sweep.extrema) names.insert(names.end(), {"min_" + name, "max_" + name});
  for (const std::string& name : sweep.events) names.insert(names.end(), {name + "_time", name + "_count"});
  names.insert(names.end(), sweep.derivatives.begin(), sweep.derivatives.end());
  return names;
}

}  // namespace diracstep
