#pragma once

#include <diracstep/validation/studies/convergence_study.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// What changed since an earlier study: the same scene, method and order in both.
struct StudyChange {
  std::string scene, method;
  int order = 0;
  std::string what;  ///< "CPU to 1e-06", or "error at step 0.05"
  double before = 0.0, now = 0.0;
  double ratio = 1.0;   ///< before over now: above 1 is better
  std::string verdict;  ///< "faster", "slower", "more exact", "less exact", or empty within the noise
};

/// Throws Misuse where the text is no study.json.
void require_study(const std::string& json);

/// Compares with the text of an earlier study.json: the CPU times of at_error, where a ratio within 1.25
/// counts as noise, and the errors of rows at the same step, where one within 1.05, or both errors below
/// 1e-12, does. Throws Misuse for a text that is no study, and where the two share nothing.
std::vector<StudyChange> compare_studies(const std::vector<Study>& now, const std::string& before_json);

/// The changes as a table for a terminal, those within the noise counted only.
std::string comparison_table(const std::vector<StudyChange>& changes);

}  // namespace diracstep
