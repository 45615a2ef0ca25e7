#include <fmt/format.h>

#include <cmath>
#include <diracstep/files/shown_text.hpp>
#include <diracstep/reports/html_table.hpp>

namespace diracstep {

namespace {

std::string heads(const HtmlTable& table) {
  std::string text;
  if (!table.groups.empty()) {
    text += "<tr>";
    for (const auto& [name, columns] : table.groups)
      text += name.empty() ? fmt::format("<td colspan=\"{}\"></td>", columns)
                           : fmt::format("<th class=\"group\" scope=\"colgroup\" colspan=\"{}\">{}</th>",
                                         columns, html(name));
    text += "</tr>\n";
  }
  text += "<tr>";
  for (std::size_t i = 0; i < table.header.size(); ++i) {
    const bool of_text = !table.rows.empty() && !table.rows.front()[i].number;
    text += fmt::format("<th scope=\"col\"{}><button type=\"button\">{}</button></th>",
                        of_text ? " class=\"text\"" : "", html(table.header[i]));
  }
  return text + "</tr>";
}

std::string cell_text(const HtmlCell& cell) {
  if (!cell.number)
    return fmt::format("<td class=\"text{}\">{}</td>", cell.look.empty() ? "" : " " + cell.look,
                       cell.content);
  return fmt::format("<td{} data-value=\"{}\">{}</td>",
                     cell.look.empty() ? "" : fmt::format(" class=\"{}\"", cell.look),
                     cell.value ? fmt::format("{:.9g}", *cell.value) : "", cell.content);
}

}  // namespace

std::string html(std::string_view text) {
  std::string safe;
  for (const char c : shown_lines(text)) switch (c) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '"':
        safe += "&quot;";
        break;
      default:
        safe += c;
    }
  return safe;
}

HtmlCell words(std::string_view text, std::string look) { return {html(text), {}, false, std::move(look)}; }

HtmlCell number_cell(std::optional<double> value, const std::string& text) {
  const bool there = value && std::isfinite(*value);
  return {there ? html(text) : "–", there ? value : std::nullopt, true, {}};
}

std::string HtmlTable::text() const {
  std::string text = "<div class=\"table\"><table>";
  text += "<thead>" + heads(*this) + "</thead><tbody>\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    text += i < best.size() && best[i] ? "<tr class=\"best\">" : "<tr>";
    for (const HtmlCell& cell : rows[i]) text += cell_text(cell);
    text += "</tr>\n";
  }
  return text + "</tbody></table></div>\n";
}

}  // namespace diracstep
