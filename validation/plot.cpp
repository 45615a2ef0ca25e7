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

/// Okabe and Ito's colours, told apart with any colour vision, without black, which is IDA's, and without
/// yellow.
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

std::string file_name(std::string name) {
  std::ranges::replace_if(
      name, [](char c) { return c == '/' || c == '\\'; }, '_');
  return name;
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

std::string draw_work_precision(const Study& study, const std::filesystem::path& directory) {
  const std::size_t keys = curves(study).size();
  if (keys == 0) return study.scene + ": no run succeeded, so there is nothing to draw";
  const std::string stem = (directory / file_name(study.scene)).string();
  const std::string picture = work_precision_script(study);
  const std::size_t width = methods_of(study).size() > 1 ? 980 : 720;  // the key names the methods then
  const std::size_t height = std::max<std::size_t>(480, 90 + 28 * keys);
  return render(picture, stem, width, height);
}

}  // namespace diracstep
