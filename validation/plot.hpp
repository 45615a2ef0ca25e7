#pragma once

#include <diracstep/validation/convergence_study.hpp>
#include <filesystem>
#include <string>

namespace diracstep {

/// The gnuplot script of a study's work–precision picture, data inline: error at t_end (the larger one of q
/// and p) over CPU time, both logarithmic, one curve for each (method, order) and one for IDA.  The script
/// sets neither terminal nor output.
std::string work_precision_script(const Study& study);

/// Writes DIRECTORY/SCENE.svg and SCENE.png with gnuplot.  Empty, or what went wrong.
std::string draw_work_precision(const Study& study, const std::filesystem::path& directory);

}  // namespace diracstep
