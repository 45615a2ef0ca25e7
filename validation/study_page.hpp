#pragma once

#include <diracstep/validation/history.hpp>
#include <filesystem>
#include <string>
#include <vector>

namespace diracstep {

/// All that the page shows of one scene.
struct PageEntry {
  Study study;
  History history;
  std::string kind, description, source;  ///< of the scene
};

/// One HTML page that needs no other file: a summary table and picture, then for each scene its pictures,
/// tables and plan.  Pictures are taken from DIRECTORY/*.svg, as the plot functions write them; one that is
/// not there is left out.
std::string study_page(const std::vector<PageEntry>& entries, const std::filesystem::path& directory);

}  // namespace diracstep
