#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/validation/build_facts.hpp>
#include <diracstep/validation/plot.hpp>
#include <diracstep/validation/report.hpp>
#include <diracstep/validation/study_page.hpp>
#include <fstream>
#include <sstream>

namespace diracstep {

namespace {

constexpr std::string_view head = R"(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>DiracStep: error against run time</title>
<style>
:root { color-scheme: light dark; --ink: #1c2733; --paper: #ffffff; --line: #d5dbe1; --soft: #f3f5f8; --best: #00704f; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e9ee; --paper: #12171d; --line: #36414c; --soft: #1b232b; --best: #5fd3a6; }
}
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 72rem;
       margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.7rem; margin: 0.5rem 0; } h2 { font-size: 1.25rem; margin: 2.5rem 0 0.5rem;
     border-top: 1px solid var(--line); padding-top: 1rem; }
.table { overflow-x: auto; margin: 0.8rem 0; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.25rem 0.7rem; border-bottom: 1px solid var(--line); text-align: right; white-space: nowrap; }
th:first-child, td:first-child, td.text, th.text { text-align: left; }
th button { all: unset; cursor: pointer; font-weight: 600; } th button:focus-visible { outline: 2px solid; }
th[aria-sort=ascending] button::after { content: " ▲"; } th[aria-sort=descending] button::after { content: " ▼"; }
tr.best td { color: var(--best); font-weight: 600; }
figure { margin: 1rem 0; } img { max-width: 100%; height: auto; background: #fff; border: 1px solid var(--line);
         border-radius: 6px; } .pair { display: flex; flex-wrap: wrap; gap: 1rem; } .pair figure { flex: 1 1 20rem; margin: 0; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 0.1rem 1rem; } dd { margin: 0; }
details { background: var(--soft); border-radius: 6px; padding: 0.5rem 1rem; margin: 0.8rem 0; }
@media print { body { max-width: none; font-size: 11pt; } h2 { break-before: page; } details { background: none; } }
</style>
</head>
<body>
)";

constexpr std::string_view tail = R"(<script>
document.querySelectorAll('th button').forEach(button => button.addEventListener('click', () => {
  const th = button.closest('th'), body = th.closest('table').tBodies[0], column = th.cellIndex;
  const up = th.getAttribute('aria-sort') !== 'ascending';
  th.parentNode.querySelectorAll('th').forEach(other => other.removeAttribute('aria-sort'));
  th.setAttribute('aria-sort', up ? 'ascending' : 'descending');
  const key = row => { const cell = row.cells[column], value = cell.dataset.value;
    return value === undefined ? cell.textContent : value === '' ? Infinity : Number(value); };
  [...body.rows].sort((a, b) => { const x = key(a), y = key(b);
    return (typeof x === 'string' ? x.localeCompare(y) : x === y ? 0 : x < y ? -1 : 1) * (up ? 1 : -1);
  }).forEach(row => body.append(row));
}));
</script>
</body>
</html>
)";

std::string escaped(std::string_view text) {
  std::string safe;
  for (const char c : text) switch (c) {
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

/// A cell: what is shown, and the number it is sorted by, if it is one.
struct Cell {
  std::string text;
  std::optional<double> value = {};
  bool number = false;
};

Cell words(std::string text) { return {escaped(text)}; }
Cell number(std::optional<double> value, const std::string& text) {
  const bool there = value && std::isfinite(*value);
  return {there ? escaped(text) : "–", there ? value : std::nullopt, true};
}
Cell seconds(std::optional<double> value) { return number(value, value ? time_cell(*value) : ""); }
Cell ratio(std::optional<double> value) { return number(value, value ? fmt::format("{:.1f}", *value) : ""); }
Cell exponent(double value) { return number(value, fmt::format("{:.0e}", value)); }

std::string table(const std::vector<std::string>& header, const std::vector<std::vector<Cell>>& rows,
                  const std::vector<bool>& best = {}) {
  std::string text = "<div class=\"table\"><table><thead><tr>";
  for (std::size_t i = 0; i < header.size(); ++i) {
    const bool of_text = !rows.empty() && !rows.front()[i].number;
    text +=
        (of_text ? "<th class=\"text\"><button>" : "<th><button>") + escaped(header[i]) + "</button></th>";
  }
  text += "</tr></thead><tbody>\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    text += i < best.size() && best[i] ? "<tr class=\"best\">" : "<tr>";
    for (const Cell& cell : rows[i])
      text += cell.number ? fmt::format("<td data-value=\"{}\">{}</td>",
                                        cell.value ? fmt::format("{:.9g}", *cell.value) : "", cell.text)
                          : "<td class=\"text\">" + cell.text + "</td>";
    text += "</tr>\n";
  }
  return text + "</tbody></table></div>\n";
}

/// An SVG file as the address of an image, so that its names meet no others; empty where there is no file.
std::string image(const std::filesystem::path& svg, const std::string& description) {
  std::ifstream file(svg);
  const std::string content = (std::ostringstream() << file.rdbuf()).str();
  if (content.empty()) return {};
  std::string address;
  for (const char c : content)
    if (std::string_view("%#<>\"\n&").find(c) == std::string_view::npos)
      address += c;
    else
      address += fmt::format("%{:02X}", static_cast<unsigned char>(c));
  return fmt::format("<figure><img alt=\"{}\" src=\"data:image/svg+xml;charset=utf-8,{}\"></figure>\n",
                     escaped(description), address);
}

std::string method_of(const AtError& at) { return fmt::format("{}, order {}", at.method, at.order); }

std::string summary(const std::vector<PageEntry>& entries) {
  std::vector<std::vector<Cell>> rows;
  for (const PageEntry& entry : entries)
    for (const AtError& at : entry.study.at_error)
      if (at.best)
        rows.push_back({{fmt::format("<a href=\"#{0}\">{0}</a>", escaped(entry.study.scene))},
                        words(entry.kind),
                        exponent(at.error),
                        words(method_of(at)),
                        seconds(at.cpu_seconds),
                        seconds(at.ida_cpu_seconds),
                        ratio(at.ratio),
                        seconds(at.erk_cpu_seconds),
                        ratio(at.erk_ratio)});
  return table({"scene", "class", "error", "fastest of ours", "ours", "IDA", "IDA / ours", "explicit",
                "explicit / ours"},
               rows);
}

std::string comparison(const Study& study) {
  std::vector<std::vector<Cell>> rows;
  std::vector<bool> best;
  for (const AtError& at : study.at_error) {
    if (!at.cpu_seconds) continue;
    rows.push_back({exponent(at.error), words(method_of(at)), seconds(at.cpu_seconds), ratio(at.ratio),
                    ratio(at.erk_ratio)});
    best.push_back(at.best);
  }
  return table({"error", "method", "CPU", "IDA / ours", "explicit / ours"}, rows, best);
}

std::string orders(const Study& study) {
  std::vector<std::vector<Cell>> rows;
  for (const MeasuredOrder& m : study.measured_orders)
    rows.push_back({words(m.method), number(m.order, fmt::format("{}", m.order)),
                    number(m.slope, m.slope ? fmt::format("{:.2f}", *m.slope) : ""),
                    number(m.points, fmt::format("{}", m.points)), words(m.ladder_end)});
  return table({"method", "order", "measured", "points", "the ladder ended because"}, rows);
}

std::string plan(const History& history) {
  if (history.plan.empty()) return {};
  std::string text = fmt::format("<details><summary>What {} does here and what it leaves out</summary><dl>\n",
                                 escaped(history.method));
  for (const PlanLine& line : history.plan)
    text += fmt::format("<dt>{}</dt><dd>{}{}</dd>\n", escaped(line.item), escaped(line.decision),
                        line.reason.empty() ? "" : " – " + escaped(line.reason));
  return text + "</dl></details>\n";
}

std::string section(const PageEntry& entry, const std::filesystem::path& directory) {
  const Study& study = entry.study;
  const std::string stem = (directory / file_name(study.scene)).string();
  std::string text =
      fmt::format("<h2 id=\"{0}\">{0}</h2>\n<p>{1}</p>\n", escaped(study.scene), escaped(entry.description));
  text += fmt::format(
      "<p>{}; t = {:g} to {:g}; {} unknowns; reference: {} ({}), its own error {:.1e}. Data: {}</p>\n",
      escaped(entry.kind), study.t_start, study.t_end, study.unknowns, escaped(study.reference_kind),
      escaped(study.reference_how), study.reference_error, escaped(entry.source));
  text += image(stem + ".svg", "error against CPU time of " + study.scene);
  text += comparison(study);
  text += "<div class=\"pair\">" +
          image(stem + "-history.svg", "energy, invariants and constraint residual over time") +
          image(stem + "-motion.svg", "the motion") + "</div>\n";
  if (!entry.history.failure.empty()) text += "<p>" + escaped(entry.history.failure) + "</p>\n";
  return text + "<details><summary>Measured orders</summary>" + orders(study) + "</details>\n" +
         plan(entry.history);
}

}  // namespace

std::string study_page(const std::vector<PageEntry>& entries, const std::filesystem::path& directory) {
  std::string text(head);
  text +=
      "<h1>DiracStep: error against run time</h1>\n"
      "<p>For each scene the CPU time in which the end of the motion is reached with a given relative error "
      "of q and p, "
      "beside SUNDIALS IDA on the implicit Lagrangian system and ARKODE's explicit Runge–Kutta method of "
      "order 8 on the "
      "index-reduced equations, which drifts off the constraints. A ratio above 1 means that ours is "
      "faster.</p>\n";
  text += summary(entries) +
          image(directory / "summary.svg", "time of the yardsticks over ours at the error 1e-6");
  text += "<details><summary>Machine and build</summary><dl>\n";
  for (const auto& [name, value] : build_facts())
    text += fmt::format("<dt>{}</dt><dd>{}</dd>\n", escaped(name), escaped(value));
  text += "</dl></details>\n";
  for (const PageEntry& entry : entries) text += section(entry, directory);
  return text + std::string(tail);
}

}  // namespace diracstep
