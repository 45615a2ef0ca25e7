#pragma once

#include <diracstep/validation/history.hpp>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace diracstep {

/// The gnuplot script of a study's work–precision picture, data inline: error at t_end (the larger one of q
/// and p) over CPU time, both logarithmic, one curve for each (method, order) and one for IDA.  The script
/// sets neither terminal nor output.
std::string work_precision_script(const Study& study);

/// Writes DIRECTORY/SCENE.svg and SCENE.png with gnuplot.  Empty, or what went wrong.
std::string draw_work_precision(const Study& study, const std::filesystem::path& directory);

/// What stays and what should stay over time, as DIRECTORY/SCENE-history.svg: the change of energy and
/// invariants and the violation of the rows, on a logarithmic axis; and the motion in its first two
/// coordinates, as SCENE-motion.svg.  Empty, or what went wrong.
std::string draw_history(const History& history, const std::string& scene,
                         const std::filesystem::path& directory);

/// IDA's and the explicit method's time over ours at the error 1e-6 for every study that has them, as
/// DIRECTORY/summary.svg and .png.  Empty, or what went wrong.
std::string draw_summary(const std::vector<Study>& studies, const std::filesystem::path& directory);

/// The stem of a scene's files in a directory.
std::string file_name(std::string scene);
/// A gnuplot string that is taken as it stands.
std::string gnuplot_text(std::string_view text);

/// Writes STEM.svg and STEM.png of a script that sets neither terminal nor output; width and height in
/// points. Empty, or what went wrong.
std::string render(const std::string& picture, const std::string& stem, std::size_t width,
                   std::size_t height);

}  // namespace diracstep
