#include <fmt/format.h>

#include <charconv>
#include <diracstep/command/verbs/published_orders.hpp>
#include <system_error>

namespace diracstep::command {

extern const std::string_view orders_page;  // docs/orders.md, see command/CMakeLists.txt

namespace {

/// The cells of a line of a Markdown table, without the blanks around them.
std::vector<std::string_view> cells(std::string_view line) {
  std::vector<std::string_view> all;
  for (std::size_t begin = line.find('|'); begin != line.npos;) {
    const std::size_t end = line.find('|', begin + 1);
    if (end == line.npos) break;
    std::string_view cell = line.substr(begin + 1, end - begin - 1);
    while (cell.starts_with(' ')) cell.remove_prefix(1);
    while (cell.ends_with(' ')) cell.remove_suffix(1);
    all.push_back(cell);
    begin = end;
  }
  return all;
}

}  // namespace

std::vector<PublishedOrder> published_orders(std::string_view text, const std::string& method, int order) {
  const std::string row = fmt::format("| `{}` | {} |", method, order);
  std::vector<std::string_view> classes;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = text.substr(begin, end - begin);
    begin = end + 1;
    if (classes.empty() && line.starts_with("| method | claimed |")) classes = cells(line);
    if (!line.starts_with(row)) continue;
    std::vector<PublishedOrder> found;
    const auto values = cells(line);
    for (std::size_t i = 2; i < std::min(values.size(), classes.size()); ++i) {
      if (classes[i] == "reversal") break;  // the defects follow
      double slope{};
      const auto [stop, error] =
          std::from_chars(values[i].data(), values[i].data() + values[i].size(), slope);
      if (error == std::errc()) found.push_back({std::string(classes[i]), slope});
    }
    return found;
  }
  return {};
}

std::vector<PublishedOrder> published_orders(const std::string& method, int order) {
  return published_orders(orders_page, method, order);
}

}  // namespace diracstep::command
