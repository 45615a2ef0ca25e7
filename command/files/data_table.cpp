#include <fmt/format.h>

#include <charconv>
#include <diracstep/command/files/data_table.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/input_file.hpp>
#include <limits>
#include <string_view>

namespace diracstep::command {

namespace {

constexpr std::size_t most_data_bytes = 100'000'000;

std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    std::string_view part = line.substr(begin, end - begin);
    while (!part.empty() && (part.front() == ' ' || part.front() == '"')) part.remove_prefix(1);
    while (!part.empty() && (part.back() == ' ' || part.back() == '"' || part.back() == '\r'))
      part.remove_suffix(1);
    parts.push_back(part);
    begin = end + 1;
  }
  return parts;
}

double number(std::string_view cell, const std::string& path, std::size_t line) {
  if (cell.empty()) return std::numeric_limits<double>::quiet_NaN();
  double value = 0.0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc() || end != cell.data() + cell.size())
    throw Misuse(fmt::format("'{}', line {}: '{}' is not a number", path, line, cell));
  return value;
}

}  // namespace

DataTable read_table(const std::string& path) {
  const std::string text = read_file(path, "the data", most_data_bytes);
  DataTable table;
  std::size_t number_of_line = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line(text.data() + begin, end - begin);
    begin = end + 1;
    ++number_of_line;
    if (line.empty() || line == "\r" || line.front() == '#') continue;
    const auto parts = fields_of(line);
    if (table.names.empty()) {
      table.names.assign(parts.begin(), parts.end());
      continue;
    }
    if (parts.size() != table.names.size())
      throw Misuse(fmt::format("'{}', line {}: {} fields; the first line names {}", path, number_of_line,
                               parts.size(), table.names.size()));
    auto& row = table.rows.emplace_back();
    for (const std::string_view part : parts) row.push_back(number(part, path, number_of_line));
  }
  if (table.rows.empty()) throw Misuse(fmt::format("'{}' has no lines of data", path));
  return table;
}

}  // namespace diracstep::command
