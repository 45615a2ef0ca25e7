#include <diracstep/c_interface/point_writer.hpp>
#include <diracstep/core/runs/ensemble.hpp>
#include <diracstep/core/runs/run.hpp>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace {

std::vector<Start> starts_of(const diracstep_model& model, const diracstep_ensemble& ensemble) {
  const auto n = static_cast<std::size_t>(model.scene->dimension()),
             s = static_cast<std::size_t>(model.scene->storage_size());
  const double* const q = &given(ensemble.q, "the list of starts q");
  std::vector<Start> starts(static_cast<std::size_t>(ensemble.members), model.scene->start);
  for (std::size_t k = 0; k < starts.size(); ++k) {
    if (ensemble.time != nullptr) starts[k].time = ensemble.time[k];
    starts[k].q = Eigen::Map<const Vector>(q + k * s, static_cast<Eigen::Index>(s));
    if (ensemble.v != nullptr)
      starts[k].v = Eigen::Map<const Vector>(ensemble.v + k * n, static_cast<Eigen::Index>(n));
  }
  return starts;
}

/// The starting time; throws Misuse where members that are to end at one time have several.
double start_of_all(const diracstep_model& model, const diracstep_ensemble& ensemble) {
  if (ensemble.time == nullptr || ensemble.members == 0) return model.scene->start.time;
  const double first = ensemble.time[0];
  if (ensemble.steps == 0)
    for (int k = 1; k < ensemble.members; ++k)
      if (ensemble.time[k] != first)
        throw Misuse("members 0 and " + std::to_string(k) + " start at " + to_text(first) + " and " +
                     to_text(ensemble.time[k]) +
                     ": steps of one size that end at one time need one start; give the number of steps");
  return first;
}

void require_room_for_all(const diracstep_ensemble& ensemble, const diracstep_points& ends) {
  if (ensemble.members < 0 || ensemble.steps < 0)
    throw Misuse("members = " + std::to_string(ensemble.members) +
                 ", steps = " + std::to_string(ensemble.steps) + "; 0 or more are needed");
  if (ends.room < ensemble.members)
    throw Misuse("there is room for " + std::to_string(ends.room) + " ends of " +
                 std::to_string(ensemble.members) + " members");
}

void run(const diracstep_model& model, const diracstep_options& options, const diracstep_ensemble& ensemble,
         diracstep_points& ends, diracstep_table* told) {
  const CatalogueScene& entry = entry_of(model);
  require_room_for_all(ensemble, ends);
  if (steps_vary(options) || options.pushed != 0)
    throw Misuse("ensembles need steps of fixed size, and no push");
  IntegratorOptions stepping = stepping_from(model, options);
  const double start = start_of_all(model, ensemble);
  stepping.step = open_step(model, options, start);
  diracstep_options chosen = options;
  chosen.fixed = 1;
  choose_method(model, chosen, stepping);
  stepping.step = fitted_step(options, start, stepping.step);
  const long steps =
      ensemble.steps > 0 ? ensemble.steps : fit_steps(start, end_from(model, options), stepping.step).steps;
  const auto members =
      run_ensemble(entry.scene, model.registry, solvers_from(options), stepping, starts_of(model, ensemble),
                   steps, momentum_from(ensemble.momentum), ensemble.threads,
                   [&] { return !stopped(ensemble.stop); }, {entry.all_rows, entry.events});
  PointWriter writer(ends, entry);
  std::vector<std::string> cells;
  long unread = 0;
  for (std::size_t k = 0; k < members.size(); ++k) {
    if (members[k].end.q.size() > 0)
      writer.write(members[k].end, static_cast<long>(k));
    else
      ++unread;
    if (!members[k].last.ok())
      cells.insert(cells.end(), {std::to_string(k), "failed", members[k].last.failure});
    else if (!members[k].doubt.empty())
      cells.insert(cells.end(), {std::to_string(k), "doubted", members[k].doubt});
  }
  ends.count = ensemble.members;
  if (told != nullptr) *told = keep(3, std::move(cells));
  if (stopped(ensemble.stop) && unread > 0)
    throw Interruption("interrupted; " + std::to_string(unread) + " members were not stepped");
}

}  // namespace

int diracstep_run_ensemble(const diracstep_model* model, const diracstep_options* options,
                           const diracstep_ensemble* ensemble, diracstep_points* ends,
                           diracstep_table* told) {
  return guarded([&] {
    if (told != nullptr) *told = {};
    run(given(model, "the model"), options != nullptr ? *options : diracstep_options{},
        given(ensemble, "the ensemble"), given(ends, "where the ends go"), told);
  });
}
