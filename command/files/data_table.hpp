#pragma once

#include <string>
#include <vector>

namespace diracstep::command {

/// A table with its columns named in the first line; an empty field is NaN.
struct DataTable {
  std::vector<std::string> names;
  std::vector<std::vector<double>> rows;
};

/// Reads one from a CSV file; lines that begin with # are left out.  Throws Misuse where a field is no number
/// or a line has more or fewer than the first, naming the line, and where no line has data.
DataTable read_table(const std::string& path);

}  // namespace diracstep::command
