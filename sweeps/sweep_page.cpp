#include <fmt/format.h>

#include <cmath>
#include <diracstep/reports/html_table.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/sweeps/page_text.hpp>
#include <diracstep/sweeps/sweep_page.hpp>

namespace diracstep {

namespace {

/// As it may stand in a script of a page: no tag ends or begins in it.
std::string in_script(const std::string& json) {
  std::string text;
  for (const char c : json) text += c == '<' ? std::string("\\u003c") : std::string(1, c);
  return text;
}

std::string facts(const Sweep& sweep, const SweepReport& report, long every) {
  std::string text = fmt::format("{} members by {}: {} ok, {} doubted, {} failed.", report.members,
                                 report.method, report.ok, report.doubted, report.failed);
  if (sweep.end) text += fmt::format(" From the start to t = {:g}.", *sweep.end);
  if (every > 1) text += fmt::format(" The pictures show one member of {}.", every);
  return text;
}

void replace(std::string& text, const std::string& mark, const std::string& by) {
  for (std::size_t at = text.find(mark); at != std::string::npos; at = text.find(mark, at + by.size()))
    text.replace(at, mark.size(), by);
}

}  // namespace

void PageData::take(const std::vector<double>& numbers) {
  if (seen_++ % every_ != 0) return;
  for (std::size_t k = 0; k < columns_.size(); ++k) columns_[k].push_back(numbers[k]);
  if (columns_.empty() || columns_[0].size() <= most_members) return;
  every_ *= 2;
  for (std::vector<double>& column : columns_) {
    for (std::size_t k = 0; 2 * k < column.size(); ++k) column[k] = column[2 * k];
    column.resize((column.size() + 1) / 2);
  }
}

std::string PageData::page(const Sweep& sweep, const SweepReport& report) const {
  const auto varied = static_cast<std::ptrdiff_t>(sweep.names().size());
  Json json{{"facts", facts(sweep, report, every_)},
            {"varied", std::vector<std::string>(names_.begin(), names_.begin() + varied)},
            {"recorded", std::vector<std::string>(names_.begin() + varied, names_.end())},
            {"columns", Json::object()},
            {"summary", Json::array()},
            {"reasons", report.reasons}};
  for (std::size_t k = 0; k < names_.size(); ++k) add_member(json["columns"], names_[k], columns_[k]);
  for (const SweepColumn& column : report.columns)
    json["summary"].push_back({column.name, column.count, column.least, column.mean, column.most});
  std::string page(sweep_page_text);
  replace(page, "{scene}", html(sweep.scene));
  replace(page, "{data}", in_script(to_text(json)));
  return page;
}

}  // namespace diracstep
