#pragma once

#include <diracstep/validation/convergence_study.hpp>
#include <filesystem>
#include <string>
#include <string_view>

namespace diracstep {

/// The gnuplot script of a study's work–precision picture, data inline: error at t_end (the larger one of q
/// and p) over CPU time, both logarithmic, one curve for each (method, order) and one for IDA.  The script
/// sets neither terminal nor output.
std::string work_precision_script(const Study& study);

/// Writes DIRECTORY/SCENE.svg and SCENE.png with gnuplot.  Empty, or what went wrong.
std::string draw_work_precision(const Study& study, const std::filesystem::path& directory);

/// A gnuplot string that is taken as it stands.
std::string gnuplot_text(std::string_view text);

/// Writes STEM.svg and STEM.png of a script that sets neither terminal nor output; width and height in
/// points. Empty, or what went wrong.
std::string render(const std::string& picture, const std::string& stem, std::size_t width,
                   std::size_t height);

}  // namespace diracstep
