#pragma once

#include <diracstep/reports/history.hpp>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// All that the page shows of one scene.
struct PageEntry {
  Study study;
  History history;
  std::string kind, description, source;  ///< of the scene
  std::string time_unit = {};             ///< empty where it is not known
};

/// What was asked for, by name: "methods", "repeats", …
using PageFacts = std::vector<std::pair<std::string, std::string>>;

/// One HTML page that needs no other file: a summary table and picture, then for each scene its pictures,
/// tables and plan.  The pictures are drawn in the browser from the data that the page holds; where no script
/// runs, those of DIRECTORY/*.svg stand in their places, if they are there.
std::string study_page(const std::vector<PageEntry>& entries, const PageFacts& options,
                       const std::filesystem::path& directory);

/// The data of the page as JSON: that of studies_json, the styles of the curves, and the runs of the
/// histories.
std::string study_page_data(const std::vector<PageEntry>& entries);

}  // namespace diracstep
