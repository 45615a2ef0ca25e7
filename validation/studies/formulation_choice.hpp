#pragma once

#include <diracstep/validation/studies/study_run.hpp>
#include <vector>

namespace diracstep {

/// The formulations in which IDA is the baseline of a scene: for each of the errors 1e-6, 1e-3 and 1e-9 the
/// one with the least CPU time, or one chosen already that is within a tenth of it.  Each formulation is run
/// once at each tolerance, until a run takes longer than `budget` CPU seconds; where none reaches those
/// errors it is the first of those that complete at the most tolerances.  `look` is called before each run
/// and may throw to end it; `sizes` are those of ReferenceOptions.
std::vector<DaeFormulation> best_formulations(const Scene& scene, double t_end,
                                              const std::vector<double>& rtols, const ReferenceEnd& reference,
                                              double budget, const Look& look = {}, const Vector& sizes = {});

}  // namespace diracstep
