#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/reports/study_comparison.hpp>
#include <map>
#include <tuple>

namespace diracstep {

namespace {

using Key = std::tuple<std::string, std::string, int, double>;  ///< scene, method, order, and error or step

constexpr double time_noise = 1.25, error_noise = 1.05, round_off = 1e-12;

struct Earlier {
  std::map<Key, double> seconds;  ///< by the error reached
  std::map<Key, double> error;    ///< by the step
};

bool is_number(const Json& json, const char* key) { return json.contains(key) && json[key].is_number(); }

/// A number too large for an int must not become one.
int order_of(const Json& row) {
  const double order = row.at("order");
  if (order >= 0.0 && order <= 1000.0) return static_cast<int>(order);
  throw Misuse(fmt::format("the earlier study has a row of order {:g}; 0 to 1000 is needed", order));
}

Earlier read_earlier(const std::string& text) {
  Earlier earlier;
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("studies") || !json["studies"].is_array())
    throw Misuse("the earlier study is not one: it has no list \"studies\"; a study.json of --out is needed");
  try {
    for (const Json& study : json["studies"]) {
      const std::string scene = study.at("scene");
      for (const Json& at : study.at("at_error"))
        if (is_number(at, "cpu_seconds"))
          earlier.seconds[{scene, at.at("method"), order_of(at), at.at("error")}] = at["cpu_seconds"];
      for (const Json& row : study.at("rows"))
        if (is_number(row, "step") && is_number(row, "error_q") && is_number(row, "error_p"))
          earlier.error[{scene, row.at("method"), order_of(row), row["step"]}] =
              std::max(row["error_q"].get<double>(), row["error_p"].get<double>());
    }
  } catch (const Json::exception& wrong) {
    throw Misuse(std::string("the earlier study lacks something: ") + wrong.what());
  }
  return earlier;
}

std::string verdict(double ratio, double noise, const char* better, const char* worse) {
  if (ratio > noise) return better;
  return ratio < 1.0 / noise ? worse : "";
}

}  // namespace

void require_study(const std::string& json) { static_cast<void>(read_earlier(json)); }

std::vector<StudyChange> compare_studies(const std::vector<Study>& now, const std::string& before_json) {
  const Earlier earlier = read_earlier(before_json);
  std::vector<StudyChange> changes;
  for (const Study& study : now) {
    for (const AtError& at : study.at_error) {
      const auto before = earlier.seconds.find({study.scene, at.method, at.order, at.error});
      if (!at.cpu_seconds || before == earlier.seconds.end()) continue;
      const double ratio = before->second / *at.cpu_seconds;
      changes.push_back({study.scene, at.method, at.order, fmt::format("CPU to {:.0e}", at.error),
                         before->second, *at.cpu_seconds, ratio,
                         verdict(ratio, time_noise, "faster", "slower")});
    }
    for (const StudyRow& row : study.rows) {
      const auto before = earlier.error.find({study.scene, row.method, row.order, row.step});
      if (!row.ok() || row.is_baseline() || before == earlier.error.end()) continue;
      const bool exact = std::max(row.error(), before->second) < round_off;
      const double ratio = exact ? 1.0 : before->second / std::max(row.error(), 1e-300);
      changes.push_back({study.scene, row.method, row.order, fmt::format("error at step {:.4g}", row.step),
                         before->second, row.error(), ratio,
                         verdict(ratio, error_noise, "more exact", "less exact")});
    }
  }
  if (changes.empty()) throw Misuse("the earlier study shares no scene, method and order with this one");
  return changes;
}

std::string comparison_table(const std::vector<StudyChange>& changes) {
  std::vector<std::vector<std::string>> cells{
      {"scene", "method", "order", "what", "before", "now", "ratio", ""}};
  std::size_t same = 0;
  for (const StudyChange& change : changes) {
    if (change.verdict.empty()) {
      ++same;
      continue;
    }
    const bool time = change.what.starts_with("CPU");
    const auto cell = [&](double value) { return time ? time_cell(value) : fmt::format("{:.2e}", value); };
    cells.push_back({change.scene, change.method, fmt::format("{}", change.order), change.what,
                     cell(change.before), cell(change.now), fmt::format("{:.2f}", change.ratio),
                     change.verdict});
  }
  const std::string counted = fmt::format("{} of {} comparisons within the noise\n", same, changes.size());
  return (cells.size() > 1 ? aligned(cells) : "") + counted;
}

}  // namespace diracstep
