#include <cmath>
#include <diracstep/sweeps/random_numbers.hpp>
#include <diracstep/sweeps/sweep.hpp>

namespace diracstep {

namespace {

double drawn_value(const Drawn& drawn, double u) {
  switch (drawn.law) {
    case Drawn::Law::uniform:
      return drawn.a + (drawn.b - drawn.a) * u;
    case Drawn::Law::log_uniform:
      return drawn.a * std::pow(drawn.b / drawn.a, u);
    case Drawn::Law::normal:
      return drawn.a + drawn.b * normal_quantile(u);
  }
  return 0.0;
}

}  // namespace

long Sweep::members() const {
  long count = draws * (table_names.empty() ? 1 : static_cast<long>(table.size()));
  for (const Axis& axis : grid) count *= static_cast<long>(axis.values.size());
  return count;
}

std::vector<std::string> Sweep::names() const {
  std::vector<std::string> all;
  for (const Axis& axis : grid) all.push_back(axis.name);
  all.insert(all.end(), table_names.begin(), table_names.end());
  for (const Drawn& variable : drawn) all.push_back(variable.name);
  return all;
}

std::vector<double> Sweep::member(long number) const {
  const long draw = number % draws;
  long rest = number / draws;
  std::vector<double> found(grid.size());
  const long line = table_names.empty() ? 0 : rest % static_cast<long>(table.size());
  if (!table_names.empty()) rest /= static_cast<long>(table.size());
  for (std::size_t k = grid.size(); k-- > 0;) {
    const auto count = static_cast<long>(grid[k].values.size());
    found[k] = grid[k].values[static_cast<std::size_t>(rest % count)];
    rest /= count;
  }
  if (!table_names.empty()) {
    const std::vector<double>& row = table[static_cast<std::size_t>(line)];
    found.insert(found.end(), row.begin(), row.end());
  }
  for (std::size_t k = 0; k < drawn.size(); ++k)
    found.push_back(drawn_value(
        drawn[k], sobol ? sobol_number(seed, static_cast<std::uint64_t>(draw), static_cast<int>(k))
                        : uniform_number(seed, static_cast<std::uint64_t>(number), k)));
  return found;
}

}  // namespace diracstep
