#include <fmt/format.h>

#include <algorithm>
#include <diracstep/reports/modes_plot.hpp>
#include <diracstep/reports/plot.hpp>

namespace diracstep {

namespace {

constexpr std::size_t most_shapes = 6;
constexpr std::size_t most_names = 16;  // on an axis

constexpr std::string_view modes_style = R"(set encoding utf8
set border 3 linewidth 1.2 linecolor '#404040'
set tics nomirror out scale 0.7,0.35
set grid xtics ytics linetype 1 linewidth 0.7 linecolor '#D9D9D9' dashtype solid
)";

std::string eigenvalue_plot(const std::string& title, const Eigenmodes& modes) {
  std::string points;
  for (const Mode& mode : modes.modes) {
    const double real = mode.eigenvalue.real(), imaginary = mode.eigenvalue.imag();
    points += fmt::format("{:.9g} {:.9g}\n", real, imaginary);
    if (imaginary > 0.0) points += fmt::format("{:.9g} {:.9g}\n", real, -imaginary);
  }
  return fmt::format(
      "set title {} noenhanced\nset xlabel 'Re s'\nset ylabel 'Im s'\nset xzeroaxis linecolor '#404040'\n"
      "set yzeroaxis linecolor '#404040'\nset offsets graph 0.1, graph 0.1, graph 0.1, graph 0.1\n"
      "$eigenvalues << EOD\n{}EOD\n"
      "plot $eigenvalues with points pointtype 7 pointsize 0.7 linecolor '#0072B2' notitle\n",
      gnuplot_text(title), points);
}

std::string names_of_axis(const std::vector<std::string>& coordinates) {
  if (coordinates.size() > most_names) return "set xlabel 'number of the coordinate'\nset xtics auto\n";
  std::string names;
  for (std::size_t i = 0; i < coordinates.size(); ++i)
    names += fmt::format("{}{} {}", i == 0 ? "" : ", ", gnuplot_text(coordinates[i]), i + 1);
  return "set xlabel ''\nset xtics (" + names + ") noenhanced\n";
}

std::string shape_plot(std::size_t number, const Mode& mode, std::size_t coordinates) {
  std::string points;
  for (Eigen::Index i = 0; i < mode.shape.size(); ++i)
    points += fmt::format("{} {:.6g} {:.6g}\n", i + 1, mode.shape[i].real(), mode.shape[i].imag());
  const std::string style =
      coordinates > most_names ? "lines linewidth 1.5" : "linespoints linewidth 1.5 pointtype 7";
  const bool real = mode.shape.imag().cwiseAbs().maxCoeff() < 1e-9;
  return fmt::format(
      "$shape{0} << EOD\n{1}EOD\nset title {2} noenhanced\n"
      "plot $shape{0} using 1:2 with {3} linecolor '#0072B2' notitle{4}\n",
      number, points,
      gnuplot_text(fmt::format(
          "s = {:.6g}{}", mode.eigenvalue.real() + 0.0,
          mode.eigenvalue.imag() > 0.0 ? fmt::format(" ± {:.6g} i", mode.eigenvalue.imag()) : "")),
      style,
      real ? std::string()
           : fmt::format(", $shape{} using 1:3 with {} linecolor '#D55E00' dashtype '-' notitle", number,
                         style));
}

}  // namespace

std::string draw_modes(const std::string& scene, const std::vector<std::string>& coordinates,
                       const Eigenmodes& modes, const std::string& stem) {
  const std::size_t shapes = std::min(modes.modes.size(), most_shapes), rows = (shapes + 1) / 2;
  std::string script(modes_style);
  script += fmt::format("set multiplot\nset size 0.36,1\nset origin 0,0\n{}unset offsets\n",
                        eigenvalue_plot("eigenvalues of " + scene, modes));
  script += fmt::format("set ylabel ''\nset yrange [-1.05:1.05]\nset ytics 0.5\nset xrange [0.5:{}.5]\n{}",
                        coordinates.size(), names_of_axis(coordinates));
  for (std::size_t k = 0; k < shapes; ++k) {
    const std::size_t row = k / 2 + 1;
    script +=
        fmt::format("set size 0.31,{:.4f}\nset origin {:.2f},{:.4f}\n{}", 1.0 / static_cast<double>(rows),
                    k % 2 == 0 ? 0.37 : 0.68, 1.0 - static_cast<double>(row) / static_cast<double>(rows),
                    shape_plot(k, modes.modes[k], coordinates.size()));
  }
  return render(script + "unset multiplot\n", stem, 1300, std::max<std::size_t>(480, 240 * rows));
}

}  // namespace diracstep
