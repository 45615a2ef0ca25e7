#pragma once

#include <cstdint>
#include <diracstep/core/numerics/snapshot.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace diracstep {

/// What a run needs to go on where it stood.
struct Checkpoint {
  /// What must be the same to go on: {"method", "type1/midpoint"}, {"step", "0.05"}, …
  std::vector<std::pair<std::string, std::string>> run;
  long points = 0;  ///< lines of the trajectory written so far
  long bytes = 0;   ///< and how long the file was
  Snapshot state;   ///< of the integrator
};

/// As bytes: a line with name and version of the format, a line of JSON, the bytes of the state, and a check
/// sum of all that.
std::string encoded(const Checkpoint& checkpoint);

/// Throws Misuse, naming `path` and what is wrong, for anything but what encoded() makes.
Checkpoint decoded(std::string_view bytes, const std::string& path);

/// The check sum at the end: 64 bits, Fowler-Noll-Vo 1a.
std::uint64_t check_sum(std::string_view bytes);

inline constexpr std::size_t largest_checkpoint = std::size_t{1} << 34;  ///< bytes that are read: 16 GiB

/// The file at `path` is replaced at once: the old checkpoint stays whole until the new one is.
void write_checkpoint(const std::string& path, const Checkpoint& checkpoint);
Checkpoint read_checkpoint(const std::string& path);

/// Throws Misuse, with every value that differs, unless the run saved is the one described.
void require_same_run(const Checkpoint& saved, const std::vector<std::pair<std::string, std::string>>& run,
                      const std::string& path);

}  // namespace diracstep
