#pragma once

#include <diracstep/solvers/sundials_build.hpp>
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

/// The fastest of ours beside the baselines at each compared error, all scenes in one Markdown table below a
/// line that names the SUNDIALS of both.  The ratios of the times are left out where it is not known to be
/// optimised.
std::string summary_markdown(const std::vector<Study>& studies, bool with_ratios = sundials_is_optimised());

/// The same on a terminal: a line that names SUNDIALS and one with the heads of the columns, and what belongs
/// below them for each scene.
std::string summary_head(bool with_ratios = sundials_is_optimised());
std::string summary_rows(const Study& study, bool with_ratios = sundials_is_optimised());

/// The same in one line, for a pipe: "knife_edge: 1e-3 type1/gl:3 22.4 µs (IDA 106 µs, explicit 64 µs); 1e-6
/// …".
std::string summary_line(const Study& study);

/// 1e-06 as "1e-6".
std::string power_text(double power_of_ten);

/// All rows of all studies, one line each, with a header; a number that does not apply is left empty.
std::string studies_csv(const std::vector<Study>& studies);

/// {"studies": [...], "build": {...}}; a number that does not apply or is not finite is null.
std::string studies_json(const std::vector<Study>& studies);

/// 1.23e-05 s as "12.3 µs"; "-" for a time that is not finite.
std::string time_cell(double seconds);

/// A field of a CSV file, quoted where it must be.
std::string csv_field(std::string_view text);

/// Columns of text, each as wide as its widest cell; the first row is the header.  With a `line_width` the
/// last column is broken between words where it would go beyond, and goes on below itself.
std::string aligned(const std::vector<std::vector<std::string>>& rows, std::size_t line_width = 0);

}  // namespace diracstep
