#pragma once

#include <chrono>
#include <diracstep/reports/study_page.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <filesystem>
#include <string>
#include <vector>

namespace diracstep::command {

/// Markdown: the CPU time of each method at the compared errors.
std::string tables(const std::vector<Study>& studies);

/// The directory of --out: study.csv, study.json, summary.md, report.html, and of each scene its pictures and
/// the run looked at, renewed after each scene; report.html, which holds them all, at the end and now and
/// then.
class OutputDirectory {
 public:
  /// Throws Misuse where nothing can be written there.
  explicit OutputDirectory(const std::string& path);

  /// Empty, or what could not be written.
  std::string write(const std::vector<Study>& studies, const std::vector<PageEntry>& page,
                    const PageFacts& options, bool last);

  std::string report() const { return (path_ / "report.html").string(); }

 private:
  void draw(const std::vector<Study>& studies, const PageEntry& entry) const;
  std::string write_tables(const std::vector<Study>& studies) const;

  std::filesystem::path path_;
  std::chrono::steady_clock::time_point next_page_ = std::chrono::steady_clock::now();
};

}  // namespace diracstep::command
