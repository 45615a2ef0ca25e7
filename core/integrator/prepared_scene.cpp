#include <diracstep/core/integrator/point_reader.hpp>
#include <diracstep/core/integrator/prepared_scene.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/names.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/contradictory_rows.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/core/system/hamiltonian_point.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <diracstep/core/system/kernel_motions.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <sstream>
#include <utility>

namespace diracstep {

namespace {

void require_start(const Scene& scene, const FirstOrderMotions& motions = {}) {
  try {
    if (motions.hide_equations()) require_on_hidden(scene, motions);
    if (motions.levels.empty()) require_consistent(scene, scene.start);  // else velocities are not given
  } catch (const InconsistentStart& off) {
    throw InconsistentStart(
        scene.name, off.reason(), off.of(),
        "; to move it there name what may move, guess = [\"…\"] in [start] of a scene file, or "
        "set IntegratorOptions::project_start");
  }
}

/// So close to depending on each other, rows have forces that no double can tell from each other's.
constexpr double nearly_dependent = 3e-8;

/// The rows that can be left out, where they may be; throws Misuse for other redundant ones.
std::vector<std::string> dependent_rows(const Scene& scene, bool may_be_left_out) {
  if (scene.rows() == 0 || !scene.start.q.allFinite()) return {};
  const std::vector<std::string> nearly = redundant_rows(scene, scene.start, nearly_dependent);
  if (nearly.empty()) return {};
  const std::string of_scene = "scene '" + scene.name + "': ";
  std::vector<std::string> dependent = redundant_rows(scene, scene.start);
  if (dependent.empty()) {
    // Beside a singular pose steps lead away from it.
    if (row_dependence(scene, scene.start, nearly, nearly_dependent) == RowDependence::at_start_only)
      return {};
    throw Misuse(
        of_scene + "nearly redundant constraints, to within 3e-8 of their size: " + name_list(nearly) +
        " beside " + name_list(combined_rows(scene, scene.start, nearly.front(), nearly)) +
        "; their forces cannot be told apart: write rows that differ by more, such as the difference of "
        "two divided by what is small in it");
  }
  if (const std::string against = contradiction(scene, scene.start, dependent); !against.empty())
    throw Misuse(of_scene + "contradictory constraints: " + against);
  const std::string redundant =
      of_scene + "redundant constraints at the start: " + name_list(dependent) + "; ";
  const std::string kept_for = why_not_left_out(row_dependence(scene, scene.start, dependent));
  if (!kept_for.empty()) throw Misuse(redundant + kept_for);
  if (!may_be_left_out)
    throw Misuse(redundant +
                 "remove them, or drop them: --drop-redundant, redundant = \"drop\" in a scene file, or "
                 "IntegratorOptions::drop_redundant_rows");
  return dependent;
}

}  // namespace

std::shared_ptr<const Scene> with_independent_rows(const std::shared_ptr<const Scene>& scene,
                                                   bool also_refused) {
  const std::vector<std::string> dependent =
      dependent_rows(*scene, also_refused || !scene->refuse_redundant_rows);
  return dependent.empty() ? scene : with_rows_left_out(scene, dependent);
}

PreparedScene prepared(std::shared_ptr<const Scene> given, const IntegratorOptions& options,
                       const SolverFactory& solvers) {
  PreparedScene result{completed(std::move(given)), {}};
  auto& scene = result.scene;
  require_size("scene '" + scene->name + "': the start q", scene->start.q.size(), scene->storage_size());
  scene = with_independent_rows(scene, options.drop_redundant_rows);
  if (scene->whole)
    result.lines.push_back({"dropped rows", name_list(rows_left_out(*scene)),
                            "redundant constraints at the start; forces_of_whole() gives the forces of all"});
  if (scene->by_hamiltonian()) require_regular_rows(*scene);
  const int own_rows = scene->rows();
  scene = with_hidden_rows(scene);
  if (scene->rows() > own_rows) {
    std::vector<std::string> names = scene->row_names();
    names.erase(names.begin(), names.begin() + own_rows);
    result.lines.push_back(
        {"hidden rows", name_list(names), "motions without momentum; these rows determine them"});
  }
  if (const FirstOrderMotions motions = first_order_motions(*scene);
      motions.exist() && scene->start.v.size() == scene->dimension() && !by_two_form_alone(*scene, motions)) {
    if (motions.hide_equations() && options.project_start) {
      auto moved = std::make_shared<Scene>(*scene);
      moved->start = project_start(*scene, scene->start, solvers).start;
      scene = moved;
    }
    if (motions.hide_equations()) require_start(*scene, motions);
    require_determined(*scene, motions);
    auto copy = std::make_shared<Scene>(*scene);
    PointReader(scene, solvers, true).determine(copy->start);
    scene = copy;
    result.lines.push_back({"velocities",
                            motions.by_force           ? "by forces"
                            : !motions.levels.empty()  ? "by the constraint algorithm"
                            : motions.hide_equations() ? "along the kernel of the masses"
                                                       : "of motions of first order",
                            std::to_string(motions.w.cols()) + " of " + std::to_string(scene->dimension()) +
                                " are no data of a motion: positions and rows determine them"});
  }
  if (options.project_start) {
    const ProjectedStart moved = project_start(*scene, scene->start, solvers);
    auto copy = std::make_shared<Scene>(*scene);
    copy->start = moved.start;
    scene = copy;
    std::ostringstream text;
    text << "q moved by " << moved.position_moved << ", v by " << moved.velocity_moved;
    result.lines.push_back({"start", "projected", text.str()});
  }
  require_start(*scene);
  return result;
}

std::shared_ptr<const Scene> with_determined_start(std::shared_ptr<const Scene> scene,
                                                   const SolverFactory& solvers) {
  if (scene->start.v.size() != scene->dimension() || !first_order_motions(*scene).exist()) return scene;
  auto copy = std::make_shared<Scene>(*scene);
  try {
    PointReader(scene, solvers, true).determine(copy->start);
  } catch (const Misuse&) {
    return scene;
  }
  return copy;
}

}  // namespace diracstep
