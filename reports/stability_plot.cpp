#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/reports/plot.hpp>
#include <diracstep/reports/stability_report.hpp>
#include <functional>
#include <map>
#include <string_view>

namespace diracstep {

namespace {

constexpr std::array<std::string_view, 7> stability_colours{"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                                            "#E69F00", "#56B4E9", "#000000"};
constexpr std::array<int, 5> stability_markers{7, 5, 9, 13, 11};
constexpr std::array<std::string_view, 3> stability_dashes{"solid", "(9,5)", "(2,4)"};
constexpr std::size_t fewest_cases = 3;
constexpr double growth_floor = 1e-17, largest_growth = 1e12;
constexpr double smallest_growth = 1e-6;

constexpr std::string_view stability_style = R"(set encoding utf8
set logscale xy
set format x '10^{%L}'
set format y '10^{%L}'
set yrange [*:1e-15<*]
set border 3 linewidth 1.2 linecolor '#404040'
set tics nomirror out scale 0.7,0.35
set grid xtics ytics linetype 1 linewidth 0.7 linecolor '#D9D9D9' dashtype solid
set key outside right center Left reverse samplen 2.4 spacing 1.3 width 1 noenhanced
)";

struct Curve {
  std::string label;
  std::string data = {};  // lines "x y"
  int others = 0;         // methods with the same data

  void add(double x, double y) {
    if (x > 0.0 && std::isfinite(y) && y <= largest_growth)
      data += fmt::format("{:.6e} {:.6e}\n", x, std::max(y, growth_floor));
  }
};

struct Picture {
  std::string title, x_label, y_label;
  std::vector<Curve> curves;
  int marked = 1;  // each which point
};

std::string look(std::size_t k) {
  return fmt::format("linewidth 2 dashtype {} pointtype {} pointsize 0.8 linecolor '{}'",
                     stability_dashes[k / stability_colours.size() % stability_dashes.size()],
                     stability_markers[k % stability_markers.size()],
                     stability_colours[k % stability_colours.size()]);
}

std::string key(const Curve& curve) {
  return curve.others == 0 ? curve.label : fmt::format("{} and {} like it", curve.label, curve.others);
}

std::string script(const Picture& picture) {
  std::string text(stability_style);
  text += fmt::format(
      "set title {} noenhanced offset 0,-0.3\nset xlabel {} noenhanced\nset ylabel {} noenhanced\n",
      gnuplot_text(picture.title), gnuplot_text(picture.x_label), gnuplot_text(picture.y_label));
  for (std::size_t k = 0; k < picture.curves.size(); ++k)
    text += fmt::format("$curve{} << EOD\n{}EOD\n", k, picture.curves[k].data);
  for (std::size_t k = 0; k < picture.curves.size(); ++k)
    text += fmt::format("{}$curve{} with linespoints {} pointinterval {} title {}",
                        k == 0 ? "plot " : ", \\\n     ", k, look(k), picture.marked,
                        gnuplot_text(key(picture.curves[k])));
  return text + "\n";
}

std::string draw(Picture picture, const std::filesystem::path& directory, std::string file) {
  std::erase_if(picture.curves, [](const Curve& curve) { return curve.data.empty(); });
  if (picture.curves.empty()) return {};
  std::ranges::replace_if(
      file, [](char c) { return c == '/' || c == '\\' || c == ' ' || c == ','; }, '_');
  const std::size_t height = std::max<std::size_t>(480, 140 + 36 * picture.curves.size());
  return render(script(picture), (directory / file).string(), 1300, height);
}

std::string label(const std::string& method, int order) { return fmt::format("{}, order {}", method, order); }

/// Methods whose curves are the same share one.
void merge_equal(std::vector<Curve>& curves) {
  std::vector<Curve> merged;
  for (Curve& curve : curves) {
    const auto same = std::ranges::find(merged, curve.data, &Curve::data);
    if (same == merged.end())
      merged.push_back(std::move(curve));
    else
      ++same->others;
  }
  curves = std::move(merged);
}

/// Rounded, so that curves that differ by round-off are found equal.
double rounded_growth(double growth) {
  return std::isfinite(growth) ? std::stod(fmt::format("{:.3e}", growth)) : growth;
}

std::vector<Curve> growth_curves(const std::vector<LinearStability>& linear,
                                 const std::function<double(const GrowthPoint&)>& value) {
  std::vector<Curve> curves;
  for (const LinearStability& stability : linear) {
    curves.push_back({label(stability.method, stability.order)});
    for (const GrowthPoint& point : stability.growth)
      curves.back().add(point.step, std::max(rounded_growth(value(point)), smallest_growth));
  }
  merge_equal(curves);
  return curves;
}

/// One curve for each method and one for the best IDA at the highest CPU time.
Picture group_picture(const std::string& group, const std::vector<const StabilityResult*>& results) {
  const auto with_errors = std::ranges::count_if(results, [](const StabilityResult* result) {
    return std::ranges::any_of(result->rows,
                               [](const StabilityRow& row) { return std::isfinite(row.error); });
  });
  const bool errors = with_errors > 1;
  const auto& watches = results.front()->that.watches;
  Picture picture{group,
                  group.substr(group.rfind(", ") == std::string::npos ? 0 : group.rfind(", ") + 2),
                  errors            ? "relative error at the end"
                  : watches.empty() ? ""
                                    : watches.front().name + ", band",
                  {}};
  std::map<std::string, std::size_t> places;
  const auto curve = [&](const std::string& name) -> Curve& {
    const auto [place, added] = places.emplace(name, picture.curves.size());
    if (added) picture.curves.push_back({name});
    return picture.curves[place->second];
  };
  for (const StabilityResult* result : results) {
    for (const StabilityRow& row : result->rows)
      curve(label(row.method, row.order))
          .add(result->that.value, errors                ? row.error
                                   : row.watches.empty() ? std::nan("")
                                                         : row.watches.front().band);
    for (auto ida = result->ida.rbegin(); ida != result->ida.rend(); ++ida)
      if (ida->ok()) {
        curve("IDA, at the highest CPU time").add(result->that.value, errors ? ida->error : ida->deviation);
        break;
      }
  }
  return picture;
}

}  // namespace

std::string draw_linear_stability(const std::vector<LinearStability>& linear,
                                  const std::filesystem::path& directory) {
  std::string failure =
      draw({"oscillator", "hω", "spectral radius of a step",
            growth_curves(linear, [](const GrowthPoint& point) { return point.oscillator; }), 20},
           directory, "growth_oscillator");
  if (!failure.empty()) return failure;
  return draw({"damped mass", "hγ", "|p1/p0|",
               growth_curves(linear, [](const GrowthPoint& point) { return point.damping; }), 20},
              directory, "growth_damping");
}

std::string draw_stability(const std::vector<StabilityResult>& results,
                           const std::filesystem::path& directory) {
  std::map<std::string, std::vector<const StabilityResult*>> groups;
  for (const StabilityResult& result : results) groups[result.that.group].push_back(&result);
  for (const auto& [group, members] : groups) {
    if (members.size() < fewest_cases) continue;
    if (std::string failure = draw(group_picture(group, members), directory, group); !failure.empty())
      return failure;
  }
  return {};
}

}  // namespace diracstep
