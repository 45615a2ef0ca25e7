#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/csv_table.hpp>
#include <diracstep/files/input_file.hpp>
#include <limits>
#include <optional>
#include <string_view>

namespace diracstep {

namespace {

std::string_view trimmed(std::string_view text, std::string_view of = " \t\r") {
  const std::size_t first = text.find_first_not_of(of);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(of) + 1 - first);
}

std::vector<std::string> fields_of(std::string_view line) {
  std::vector<std::string> fields;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    fields.emplace_back(trimmed(line.substr(begin, end - begin), " \t\r\""));
    begin = end + 1;
  }
  return fields;
}

std::optional<std::vector<double>> numbers_of(const std::vector<std::string>& fields, EmptyFields empty) {
  std::vector<double> numbers;
  for (const std::string& field : fields) {
    if (field.empty() && empty == EmptyFields::missing) {
      numbers.push_back(std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    double value = 0.0;
    const char* const end = field.data() + field.size();
    const auto [stop, error] = std::from_chars(field.data(), end, value);
    if (field.empty() || error != std::errc{} || stop != end || !std::isfinite(value)) return std::nullopt;
    numbers.push_back(value);
  }
  return numbers;
}

}  // namespace

std::size_t CsvTable::column(const std::string& name) const {
  const auto found = std::ranges::find(names, name);
  if (found == names.end())
    throw Misuse(fmt::format("there is no column '{}'; the columns are {}", name,
                             names.empty() ? "without names" : fmt::format("{}", fmt::join(names, ", "))));
  return static_cast<std::size_t>(found - names.begin());
}

CsvTable read_csv(const std::string& path, const std::string& what, std::size_t limit,
                  std::size_t least_columns, EmptyFields empty) {
  const std::string text = read_file(path, what, limit);
  CsvTable table;
  std::size_t width = 0;
  long number = 0;
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  for (std::size_t begin = text.starts_with(byte_order_mark) ? byte_order_mark.size() : 0;
       begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = trimmed(std::string_view(text).substr(begin, end - begin));
    begin = end + 1;
    ++number;
    if (line.empty() || line.front() == '#') continue;
    const std::vector<std::string> fields = fields_of(line);
    auto numbers = numbers_of(fields, empty);
    if (width == 0 && fields.size() < least_columns)
      throw Misuse(
          fmt::format("{}: '{}', line {}: expected {} columns or more", what, path, number, least_columns));
    if (width != 0 && fields.size() != width)
      throw Misuse(fmt::format("{}: '{}', line {}: {} columns; expected {}", what, path, number,
                               fields.size(), width));
    if (numbers)
      table.lines.push_back(std::move(*numbers));
    else if (width == 0)
      table.names = fields;
    else
      throw Misuse(fmt::format("{}: '{}', line {}: '{}': expected finite numbers", what, path, number, line));
    width = fields.size();
  }
  return table;
}

}  // namespace diracstep
