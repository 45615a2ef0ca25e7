#pragma once

#include <diracstep/validation/study_run.hpp>
#include <functional>
#include <vector>

namespace diracstep {

/// The posing in which IDA is the yardstick of a scene: of those that complete at the most tolerances the one
/// with the least CPU time at the errors 1e-3, 1e-6 and 1e-9, in the geometric mean over those errors that
/// all of them reach; `rates` where they share none.  Each posing is run once at each tolerance, until a run
/// takes longer than `budget` CPU seconds.  `look` is called before each run and may throw to end it.
Posing fastest_posing(const Scene& scene, double t_end, const std::vector<double>& rtols, const Truth& truth,
                      double budget, const Look& look = {});

}  // namespace diracstep
