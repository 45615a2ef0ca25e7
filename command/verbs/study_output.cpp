#include <diracstep/command/files/written_file.hpp>
#include <diracstep/command/session.hpp>
#include <diracstep/command/verbs/study_output.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/paths.hpp>
#include <diracstep/reports/plot.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/reports/study_plot.hpp>
#include <diracstep/solvers/sundials_build.hpp>

namespace diracstep::command {

namespace {

constexpr const char* summary_explanation =
    "# CPU time to an error\n\n"
    "Written by `diracstep study SCENE... --methods A,B,... --table FILE`: the thread's CPU time at which "
    "the relative\n"
    "error (maximum norm, q and projected p) at the end of the motion reaches each level, read off the lower "
    "envelope of\n"
    "error against time by log-log interpolation. A dash: the method does not get there. Where the "
    "coarsest run is\n"
    "below the level already, its time stands, on every side. The fastest of ours is bold. One run on one "
    "machine:\ncompare within a table.\n\n";

constexpr std::chrono::seconds between_pages(10);

void tell(const std::string& failure) {
  if (!failure.empty()) say(failure);
}

}  // namespace

std::string tables(const std::vector<Study>& studies) {
  std::string text = summary_explanation + sundials_build() + ".\n\n";
  for (const Study& study : studies) text += at_error_markdown(study);
  return text;
}

OutputDirectory::OutputDirectory(const std::string& path) : path_(output_directory(path)) {
  if (const auto failure = write_tables({}); !failure.empty()) throw Misuse("--out: " + failure);
}

std::string OutputDirectory::write(const std::vector<Study>& studies, const std::vector<PageEntry>& page,
                                   const PageFacts& options, bool last) {
  draw(studies, page.back());
  const std::string stem = (path_ / file_name(page.back().study.scene)).string();
  std::string failure = write_tables(studies);
  if (failure.empty()) failure = write_file(stem + ".txt", study_table(page.back().study));
  const History& history = page.back().history;
  if (failure.empty() && !history.time.empty())
    failure = write_file(stem + "-history.csv", history_csv(history));
  if (failure.empty() && !history.time.empty())
    failure = write_file(stem + "-motion.csv", motion_csv(history));
  const auto now = std::chrono::steady_clock::now();
  if (failure.empty() && (last || now > next_page_)) {
    failure = write_file(path_ / "report.html", study_page(page, options, path_));
    next_page_ = now + between_pages;
  }
  return failure;
}

void OutputDirectory::draw(const std::vector<Study>& studies, const PageEntry& entry) const {
  tell(draw_work_precision(entry.study, entry.time_unit, series_styles(studies), path_));
  if (!entry.history.time.empty())
    tell(draw_history(entry.history, entry.study.scene, entry.time_unit, series_styles(studies), path_));
  if (sundials_is_optimised()) tell(draw_summary(studies, path_));
}

std::string OutputDirectory::write_tables(const std::vector<Study>& studies) const {
  std::string failure = write_file(path_ / "study.csv", studies_csv(studies));
  if (failure.empty()) failure = write_file(path_ / "study.json", studies_json(studies) + '\n');
  if (failure.empty()) failure = write_file(path_ / "summary.md", summary_markdown(studies));
  return failure;
}

}  // namespace diracstep::command
