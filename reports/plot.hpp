#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace diracstep {

/// The stem of a scene's files in a directory.
std::string file_name(std::string scene);

/// A gnuplot string that is taken as it stands.
std::string gnuplot_text(std::string_view text);

/// STEM.svg and STEM.png.
std::vector<std::string> picture_files(const std::string& stem);

/// Writes these of a script that sets neither terminal nor output; width and height in
/// points. A picture that is there is replaced by a whole one or stays. Empty, or what went wrong.
std::string render(const std::string& picture, const std::string& stem, std::size_t width,
                   std::size_t height);

}  // namespace diracstep
