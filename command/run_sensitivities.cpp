#include <fmt/format.h>

#include <algorithm>
#include <diracstep/command/run_sensitivities.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>

namespace diracstep::command {

namespace {

/// What the start is differentiated by, and what stands before a coordinate's name for it.
constexpr std::pair<const char*, const char*> start_words[]{{"q0", ""}, {"v0", "v_"}, {"p0", "p_"}};

bool is_start(const std::string& word) {
  return std::ranges::any_of(start_words, [&](const auto& known) { return word == known.first; });
}

ParametricScene parameters_of(const std::vector<std::string>& wanted, const std::string& name,
                              const Parameters& changes, const CatalogueScene& entry) {
  std::vector<std::string> parameters;
  for (const std::string& word : wanted) {
    if (is_start(word)) continue;
    if (!entry.parameters.contains(word))
      throw Misuse(fmt::format("--sensitivities: '{}' is neither a parameter of scene '{}' nor q0, v0 or p0",
                               word, entry.scene->name));
    parameters.push_back(word);
  }
  return parametric_scene(name, entry, parameters, changes);
}

}  // namespace

RunSensitivities::RunSensitivities(const std::vector<std::string>& wanted, const std::string& name,
                                   const Parameters& changes, const CatalogueScene& entry,
                                   const Registry& registry, Integrator& integrator)
    : RunSensitivities(wanted, parameters_of(wanted, name, changes, entry), registry, integrator) {}

RunSensitivities::RunSensitivities(const std::vector<std::string>& wanted, const ParametricScene& scene,
                                   const Registry& registry, Integrator& integrator)
    : doubt_(scene.doubt), sensitivities_(integrator, registry, scene) {
  const int n = sensitivities_.coordinates();
  const auto starts = std::ranges::count_if(wanted, is_start);
  directions_.resize(2 * n + sensitivities_.parameters(),
                     n * starts + static_cast<Eigen::Index>(wanted.size()) - starts);
  const Directions by_parameters = sensitivities_.by_parameters();
  Eigen::Index column = 0, parameter = 0;
  for (const std::string& word : wanted) {
    if (!is_start(word)) {
      directions_.col(column++) = by_parameters.col(parameter++);
      columns_.push_back({word, {}, {}, {}});
      continue;
    }
    directions_.middleCols(column, n) = word == "q0"   ? sensitivities_.by_position()
                                        : word == "v0" ? sensitivities_.by_velocity()
                                                       : sensitivities_.by_momentum();
    column += n;
    const auto* const known =
        std::ranges::find_if(start_words, [&](const auto& each) { return word == each.first; });
    for (const std::string& coordinate : integrator.scene().coordinates)
      columns_.push_back({fmt::format("{}{}(0)", known->second, coordinate), {}, {}, {}});
  }
}

void RunSensitivities::follow_step() {
  sensitivities_.follow(directions_);
  known_ = false;
}

const std::vector<SensitivityColumn>& RunSensitivities::read() {
  if (known_) return columns_;
  const ReadDirections read = sensitivities_.read(directions_);
  for (std::size_t k = 0; k < columns_.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    columns_[k].q = read.q.col(column);
    if (read.v.size() > 0) columns_[k].v = read.v.col(column);
    columns_[k].p = read.p.col(column);
  }
  known_ = true;
  return columns_;
}

std::vector<Output> RunSensitivities::columns() {
  std::vector<Output> all;
  const auto& coordinates = sensitivities_.scene().coordinates;
  const bool velocities = read().front().v.size() > 0;
  for (std::size_t k = 0; k < columns_.size(); ++k)
    for (std::size_t i = 0; i < coordinates.size() * (velocities ? 2 : 1); ++i) {
      const bool velocity = i >= coordinates.size();
      const auto index = static_cast<Eigen::Index>(i % coordinates.size());
      all.push_back({fmt::format("d({}{})/d({})", velocity ? "v_" : "", coordinates[i % coordinates.size()],
                                 columns_[k].by),
                     [this, k, velocity, index](const MotionPoint&) {
                       const SensitivityColumn& column = read()[k];
                       return (velocity ? column.v : column.q)[index];
                     }});
    }
  return all;
}

}  // namespace diracstep::command
