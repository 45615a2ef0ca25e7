#pragma once

#include <diracstep/sweeps/sweep_folder.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// Gathers numbers of members for the page of a sweep: of all, or of every second, fourth, … where they are
/// many.
class PageData {
 public:
  static constexpr std::size_t most_members = 20000;

  explicit PageData(std::vector<std::string> names) : names_(std::move(names)), columns_(names_.size()) {}
  /// A member's numbers, in the order of the names.
  void take(const std::vector<double>& numbers);
  /// One HTML page that needs no other file.
  std::string page(const Sweep& sweep, const SweepReport& report) const;

 private:
  std::vector<std::string> names_;
  std::vector<std::vector<double>> columns_;
  long every_ = 1, seen_ = 0;
};

}  // namespace diracstep
