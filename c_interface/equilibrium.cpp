#include <cmath>
#include <complex>
#include <diracstep/c_interface/point_writer.hpp>
#include <diracstep/core/equilibrium/small_motions.hpp>
#include <diracstep/core/integrator/solved_start.hpp>
#include <diracstep/eigenvalues/largest_eigenpairs.hpp>
#include <diracstep/scene_format/position_names.hpp>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace {

void copy(const Vector& column, double* to) {
  if (to != nullptr) std::copy(column.begin(), column.end(), to);
}

void add_parts(const std::complex<double>& value, std::vector<double>& to) {
  to.insert(to.end(), {value.real(), value.imag()});
}

/// Forces of the rows that are shown.
Vector forces_at_rest(const diracstep_model& model, const Equilibrium& at) {
  const int shown = model.entry.shown().rows();
  if (at.lambda.size() == shown) return at.lambda;
  Vector all = shown_forces(model.entry, at.time, at.q, at.lambda);
  all.conservativeResizeLike(Vector::Zero(shown));
  return all;
}

void tell_point(const diracstep_model& model, const Equilibrium& at, diracstep_equilibrium& found) {
  found.time = at.time;
  found.iterations = at.iterations;
  found.q = keep_entries(at.q);
  found.v = keep_entries(at.v);
  found.lambda = keep_entries(forces_at_rest(model, at));
}

void tell_matrices(const Linearisation& linear, diracstep_equilibrium& found) {
  found.redundant_rows = linear.redundant_rows;
  found.positions = static_cast<int>(linear.positions.cols());
  found.velocities = static_cast<int>(linear.velocities.cols());
  found.of_positions = keep_matrix(linear.positions);
  found.of_velocities = keep_matrix(linear.velocities);
  found.drift = keep_matrix(linear.drift);
  found.mass = keep_matrix(linear.mass);
  found.damping = keep_matrix(linear.damping);
  found.stiffness = keep_matrix(linear.stiffness);
}

void tell_motions(const SmallMotions& small, diracstep_equilibrium& found) {
  std::vector<double> values, shapes;
  for (const Mode& mode : small.modes.modes) {
    add_parts(mode.eigenvalue, values);
    for (const std::complex<double>& component : mode.shape) add_parts(component, shapes);
  }
  found.modes = static_cast<int>(small.modes.modes.size());
  found.eigenvalue = keep_numbers(std::move(values));
  found.shape = keep_numbers(std::move(shapes));
  found.zeros = small.modes.zeros;
  found.zeros_below = small.modes.zeros_below;
  found.free_directions = static_cast<int>(small.modes.free_directions.cols());
  found.free = keep_matrix(small.modes.free_directions.transpose());
  found.stability = describe(small.modes.stability);
  found.variation = small.variation;
  if (small.nearest) found.near = small.nearest->near;
  if (small.linear) tell_matrices(*small.linear, found);
  found.doubt = keep(small.doubt);
}

SmallMotionOptions modes_from(const diracstep_rest& rest) {
  constexpr int most = 1000;
  if (rest.modes < 0 || rest.modes > most)
    throw Misuse("modes is " + std::to_string(rest.modes) + "; a number from 0 to " + std::to_string(most) +
                 " is needed");
  if (rest.nearby != 0 && !std::isfinite(rest.near))
    throw Misuse("near is " + to_text(rest.near) + "; a finite number is needed");
  SmallMotionOptions options;
  if (rest.modes > 0) options.modes = rest.modes;
  if (rest.nearby != 0) options.near = rest.near;
  return options;
}

void find(const diracstep_model& model, const diracstep_rest& rest, diracstep_equilibrium& found) {
  const SmallMotionOptions options = modes_from(rest);
  const CatalogueScene& entry = entry_of(model);
  const bool all = entry.events.empty() && entry.all_rows && !model.drop_redundant;
  std::shared_ptr<const Scene> scene = all ? entry.all_rows : entry.scene;
  const auto go_on = [stop = rest.stop] { return !stopped(stop); };
  const auto require_wanted = [&] {
    if (stopped(rest.stop)) throw Interruption("interrupted");
  };
  Equilibrium at = find_equilibrium(*scene, scene->start, rest.along != 0, go_on);
  require_wanted();
  if (all && !at.ok()) {  // rows that are redundant on their surface alone stop it
    Equilibrium by_independent = find_equilibrium(*entry.scene, entry.scene->start, rest.along != 0, go_on);
    require_wanted();
    if (by_independent.ok()) {
      scene = entry.scene;
      at = std::move(by_independent);
    }
  }
  tell_point(model, at, found);
  if (!at.ok()) throw Failure("no equilibrium found: " + at.failure);
  tell_motions(small_motions(*scene, at, entry.t_end, options, largest_eigenpairs), found);
}

std::vector<std::string> origins_of(const CatalogueScene& entry) {
  std::vector<std::string> cells;
  if (!entry.stated_start) return cells;
  const StatedStart& stated = *entry.stated_start;
  const auto add = [&cells](const std::vector<std::string>& names, const std::string& prefix,
                            const std::vector<StartOrigin>& origins, const Vector& values) {
    for (std::size_t i = 0; i < std::min(names.size(), origins.size()); ++i)
      cells.insert(cells.end(), {prefix + names[i], describe(origins[i]),
                                 i < static_cast<std::size_t>(values.size())
                                     ? to_text(values[static_cast<Eigen::Index>(i)], 17)
                                     : ""});
  };
  add(position_names(*entry.scene), "", stated.q, stated.start.q);
  const bool momenta = stated.start.v.size() == 0;
  add(entry.scene->coordinates, momenta ? "p_" : "v_", stated.v, momenta ? stated.start.p : stated.start.v);
  return cells;
}

}  // namespace

int diracstep_solve_start(const diracstep_model* model, diracstep_state* state, double* acceleration,
                          diracstep_table* origins) {
  return guarded([&] {
    const diracstep_model& of = given(model, "the model");
    const CatalogueScene& entry = entry_of(of);
    diracstep_state& to = given(state, "the state");
    const SolvedStart solved =
        solved_start(entry.scene, {.drop_redundant_rows = of.drop_redundant}, solvers_from({}));
    Sample sample = solved.sample;
    sample.lambda = shown_forces(entry, sample.time, sample.q, sample.lambda);
    to.time = sample.time;
    to.energy = sample.energy;
    copy(sample.q, to.q);
    copy(sample.v, to.v);
    copy(sample.p, to.p);
    write_forces(entry, sample, to.lambda);
    write_numbers(entry, sample, to.invariants, to.outputs);
    const bool accelerated = solved.acceleration.size() > 0;
    copy(accelerated ? solved.acceleration : Vector::Constant(entry.scene->dimension(), std::nan("")),
         acceleration);
    if (origins != nullptr) *origins = keep(3, origins_of(entry));
  });
}

int diracstep_find_equilibrium(const diracstep_model* model, const diracstep_rest* rest,
                               diracstep_equilibrium* found) {
  return guarded([&] {
    diracstep_equilibrium& told = given(found, "where the findings go");
    told = {};
    told.stability = told.doubt = "";
    told.near = told.variation = std::nan("");
    find(given(model, "the model"), rest != nullptr ? *rest : diracstep_rest{}, told);
  });
}
