#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/reports/stability_report.hpp>

namespace diracstep {

namespace {

using Cells = std::vector<std::string>;

std::string cell(double value) { return std::isfinite(value) ? fmt::format("{:.1e}", value) : "-"; }

std::string limit_cell(double limit) {
  if (std::isnan(limit)) return "-";
  return limit >= largest_tested_step ? "none" : fmt::format("{:.4g}", limit);
}

std::string drift_cell(const WatchResult& watch) {
  if (!std::isfinite(watch.drift)) return "-";
  return fmt::format("{:+.1e} ± {:.0e}", watch.drift, watch.drift_half_width);
}

Json growth_json(const LinearStability& stability) {
  Json growth = Json::array();
  for (const GrowthPoint& point : stability.growth)
    growth.push_back(
        {{"step", point.step}, {"oscillator", Json(point.oscillator)}, {"damping", Json(point.damping)}});
  return growth;
}

Json ida_json(const IdaBeside& ida) {
  return {{"rtol", ida.rtol},
          {"status", ida.status},
          {"error", Json(ida.error)},
          {"deviation", Json(ida.deviation)},
          {"constraint", Json(ida.constraint)},
          {"cpu_seconds", Json(ida.cpu_seconds)}};
}

Json row_json(const StabilityRow& row) {
  Json json{{"method", row.method},    {"order", row.order}, {"outcome", name(row.outcome)},
            {"message", row.message},  {"steps", row.steps}, {"t_reached", Json(row.t_reached)},
            {"watches", Json::array()}};
  for (const WatchResult& watch : row.watches)
    json["watches"].push_back({{"name", watch.name},
                               {"band", Json(watch.band)},
                               {"drift", Json(watch.drift)},
                               {"drift_half_width", Json(watch.drift_half_width)},
                               {"bounded_until", Json(watch.bounded_until)}});
  json["constraint"] = Json(row.constraint);
  json["error"] = Json(row.error);
  json["failed_solves"] = row.failed_solves;
  json["newton_iterations"] = row.newton_iterations;
  json["cpu_seconds"] = Json(row.cpu_seconds);
  json["ida"] = row.ida ? ida_json(*row.ida) : Json(nullptr);
  return json;
}

bool has_reference(const StabilityCase& that) {
  return that.scene.reference.at && that.scene.reference.at(that.t_end);
}

Json case_json(const StabilityResult& result) {
  const StabilityCase& that = result.that;
  Json json{{"group", that.group},
            {"value", that.value},
            {"case", that.name},
            {"scene", that.scene.scene->name},
            {"parameters", Json::object()},
            {"step", that.step},
            {"t_end", that.t_end},
            {"accuracy", that.accuracy},
            {"reference", has_reference(that) ? Json(that.scene.reference.how) : Json(nullptr)}};
  for (const auto& [key, value] : that.scene.parameters) json["parameters"][key] = Json(value);
  for (const char* key : {"rows", "ida"}) json[key] = Json::array();
  for (const StabilityRow& row : result.rows) json["rows"].push_back(row_json(row));
  for (const IdaBeside& ida : result.ida) json["ida"].push_back(ida_json(ida));
  return json;
}

Cells case_cells(const StabilityRow& row) {
  Cells cells{fmt::format("{}, order {}", row.method, row.order), name(row.outcome),
              std::to_string(row.steps), cell(row.t_reached)};
  WatchResult none;
  double bounded_until = row.watches.empty() ? std::nan("") : row.watches.front().bounded_until;
  for (const WatchResult& watch : row.watches) bounded_until = std::min(bounded_until, watch.bounded_until);
  const WatchResult& first = row.watches.empty() ? none : row.watches.front();
  cells.insert(cells.end(), {cell(bounded_until), cell(first.band), drift_cell(first)});
  std::string others;
  for (std::size_t k = 1; k < row.watches.size(); ++k)
    others += (others.empty() ? "" : ", ") + cell(row.watches[k].band);
  cells.insert(cells.end(), {others.empty() ? "-" : others, cell(row.constraint), cell(row.error),
                             std::to_string(row.failed_solves), cell(row.cpu_seconds)});
  cells.push_back(row.ida ? fmt::format("{:.0e}: {}", row.ida->rtol,
                                        row.ida->ok() ? cell(row.ida->error) + ", " + cell(row.ida->deviation)
                                                      : "stopped")
                          : "-");
  return cells;
}

// ---- Markdown

std::string letter(const StabilityRow& row) {
  switch (row.outcome) {
    case StabilityOutcome::accurate:
      return "**A**";
    case StabilityOutcome::bounded:
      return "B";
    case StabilityOutcome::doubted:
      return "d";
    case StabilityOutcome::stopped:
      return "s";
    case StabilityOutcome::refused:
      return "r";
    case StabilityOutcome::wrong:
      return "**✗**";
  }
  return "?";
}

std::string markdown_row(const Cells& cells) {
  std::string line = "|";
  for (const std::string& text : cells) line += ' ' + text + " |";
  return line + '\n';
}

std::string markdown(const std::vector<Cells>& rows) {
  std::string text = markdown_row(rows.front()) + markdown_row(Cells(rows.front().size(), "---"));
  for (std::size_t k = 1; k < rows.size(); ++k) text += markdown_row(rows[k]);
  return text;
}

std::vector<Cells> linear_cells(const std::vector<LinearStability>& linear) {
  std::vector<Cells> rows{
      {"method", "order", "hω up to", "radius at hω = 1e6", "hγ up to", "damping at hγ = 1e6"}};
  for (const LinearStability& stability : linear) {
    const GrowthPoint& last = stability.growth.back();
    const auto radius = [](double value) {
      return std::isfinite(value) ? fmt::format("{:.3g}", value) : "-";
    };
    rows.push_back({stability.method, std::to_string(stability.order), limit_cell(stability.oscillator_limit),
                    radius(last.oscillator), limit_cell(stability.damping_limit), radius(last.damping)});
  }
  return rows;
}

std::vector<Cells> outcome_cells(const std::vector<StabilityResult>& results) {
  std::vector<Cells> rows{{"case"}};
  for (const StabilityRow& row : results.front().rows)
    rows.front().push_back(fmt::format("{} {}", row.method, row.order));
  for (const StabilityResult& result : results) {
    rows.push_back({result.that.name});
    for (const StabilityRow& row : result.rows) rows.back().push_back(letter(row));
    rows.back().resize(rows.front().size());
  }
  return rows;
}

/// The accurate row of least error, else the bounded one of least band; null where there is neither.
const StabilityRow* best(const StabilityResult& result) {
  const StabilityRow* found = nullptr;
  for (const StabilityRow& row : result.rows) {
    if (row.outcome != StabilityOutcome::accurate && row.outcome != StabilityOutcome::bounded) continue;
    const auto key = [](const StabilityRow& r) {
      const bool accurate = r.outcome == StabilityOutcome::accurate;
      return std::pair(!accurate, accurate ? r.error : r.watches.empty() ? 0.0 : r.watches.front().band);
    };
    if (found == nullptr || key(row) < key(*found)) found = &row;
  }
  return found;
}

std::vector<Cells> best_cells(const std::vector<StabilityResult>& results) {
  std::vector<Cells> rows{{"case", "method", "error", "energy band", "drift per unit time", "constraint",
                           "CPU s", "IDA: rtol", "error", "deviation", "constraint"}};
  for (const StabilityResult& result : results) {
    const StabilityRow* row = best(result);
    if (row == nullptr) continue;
    const WatchResult watch = row->watches.empty() ? WatchResult{} : row->watches.front();
    rows.push_back({result.that.name, fmt::format("{} {}", row->method, row->order), cell(row->error),
                    cell(watch.band), drift_cell(watch), cell(row->constraint), cell(row->cpu_seconds)});
    const IdaBeside ida = row->ida.value_or(IdaBeside{});
    if (!row->ida || !ida.ok())
      rows.back().insert(rows.back().end(), {row->ida ? "stopped" : "-", "-", "-", "-"});
    else
      rows.back().insert(rows.back().end(),
                         {cell(ida.rtol), cell(ida.error), cell(ida.deviation), cell(ida.constraint)});
  }
  return rows;
}

}  // namespace

std::string linear_stability_table(const std::vector<LinearStability>& linear) {
  return "linear stability\n" + aligned(linear_cells(linear));
}

std::string stability_table(const StabilityResult& result) {
  std::string others;
  const auto& watches = result.that.watches;
  for (std::size_t k = 1; k < watches.size(); ++k) others += (k == 1 ? "" : ", ") + watches[k].name;
  const std::string first = watches.empty() ? "watch" : watches.front().name;
  std::vector<Cells> rows{{"method", "outcome", "steps", "t", "bounded until", first + " band",
                           "drift per unit time", others.empty() ? "others" : others, "constraint", "error",
                           "failed", "CPU s", "IDA at that cost: error, deviation"}};
  for (const StabilityRow& row : result.rows) rows.push_back(case_cells(row));
  std::string text = fmt::format("{}, step {:g}, to t = {:g}\n{}", result.that.name, result.that.step,
                                 result.that.t_end, aligned(rows));
  for (const StabilityRow& row : result.rows)
    if (!row.message.empty()) text += fmt::format("{}, order {}: {}\n", row.method, row.order, row.message);
  for (const IdaBeside& ida : result.ida)
    if (!ida.ok()) text += fmt::format("IDA, rtol {:g}: {}\n", ida.rtol, ida.status);
  return text;
}

std::string stability_json(const std::vector<LinearStability>& linear,
                           const std::vector<StabilityResult>& results) {
  Json json{{"growth_tolerance", growth_tolerance}, {"linear", Json::array()}, {"cases", Json::array()}};
  for (const LinearStability& stability : linear)
    json["linear"].push_back({{"method", stability.method},
                              {"order", stability.order},
                              {"oscillator_limit", Json(stability.oscillator_limit)},
                              {"damping_limit", Json(stability.damping_limit)},
                              {"growth", growth_json(stability)}});
  for (const StabilityResult& result : results) json["cases"].push_back(case_json(result));
  return to_text(json, 2);
}

std::string stability_markdown(const std::vector<LinearStability>& linear,
                               const std::vector<StabilityResult>& results) {
  std::string text;
  if (!linear.empty()) text += "### Linear stability\n\n" + markdown(linear_cells(linear));
  if (results.empty()) return text;
  text += "\n### Outcomes\n\n" + markdown(outcome_cells(results));
  return text + "\n### The best of each case, and IDA at its cost\n\n" + markdown(best_cells(results));
}

}  // namespace diracstep
