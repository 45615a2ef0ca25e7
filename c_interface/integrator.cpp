#include <diracstep/c_interface/handles.hpp>
#include <diracstep/c_interface/pushed_force.hpp>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/adaptive/rate_survey.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace {

/// Throws Misuse where steps vary.
template <class Handle>
auto& fixed_of(Handle& handle, const char* what) {
  auto* const fixed = std::get_if<Integrator>(&handle.stepper);
  if (fixed == nullptr) throw Misuse(std::string(what) + " needs steps of fixed size");
  return *fixed;
}

void require_ok(const StepReport& report) {
  if (!report.failure.empty()) throw Failure(report.failure);
}

std::shared_ptr<const Scene> pushed(const Scene& scene, const std::shared_ptr<const Vector>& push) {
  Scene copy = scene;
  copy.force = std::make_shared<const PushedForce>(scene.force, push);
  return std::make_shared<const Scene>(std::move(copy));
}

AdaptiveIntegrator varying(const diracstep_model& model, const std::shared_ptr<const Scene>& scene,
                           const IntegratorOptions& stepping, const diracstep_options& options) {
  AdaptiveOptions adaptive{.eps = options.eps, .control = control_from(options)};
  if (const double end = end_from(model, options); end != model.scene->start.time) adaptive.end = end;
  adaptive.smallest_step = options.smallest_step;
  if (options.max_steps != 0) adaptive.max_steps = options.max_steps;
  return {scene, model.registry, solvers_from(options), stepping, adaptive};
}

std::vector<PlanLine> notes_of(const diracstep_model& model, const diracstep_options& options) {
  std::vector<PlanLine> notes;
  for (const std::string& change : model.entry.changes) notes.push_back({"scene", "changed", change});
  if (options.method == nullptr && options.order == 0 && model.entry.recommended.stated)
    notes.push_back({"method", model.entry.recommended.method, "the scene's file recommends it"});
  return notes;
}

/// The method where none is named, and where eps is not given in radians, which say how a reversible step is
/// to vary; a force that its owner changes is not known yet.
void choose_method(const diracstep_model& model, const diracstep_options& options,
                   IntegratorOptions& stepping) {
  if (stepping.method != automatic_method || options.eps > 0.0 || options.pushed != 0) return;
  const double end = end_from(model, options);
  if (end == model.scene->start.time) return;
  const DefaultMethod choice = default_method_of_motion(
      entry_of(model).scene, model.registry, solvers_from(options), end, std::abs(stepping.step), stepping,
      {stepping.order, 0.0, stepping.constraint_rule, large_from(stepping.dense_limit)});
  if (model.registry.method(choice.method).info.damped) stepping.method = choice.method;
}

std::unique_ptr<diracstep_integrator> make(const diracstep_model& model, const diracstep_options& options) {
  const CatalogueScene& entry = entry_of(model);
  std::shared_ptr<const Scene> scene = entry.scene;
  std::shared_ptr<Vector> push;
  if (options.pushed != 0) {
    push = std::make_shared<Vector>(Vector::Zero(scene->dimension()));
    scene = pushed(*scene, push);
  }
  IntegratorOptions stepping = stepping_from(model, options);
  stepping.step = step_from(model, options);
  choose_method(model, options, stepping);
  using Stepper = std::variant<Integrator, AdaptiveIntegrator>;
  Stepper stepper = steps_vary(options)
                        ? Stepper(varying(model, scene, stepping, options))
                        : Stepper(Integrator(scene, model.registry, solvers_from(options), stepping));
  auto handle = std::make_unique<diracstep_integrator>(diracstep_integrator{
      std::move(stepper), model.scene, entry.invariants, !entry.scene->lagrangian, !entry.events.empty(),
      entry.parameters, notes_of(model, options), end_from(model, options), std::move(push)});
  if (const auto* const made = std::get_if<AdaptiveIntegrator>(&handle->stepper))
    handle->side = [scene, registry = model.registry, solvers = solvers_from(options),
                    used = made->options()] { return Integrator(scene, registry, solvers, used); };
  return handle;
}

void write(const Vector& column, double* to) {
  if (to != nullptr) std::copy(column.begin(), column.end(), to);
}

/// Throws Misuse where the snapshot is of a scene with other parameters.
void read_parameters(SnapshotReader& from, const Parameters& parameters) {
  from.section("parameters");
  for (const auto& [name, value] : parameters)
    if (const double saved = from.number(name); saved != value)
      throw Misuse("the snapshot is of " + name + " = " + to_text(saved) + "; this scene has " + name +
                   " = " + to_text(value));
}

Eigen::Map<const Vector> column(const double* numbers, const diracstep_integrator& handle) {
  return {numbers, handle.scene->dimension()};
}

}  // namespace

const Integrator& diracstep_integrator::stepping() const {
  if (const auto* const varying = std::get_if<AdaptiveIntegrator>(&stepper)) return varying->integrator();
  return std::get<Integrator>(stepper);
}

int diracstep_create(const diracstep_model* model, const diracstep_options* options,
                     diracstep_integrator** integrator) {
  return guarded([&] {
    given(integrator, "where the integrator goes") = nullptr;
    *integrator =
        make(given(model, "the model"), options != nullptr ? *options : diracstep_options{}).release();
  });
}

void diracstep_destroy(diracstep_integrator* integrator) { delete integrator; }

int diracstep_plan(const diracstep_integrator* integrator, diracstep_table* table) {
  return guarded([&] {
    const diracstep_integrator& from = given(integrator, "the integrator");
    std::vector<PlanLine> lines = std::visit([](const auto& made) { return made.plan(); }, from.stepper);
    const Integrator& stepping = from.stepping();
    if (from.end != from.scene->start.time)
      lines.push_back(variable_steps_line(from.scene, kinsol(), from.end, stepping.options().step, "eps"));
    lines.insert(lines.end(), from.notes.begin(), from.notes.end());
    std::vector<std::string> cells;
    for (const PlanLine& line : lines) cells.insert(cells.end(), {line.item, line.decision, line.reason});
    given(table, "where the table goes") = keep(3, std::move(cells));
  });
}

int diracstep_step(diracstep_integrator* integrator, long steps) {
  return guarded([&] {
    auto& stepper = given(integrator, "the integrator").stepper;
    if (steps < 0) throw Misuse("steps is " + std::to_string(steps) + "; 0 or more are needed");
    require_ok(std::visit([&](auto& made) { return take_steps(made, steps); }, stepper));
  });
}

int diracstep_step_by(diracstep_integrator* integrator, double h) {
  return guarded(
      [&] { require_ok(fixed_of(given(integrator, "the integrator"), "a step of this size").step(h)); });
}

int diracstep_push(diracstep_integrator* integrator, const double* force) {
  return guarded([&] {
    const diracstep_integrator& to = given(integrator, "the integrator");
    if (!to.push) throw Misuse("the integrator was created without the option 'pushed'");
    const auto numbers = column(&given(force, "the force"), to);
    if (!numbers.allFinite()) throw Misuse("the force is not finite");
    *to.push = numbers;
  });
}

int diracstep_read(diracstep_integrator* integrator, int momentum, diracstep_state* state) {
  return guarded([&] {
    diracstep_integrator& from = given(integrator, "the integrator");
    diracstep_state& to = given(state, "the state");
    const Momentum wanted = momentum_from(momentum);
    Sample& sample = from.sample;
    const SolveReport report =
        std::visit([&](auto& made) { return made.sample(wanted, sample); }, from.stepper);
    if (!report.ok()) throw Failure(std::string("reading the state: ") + describe(report.status));
    to.time = sample.time;
    to.energy = sample.energy;
    write(sample.q, to.q);
    write(sample.v, to.v);
    write(sample.p, to.p);
    const Eigen::Index rows = std::min<Eigen::Index>(from.scene->rows(), sample.lambda.size());
    write(sample.lambda.head(rows), to.lambda);  // an integrator may know more rows than the scene
  });
}

double diracstep_time(const diracstep_integrator* integrator) {
  return integrator != nullptr ? integrator->stepping().time() : 0.0;
}

int diracstep_reset(diracstep_integrator* integrator, double time, const double* q, const double* v) {
  return guarded([&] {
    diracstep_integrator& handle = given(integrator, "the integrator");
    if ((q == nullptr) != (v == nullptr)) throw Misuse("only one of q and v is NULL; both or none must be");
    handle.doubt.clear();
    if (q == nullptr)
      std::visit([](auto& made) { made.reset(); }, handle.stepper);
    else
      fixed_of(handle, "another start").reset({time, column(q, handle), column(v, handle)});
  });
}

int diracstep_save(const diracstep_integrator* integrator, char* bytes, size_t room, size_t* size) {
  return guarded([&] {
    const diracstep_integrator& from = given(integrator, "the integrator");
    Snapshot snapshot;
    snapshot.section("parameters");
    for (const auto& [name, value] : from.parameters) snapshot.put(name, value);
    if (from.push) snapshot.put("push", *from.push);
    fixed_of(from, "a snapshot").save(snapshot);
    const std::string saved = snapshot.bytes();
    given(size, "where the size goes") = saved.size();
    if (bytes != nullptr && room >= saved.size()) saved.copy(bytes, saved.size());
  });
}

int diracstep_restore(diracstep_integrator* integrator, const char* bytes, size_t size) {
  return guarded([&] {
    diracstep_integrator& handle = given(integrator, "the integrator");
    Integrator& to = fixed_of(handle, "a snapshot");
    const Snapshot snapshot = Snapshot::from_bytes({&given(bytes, "the snapshot"), size});
    try {
      SnapshotReader reader(snapshot);
      read_parameters(reader, handle.parameters);
      Vector push = handle.push ? *handle.push : Vector();
      if (handle.push) reader.read("push", push);
      to.restore(reader);
      reader.require_end();
      if (handle.push) *handle.push = push;
    } catch (const Misuse&) {
      to.reset();
      throw;
    }
  });
}

const char* diracstep_doubt(const diracstep_integrator* integrator) {
  begin_call();
  if (integrator == nullptr) return "";
  const Scene& scene = integrator->stepping().scene();
  if (!integrator->doubt.empty() || !scene.doubt) return keep(integrator->doubt);
  return keep(scene.doubt());
}

int diracstep_read_statistics(const diracstep_integrator* integrator, diracstep_statistics* statistics) {
  return guarded([&] {
    const diracstep_integrator& from = given(integrator, "the integrator");
    diracstep_statistics& to = given(statistics, "where the statistics go");
    const Work& work = from.stepping().work();
    const IntegratorOptions& options = from.stepping().options();
    to = {};
    to.steps = work.steps;
    to.solves = work.solves;
    to.iterations = work.iterations;
    to.residuals = work.residual_evaluations;
    to.jacobians = work.jacobian_evaluations;
    to.retries = work.retries.total();
    to.order = options.order;
    to.method = options.method.c_str();
    if (const auto* const varying = std::get_if<AdaptiveIntegrator>(&from.stepper)) {
      to.order = varying->options().order;
      to.smallest = varying->control().smallest_step;
      to.largest = varying->control().largest_step;
      to.resets = varying->control().resets;
    } else {
      to.step = options.step;
    }
  });
}
