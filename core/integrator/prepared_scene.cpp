#include <algorithm>
#include <diracstep/core/integrator/prepared_scene.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/hidden_rows.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <span>
#include <sstream>
#include <utility>

namespace diracstep {

namespace {

std::string joined(const std::vector<std::string>& names) {
  constexpr std::size_t most = 50;
  std::string list;
  for (const std::string& name : std::span(names).first(std::min(most, names.size())))
    list += (list.empty() ? "'" : ", '") + name + "'";
  if (names.size() > most) list += " and " + std::to_string(names.size() - most) + " more";
  return list;
}

void require_start(const Scene& scene) {
  try {
    require_consistent(scene, scene.start);
  } catch (const InconsistentStart& off) {
    throw InconsistentStart(
        std::string(off.what()) +
        "; to move it there name what may move, guess = [\"…\"] in [start] of a scene file, or "
        "set IntegratorOptions::project_start");
  }
}

}  // namespace

PreparedScene prepared(std::shared_ptr<const Scene> given, const IntegratorOptions& options,
                       const SolverFactory& solvers) {
  PreparedScene result{completed(std::move(given)), {}};
  auto& scene = result.scene;
  require_size("scene '" + scene->name + "': the start q", scene->start.q.size(), scene->storage_size());
  if (scene->rows() > 0 && scene->start.q.allFinite()) {
    const std::vector<std::string> dependent = redundant_rows(*scene, scene->start);
    const std::string kept_for =
        dependent.empty() ? "" : why_not_left_out(row_dependence(*scene, scene->start, dependent));
    if (!kept_for.empty())
      throw Misuse("scene '" + scene->name + "': redundant constraints at the start: " + joined(dependent) +
                   "; " + kept_for);
    if (!dependent.empty() && !options.drop_redundant_rows)
      throw Misuse("scene '" + scene->name + "': redundant constraints at the start: " + joined(dependent) +
                   "; remove them, or drop them: --drop-redundant, redundant = \"drop\" in a scene file, or "
                   "IntegratorOptions::drop_redundant_rows");
    if (!dependent.empty()) {
      scene = without_rows(*scene, dependent);
      result.lines.push_back({"dropped rows", joined(dependent), "redundant constraints at the start"});
    }
  }
  const int own_rows = scene->rows();
  scene = with_hidden_rows(scene);
  if (scene->rows() > own_rows) {
    std::vector<std::string> names = scene->row_names();
    names.erase(names.begin(), names.begin() + own_rows);
    result.lines.push_back(
        {"hidden rows", joined(names), "motions without momentum; these rows determine them"});
  }
  if (options.project_start) {
    const ConsistentStart moved = project_start(*scene, scene->start, solvers);
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

}  // namespace diracstep
