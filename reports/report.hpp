#pragma once

#include <diracstep/validation/studies/convergence_study.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace diracstep {

/// A study as tables for a terminal: the rows, the measured orders, and the time to reach an error.
std::string study_table(const Study& study);

/// CPU time at the compared errors as a Markdown table with its heading: methods side by side, the fastest
/// bold.
std::string at_error_markdown(const Study& study);

/// The fastest of ours beside the baselines at the errors 1e-6 and 1e-9, all scenes in one Markdown table.
std::string summary_markdown(const std::vector<Study>& studies);

/// All rows of all studies, one line each, with a header; a number that does not apply is left empty.
std::string studies_csv(const std::vector<Study>& studies);

/// {"studies": [...], "build": {...}}; a number that does not apply or is not finite is null.
std::string studies_json(const std::vector<Study>& studies);

/// 1.23e-05 s as "12.3 µs"; "-" for a time that is not finite.
std::string time_cell(double seconds);

/// A field of a CSV file, quoted where it must be.
std::string csv_field(std::string_view text);

/// Columns of text, each as wide as its widest cell; the first row is the header.
std::string aligned(const std::vector<std::vector<std::string>>& rows);

}  // namespace diracstep
