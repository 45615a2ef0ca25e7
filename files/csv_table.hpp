#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace diracstep {

/// Numbers in columns.
struct CsvTable {
  std::vector<std::string> names;  ///< of the columns; empty where the file begins with numbers
  std::vector<std::vector<double>> lines;

  /// The number of a column; throws Misuse for a name that is none, with the known ones.
  std::size_t column(const std::string& name) const;
};

/// Whether a field may be empty, which then is NaN.
enum class EmptyFields { refused, missing };

/// Reads numbers separated by commas, `least_columns` or more, the same in each line; a first line that is
/// none of numbers names the columns.  Fields may stand in quotes.  Empty lines and lines that begin with #
/// are skipped.  Throws Misuse as read_file() does, and for anything else, with the line.
CsvTable read_csv(const std::string& path, const std::string& what, std::size_t limit,
                  std::size_t least_columns = 2, EmptyFields empty = EmptyFields::refused);

}  // namespace diracstep
