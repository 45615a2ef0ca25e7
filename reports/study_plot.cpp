#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/reports/plot.hpp>
#include <diracstep/reports/study_plot.hpp>
#include <functional>
#include <limits>
#include <string_view>

namespace diracstep {

namespace {

/// Okabe and Ito's colours, told apart with any colour vision, without black and grey, which are the
/// baselines', and without yellow.  The page of the study has the same, see study_page/style.css.
constexpr std::array<std::string_view, 6> colours{"#0072B2", "#D55E00", "#009E73",
                                                  "#CC79A7", "#E69F00", "#56B4E9"};
/// Full ones and then hollow ones, told apart in grey print; squares and triangles that are hollow are the
/// baselines'.
constexpr std::array<int, 8> markers{7, 5, 9, 13, 11, 6, 12, 10};
constexpr std::array<std::string_view, 4> dashes{"solid", "(9,4)", "(2,3)", "(9,3,2,3)"};
constexpr double largest_drawn = 10.0;  // errors above it show no trend
constexpr double drawn_zero = 1e-16;    // smaller changes are below the spacing of numbers
constexpr double summary_error = 1e-6;
constexpr double shown_near_reference = 10.0;
constexpr std::size_t max_trails = 8;  // of bodies in one picture

constexpr std::string_view study_style = R"(set encoding utf8
set logscale xy
set format x '10^{%L}'
set format y '10^{%L}'
set border 3 linewidth 1.2 linecolor '#404040'
set tics nomirror out scale 0.7,0.35
set mxtics 10
unset mytics
set grid xtics ytics linetype 1 linewidth 0.7 linecolor '#D9D9D9' dashtype solid
set key outside right center Left reverse samplen 2.4 spacing 1.3 width 1 noenhanced
)";

struct StudyCurve {
  std::string label, look;
  std::string data = {};  // lines "x y"

  void add(double x, double y) {
    if (std::isfinite(x) && std::isfinite(y)) data += fmt::format("{:.6e} {:.6e}\n", x, y);
  }
};

std::string line_look(std::size_t k) {
  return fmt::format("with lines linewidth 1.5 dashtype {} linecolor '{}'", dashes[k % dashes.size()],
                     colours[k % colours.size()]);
}

std::string axes(const std::string& title, const std::string& x, const std::string& y) {
  return fmt::format(
      "set title {} noenhanced offset 0,-0.3\nset xlabel {} noenhanced offset 0,0.2\n"
      "set ylabel {} noenhanced offset 0.6,0\n",
      gnuplot_text(title), gnuplot_text(x), gnuplot_text(y));
}

std::string plotted(std::vector<StudyCurve> curves) {
  std::erase_if(curves, [](const StudyCurve& curve) { return curve.data.empty(); });
  std::string data, plots;
  for (std::size_t i = 0; i < curves.size(); ++i) {
    data += fmt::format("$curve{} << EOD\n{}EOD\n", i, curves[i].data);
    plots += fmt::format("{}$curve{} {} title {}", i == 0 ? "plot " : ", \\\n     ", i, curves[i].look,
                         gnuplot_text(curves[i].label));
  }
  return data + plots + "\n";
}

/// Smaller errors are those of the reference.
double smallest_drawn(const Study& study) {
  return std::isfinite(study.reference_error) ? study.reference_error : 0.0;
}

/// A level line where the reference ends, if the picture goes down to it.
std::string reference_line(const Study& study, const std::vector<StudyCurve>& curves) {
  const double own = smallest_drawn(study);
  const bool near = std::ranges::any_of(study.rows, [&](const StudyRow& row) {
    return row.ok() && row.error() > 0.0 && row.error() < shown_near_reference * own;
  });
  if (!near || curves.empty()) return {};
  return fmt::format(
      "set arrow from graph 0, first {0:.3e} to graph 1, first {0:.3e} nohead linewidth 1 dashtype (4,4) "
      "linecolor '#808080'\nset label 'own error of the reference' at graph 0.01, first {0:.3e} offset "
      "0,0.5 "
      "textcolor '#606060'\n",
      own);
}

/// Few enough tics that their labels stand apart, whatever shape an equal scale gives the picture.
std::string tics(const char* axis, double least, double most) {
  if (!(most > least)) return {};
  const double rough = (most - least) / 3.0, power = std::pow(10.0, std::floor(std::log10(rough)));
  const double nice = rough >= 5.0 * power ? 5.0 : rough >= 2.0 * power ? 2.0 : 1.0;
  return fmt::format("set {}tics {:g}\n", axis, nice * power);
}

using Abscissa = std::function<double(const StudyRow&)>;

using Choice = std::function<bool(const StudyRow&)>;

void add_rows(StudyCurve& curve, const Study& study, const Choice& chosen, const Abscissa& x) {
  for (const StudyRow& row : study.rows)
    if (row.ok() && chosen(row) && row.error() > smallest_drawn(study) && row.error() <= largest_drawn)
      curve.add(x(row), row.error());
}

std::vector<StudyCurve> curves_of(const Study& study, const std::vector<SeriesStyle>& styles,
                                  const Abscissa& x) {
  std::vector<StudyCurve> all;
  for (const SeriesStyle& s : styles) {
    all.push_back(
        {s.label(), fmt::format("with linespoints linewidth 2 dashtype {} pointtype {} "
                                "pointsize 0.85 linecolor '{}'",
                                dashes[s.marker % dashes.size()], markers[s.marker % markers.size()],
                                colours[s.colour % colours.size()])});
    add_rows(
        all.back(), study,
        [&](const StudyRow& row) { return row.method == s.method && row.order == s.order; }, x);
  }
  return all;
}

/// A curve of IDA for each formulation it runs in.
void add_baselines(std::vector<StudyCurve>& curves, const Study& study, const Abscissa& x) {
  std::vector<std::string> formulations;
  for (const StudyRow& row : study.rows)
    if (row.method == ida_method && std::ranges::find(formulations, row.formulation) == formulations.end())
      formulations.push_back(row.formulation);
  for (std::size_t i = 0; i < formulations.size(); ++i) {
    curves.push_back({"IDA, " + formulations[i],
                      fmt::format("with linespoints linewidth 2 dashtype {} pointtype 4 pointsize 0.95 "
                                  "linecolor '#000000'",
                                  dashes[i % dashes.size()])});
    add_rows(
        curves.back(), study, [&](const StudyRow& row) { return row.formulation == formulations[i]; }, x);
  }
  curves.push_back({"explicit",
                    "with linespoints linewidth 2 dashtype (6,4) pointtype 8 pointsize 0.95 "
                    "linecolor '#707070'"});
  add_rows(
      curves.back(), study, [](const StudyRow& row) { return row.method == erk_method; }, x);
}

std::vector<double> component(const std::vector<Vector>& points, int i) {
  std::vector<double> values;
  for (const Vector& point : points) values.push_back(point[i]);
  return values;
}

StudyCurve curve(std::string label, std::size_t k, const std::vector<double>& x,
                 const std::vector<double>& y) {
  StudyCurve drawn{std::move(label), line_look(k)};
  for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i) drawn.add(x[i], y[i]);
  return drawn;
}

StudyCurve logarithmic(std::string label, std::size_t k, const History& history, std::vector<double> values) {
  for (double& value : values) value = std::max(std::abs(value), drawn_zero);
  return curve(std::move(label), k, history.time, values);
}

std::string in_unit(const std::string& name, const std::string& unit) {
  return unit.empty() ? name : fmt::format("{} [{}]", name, unit);
}

std::string run_title(const History& history, const std::string& scene) {
  return fmt::format("{}: {} order {}, step {:.3g}", scene, history.method, history.order, history.step);
}

std::string history_script(const History& history, const std::string& title, const std::string& time) {
  std::vector<StudyCurve> curves{logarithmic("total energy", 0, history, history.energy)};
  if (!history.constraint.empty()) curves.push_back(logarithmic("rows", 1, history, history.constraint));
  for (const History::Change& invariant : history.invariants)
    curves.push_back(logarithmic(invariant.name, curves.size(), history, invariant.values));
  return std::string(study_style) +
         "unset logscale x\nunset mxtics\nset format x '%g'\nset yrange [1e-16:*]\n" +
         tics("x", history.time.front(), history.time.back()) +
         axes(title, time, "relative change, or violation [1]") + plotted(curves);
}

std::string error_script(const History& history, const std::string& title, const std::string& time,
                         const std::vector<SeriesStyle>& styles) {
  const auto style_of = std::ranges::find(styles, history.method, &SeriesStyle::method);
  StudyCurve error{"error",
                   fmt::format("with lines linewidth 1.5 linecolor '{}'",
                               colours[style_of == styles.end() ? 0 : style_of->colour % colours.size()])};
  for (std::size_t i = 0; i < history.time.size(); ++i)
    if (history.time[i] > history.time.front() && history.error[i] > 0.0)
      error.add(history.time[i] - history.time.front(), history.error[i]);
  if (error.data.empty()) return {};
  return std::string(study_style) + axes(title, time, "error over largest q, p [1]") +
         fmt::format("set key off\n{}", plotted({error}));
}

/// The range of a coordinate of all bodies.
std::string tics(const char* axis, const History& history, int DrawnMotion::Body::*coordinate) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const Vector& at : history.positions)
    for (const DrawnMotion::Body& body : history.motion.bodies) {
      least = std::min(least, at[body.*coordinate]);
      most = std::max(most, at[body.*coordinate]);
    }
  return tics(axis, least, most);
}

std::string plane_script(const History& history) {
  const DrawnMotion& motion = history.motion;
  const auto& x = motion.coordinates[static_cast<std::size_t>(motion.bodies[0].x)];
  const auto& y = motion.coordinates[static_cast<std::size_t>(motion.bodies[0].y)];
  std::vector<StudyCurve> curves;
  const std::size_t every = (motion.bodies.size() + max_trails - 1) / max_trails;
  for (std::size_t i = every - 1; i < motion.bodies.size(); i += every) {
    const DrawnMotion::Body& body = motion.bodies[i];
    curves.push_back(curve(body.name, curves.size(), component(history.positions, body.x),
                           component(history.positions, body.y)));
  }
  const std::string key = curves.size() < 2 ? "set key off\n" : "";
  const std::string equal = x.unit == y.unit ? "set size ratio -1\n" : "";
  return key + equal + tics("x", history, &DrawnMotion::Body::x) + tics("y", history, &DrawnMotion::Body::y) +
         axes("", in_unit(motion.bodies.size() > 1 ? "x" : x.name, x.unit),
              in_unit(motion.bodies.size() > 1 ? "y" : y.name, y.unit)) +
         plotted(curves);
}

/// The elements over their number at a few times.
std::string profile_script(const History& history) {
  std::vector<StudyCurve> curves;
  std::vector<double> number;
  for (const auto& c : history.motion.coordinates) number.push_back(c.index + 1);
  constexpr std::size_t times = 5;
  for (std::size_t k = 0; k < times; ++k) {
    const std::size_t i = k * (history.track_time.size() - 1) / (times - 1);
    const Vector& q = history.positions[i];
    curves.push_back(
        curve(fmt::format("t = {:.3g}", history.track_time[i]), k, number, {q.begin(), q.end()}));
  }
  const auto& first = history.motion.coordinates.front();
  const std::string family = first.name.substr(0, first.name.find_last_of('_'));
  return tics("x", number.front(), number.back()) + axes("", "number [1]", in_unit(family, first.unit)) +
         plotted(curves);
}

std::string curves_script(const History& history, const std::string& time) {
  std::vector<StudyCurve> curves;
  for (std::size_t i = 0; i < history.motion.coordinates.size(); ++i) {
    const auto& c = history.motion.coordinates[i];
    curves.push_back(curve(in_unit(c.name, c.unit), i, history.track_time,
                           component(history.positions, static_cast<int>(i))));
  }
  return tics("x", history.track_time.front(), history.track_time.back()) + axes("", time, "coordinates") +
         plotted(curves);
}

/// The ways of the centres of bodies, in space.
std::string space_script(const History& history) {
  std::string data, plots;
  std::size_t drawn = 0;
  for (const DrawnMotion::Solid& solid : history.motion.solids) {
    if (solid.places.empty() || drawn == max_trails) continue;
    data += fmt::format("$body{} << EOD\n", drawn);
    for (const Vector& at : history.positions)
      data += fmt::format("{:.6g} {:.6g} {:.6g}\n", at[solid.places[0]], at[solid.places[1]],
                          solid.places.size() == 7 ? at[solid.places[2]] : 0.0);
    data += "EOD\n";
    plots += fmt::format("{}$body{} with lines lw 1.5 title {} noenhanced", drawn == 0 ? "" : ", ", drawn,
                         gnuplot_text(solid.name));
    ++drawn;
  }
  return data + "set view equal xyz\nset xlabel 'x [m]'\nset ylabel 'y [m]'\nset zlabel 'z [m]'\nsplot " +
         plots + '\n';
}

std::string motion_script(const History& history, const std::string& time) {
  const std::string linear = std::string(study_style) + "unset logscale\nunset mxtics\nset format '%g'\n";
  switch (history.motion.form) {
    case DrawnMotion::Form::space:
      return linear + space_script(history);
    case DrawnMotion::Form::plane:
      return linear + plane_script(history);
    case DrawnMotion::Form::profile:
      return linear + profile_script(history);
    case DrawnMotion::Form::curves:
      break;
  }
  return linear + curves_script(history, time);
}

std::string first_failure(std::initializer_list<std::string> failures) {
  for (const std::string& failure : failures)
    if (!failure.empty()) return failure;
  return {};
}

}  // namespace

std::string draw_work_precision(const Study& study, const std::string& time_unit,
                                const std::vector<SeriesStyle>& styles,
                                const std::filesystem::path& directory) {
  std::vector<StudyCurve> work =
      curves_of(study, styles, [](const auto& row) { return row.cpu_seconds.median; });
  add_baselines(work, study, [](const auto& row) { return row.cpu_seconds.median; });
  const auto steps = curves_of(study, styles, [](const auto& row) { return std::abs(row.step); });
  const auto drawn = std::ranges::count_if(work, [](const StudyCurve& c) { return !c.data.empty(); });
  if (drawn == 0) return study.scene + ": no run succeeded, so there is nothing to draw";
  const std::size_t height = std::max<std::size_t>(480, 90 + 28 * static_cast<std::size_t>(drawn));
  const std::string title = fmt::format("{}: t = {:g} … {:g}", study.scene, study.t_start, study.t_end);
  const std::string stem = (directory / file_name(study.scene)).string(), error = "relative error of q and p";
  const bool two_steps =  // an order takes two
      std::ranges::any_of(steps, [](const StudyCurve& c) { return std::ranges::count(c.data, '\n') > 1; });
  return first_failure(
      {render(std::string(study_style) + axes(title, "CPU time [s]", error + " at the end [1]") +
                  reference_line(study, work) + plotted(work),
              stem, 980, height),
       two_steps ? render(std::string(study_style) +
                              axes(title, in_unit("step size", time_unit), error + " at the end [1]") +
                              reference_line(study, steps) + plotted(steps),
                          stem + "-orders", 980, height)
                 : ""});
}

std::string draw_history(const History& history, const std::string& scene, const std::string& time_unit,
                         const std::vector<SeriesStyle>& styles, const std::filesystem::path& directory) {
  const std::string stem = (directory / file_name(scene)).string(), title = run_title(history, scene);
  const std::string time = in_unit("time", time_unit);
  const std::string error = error_script(history, title, time, styles);
  return first_failure({render(history_script(history, title, time), stem + "-history", 760, 420),
                        error.empty() ? "" : render(error, stem + "-error", 760, 420),
                        render(motion_script(history, time), stem + "-motion", 620, 420)});
}

std::string draw_summary(const std::vector<Study>& studies, const std::filesystem::path& directory) {
  std::string ida, erk, names;
  std::size_t place = 0;
  for (const Study& study : studies)
    for (const AtError& at : study.at_error) {
      if (!at.best || at.error != summary_error) continue;
      if (at.ratio) ida += fmt::format("{:.6e} {}\n", *at.ratio, place);
      if (at.erk_ratio) erk += fmt::format("{:.6e} {}\n", *at.erk_ratio, place);
      names += fmt::format("{}{} {}", place == 0 ? "" : ", ", gnuplot_text(study.scene), place);
      ++place;
    }
  if (ida.empty() && erk.empty())
    return "no study reaches 1e-6 on both sides, so there is no summary to draw";
  const std::string script =
      std::string(study_style) +
      fmt::format(
          "unset logscale y\nset format y '%s'\nset format x '%g'\nset xrange [*<0.5:2<*]\nset yrange "
          "[{}:-0.7]\nset ytics ({}) "
          "noenhanced\n"
          "set ylabel ''\nset xlabel 'time of the baseline over ours at the error 1e-6: right of 1 ours is "
          "faster'\n"
          "set arrow from 1, graph 0 to 1, graph 1 nohead linewidth 1.5 linecolor '#404040'\n"
          "$ida << EOD\n{}EOD\n$erk << EOD\n{}EOD\n",
          static_cast<double>(place) - 0.3, names, ida.empty() ? "NaN NaN\n" : ida,
          erk.empty() ? "NaN NaN\n" : erk) +
      "plot $ida with points pointtype 5 pointsize 1.2 linecolor '#000000' title 'IDA', $erk with points "
      "pointtype 9 "
      "pointsize 1.3 linecolor '#707070' title 'explicit'\n";
  return render(script, (directory / "summary").string(), 860, std::max<std::size_t>(260, 120 + 34 * place));
}

}  // namespace diracstep
