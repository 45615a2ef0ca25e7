#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/integrator/kept_momenta.hpp>
#include <diracstep/core/integrator/step_sequence.hpp>
#include <diracstep/core/numerics/names.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/steps/groups/step.hpp>
#include <diracstep/core/system/first_order_motions.hpp>

namespace diracstep {

namespace {

PlanLine space_line(const Scene& scene) {
  const std::string sizes = std::to_string(scene.storage_size()) + " numbers for " +
                            std::to_string(scene.dimension()) + " velocities, left-trivialised";
  return {"space", scene.space->name(),
          reduced_on_group(scene) ? sizes +
                                        "; reduced: L and the rows do not depend on the configuration, which "
                                        "follows from the velocities"
                                  : sizes};
}

/// The first of them by name, and how many more.
PlanLine kept_momenta_line(const Scene& scene, const std::vector<std::string>& names) {
  const std::string function = scene.by_hamiltonian() ? "H" : "L";
  return {
      "cyclic coordinates", name_list(names, 6, {}),
      function + (scene.space ? " does not change along them, as axes of space, and neither rows nor forces "
                                "act there: these momenta in space are kept"
                              : " does not depend on them, and neither rows nor forces act along them: "
                                "their momenta are kept")};
}

}  // namespace

std::vector<PlanLine> Integrator::plan() const {
  const StepSolver& part = sequence_->part();
  const StepProblem& problem = part.problem();
  const NonlinearSolver* const solver = part.solver();
  const int m = scene_->rows();
  std::vector<PlanLine> lines = preparation_;
  const MethodInfo& info = method_.info;
  lines.push_back(
      {"step", info.name, info.solved_as.empty() ? info.summary : info.summary + "; " + info.solved_as});
  if (scene_->space) lines.push_back(space_line(*scene_));
  if (const auto kept = kept_momenta(*scene_); !kept.empty())
    lines.push_back(kept_momenta_line(*scene_, kept));
  lines.push_back(
      {"unknowns", problem.traits().unknowns,
       solver != nullptr ? "one nonlinear system in each solve" : "the graph is solved for its end"});
  if (solver != nullptr)
    lines.push_back({"nonlinear solver", solver->description(), solver->strategy()});
  else
    lines.push_back({"nonlinear solver", "left out", "the step is explicit and there are no rows"});
  if (solver != nullptr) {
    const int nonzeros = problem.pattern().nonzeros();
    const MatrixForm matrices = matrix_form(*scene_, options_.dense_limit);
    lines.push_back({"Jacobian", matrices.full ? "full" : "sparse",
                     std::to_string(problem.size()) + " unknowns, " + std::to_string(nonzeros) +
                         " entries: " + matrices.reason});
  }
  if (m == 0) {
    lines.push_back({"multipliers", "left out", "the scene has no rows"});
    lines.push_back({"projection", "left out", "every momentum is that of a velocity"});
  } else {
    const ConstraintRule rule = options_.constraint_rule.value_or(method_.info.constraint_rule);
    const FirstOrderMotions motions = first_order_motions(*scene_);
    const bool first_order = motions.exist() && !motions.by_force && !method_.info.damped;
    lines.push_back(
        {"multipliers", std::to_string(m) + (method_.info.rows_inside ? " a node" : ""),
         first_order && !motions.levels.empty() ? "all rows at the Gauss nodes: constraints of levels"
         : first_order && motions.hide_equations()
             ? "hidden equations and holonomic rows at the Lobatto, others at the Gauss nodes"
         : first_order              ? "all rows at the Gauss nodes: motions of first order"
         : method_.info.damped      ? "all rows, and the rates of holonomic rows, at the Radau nodes"
         : method_.info.rows_inside ? "nonholonomic rows at the Gauss, holonomic rows at the Lobatto nodes"
                                    : std::string("nonholonomic rows by the ") + rule.description() +
                                          " rule, holonomic rows at the end of the step"});
    if (first_order && !motions.levels.empty())
      lines.push_back({"projection", "at both ends", "onto rows and the constraints of all levels"});
    else if (first_order && motions.hide_equations())
      lines.push_back(
          {"projection", "left out", "a step ends on all rows and equations without accelerations"});
    else if (first_order)
      lines.push_back(
          {"projection", "at both ends", "onto holonomic rows; p = ∂L/∂v along motions of first order"});
    else if (method_.info.damped)
      lines.push_back({"projection", "left out", "a step ends on all rows, with the momentum of a velocity"});
    else
      lines.push_back(
          {"projection", "where the state is read", "p is defined up to the annihilator between steps"});
  }
  lines.push_back({"composition",
                   sequence_->stages() == 1 ? "left out" : std::to_string(sequence_->stages()) + " stages",
                   "order " + std::to_string(options_.order) + ", the method's own is " +
                       std::to_string(method_.info.order)});
  lines.push_back({"forces",
                   !scene_->force        ? "left out"
                   : method_.info.damped ? "at the Radau nodes"
                                         : "two impulses a step",
                   !scene_->force        ? "the scene has none"
                   : method_.info.damped ? "with those of L"
                                         : "by the rule of the rows"});
  lines.push_back(
      {"Hamiltonian", scene_->hamiltonian ? "given" : "derived only by methods that need it", ""});
  return lines;
}

}  // namespace diracstep
