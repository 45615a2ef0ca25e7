#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/reports/report.hpp>
#include <iterator>
#include <sstream>

namespace diracstep {

namespace {

using Cells = std::vector<std::string>;

std::string error_cell(double value) { return std::isfinite(value) ? fmt::format("{:.2e}", value) : "-"; }

/// Three significant digits, and no exponent from 1 to 1e6.
std::string short_number(double value) {
  return value < 100.0 ? fmt::format("{:#.3g}", value) : fmt::format("{:.0f}", value);
}

/// How far the times lie from their median: "-3 % +8 % of 5".
std::string spread_cell(const CpuSeconds& cpu) {
  if (cpu.repeats < 2) return cpu.repeats == 0 ? "-" : "one run";
  return fmt::format("{:+.0f} % {:+.0f} % of {}", 100.0 * (cpu.min / cpu.median - 1.0),
                     100.0 * (cpu.max / cpu.median - 1.0), cpu.repeats);
}

std::string status_cell(const StudyRow& row) {
  if (!row.is_baseline() || !std::isfinite(row.self_error)) return row.status;
  return fmt::format("{}, by its own estimate {:.0e}", row.status, row.self_error);
}

std::size_t width(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count_if(text, [](char c) { return (c & 0xC0) != 0x80; }));
}

/// A text that begins in some column, broken between words so that no line goes beyond `line_width`.
std::string broken(const std::string& text, std::size_t column, std::size_t line_width) {
  std::string lines;
  std::size_t at = column;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (at > column && at + 1 + width(word) > line_width) {
      lines += '\n' + std::string(column, ' ');
      at = column;
    } else if (at > column) {
      lines += ' ';
      ++at;
    }
    lines += word;
    at += width(word);
  }
  return lines;
}

Cells row_cells(const StudyRow& row) {
  return {row.method == ida_method ? "IDA, " + row.formulation : row.method,
          row.is_baseline() ? "" : fmt::format("{}", row.order),
          row.is_baseline() ? fmt::format("rtol {:g}", row.rtol)
                            : (std::isfinite(row.step) ? fmt::format("{:.4g}", row.step) : "-"),
          fmt::format("{}", row.steps),
          error_cell(row.error_q),
          error_cell(row.error_p),
          error_cell(row.constraint),
          error_cell(row.energy_error),
          time_cell(row.cpu_seconds.median),
          spread_cell(row.cpu_seconds),
          fmt::format("{}", row.newton_iterations),
          status_cell(row)};
}

std::string rows_table(const Study& study) {
  std::vector<Cells> cells{{"method", "order", "step", "steps", "error q", "error p", "constraint", "energy",
                            "CPU", "spread", "Newton", "status"}};
  for (const StudyRow& row : study.rows) cells.push_back(row_cells(row));
  return aligned(cells);
}

std::string order_table(const Study& study) {
  std::vector<Cells> cells{{"method", "order", "measured", "points", "the ladder ended because"}};
  for (const MeasuredOrder& m : study.measured_orders)
    cells.push_back({m.method, fmt::format("{}", m.order), m.slope ? fmt::format("{:.2f}", *m.slope) : "-",
                     fmt::format("{}", m.points),
                     m.ladder_end.empty() ? "the steps were given" : m.ladder_end});
  return aligned(cells);
}

bool has_run(const Study& study, const std::string& method, int order) {
  return std::ranges::any_of(study.rows, [&](const StudyRow& row) {
    return row.ok() && row.method == method && row.order == order;
  });
}

std::string comparison_table(const Study& study) {
  const auto cell = [](const std::optional<double>& seconds) { return seconds ? time_cell(*seconds) : "-"; };
  const auto ratio = [](const std::optional<double>& r) { return r ? fmt::format("{:.2f}", *r) : "-"; };
  const bool with_ratios = sundials_is_optimised();
  std::vector<Cells> cells{with_ratios ? Cells{"error", "method", "order", "CPU", "IDA", "IDA / ours",
                                               "explicit", "explicit / ours", ""}
                                       : Cells{"error", "method", "order", "CPU", "IDA", "explicit", ""}};
  for (const AtError& at : study.at_error) {
    if (!has_run(study, at.method, at.order)) continue;
    Cells row{fmt::format("{:.0e}", at.error), at.method, fmt::format("{}", at.order), cell(at.cpu_seconds),
              cell(at.ida_cpu_seconds)};
    if (with_ratios) row.push_back(ratio(at.ratio));
    row.push_back(cell(at.erk_cpu_seconds));
    if (with_ratios) row.push_back(ratio(at.erk_ratio));
    row.emplace_back(at.best ? "fastest of ours" : "");
    cells.push_back(std::move(row));
  }
  return aligned(cells);
}

std::string csv_number(double value) { return std::isfinite(value) ? fmt::format("{:.17g}", value) : ""; }

std::string csv_line(const Study& study, const StudyRow& row) {
  const bool baseline = row.is_baseline(), timed = row.cpu_seconds.repeats > 0;
  const auto time = [&](double seconds) { return timed ? csv_number(seconds) : std::string(); };
  const Cells fields{csv_field(study.scene),
                     csv_field(row.method),
                     baseline ? "" : fmt::format("{}", row.order),
                     baseline ? "" : name(study.momentum),
                     csv_number(row.step),
                     csv_number(row.rtol),
                     csv_field(row.status),
                     csv_number(row.error_q),
                     csv_number(row.error_p),
                     csv_number(row.self_error),
                     csv_number(row.constraint),
                     csv_number(row.energy_error),
                     time(row.cpu_seconds.median),
                     time(row.cpu_seconds.min),
                     time(row.cpu_seconds.max),
                     fmt::format("{}", row.cpu_seconds.repeats),
                     fmt::format("{}", row.steps),
                     fmt::format("{}", row.newton_iterations),
                     fmt::format("{}", row.residual_evaluations),
                     fmt::format("{}", row.jacobian_evaluations),
                     row.formulation};
  return fmt::format("{}\n", fmt::join(fields, ","));
}

}  // namespace

std::string aligned(const std::vector<std::vector<std::string>>& rows, std::size_t line_width) {
  std::vector<std::size_t> widths;
  for (const Cells& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], width(row[i]));
  }
  std::size_t before_last = 0;
  for (std::size_t i = 0; i + 1 < widths.size(); ++i) before_last += widths[i] + 2;
  std::string text;
  for (const Cells& row : rows) {
    std::string line;
    for (std::size_t i = 0; i + 1 < row.size(); ++i)
      line += row[i] + std::string(widths[i] - width(row[i]) + 2, ' ');
    if (!row.empty()) line += line_width == 0 ? row.back() : broken(row.back(), before_last, line_width);
    text += line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
  }
  return text;
}

std::string study_table(const Study& study) {
  std::string title = fmt::format("{}: t = {:g} to {:g}, {} unknowns, momentum {}", study.scene,
                                  study.t_start, study.t_end, study.unknowns, name(study.momentum));
  for (const auto& [key, value] : study.parameters) title += fmt::format(", {} = {:g}", key, value);
  const std::string reference = fmt::format("reference: {} ({}), its own error {}", study.reference_kind,
                                            study.reference_how, error_cell(study.reference_error));
  return fmt::format("{}\n{}\n\n{}\n{}\n{}{}", title, reference, rows_table(study), order_table(study),
                     comparison_table(study), study.interrupted ? "\ninterrupted\n" : "");
}

std::string at_error_markdown(const Study& study) {
  std::vector<MeasuredOrder> series = study.measured_orders;
  std::erase_if(series, [&](const MeasuredOrder& m) { return !has_run(study, m.method, m.order); });
  std::string text =
      fmt::format("## `{}`, t = {:g} to {:g}\n\n| error |", study.scene, study.t_start, study.t_end);
  std::string rule = "|---|";
  for (const MeasuredOrder& m : series) {
    text += fmt::format(" `{}`, order {} |", m.method, m.order);
    rule += "---|";
  }
  text += " IDA | explicit |\n" + rule + "---|---|\n";
  for (const double error : compared_errors) {
    text += fmt::format("| {:.0e} |", error);
    std::optional<double> ida, erk;
    for (const MeasuredOrder& m : series)
      for (const AtError& at : study.at_error) {
        if (at.error != error || at.method != m.method || at.order != m.order) continue;
        const std::string cell = at.cpu_seconds ? time_cell(*at.cpu_seconds) : "-";
        text += at.best ? " **" + cell + "** |" : " " + cell + " |";
        ida = at.ida_cpu_seconds;
        erk = at.erk_cpu_seconds;
      }
    text += fmt::format(" {} | {} |\n", ida ? time_cell(*ida) : "-", erk ? time_cell(*erk) : "-");
  }
  return text + '\n';
}

namespace {

std::string time_or_dash(const std::optional<double>& time) { return time ? time_cell(*time) : "-"; }
std::string ratio_or_dash(const std::optional<double>& r) { return r ? fmt::format("{:.2f}", *r) : "-"; }

/// The lines that name the SUNDIALS of a table of times.
std::string build_line(bool with_ratios) {
  return "Times with " + sundials_build() +
         (with_ratios
              ? ""
              : ";\nratios only with one that is known to be optimised: ./dev --optimised-sundials study");
}

std::vector<const AtError*> fastest_of_ours(const Study& study) {
  std::vector<const AtError*> found;
  for (const AtError& at : study.at_error)
    if (at.best) found.push_back(&at);
  return found;
}

/// A cell of a fixed width; a longer text pushes the rest on.
std::string fixed(const std::string& text, std::size_t columns, bool right = false) {
  const std::string blanks(width(text) < columns ? columns - width(text) : 0, ' ');
  return right ? blanks + text : text + blanks;
}

std::string summary_row(const Cells& cells, bool with_ratios) {
  std::string line = fixed(cells[0], 28) + fixed(cells[1], 7) + fixed(cells[2], 18) + fixed(cells[3], 6);
  for (const std::size_t time : {4, 5, 7}) {
    line += fixed(cells[time], 9, true);
    if (with_ratios && time != 4) line += fixed(cells[time + 1], 8, true);
  }
  return line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
}

}  // namespace

std::string summary_markdown(const std::vector<Study>& studies, bool with_ratios) {
  std::string text = build_line(with_ratios) + ".\n\n";
  text += with_ratios
              ? "| scene | error | fastest of ours | ours | IDA | IDA / ours | explicit | explicit / ours |\n"
                "|---|---|---|---|---|---|---|---|\n"
              : "| scene | error | fastest of ours | ours | IDA | explicit |\n|---|---|---|---|---|---|\n";
  for (const Study& study : studies)
    for (const AtError* at : fastest_of_ours(study)) {
      text += fmt::format("| `{}` | {:.0e} | `{}`, order {} | {} | {} |", study.scene, at->error, at->method,
                          at->order, time_or_dash(at->cpu_seconds), time_or_dash(at->ida_cpu_seconds));
      if (with_ratios) text += fmt::format(" {} |", ratio_or_dash(at->ratio));
      text += fmt::format(" {} |", time_or_dash(at->erk_cpu_seconds));
      text += with_ratios ? fmt::format(" {} |\n", ratio_or_dash(at->erk_ratio)) : "\n";
    }
  return text;
}

std::string summary_head(bool with_ratios) {
  return build_line(with_ratios) + "\n\n" +
         summary_row(
             {"scene", "error", "fastest of ours", "order", "ours", "IDA", "/ours", "explicit", "/ours"},
             with_ratios);
}

std::string summary_rows(const Study& study, bool with_ratios) {
  std::string text;
  for (const double error : compared_errors) {
    const auto found = std::ranges::find_if(
        study.at_error, [&](const AtError& each) { return each.error == error && each.best; });
    const std::string scene = text.empty() ? study.scene : "";
    if (found == study.at_error.end()) {
      const bool hidden = std::isfinite(study.reference_error) && error < study.reference_error;
      text += summary_row(
          {scene, power_text(error), hidden ? "reference ends" : "not reached", "", "-", "-", "", "-", ""},
          with_ratios);
      continue;
    }
    text += summary_row(
        {scene, power_text(error), found->method, fmt::format("{}", found->order),
         time_or_dash(found->cpu_seconds), time_or_dash(found->ida_cpu_seconds), ratio_or_dash(found->ratio),
         time_or_dash(found->erk_cpu_seconds), ratio_or_dash(found->erk_ratio)},
        with_ratios);
  }
  return text;
}

std::string summary_line(const Study& study) {
  std::string text = study.scene + ":";
  for (const AtError* at : fastest_of_ours(study))
    text += fmt::format("{} {} {}, order {}: {} (IDA {}, explicit {})", text.back() == ':' ? "" : ";",
                        power_text(at->error), at->method, at->order, time_or_dash(at->cpu_seconds),
                        time_or_dash(at->ida_cpu_seconds), time_or_dash(at->erk_cpu_seconds));
  return text + (text.back() == ':' ? " no method reaches an error of 1e-3\n" : "\n");
}

std::string power_text(double power_of_ten) {
  return fmt::format("1e{}", std::lround(std::log10(power_of_ten)));
}

std::string studies_csv(const std::vector<Study>& studies) {
  std::string text =
      "scene,method,order,momentum,step,rtol,status,error_q,error_p,self_error,constraint,energy_error,"
      "cpu_seconds_median,cpu_seconds_min,cpu_seconds_max,repeats,steps,newton_iterations,residual_"
      "evaluations,"
      "jacobian_evaluations,formulation\n";
  for (const Study& study : studies)
    for (const StudyRow& row : study.rows) text += csv_line(study, row);
  return text;
}

std::string time_cell(double seconds) {
  if (!std::isfinite(seconds) || seconds <= 0.0) return "-";
  if (seconds < 1e-3) return short_number(seconds * 1e6) + " µs";
  if (seconds < 1.0) return short_number(seconds * 1e3) + " ms";
  return short_number(seconds) + " s";
}

std::string csv_field(std::string_view text) {
  if (text.find_first_of(",\"\n\r") == std::string_view::npos) return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

}  // namespace diracstep
