#pragma once

#include <diracstep/reports/history.hpp>
#include <diracstep/reports/series_style.hpp>
#include <filesystem>
#include <string>
#include <vector>

namespace diracstep {

/// The pictures of a study as files, drawn by gnuplot: each function writes DIRECTORY/NAME.svg and .png and
/// returns an empty text, or what went wrong.

/// SCENE: error at t_end, the larger one of q and p, over CPU time, both logarithmic, one curve for each
/// method and order and one for each baseline.  SCENE-orders: the same error over the step.  Errors below
/// that of the reference are not drawn; where the curves come near it a level line shows it.
std::string draw_work_precision(const Study& study, const std::string& time_unit,
                                const std::vector<SeriesStyle>& styles,
                                const std::filesystem::path& directory);

/// SCENE-history: what should stay constant, that is the change of energy and invariants and the violation
/// of the rows, on a logarithmic axis; SCENE-error: the error over time, both logarithmic; SCENE-motion.
std::string draw_history(const History& history, const std::string& scene, const std::string& time_unit,
                         const std::vector<SeriesStyle>& styles, const std::filesystem::path& directory);

/// summary: IDA's and the explicit method's time over ours at the error 1e-6, for every study that has them.
std::string draw_summary(const std::vector<Study>& studies, const std::filesystem::path& directory);

}  // namespace diracstep
