#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/integrator/prepared_scene.hpp>
#include <diracstep/core/methods/default_method.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/event_steps.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/steps/matrix_form.hpp>
#include <diracstep/core/system/contradictory_rows.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <diracstep/validation/laws/scene_examination.hpp>
#include <optional>

namespace diracstep {

namespace {

constexpr long dense_limit = 1500;  // rows or unknowns of a full matrix that is taken apart
constexpr long steps_looked_at = 16;
constexpr double ill_conditioned = 1e13, no_digit_left = 4.5e15;

Eigen::MatrixXd full(const SparsityPattern& pattern, const Vector& values) {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(pattern.rows(), pattern.columns());
  const auto entries = pattern.entries();
  for (std::size_t k = 0; k < entries.size(); ++k)
    matrix(entries[k].first, entries[k].second) = values[static_cast<Eigen::Index>(k)];
  return matrix;
}

Finding examine_dimensions(const Scene& scene) {
  try {
    require_well_formed(scene);
  } catch (const Misuse& misuse) {
    return {"dimensions", false, misuse.what()};
  }
  const int n = scene.dimension(), m = scene.rows();
  return {"dimensions", m <= n || !scene.refuse_redundant_rows,
          fmt::format("{} coordinates, {} rows{}", n, m,
                      m < n    ? ""
                      : m == n ? ": they alone determine the motion"
                      : scene.refuse_redundant_rows
                          ? ": more rows than coordinates; --drop-redundant leaves out redundant ones"
                          : ": more rows than coordinates, which depend on each other")};
}

Finding examine_start(const Scene& scene) {
  try {
    require_consistent(scene, scene.start);
    return {"consistency of the start", true, "the start lies on all rows"};
  } catch (const Misuse& misuse) {
    return {"consistency of the start", false, misuse.what()};
  }
}

/// As a run judges it.
Finding examine_rank(const Scene& scene) {
  const int m = scene.rows();
  if (m == 0) return {"rank of the rows", true, "no rows"};
  const std::vector<std::string> dependent = redundant_rows(scene, scene.start);
  Finding finding{"rank of the rows", dependent.empty(),
                  fmt::format("rank {} of {} at the start", m - static_cast<int>(dependent.size()), m)};
  if (dependent.empty()) return finding;
  if (const std::string against = contradiction(scene, scene.start, dependent); !against.empty()) {
    finding.detail += "; contradictory: " + against;
    return finding;
  }
  for (const std::string& name : dependent)
    finding.detail += fmt::format("{}'{}'", &name == dependent.data() ? "; redundant: " : ", ", name);
  const std::string kept_for = why_not_left_out(row_dependence(scene, scene.start, dependent));
  finding.passed = kept_for.empty() && !scene.refuse_redundant_rows;
  finding.detail += finding.passed ? ", left out of the steps"
                    : kept_for.empty()
                        ? "; remove it, or leave it out with --drop-redundant or redundant = \"drop\""
                        : "; " + kept_for;
  return finding;
}

/// Solves with another solver and keeps the condition of the Jacobian it ended at.
class WatchedSolver final : public NonlinearSolver {
 public:
  WatchedSolver(NonlinearProblem& problem, std::unique_ptr<NonlinearSolver> solver, const bool& watching,
                double& condition)
      : problem_(problem), solver_(std::move(solver)), watching_(watching), condition_(condition) {}

  SolveReport solve(VectorRef x) override {
    SolveReport report = solver_->solve(x);
    if (!watching_ || problem_.size() == 0 || problem_.size() > dense_limit) return report;
    Vector values(problem_.pattern().nonzeros());
    problem_.jacobian(x, values);
    if (!values.allFinite()) return report;
    const Eigen::VectorXd s = full(problem_.pattern(), values).jacobiSvd().singularValues();
    condition_ = std::max(condition_, s[s.size() - 1] > 0.0 ? s[0] / s[s.size() - 1] : HUGE_VAL);
    return report;
  }
  std::string description() const override { return solver_->description(); }

 private:
  NonlinearProblem& problem_;
  std::unique_ptr<NonlinearSolver> solver_;
  const bool& watching_;
  double& condition_;
};

constexpr const char* reading_of_velocities = "velocities from momenta";

std::string why_velocities(const Integrator& integrator) {
  const Scene& scene = integrator.scene();
  if (scene.by_hamiltonian())
    return scene.rows() == 0 ? "v = ∂H/∂p: nothing is inverted" : "A ∂²H/∂p² Aᵀ is regular";
  if (scene.lagrangian->structure().phase_space())
    return "L is linear in v: the velocity follows from the position, not from the momentum";
  if (scene.lagrangian->structure().y_hessian_zero) return "L holds no v: the rows determine the velocity";
  if (first_order_motions(scene).exist())
    return "∂²L/∂v² is singular: beside momenta, the equations of motion along its kernel determine "
           "velocities";
  return "∂²L/∂v² is regular along the rows";
}

/// The method of a run that names none.
DefaultMethod method_of_a_run(const CatalogueScene& entry, const Registry& registry,
                              const SolverFactory& solvers) {
  const Recommendation& advice = entry.recommended;
  if (advice.method != automatic_method) return {advice.method, advice.order, ""};
  DefaultMethod choice = default_method(*completed(entry.scene), {.order = advice.order});
  try {
    const DefaultMethod of_motion = default_method_of_motion(entry.scene, registry, solvers, entry.t_end,
                                                             advice.step, {}, {.order = advice.order});
    if (registry.method(of_motion.method).info.damped) choice = of_motion;
  } catch (const Misuse&) {  // which the steps will tell
  }
  return choice;
}

/// Some steps as a run takes them: whether they can be solved, how well the first is conditioned, and
/// velocities read from momenta; points of the motion at steps 1, 4 and 16 go into `motion`.
void examine_steps(const CatalogueScene& entry, const Registry& registry, const SolverFactory& solvers,
                   const DefaultMethod& method, std::vector<Finding>& findings,
                   std::vector<ExaminedPoint>& motion) {
  Finding steps{"regularity of the steps", false, ""};
  std::optional<Finding> reading;
  double condition = 0.0;
  bool watching = true;
  const SolverFactory watched = [&](NonlinearProblem& problem) {
    return std::make_unique<WatchedSolver>(problem, solvers(problem), watching, condition);
  };
  const Recommendation& advice = entry.recommended;
  const double h = std::copysign(advice.step, entry.t_end - entry.scene->start.time);
  const bool large = entry.scene->dimension() + entry.scene->rows() > dense_limit;
  try {
    std::optional<Integrator> fixed;
    std::optional<AdaptiveIntegrator> variable;  // what is damped strongly is run by the local error
    if (advice.method == automatic_method && registry.method(method.method).info.damped)
      variable.emplace(entry.scene, registry, watched, IntegratorOptions{method.method, 0, h, {}},
                       AdaptiveOptions{.end = entry.t_end});
    else
      fixed.emplace(entry.scene, registry, watched, IntegratorOptions{advice.method, advice.order, h, {}});
    const Integrator& integrator = fixed ? *fixed : variable->integrator();
    StepReport report;
    for (long k = 1; k <= (large ? 1 : steps_looked_at); ++k) {
      report = fixed ? fixed->step() : variable->step();
      watching = false;
      if (!report.ok()) break;
      if (k != 1 && k != 4 && k != 16) continue;
      Sample sample;
      const SolveReport read =
          fixed ? fixed->sample(Momentum::projected, sample) : variable->sample(Momentum::projected, sample);
      if (!reading || reading->passed)
        reading = {reading_of_velocities, read.ok(),
                   read.ok() ? why_velocities(integrator) : describe(read.status)};
      if (read.ok()) motion.push_back({sample.time, sample.q, entry.scene->lagrangian ? sample.v : sample.p});
    }
    steps.passed = report.ok() && condition < no_digit_left;
    steps.detail = fmt::format("{} of order {}, {}: condition of the Jacobian {:.1e}",
                               integrator.options().method, integrator.options().order,
                               fixed ? fmt::format("step {:g}", h) : "steps by their local error", condition);
    if (condition > ill_conditioned)
      steps.detail += fmt::format("; of the 16 digits of some component {:.0f} may be left",
                                  std::max(0.0, 16.0 - std::log10(condition)));
    if (!report.ok()) steps.detail += "; " + report.failure;
  } catch (const Misuse& misuse) {
    steps.detail = misuse.what();
  }
  findings.push_back(std::move(steps));
  if (reading) findings.push_back(std::move(*reading));
}

/// Of a scene with events: whether the motion goes through them, and what was met.
void examine_events(const CatalogueScene& entry, const Registry& registry, const SolverFactory& solvers,
                    const DefaultMethod& method, std::vector<Finding>& findings) {
  if (entry.events.empty()) return;
  constexpr long most_steps = 2000;
  Finding events{"motion with its events", false, ""};
  const double start = entry.scene->start.time;
  const StepGrid grid =
      fit_steps(start, entry.t_end, std::copysign(entry.recommended.step, entry.t_end - start));
  try {
    EventSteps<Integrator> motion(
        entry.scene, entry.all_rows, entry.events, solvers, Momentum::projected,
        integrators(registry, solvers, {.method = method.method, .order = method.order, .step = grid.step}));
    StepReport report;
    for (long k = 0; k < std::min(grid.steps, most_steps) && report.ok() && !motion.stopped(); ++k)
      report = motion.step();
    events.passed = report.ok();
    events.detail = fmt::format("{} met until t = {:.6g}", motion.hits().size(), motion.time());
    if (!motion.hits().empty())
      events.detail +=
          fmt::format(", the last '{}' at t = {:.10g}", motion.events()[motion.hits().back().event].name,
                      motion.hits().back().sample.time);
    if (!report.ok()) events.detail += "; " + report.failure;
  } catch (const Misuse& misuse) {
    events.detail = misuse.what();
  }
  findings.push_back(std::move(events));
}

std::vector<std::string> advise(const CatalogueScene& entry, const DefaultMethod& choice,
                                const Examination& examination) {
  const Scene& scene = *entry.scene;
  std::vector<std::string> advice;
  const Finding& last = examination.findings.back();
  if (scene.lagrangian && !last.passed) {
    if (last.what == reading_of_velocities)
      advice.emplace_back(
          "the Lagrangian is degenerate along the rows: momenta do not determine the velocities");
    return advice;
  }
  const PhaseStructure structure =
      scene.lagrangian ? scene.lagrangian->structure() : scene.hamiltonian->structure();
  if (structure.quadratic && scene.constraints.empty() && !scene.force)
    advice.emplace_back("linear: every step has the same Jacobian");
  else if (structure.separable && scene.by_hamiltonian() && scene.constraints.empty() && !scene.force)
    advice.emplace_back("separable: type2/euler is explicit and cheap where nothing is stiff");
  else if (structure.separable && structure.y_hessian_constant && scene.constraints.empty() && !scene.force)
    advice.emplace_back("separable: type1/trapezoidal is explicit and cheap where nothing is stiff");
  if (entry.recommended.stated) {
    const bool named = entry.recommended.method != automatic_method;
    advice.push_back(fmt::format(
        "without --method and --order a run takes {}{}, as the file recommends",
        named ? entry.recommended.method : choice.method,
        entry.recommended.order > 0 ? fmt::format(", order {}", entry.recommended.order) : std::string()));
  } else {
    advice.push_back(fmt::format("without --method a run takes {}, {}; --order 8 to 12 for errors below 1e-6",
                                 choice.method, choice.reason));
  }
  if (const MatrixForm form = matrix_form(scene, as_measured); !form.full)
    advice.push_back("sparse matrices: " + form.reason);
  if (scene.force)
    advice.emplace_back(
        "forces that damp strongly lose accuracy in composed orders, whose inner steps go backwards; "
        "try order 2 with a small step beside them");
  return advice;
}

}  // namespace

bool Examination::passed() const { return std::ranges::all_of(findings, &Finding::passed); }

Examination examine(const CatalogueScene& entry, const Registry& registry, const SolverFactory& solvers) {
  Examination examination;
  const auto scene = with_determined_start(completed(entry.scene), solvers);
  std::vector<Finding>& findings = examination.findings;
  findings = {examine_dimensions(*scene), examine_start(*scene), examine_rank(*scene)};
  std::vector<Finding> steps;
  std::vector<ExaminedPoint> motion;
  const DefaultMethod method = method_of_a_run(entry, registry, solvers);
  examine_steps(entry, registry, solvers, method, steps, motion);
  for (Finding& finding : examine_derivatives(*entry.scene, motion)) findings.push_back(std::move(finding));
  if (entry.scene->lagrangian && entry.scene->hamiltonian)
    findings.push_back(examine_legendre_transform(*entry.scene, motion));
  findings.insert(findings.end(), steps.begin(), steps.end());
  examination.advice = advise(entry, method, examination);
  examine_events(entry, registry, solvers, method, findings);
  return examination;
}

}  // namespace diracstep
