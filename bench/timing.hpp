#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <diracstep/solvers/sundials_build.hpp>
#include <functional>
#include <vector>

/// Every benchmark says first which SUNDIALS its times were taken with.
inline const int build_line = std::printf("%s\n", diracstep::sundials_build().c_str());

/// Processor time of the program: time in which other programs run does not count.
inline double processor_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Fewest nanoseconds of each piece of work for one of its `count` parts; the pieces take turns for so many
/// rounds.
inline std::vector<double> fewest_nanoseconds(const std::vector<std::function<void()>>& work, int count,
                                              int rounds) {
  std::vector<double> fewest(work.size(), HUGE_VAL);
  for (int round = 0; round < rounds; ++round)
    for (std::size_t i = 0; i < work.size(); ++i) {
      const double start = processor_seconds();
      work[i]();
      fewest[i] = std::min(fewest[i], 1e9 * (processor_seconds() - start) / count);
    }
  return fewest;
}
