#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/boundary_values/guesses.hpp>
#include <diracstep/boundary_values/named_ends.hpp>
#include <diracstep/command/guess_file.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/csv_table.hpp>

namespace diracstep::command {

namespace {

constexpr std::size_t most_guess_bytes = 100'000'000;

}  // namespace

GuessedMotion guess_from_file(const std::string& path, const Scene& scene) {
  const CsvTable table = read_csv(path, "--guess", most_guess_bytes, 2, EmptyFields::missing);
  if (table.lines.empty()) throw Misuse(fmt::format("--guess: '{}' has no lines of data", path));
  const int n = scene.dimension();
  const auto count = static_cast<Eigen::Index>(table.lines.size());
  Vector times(count);
  Columns states = Columns::Zero(2 * n, count);
  const std::vector<std::string> known = names_at_an_end(scene);
  const auto read = [&](const std::string& name, const auto& put) {
    const auto found = std::ranges::find(table.names, name);
    if (found == table.names.end()) return false;
    for (Eigen::Index k = 0; k < count; ++k) {
      const double number =
          table.lines[static_cast<std::size_t>(k)][static_cast<std::size_t>(found - table.names.begin())];
      if (!std::isfinite(number))
        throw Misuse(fmt::format("--guess: '{}': a field of the column '{}' is empty", path, name));
      put(k, number);
    }
    return true;
  };
  if (!read("t", [&](Eigen::Index k, double t) { times[k] = t; }))
    throw Misuse(fmt::format("--guess: '{}' has no column t", path));
  for (int i = 0; i < 2 * n; ++i) {
    const std::string& name = known[static_cast<std::size_t>(i)];
    if (!read(name, [&](Eigen::Index k, double value) { states(i, k) = value; }))
      throw Misuse(fmt::format("--guess: '{}' has no column '{}'", path, name));
  }
  return through_points(times, states.topRows(n), states.bottomRows(n));
}

}  // namespace diracstep::command
