#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/groups/stages.hpp>
#include <diracstep/core/steps/groups/step.hpp>

namespace diracstep {

void GroupNode::place(const Space& space, const Columns& v) {
  const Eigen::Index d = space.group_dimension();
  x = v * alpha;
  Columns forth(d, d);
  adjoint_back.resize(d, d);
  dtau.resize(d, d);
  dtau_back.resize(d, d);
  space.maps(x, forth, dtau);
  space.maps(-x, adjoint_back, dtau_back);
}

GroupStages::GroupStages(int stages, const Scene& of)
    : scene(of),
      space(*of.space),
      s(stages),
      n(of.dimension()),
      m(of.rows()),
      table(gauss_lobatto_tableau(stages)),
      reduced(reduced_on_group(of)),
      rows_at_start(of) {
  gauss.resize(at(s));
  lobatto.resize(at(s) + 1);
  for (int i = 0; i < s; ++i) points.emplace_back(of);
  for (int j = 0; j <= s; ++j) rows.emplace_back(of);
  for (int i = 0; i < s; ++i) gauss_rows.emplace_back(of);
}

void GroupStages::begin(Interval of, const State& start) {
  if (of.start != step.start) failure.clear();
  step = of;
  q0 = start.q;
  p0.resize(space.group_dimension());
  space.embed(start.p, p0);
  for (int i = 0; i < s; ++i) set_node(gauss[at(i)], table.c[i], table.a.row(i));
  for (int j = 0; j <= s; ++j) set_node(lobatto[at(j)], table.lobatto_c[j], table.lobatto_a.row(j));
  momentum_size = velocity_size = form_size = 0.0;
  if (m > 0) {
    rows_at_start.evaluate(step.start, q0);
    form_size = max_norm(rows_at_start.forms());
  }
  evaluated_ = false;
}

void GroupStages::set_node(GroupNode& node, double c, const Vector& a) {
  node.t = step.start + c * step.size;
  node.alpha = step.size * (a - 0.5 * table.b);
}

/// Everything the residual is made of, at x, unless x is where it was last taken.
bool GroupStages::evaluate(ConstVectorRef x) {
  if (evaluated_ && last_x_ == x) return inside_;
  evaluated_ = true;
  last_x_ = x;
  const Eigen::Index d = space.group_dimension();
  v.resize(d, s);
  for (int i = 0; i < s; ++i) space.embed(x.segment(n * i, n), v.col(i));
  y = 0.5 * step.size * (v * table.b);
  place_nodes();
  if (!inside_) return false;
  middle_momentum = centre.adjoint.transpose() * p0;
  add_forces();
  if (m > 0) add_rows(x);
  velocity_size = max_norm(xi);
  return true;
}

void GroupStages::place_nodes() {
  const Eigen::Index d = space.group_dimension();
  for (Columns* matrix : {&centre.adjoint, &centre.dtau, &centre.dtau_back}) matrix->resize(d, d);
  Columns unused(d, d);
  space.maps(y, centre.adjoint, centre.dtau);
  space.maps(-y, unused, centre.dtau_back);
  g_c.resize(space.storage_size());
  if (!reduced) space.move(q0, y, g_c);
  double part = space.part_of_chart(y);
  for (GroupNode& node : gauss) {
    node.place(space, v);
    part = std::max(part, space.part_of_chart(node.x));
    move_to(node);
  }
  for (std::size_t j = 0; m > 0 && j < lobatto.size(); ++j) {
    lobatto[j].place(space, v);
    part = std::max(part, space.part_of_chart(lobatto[j].x));
    if (j == 0)
      lobatto[j].q = q0;
    else
      move_to(lobatto[j]);
  }
  inside_ = part < 1.0;
  if (inside_) return;
  failure = "a step turned by more than its retraction is injective on, from its middle by " +
            std::to_string(part) + " of that; take a smaller one";
}

void GroupStages::move_to(GroupNode& node) {
  node.q = q0;
  if (!reduced) space.move(g_c, node.x, node.q);
}

void GroupStages::add_forces() {
  const Eigen::Index d = space.group_dimension();
  for (Columns* columns : {&xi, &phi, &forces}) columns->resize(d, s);
  Columns along(d, d);
  momentum_size = 0.0;
  for (int i = 0; i < s; ++i) {
    GroupNode& node = gauss[at(i)];
    GroupPoint& point = points[at(i)];
    xi.col(i) = node.dtau * v.col(i);
    point.evaluate(node.t, node.q, xi.col(i));
    space.dtau_along(node.x, v.col(i), along);
    forces.col(i) = point.force();
    phi.col(i) = along.transpose() * point.momentum() + node.dtau.transpose() * point.force();
    node.carried = node.adjoint_back.transpose() * point.force();
    middle_momentum += step.size * table.b[i] * node.carried;
    momentum_size = std::max(momentum_size, max_norm(point.momentum()));
  }
  force_size = std::max(force_size, max_norm(forces));
}

void GroupStages::add_rows(ConstVectorRef x) {
  impulses.resize(space.group_dimension(), s);
  for (int j = 0; j < s; ++j) {
    GroupNode& node = lobatto[at(j)];
    rows[at(j)].evaluate(node.t, node.q);
    impulses.col(j) = rows[at(j)].impulse(multipliers(x, j));
    node.carried = node.adjoint_back.transpose() * impulses.col(j);
    middle_momentum += table.lobatto_b[j] * node.carried;
  }
  impulse_size = std::max(impulse_size, max_norm(impulses));
  for (int k = 0; has_nonholonomic() && k < s; ++k) {
    gauss_rows[at(k)].evaluate(gauss[at(k)].t, gauss[at(k)].q);
    form_size = std::max(form_size, max_norm(gauss_rows[at(k)].forms()));
  }
}

bool reduced_on_group(const Scene& scene) {
  return scene.lagrangian->structure().x_absent && !scene.force &&
         std::ranges::all_of(scene.constraints,
                             [](const auto& rows) { return rows->constant() && !rows->holonomic(); });
}

}  // namespace diracstep
