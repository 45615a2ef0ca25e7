#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/equilibrium/small_motions.hpp>
#include <diracstep/eigenvalues/largest_eigenpairs.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/modes_plot.hpp>
#include <diracstep/reports/plot.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>

namespace diracstep::command {

namespace {

struct EquilibriumArguments {
  std::string scene;
  bool along = false;
  std::optional<int> modes;    ///< how many, by sparse matrices
  std::optional<double> near;  ///< to which number
  std::string picture;
  std::vector<std::string> set;
  bool json = false;
};

/// What was found, and what it means for small motions where something was.
struct Found {
  Equilibrium at;
  std::optional<SmallMotions> small;
};

constexpr std::size_t shown_components = 6;  // of a mode
constexpr double shown_from = 1e-3;          // of its largest
constexpr int shown_coordinates = 40;

Found find(const EquilibriumArguments& options, const CatalogueScene& entry) {
  Found found{find_equilibrium(*entry.scene, entry.scene->start, options.along), {}};
  if (found.at.ok())
    found.small =
        small_motions(*entry.scene, found.at, entry.t_end, {options.modes, options.near}, largest_eigenpairs);
  return found;
}

std::string component_text(const std::string& name, std::complex<double> value) {
  const double angle = std::arg(value) * 180.0 / std::numbers::pi;
  if (std::abs(angle) < 0.05) return fmt::format("{} {:.3g}", name, std::abs(value));
  if (std::abs(angle) > 179.95) return fmt::format("{} -{:.3g}", name, std::abs(value));
  return fmt::format("{} {:.3g} at {:.1f}°", name, std::abs(value), angle);
}

/// The largest components, as "th 1, x 0.25 at 90°".
std::string direction_text(const Scene& scene, const Eigen::VectorXcd& shape) {
  std::vector<Eigen::Index> order(static_cast<std::size_t>(shape.size()));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, std::greater<>(), [&](Eigen::Index i) { return std::abs(shape[i]); });
  std::string text;
  for (std::size_t k = 0; k < std::min(order.size(), shown_components); ++k) {
    const std::complex<double> value = shape[order[k]];
    if (std::abs(value) < shown_from) break;
    text +=
        (k == 0 ? "" : ", ") + component_text(scene.coordinates[static_cast<std::size_t>(order[k])], value);
  }
  const bool more = order.size() > shown_components && std::abs(shape[order[shown_components]]) >= shown_from;
  return text + (more ? ", …" : "");
}

std::string eigenvalue_text(std::complex<double> value) {
  if (value.imag() == 0.0) return fmt::format("{:.12g}", value.real());
  if (value.real() == 0.0) return fmt::format("± {:.12g} i", value.imag());
  return fmt::format("{:.12g} ± {:.12g} i", value.real(), value.imag());
}

std::string modes_text(const Scene& scene, const Eigenmodes& modes) {
  std::vector<std::vector<std::string>> rows{{"eigenvalue", "frequency", "damping", "mode"}};
  for (const Mode& mode : modes.modes) {
    const double size = std::abs(mode.eigenvalue), imaginary = mode.eigenvalue.imag();
    rows.push_back({eigenvalue_text(mode.eigenvalue),
                    imaginary > 0.0 ? fmt::format("{:.6g}", imaginary / (2.0 * std::numbers::pi)) : "-",
                    imaginary > 0.0 ? fmt::format("{:.3g}", -mode.eigenvalue.real() / size + 0.0) : "-",
                    direction_text(scene, mode.shape)});
  }
  std::string text = modes.modes.empty() ? "" : aligned(rows);
  if (modes.zeros > 0)
    text += fmt::format("{} {} 0: motions that nothing draws back{}\n", modes.zeros,
                        modes.zeros == 1 ? "eigenvalue" : "eigenvalues",
                        modes.zeros_below > 0.0
                            ? fmt::format("; rates below {:.2g} are not told from 0", modes.zeros_below)
                            : "");
  for (Eigen::Index k = 0; k < modes.free_directions.cols(); ++k)
    text += fmt::format("free direction, an equilibrium to first order: {}\n",
                        direction_text(scene, modes.free_directions.col(k).cast<std::complex<double>>()));
  return text;
}

std::string point_text(const CatalogueScene& entry, const Equilibrium& at) {
  const Scene& scene = *entry.scene;
  const bool moves = at.v.size() > 0 && at.v.cwiseAbs().maxCoeff() > 0.0;
  std::vector<std::vector<std::string>> rows{{"coordinate", "q", "from"}};
  if (moves) rows[0].emplace_back("v");
  const std::vector<std::string> names_of_q = position_names(scene);
  const int count = scene.storage_size(), shown = std::min(count, shown_coordinates);
  for (int i = 0; i < shown; ++i) {
    rows.push_back({names_of_q[static_cast<std::size_t>(i)], fmt::format("{:.15g}", at.q[i]),
                    fmt::format("{:.6g}", scene.start.q[i])});
    if (moves) rows.back().push_back(fmt::format("{:.15g}", at.v[i]));
  }
  std::string text = aligned(rows);
  if (shown < count) text += fmt::format("… {} of {} coordinates left out\n", count - shown, count);
  const auto names = scene.row_names();
  for (int r = 0; r < std::min(scene.rows(), shown_coordinates); ++r)
    text += fmt::format("force of row {}: {:.15g}\n", names[static_cast<std::size_t>(r)], at.lambda[r]);
  if (scene.rows() > shown_coordinates)
    text += fmt::format("… {} of {} rows left out\n", scene.rows() - shown_coordinates, scene.rows());
  return text;
}

std::string as_text(const CatalogueScene& entry, const Found& found) {
  const bool moves = found.at.v.cwiseAbs().maxCoeff() > 0.0;
  std::string text = fmt::format("{}: {}, {} iterations from the start\n\n{}", entry.scene->name,
                                 !found.at.ok() ? "no equilibrium"
                                 : moves        ? "a steady motion"
                                                : "at rest",
                                 found.at.iterations, point_text(entry, found.at));
  if (!found.small) return text;
  const SmallMotions& small = *found.small;
  if (small.nearest)
    text += fmt::format("the eigenvalues nearest to {:.6g}, by sparse matrices\n\n{}of these: {}\n",
                        small.nearest->near, modes_text(*entry.scene, small.modes),
                        describe(small.modes.stability));
  if (!small.linear) return text;
  const Linearisation& linear = *small.linear;
  text += fmt::format("degrees of freedom: {} of position, {} of velocity\n", linear.positions.cols(),
                      linear.velocities.cols());
  if (linear.redundant_rows > 0)
    text += fmt::format("redundant constraints there: {}; the forces of rows are the least that hold it\n",
                        linear.redundant_rows);
  return text + '\n' + modes_text(*entry.scene, small.modes) + describe(small.modes.stability) + '\n';
}

Json numbers_by_name(const std::vector<std::string>& names, const Vector& values,
                     const std::string& prefix = "") {
  Json json = Json::object();
  for (std::size_t i = 0; i < names.size(); ++i)
    add_member(json, prefix + names[i], Json(values[static_cast<Eigen::Index>(i)]));
  return json;
}

Json matrix_json(const Columns& matrix) {
  Json rows = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    Json row = Json::array();
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) row.push_back(matrix(r, c));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json mode_json(const Scene& scene, const Mode& mode) {
  Json shape = Json::object();
  for (int i = 0; i < scene.dimension(); ++i)
    add_member(shape, scene.coordinates[static_cast<std::size_t>(i)],
               Json{mode.shape[i].real(), mode.shape[i].imag()});
  return {{"eigenvalue", {mode.eigenvalue.real(), mode.eigenvalue.imag()}}, {"mode", shape}};
}

void add_small_motions(Json& json, const Scene& scene, const SmallMotions& small) {
  if (small.linear) {
    const Linearisation& linear = *small.linear;
    json["redundant_rows"] = linear.redundant_rows;
    json["variation"] = linear.variation;
    json["positions"] = matrix_json(linear.positions);
    json["velocities"] = matrix_json(linear.velocities);
    json["drift"] = matrix_json(linear.drift);
    json["mass"] = matrix_json(linear.mass);
    json["damping"] = matrix_json(linear.damping);
    json["stiffness"] = matrix_json(linear.stiffness);
  }
  if (small.nearest) {
    json["near"] = small.nearest->near;
    json["variation"] = small.nearest->variation;
  }
  json["zero_eigenvalues"] = small.modes.zeros;
  json["zeros_below"] = small.modes.zeros_below;
  json["free_directions"] = Json::array();
  for (Eigen::Index k = 0; k < small.modes.free_directions.cols(); ++k)
    json["free_directions"].push_back(numbers_by_name(scene.coordinates, small.modes.free_directions.col(k)));
  json["stability"] = describe(small.modes.stability);
  json["modes"] = Json::array();
  for (const Mode& mode : small.modes.modes) json["modes"].push_back(mode_json(scene, mode));
}

std::string as_json(const CatalogueScene& entry, const Found& found) {
  const Scene& scene = *entry.scene;
  Json json{{"scene", scene.name}, {"parameters", Json::object()}};
  for (const auto& [key, value] : entry.parameters) json["parameters"][key] = Json(value);
  const std::string doubt = found.small ? found.small->doubt : "";
  json["status"] = !found.at.ok() ? found.at.failure : doubt.empty() ? "ok" : "doubted";
  json["doubt"] = doubt.empty() ? Json(nullptr) : Json(doubt);
  json["t"] = found.at.time;
  json["iterations"] = found.at.iterations;
  json["q"] = numbers_by_name(position_names(scene), found.at.q);
  json["v"] = numbers_by_name(scene.coordinates, found.at.v);
  json["lambda"] = numbers_by_name(scene.row_names(), found.at.lambda);
  if (found.small) add_small_motions(json, scene, *found.small);
  return to_text(json, 2) + '\n';
}

void draw(const EquilibriumArguments& options, const CatalogueScene& entry, const Eigenmodes& modes,
          Session& session) {
  const std::string failure = draw_modes(entry.scene->name, entry.scene->coordinates, modes, options.picture);
  if (failure.empty()) return;
  say(failure);
  session.exit_status = failed;
}

void equilibrium(const EquilibriumArguments& options, Session& session) {
  if (!options.picture.empty())
    for (const std::string& file : picture_files(options.picture))
      require_outputs({{"--picture", file}}, inputs_of({options.scene}, session));
  CatalogueScene entry = make_scene(session, options.scene, parameters(options.set));
  const std::shared_ptr<const Scene> independent = entry.scene;
  const bool all = entry.events.empty() && entry.all_rows && !session.drop_redundant_rows;
  if (all) entry.scene = entry.all_rows;
  tell_events_left_out(entry);
  Found found = find(options, entry);
  if (all && !found.at.ok()) {  // rows that are redundant on their surface alone stop it
    CatalogueScene without = entry;
    without.scene = independent;
    Found by_independent = find(options, without);
    if (by_independent.at.ok()) {
      entry = std::move(without);
      found = std::move(by_independent);
    }
  }
  print(options.json ? as_json(entry, found) : as_text(entry, found));
  if (found.small && !options.picture.empty()) draw(options, entry, found.small->modes, session);
  if (!found.at.ok()) {
    say(fmt::format("no equilibrium found: {}", found.at.failure));
    session.exit_status = failed;
  } else if (!found.small->doubt.empty()) {
    say("doubted: " + found.small->doubt);
    session.exit_status = doubted;
  }
}

}  // namespace

void add_equilibrium(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "equilibrium", "Where a scene rests or moves steadily, and how it vibrates there: eigenvalues, modes");
  const auto options = std::make_shared<EquilibriumArguments>();
  verb->add_option("SCENE", options->scene, "A scene; see diracstep list scenes")->required();
  verb->add_flag("--along", options->along,
                 "A steady motion: coordinates with a velocity at the start keep moving");
  verb->add_option(
          "--modes", options->modes,
          "So many modes, the nearest to --near, by sparse matrices (default beyond 2000 coordinates: 10)")
      ->check(CLI::Range(1, 1000))
      ->type_name("COUNT");
  verb->add_option("--near", options->near,
                   "The number to which the eigenvalues of --modes are nearest (default: the slowest)")
      ->type_name("S");
  verb->add_option("--picture", options->picture,
                   "Writes STEM.svg and STEM.png: eigenvalues and the first modes")
      ->type_name("STEM");
  add_redundancy_option(*verb, session);
  add_set_option(*verb, options->set);
  verb->add_flag("--json", options->json, "One JSON document on standard output, reduced matrices included");
  verb->footer(
      "Examples:\n"
      "  diracstep equilibrium hanging_chain\n"
      "  diracstep equilibrium flyball_governor --along");
  verb->callback([options, &session] { equilibrium(*options, session); });
}

}  // namespace diracstep::command
