#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/reports/build_facts.hpp>
#include <diracstep/reports/html_table.hpp>
#include <diracstep/reports/plot.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/reports/study_page.hpp>
#include <diracstep/reports/study_page_parts.hpp>
#include <diracstep/validation/studies/work_precision.hpp>
#include <fstream>
#include <sstream>

namespace diracstep {

namespace {

constexpr double headline_error = 1e-6;

HtmlCell seconds(std::optional<double> value) { return number_cell(value, value ? time_cell(*value) : ""); }
HtmlCell exponent(double value) { return number_cell(value, power_text(value)); }
HtmlCell whole(double value) { return number_cell(value, fmt::format("{}", value)); }

HtmlCell ratio(std::optional<double> value) {
  HtmlCell cell = number_cell(value, value ? fmt::format("{:.2f}", *value) : "");
  if (value) cell.look = *value >= 1.0 ? "better" : "worse";
  return cell;
}

std::string label(const AtError& at) { return fmt::format("{}, order {}", at.method, at.order); }

const AtError* best_at(const Study& study, double error) {
  const auto found =
      std::ranges::find_if(study.at_error, [&](const AtError& at) { return at.best && at.error == error; });
  return found == study.at_error.end() ? nullptr : &*found;
}

/// A picture of the page: `plot` tells the page what to draw, the file stands in where no script runs.
std::string figure(const std::string& plot, std::ptrdiff_t scene, const std::string& caption,
                   const std::string& description, const std::filesystem::path& svg) {
  std::string image;
  std::ifstream file(svg);
  const std::string content = (std::ostringstream() << file.rdbuf()).str();
  for (const char c : content)
    if (std::string_view("%#<>\"\n&").find(c) == std::string_view::npos)
      image += c;
    else
      image += fmt::format("%{:02X}", static_cast<unsigned char>(c));
  if (!image.empty())
    image =
        fmt::format("<img alt=\"{}\" src=\"data:image/svg+xml;charset=utf-8,{}\">", html(description), image);
  return fmt::format(
      "<figure data-plot=\"{}\" data-scene=\"{}\" data-description=\"{}\"><figcaption>{}</figcaption>{}"
      "<div class=\"tools\"></div></figure>\n",
      plot, scene, html(description), caption, image);
}

std::string facts(const PageFacts& list) {
  std::string text = "<dl>\n";
  for (const auto& [name, value] : list)
    text += fmt::format("<dt>{}</dt><dd>{}</dd>\n", html(name), html(value));
  return text + "</dl>\n";
}

// ------------------------------------------------------------------ the top of the page

std::optional<double> median(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  std::ranges::sort(values);
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : std::sqrt(values[n / 2 - 1] * values[n / 2]);
}

/// The ratio of the CPU times, the median over the scenes where both sides reach the error.
std::string tile(const std::vector<PageEntry>& entries, const std::string& baseline,
                 std::optional<double> AtError::*ratio) {
  std::vector<double> ratios;
  for (const PageEntry& entry : entries)
    if (const AtError* at = best_at(entry.study, headline_error); at != nullptr && at->*ratio)
      ratios.push_back(*(at->*ratio));
  const auto faster = std::ranges::count_if(ratios, [](double r) { return r > 1.0; });
  const auto middle = median(ratios);
  return fmt::format(
      "<li><b>{}</b><span>time of {} over ours at the error {}: the median of {} scenes; ours is faster on "
      "{}</span></li>",
      middle ? fmt::format("{:.1f}", *middle) : "–", baseline, power_text(headline_error), ratios.size(),
      faster);
}

/// Without ratios where the baselines' SUNDIALS may lack optimisation: they would rest on that.
std::string tiles(const std::vector<PageEntry>& entries) {
  if (!sundials_is_optimised()) return {};
  return fmt::format("<ul class=\"tiles\"><li><b>{}</b><span>scenes</span></li>{}{}</ul>\n", entries.size(),
                     tile(entries, "SUNDIALS IDA", &AtError::ratio),
                     tile(entries, "the explicit method", &AtError::erk_ratio));
}

/// Ratios of the times, or where SUNDIALS may lack optimisation the times: such a ratio would tell of the
/// build.
std::vector<HtmlCell> summary_row(const PageEntry& entry) {
  const Study& study = entry.study;
  const AtError* const best = best_at(study, headline_error);
  std::vector<HtmlCell> row{{fmt::format("<a href=\"#{0}\">{0}</a>", html(study.scene))},
                            words(entry.kind),
                            words(best == nullptr ? "–" : label(*best)),
                            seconds(best == nullptr ? std::nullopt : best->cpu_seconds)};
  const bool ratios = sundials_is_optimised();
  for (const auto member : {ratios ? &AtError::ratio : &AtError::ida_cpu_seconds,
                            ratios ? &AtError::erk_ratio : &AtError::erk_cpu_seconds})
    for (const double error : compared_errors) {
      const AtError* const at = best_at(study, error);
      const auto value = at == nullptr ? std::nullopt : at->*member;
      row.push_back(ratios ? ratio(value) : seconds(value));
    }
  return row;
}

std::string summary(const std::vector<PageEntry>& entries) {
  const bool ratios = sundials_is_optimised();
  HtmlTable table{{{"", 2},
                   {"fastest of ours at 1e-6", 2},
                   {ratios ? "IDA / ours at" : "IDA at", 4},
                   {ratios ? "explicit / ours at" : "explicit at", 4}},
                  {"scene", "class", "method", "CPU"},
                  {}};
  for (int baseline = 0; baseline < 2; ++baseline)
    for (const double error : compared_errors) table.header.push_back(power_text(error));
  for (const PageEntry& entry : entries) table.rows.push_back(summary_row(entry));
  return table.text();
}

// ------------------------------------------------------------------ a scene

std::string ratios(const Study& study) {
  HtmlTable table{{}, {"error", "fastest of ours", "ours", "IDA", "explicit"}, {}};
  if (sundials_is_optimised()) table.header.insert(table.header.end(), {"IDA / ours", "explicit / ours"});
  for (const double error : compared_errors)
    if (const AtError* at = best_at(study, error)) {
      std::vector<HtmlCell> row{exponent(error), words(label(*at)), seconds(at->cpu_seconds),
                                seconds(at->ida_cpu_seconds), seconds(at->erk_cpu_seconds)};
      if (sundials_is_optimised()) row.insert(row.end(), {ratio(at->ratio), ratio(at->erk_ratio)});
      table.rows.push_back(std::move(row));
    }
  return table.rows.empty() ? "<p>None of the methods reaches an error of 1e-3.</p>\n" : table.text();
}

std::vector<HtmlCell> method_row(const Study& study, const MeasuredOrder& m) {
  std::vector<HtmlCell> row{words(m.method), whole(m.order),
                            number_cell(m.slope, m.slope ? fmt::format("{:.2f}", *m.slope) : ""),
                            whole(m.points)};
  for (const double error : compared_errors) {
    const auto at = std::ranges::find_if(study.at_error, [&](const AtError& a) {
      return a.error == error && a.method == m.method && a.order == m.order;
    });
    row.push_back(seconds(at == study.at_error.end() ? std::nullopt : at->cpu_seconds));
  }
  row.push_back(words(m.ladder_end, "wide muted"));
  return row;
}

std::string methods(const Study& study) {
  HtmlTable table{{{"", 1}, {"order", 2}, {"", 1}, {"CPU time at the error", 4}, {"", 1}},
                  {"method", "stated", "measured", "points"},
                  {}};
  for (const double error : compared_errors) table.header.push_back(power_text(error));
  table.header.emplace_back("the ladder of steps ended because");
  for (const MeasuredOrder& m : study.measured_orders) table.rows.push_back(method_row(study, m));
  return table.rows.empty() ? "" : table.text();
}

/// The decisions of the plan; what is left out comes first and is shown unfolded.
std::string plan(const History& history) {
  if (history.plan.empty()) return {};
  PageFacts left_out, done;
  for (const PlanLine& line : history.plan) {
    const bool out = line.decision.starts_with("left out");
    const std::string reason = line.reason.empty() || out ? line.reason : ": " + line.reason;
    (out ? left_out : done).emplace_back(line.item, out ? reason : line.decision + reason);
  }
  std::string text;
  if (!left_out.empty())
    text += fmt::format("<h3>What {} leaves out here</h3>\n{}", html(history.method), facts(left_out));
  return text + fmt::format("<details><summary>What {} does here</summary>{}</details>\n",
                            html(history.method), facts(done));
}

std::string run_pictures(const PageEntry& entry, std::ptrdiff_t number, const std::string& stem) {
  const History& history = entry.history;
  if (history.time.empty()) return {};
  const std::string& scene = entry.study.scene;
  const std::string run =
      fmt::format("{}, order {}, step {:.3g}", html(history.method), history.order, history.step);
  std::string text;
  if (std::ranges::any_of(history.error, [](double e) { return e > 0.0; }))
    text += figure("error", number,
                   fmt::format("<b>Error over time</b> of {}, against {}", run, html(history.error_against)),
                   scene + ": error over time", stem + "-error.svg");
  text += figure("history", number,
                 fmt::format("<b>Conserved quantities</b>: energy{}{} over time, of {}",
                             history.constraint.empty() ? "" : ", constraint rows",
                             history.invariants.empty() ? "" : ", invariants", run),
                 scene + ": energy, invariants and constraint residual over time", stem + "-history.svg");
  if (!history.track_time.empty())
    text += figure("motion", number, "<b>The motion</b>", scene + ": the motion", stem + "-motion.svg");
  return text;
}

std::string pictures(const PageEntry& entry, std::ptrdiff_t number, const std::string& stem) {
  const Study& study = entry.study;
  std::string text = run_pictures(entry, number, stem);
  if (std::ranges::any_of(study.rows, [](const auto& row) { return row.ok() && !row.is_baseline(); }))
    text += figure("orders", number, "<b>Error over the step</b>; the legend gives the measured orders",
                   study.scene + ": error over the step", stem + "-orders.svg");
  const std::string& failure = entry.history.failure;
  return "<div class=\"figures\">\n" + text + "</div>\n" +
         (failure.empty() ? "" : "<p>" + html(failure) + "</p>\n");
}

std::string section(const PageEntry& entry, std::ptrdiff_t number, const std::filesystem::path& directory) {
  const Study& study = entry.study;
  const std::string stem = (directory / file_name(study.scene)).string();
  const bool any_row = std::ranges::any_of(study.rows, [](const StudyRow& row) { return row.ok(); });
  std::string text = fmt::format(
      "<section id=\"{0}\">\n<h2>{0}</h2>\n<p class=\"kind\">{1} · t = {2:g} to {3:g} · {4} "
      "unknowns</p>\n<p>{5}</p>\n",
      html(study.scene), html(entry.kind), study.t_start, study.t_end, study.unknowns,
      html(entry.description));
  if (any_row)
    text += figure("work", number,
                   "<b>Error against CPU time</b>, one point a run: to the left and down is better",
                   study.scene + ": error against CPU time of every method", stem + ".svg");
  text += "<h3>At equal error</h3>\n" + ratios(study) + pictures(entry, number, stem);
  text += "<h3>Methods and measured orders</h3>\n" + methods(study);
  text += plan(entry.history);
  return text + fmt::format(
                    "<p class=\"muted\">Reference: {} ({}), its own error {:.1e}. Data of the scene: "
                    "{}</p>\n</section>\n",
                    html(study.reference_kind), html(study.reference_how), study.reference_error,
                    html(entry.source));
}

constexpr std::string_view introduction =
    "<h1>Error against run time</h1>\n"
    "<p>DiracStep beside SUNDIALS IDA on the implicit Lagrangian system and the faster of explicit codes "
    "(ARKODE's Runge–Kutta method of order 8; on small scenes Boost.odeint's Fehlberg 7(8) and "
    "Bulirsch–Stoer) "
    "on the index-reduced equations, which drift off the constraints. For each scene: the CPU time in which "
    "the end of the motion is reached with a given relative error of q and p.</p>\n";

/// The data must not end the element they stand in.
std::string inside_script(const std::string& json) {
  std::string text;
  for (const char c : json) text += c == '<' ? std::string("\\u003c") : std::string(1, c);
  return text;
}

std::string scripts(const std::vector<PageEntry>& entries) {
  const bool bodies = std::ranges::any_of(
      entries, [](const PageEntry& entry) { return entry.history.motion.form == DrawnMotion::Form::space; });
  const std::string view =
      bodies ? fmt::format("<script>\n{}</script>\n", study_page_parts::body_view) : std::string();
  return view +
         fmt::format(
             "<script type=\"application/json\" id=\"data\">{}</script>\n<script>\n{}\n{}\n{}</script>\n",
             inside_script(study_page_data(entries)), study_page_parts::plot, study_page_parts::motion,
             study_page_parts::page);
}

}  // namespace

std::string study_page(const std::vector<PageEntry>& entries, const PageFacts& options,
                       const std::filesystem::path& directory) {
  std::string text = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<link rel=\"icon\" href=\"data:,\">\n<title>DiracStep: error against run time</title>\n"
      "<style>\n{}</style>\n</head>\n<body>\n{}",
      study_page_parts::style, introduction);
  text += fmt::format("<p><b>{}.</b>{}</p>\n", html(sundials_build()),
                      sundials_is_optimised()
                          ? ""
                          : " Debian's is compiled without, which slows the baselines most. So "
                            "this page has times and no ratios of them; "
                            "<code>./dev --optimised-sundials study</code> has.");
  text += tiles(entries);
  if (sundials_is_optimised())
    text +=
        "<p class=\"muted\">Time of the baselines over the time of the fastest of ours; above 1 ours is "
        "faster.</p>\n";
  text += summary(entries);
  if (sundials_is_optimised())
    text += figure("summary", -1, "<b>Time of the baselines over ours</b>: to the right of 1 ours is faster",
                   "time of IDA and of the explicit method over ours, for every scene",
                   directory / "summary.svg");
  PageFacts about = build_facts();
  about.insert(about.end(), options.begin(), options.end());
  text += "<h3>Machine, build and options</h3>\n" + facts(about) + "<div class=\"tools\" data-save></div>\n";
  for (std::size_t i = 0; i < entries.size(); ++i)
    text += section(entries[i], static_cast<std::ptrdiff_t>(i), directory);
  return text + scripts(entries) + "</body>\n</html>\n";
}

}  // namespace diracstep
