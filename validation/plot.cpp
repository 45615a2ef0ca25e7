#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <diracstep/validation/plot.hpp>
#include <string_view>
#include <system_error>

namespace diracstep {

namespace {

/// Okabe and Ito's colours, told apart with any colour vision, without black and grey, which are the
/// yardsticks', and without yellow.
constexpr std::array<std::string_view, 6> colours{"#0072B2", "#D55E00", "#009E73",
                                                  "#CC79A7", "#E69F00", "#56B4E9"};
constexpr std::array<int, 6> markers{7, 5, 9, 13, 11, 15};
constexpr std::array<std::string_view, 4> dashes{"solid", "(9,5)", "(2,4)", "(9,4,2,4)"};
constexpr double largest_drawn = 10.0;  // errors above it show no trend

constexpr std::string_view style = R"(set encoding utf8
set logscale xy
set format x '10^{%L}'
set format y '10^{%L}'
set xlabel 'CPU time [s]' offset 0,0.2
set ylabel 'relative error of q and p at the end' offset 0.6,0
set border 3 linewidth 1.2 linecolor '#404040'
set tics nomirror out scale 0.7,0.35
set mxtics 10
unset mytics
set grid xtics ytics linetype 1 linewidth 0.7 linecolor '#D9D9D9' dashtype solid
set key outside right center Left reverse samplen 2.4 spacing 1.3 width 1 noenhanced
)";

/// A terminal for each file, at a width and a height in points.
struct Terminal {
  const char* ending;
  std::string (*settings)(std::size_t width, std::size_t height);
};
constexpr std::array<Terminal, 2> terminals{
    {{".svg",
      [](std::size_t width, std::size_t height) {
        return fmt::format("svg size {},{} font 'Helvetica,Arial,sans-serif,17' background 'white'", width,
                           height);
      }},
     {".png", [](std::size_t width, std::size_t height) {
        return fmt::format("pngcairo size {},{} font 'Helvetica,15' fontscale 1.9 linewidth 2 pointscale 2",
                           2 * width, 2 * height);
      }}}};

struct Curve {
  std::string label;
  std::string look;
  std::string data;  // lines "cpu error"
};

Curve curve(const Study& study, const std::string& method, int order, std::string label, std::string look) {
  Curve drawn{std::move(label), std::move(look), {}};
  for (const StudyRow& row : study.rows)
    if (row.ok() && row.method == method && row.order == order && row.error() > 0.0 &&
        row.error() <= largest_drawn)
      drawn.data += fmt::format("{:.6e} {:.6e}\n", row.cpu_seconds.median, row.error());
  return drawn;
}

std::vector<std::string> methods_of(const Study& study) {
  std::vector<std::string> methods;
  for (const MeasuredOrder& ours : study.measured_orders)
    if (std::ranges::find(methods, ours.method) == methods.end()) methods.push_back(ours.method);
  return methods;
}

/// Colour and marker tell the curves apart, the dashes the methods.  A lone method stands in the title
/// instead.
std::vector<Curve> curves(const Study& study) {
  const std::vector<std::string> methods = methods_of(study);
  std::vector<Curve> all;
  for (const MeasuredOrder& ours : study.measured_orders) {
    const std::size_t k = all.size() % colours.size();
    const auto method = std::ranges::find(methods, ours.method) - methods.begin();
    const std::string prefix = methods.size() > 1 ? ours.method + ", " : "";
    all.push_back(
        curve(study, ours.method, ours.order, fmt::format("{}order {}", prefix, ours.order),
              fmt::format("linewidth 2 dashtype {} pointtype {} pointsize 0.85 linecolor '{}'",
                          dashes[static_cast<std::size_t>(method) % dashes.size()], markers[k], colours[k])));
  }
  all.push_back(curve(study, ida_method, 0, "IDA",
                      "linewidth 2 dashtype solid pointtype 4 pointsize 0.95 linecolor '#000000'"));
  all.push_back(curve(study, erk_method, 0, "explicit RK 8",
                      "linewidth 2 dashtype (6,4) pointtype 8 pointsize 0.95 linecolor '#707070'"));
  std::erase_if(all, [](const Curve& drawn) { return drawn.data.empty(); });
  return all;
}

/// A pipe's reader may be gone; the error is then read off its exit status, not off a signal.
class PipeSignalBlocked {
 public:
  PipeSignalBlocked() {
    sigemptyset(&pipe_);
    sigaddset(&pipe_, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &pipe_, &before_);
  }
  PipeSignalBlocked(const PipeSignalBlocked&) = delete;
  PipeSignalBlocked& operator=(const PipeSignalBlocked&) = delete;
  ~PipeSignalBlocked() {
    const timespec now{};
    if (sigismember(&before_, SIGPIPE) == 0) sigtimedwait(&pipe_, nullptr, &now);
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }

 private:
  sigset_t pipe_, before_;
};

std::string run_gnuplot(const std::string& script) {
  if (std::system("command -v gnuplot >/dev/null 2>&1") != 0)  // NOLINT: a fixed command
    return "gnuplot was not found, so no pictures were drawn (Debian: apt install gnuplot-nox)";
  const PipeSignalBlocked blocked;
  std::FILE* pipe = popen("gnuplot", "w");  // NOLINT: a fixed command
  if (pipe == nullptr) return "gnuplot could not be started";
  const bool written = std::fwrite(script.data(), 1, script.size(), pipe) == script.size();
  const int status = pclose(pipe);
  if (written && WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
  return fmt::format("gnuplot failed with status {}", WIFEXITED(status) ? WEXITSTATUS(status) : status);
}

}  // namespace

std::string gnuplot_text(std::string_view text) {
  std::string all = "'";
  for (const char c : text) all += c == '\'' ? std::string("''") : std::string(1, c);
  return all + "'";
}

std::string render(const std::string& picture, const std::string& stem, std::size_t width,
                   std::size_t height) {
  std::string script;
  for (const auto& [ending, settings] : terminals)
    script += fmt::format("reset\nset terminal {}\nset output {}\n{}unset output\n", settings(width, height),
                          gnuplot_text(stem + ending), picture);
  const std::string failure = run_gnuplot(script);
  if (!failure.empty()) return failure;
  for (const auto& [ending, settings] : terminals)
    if (std::error_code error; !std::filesystem::file_size(stem + ending, error))
      return fmt::format("gnuplot did not write {}{}", stem, ending);
  return {};
}

std::string work_precision_script(const Study& study) {
  const std::vector<Curve> all = curves(study);
  std::string script(style);
  const std::vector<std::string> methods = methods_of(study);
  const std::string method = methods.size() == 1 ? methods.front() + ", " : "";
  const std::string title =
      fmt::format("{}: {}t = {:g} … {:g}", study.scene, method, study.t_start, study.t_end);
  script += fmt::format("set title {} noenhanced offset 0,-0.3\n", gnuplot_text(title));
  for (std::size_t i = 0; i < all.size(); ++i)
    script += fmt::format("$curve{} << EOD\n{}EOD\n", i, all[i].data);
  script += "plot ";
  for (std::size_t i = 0; i < all.size(); ++i)
    script += fmt::format("{}$curve{} with linespoints {} title {}", i == 0 ? "" : ", \\\n     ", i,
                          all[i].look, gnuplot_text(all[i].label));
  return script + "\n";
}

std::string file_name(std::string scene) {
  std::ranges::replace_if(
      scene, [](char c) { return c == '/' || c == '\\'; }, '_');
  return scene;
}

namespace {

std::string block(std::size_t number, const std::vector<double>& x, const std::vector<double>& y) {
  std::string data = fmt::format("$curve{} << EOD\n", number);
  for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i)
    data += fmt::format("{:.9e} {:.9e}\n", x[i], y[i]);
  return data + "EOD\n";
}

std::vector<double> component(const std::vector<Vector>& points, Eigen::Index i) {
  std::vector<double> values;
  for (const Vector& point : points) values.push_back(point[i]);
  return values;
}

constexpr double drawn_zero = 1e-18;  // a change of exactly zero has no logarithm

std::string history_script(const History& history, const std::string& scene) {
  std::vector<std::pair<std::string, std::vector<double>>> curves{{"energy", history.energy}};
  if (!history.constraint.empty()) curves.emplace_back("rows", history.constraint);
  for (const History::Change& invariant : history.invariants)
    if (curves.size() < colours.size()) curves.emplace_back(invariant.name, invariant.values);
  std::string script(style), plots;
  script += fmt::format(
      "unset logscale x\nset format x '%g'\nset xlabel 't'\nset ylabel 'relative change, or violation'\n"
      "set title {} noenhanced\n",
      gnuplot_text(
          fmt::format("{}: {} order {}, step {:.3g}", scene, history.method, history.order, history.step)));
  for (std::size_t i = 0; i < curves.size(); ++i) {
    for (double& value : curves[i].second) value = std::max(std::abs(value), drawn_zero);
    script += block(i, history.time, curves[i].second);
    plots += fmt::format("{}$curve{} with lines linewidth 1.5 linecolor '{}' title {}",
                         i == 0 ? "plot " : ", ", i, colours[i], gnuplot_text(curves[i].first));
  }
  return script + plots + "\n";
}

std::string motion_script(const History& history, const std::string& scene) {
  const bool plane = history.coordinates.size() > 1;
  const std::vector<double> first = component(history.q, 0);
  std::string script(style);
  script += fmt::format("unset logscale\nset format '%g'\nunset key\nset title {} noenhanced\n",
                        gnuplot_text(scene));
  script += fmt::format("set xlabel {} noenhanced\nset ylabel {} noenhanced\n",
                        gnuplot_text(plane ? history.coordinates[0] : "t"),
                        gnuplot_text(history.coordinates[plane ? 1 : 0]));
  script += plane ? block(0, first, component(history.q, 1)) : block(0, history.time, first);
  return script + fmt::format("plot $curve0 with lines linewidth 1.5 linecolor '{}'\n", colours[0]);
}

constexpr double summary_error = 1e-6;

}  // namespace

std::string draw_work_precision(const Study& study, const std::filesystem::path& directory) {
  const std::size_t keys = curves(study).size();
  if (keys == 0) return study.scene + ": no run succeeded, so there is nothing to draw";
  const std::size_t width = methods_of(study).size() > 1 ? 980 : 720;  // the key names the methods then
  const std::size_t height = std::max<std::size_t>(480, 90 + 28 * keys);
  return render(work_precision_script(study), (directory / file_name(study.scene)).string(), width, height);
}

std::string draw_history(const History& history, const std::string& scene,
                         const std::filesystem::path& directory) {
  const std::string stem = (directory / file_name(scene)).string();
  const std::string failure = render(history_script(history, scene), stem + "-history", 760, 420);
  return failure.empty() ? render(motion_script(history, scene), stem + "-motion", 520, 420) : failure;
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
      std::string(style) +
      fmt::format(
          "unset logscale y\nset format y '%s'\nset format x '%g'\nset yrange [{}:-0.7]\nset ytics ({}) "
          "noenhanced\n"
          "set ylabel ''\nset xlabel 'time of the yardstick over ours at the error 1e-6: right of 1 ours is "
          "faster'\n"
          "set arrow from 1, graph 0 to 1, graph 1 nohead linewidth 1.5 linecolor '#404040'\n"
          "$ida << EOD\n{}EOD\n$erk << EOD\n{}EOD\n",
          static_cast<double>(place) - 0.3, names, ida.empty() ? "NaN NaN\n" : ida,
          erk.empty() ? "NaN NaN\n" : erk) +
      "plot $ida with points pointtype 5 pointsize 1.2 linecolor '#000000' title 'IDA', $erk with points "
      "pointtype 9 "
      "pointsize 1.3 linecolor '#D55E00' title 'explicit RK 8'\n";
  return render(script, (directory / "summary").string(), 860, std::max<std::size_t>(260, 120 + 34 * place));
}

}  // namespace diracstep
