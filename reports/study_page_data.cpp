#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <diracstep/reports/report.hpp>
#include <diracstep/reports/series_style.hpp>
#include <diracstep/reports/study_json.hpp>
#include <diracstep/reports/study_page.hpp>

namespace diracstep {

namespace {

/// Six digits: more than a picture shows, in a third of the characters.
Json rounded(double value) {
  if (!std::isfinite(value)) return nullptr;
  return std::strtod(fmt::format("{:.6g}", value).c_str(), nullptr);
}

Json rounded(const std::vector<double>& values) {
  Json list = Json::array();
  for (const double value : values) list.push_back(rounded(value));
  return list;
}

Json body_json(const DrawnMotion::Body& body) {
  Json json{{"name", body.name}, {"x", body.x}, {"y", body.y}};
  if (body.heading >= 0) json["heading"] = body.heading;
  return json;
}

constexpr std::size_t numbers_of_a_motion = 12'000;  // give or take half; the files have all

/// Each so many points of the motion go to the page.
std::size_t stride(const History& history) {
  return std::max<std::size_t>(
      1, history.track_time.size() * history.motion.coordinates.size() / numbers_of_a_motion);
}

Json motion_json(const History& history) {
  const DrawnMotion& motion = history.motion;
  const std::size_t every = stride(history);
  Json json{{"form", name(motion.form)}, {"time", Json::array()}};
  for (std::size_t k = 0; k < history.track_time.size(); k += every)
    json["time"].push_back(rounded(history.track_time[k]));
  for (const char* list : {"names", "units", "numbers", "bodies", "bars", "pins", "solids", "values"})
    json[list] = Json::array();
  for (std::size_t i = 0; i < motion.coordinates.size(); ++i) {
    json["names"].push_back(motion.coordinates[i].name);
    json["units"].push_back(motion.coordinates[i].unit);
    json["numbers"].push_back(motion.coordinates[i].index + 1);
    Json values = Json::array();
    for (std::size_t k = 0; k < history.positions.size(); k += every)
      values.push_back(rounded(history.positions[k][static_cast<Eigen::Index>(i)]));
    json["values"].push_back(std::move(values));
  }
  for (const DrawnMotion::Body& body : motion.bodies) json["bodies"].push_back(body_json(body));
  for (const DrawnMotion::Bar& bar : motion.bars) json["bars"].push_back({bar.from, bar.to});
  for (const auto& pin : motion.pins) json["pins"].push_back({rounded(pin[0]), rounded(pin[1])});
  for (const DrawnMotion::Solid& solid : motion.solids)
    json["solids"].push_back({{"name", solid.name},
                              {"shape", solid.shape},
                              {"size", rounded({solid.size.begin(), solid.size.end()})},
                              {"coordinates", solid.places},
                              {"fixed", rounded({solid.fixed.begin(), solid.fixed.end()})}});
  return json;
}

Json history_json(const PageEntry& entry) {
  const History& history = entry.history;
  if (history.time.empty()) return nullptr;
  Json json{{"method", history.method},
            {"order", history.order},
            {"step", history.step},
            {"time_unit", entry.time_unit},
            {"time", rounded(history.time)},
            {"error", rounded(history.error)},
            {"energy", rounded(history.energy)},
            {"constraint", rounded(history.constraint)},
            {"invariants", Json::array()},
            {"motion", motion_json(history)}};
  for (const History::Change& change : history.invariants)
    json["invariants"].push_back({{"name", change.name}, {"values", rounded(change.values)}});
  return json;
}

}  // namespace

std::string study_page_data(const std::vector<PageEntry>& entries) {
  std::vector<Study> studies;
  for (const PageEntry& entry : entries) studies.push_back(entry.study);
  Json json = studies_document(studies);
  json["styles"] = Json::array();
  json["histories"] = Json::array();
  for (const SeriesStyle& style : series_styles(studies))
    json["styles"].push_back({{"method", style.method},
                              {"order", style.order},
                              {"label", style.label()},
                              {"colour", style.colour},
                              {"marker", style.marker}});
  for (const PageEntry& entry : entries) json["histories"].push_back(history_json(entry));
  return to_text(json);
}

}  // namespace diracstep
