#pragma once

#include <diracstep/core/integrator/sample.hpp>
#include <diracstep/sweeps/sweep.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// A number of a point of the motion: a column of a trajectory by its name.
class RecordedValue {
 public:
  /// Throws Misuse where the scene has no such column, with the names there are.
  RecordedValue(const CatalogueScene& entry, const std::string& name);
  double at(const CatalogueScene& entry, const Sample& sample) const;

 private:
  enum class From { position, velocity, momentum, force, energy, invariant, output } from_;
  std::size_t index_ = 0;
};

/// What a sweep keeps of each member, for one scene.
class Recorded {
 public:
  /// Throws Misuse as RecordedValue does, and for an event that the scene has not.
  Recorded(const Sweep& sweep, const CatalogueScene& entry);

  bool needs_every_point() const { return !extrema_.empty(); }
  /// A node of the run.
  void see(const CatalogueScene& entry, const Sample& node);
  void see_event(const std::string& name, double time);
  /// All numbers but derivatives, in the order of recorded_names().
  std::vector<double> numbers(const CatalogueScene& entry, const Sample& end) const;

 private:
  struct Extremum {
    RecordedValue value;
    double least, most;
  };
  struct Met {
    std::string name;
    double first;
    long count = 0;
  };
  std::vector<RecordedValue> values_;
  std::vector<Extremum> extrema_;
  std::vector<Met> events_;
};

/// Sweep::values, or what stands for them where there are none.
std::vector<std::string> recorded_values(const Sweep& sweep, const CatalogueScene& entry);

/// "x", …; "min_x", "max_x", …; "EVENT_time", "EVENT_count", …; "d(x)/d(m)", ….
std::vector<std::string> recorded_names(const Sweep& sweep);

}  // namespace diracstep
