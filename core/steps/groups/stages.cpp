#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/groups/stages.hpp>
#include <diracstep/core/steps/groups/step.hpp>

namespace diracstep {

template <int D>
void GroupNode<D>::place(const Space& space, const typename GroupSizes<D>::Stages& v) {
  x.noalias() = v * alpha;
  take_maps(space);
}

template <int D>
void GroupNode<D>::take_maps(const Space& space) {
  const Eigen::Index d = space.group_dimension();
  for (Square* matrix : {&adjoint, &adjoint_back, &dtau, &dtau_back}) matrix->resize(d, d);
  space.maps(x, adjoint, adjoint_back, dtau, dtau_back);
}

template <int D>
GroupStages<D>::GroupStages(int stages, const Scene& of)
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

template <int D>
void GroupStages<D>::begin(Interval of, const State& start) {
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

template <int D>
void GroupStages<D>::set_node(GroupNode<D>& node, double c, const Vector& a) {
  node.t = step.start + c * step.size;
  node.alpha = step.size * (a - 0.5 * table.b);
}

/// Everything the residual is made of, at x, unless x is where it was last taken.
template <int D>
bool GroupStages<D>::evaluate(ConstVectorRef x) {
  if (evaluated_ && last_x_ == x) return inside_;
  evaluated_ = true;
  last_x_ = x;
  const Eigen::Index d = space.group_dimension();
  v.resize(d, s);
  for (int i = 0; i < s; ++i) space.embed(x.segment(n * i, n), v.col(i));
  centre.x.noalias() = 0.5 * step.size * (v * table.b);
  place_nodes();
  if (!inside_) return false;
  middle_momentum = centre.adjoint.transpose() * p0;
  add_forces();
  if (m > 0) add_rows(x);
  velocity_size = max_norm(xi);
  return true;
}

template <int D>
void GroupStages<D>::place_nodes() {
  centre.take_maps(space);
  g_c.resize(space.storage_size());
  if (!reduced) space.move(q0, centre.x, g_c);
  double part = space.part_of_chart(centre.x);
  for (GroupNode<D>& node : gauss) {
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

template <int D>
void GroupStages<D>::move_to(GroupNode<D>& node) {
  node.q = q0;
  if (!reduced) space.move(g_c, node.x, node.q);
}

template <int D>
void GroupStages<D>::add_forces() {
  const Eigen::Index d = space.group_dimension();
  for (Stages* columns : {&xi, &phi, &forces}) columns->resize(d, s);
  momentum_size = 0.0;
  for (int i = 0; i < s; ++i) {
    GroupNode<D>& node = gauss[at(i)];
    GroupPoint<D>& point = points[at(i)];
    xi.col(i).noalias() = node.dtau * v.col(i);
    point.evaluate(node.t, node.q, xi.col(i));
    node.along.resize(d, d);
    space.dtau_along(node.x, v.col(i), node.along);
    forces.col(i) = point.force();
    phi.col(i) = node.along.transpose() * point.momentum() + node.dtau.transpose() * point.force();
    node.carried = node.adjoint_back.transpose() * point.force();
    middle_momentum += step.size * table.b[i] * node.carried;
    momentum_size = std::max(momentum_size, max_norm(point.momentum()));
  }
  force_size = std::max(force_size, max_norm(forces));
}

template <int D>
void GroupStages<D>::add_rows(ConstVectorRef x) {
  impulses.resize(space.group_dimension(), s);
  for (int j = 0; j < s; ++j) {
    GroupNode<D>& node = lobatto[at(j)];
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

template struct GroupNode<3>;
template struct GroupNode<6>;
template struct GroupNode<Eigen::Dynamic>;
template class GroupStages<3>;
template class GroupStages<6>;
template class GroupStages<Eigen::Dynamic>;

bool reduced_on_group(const Scene& scene) {
  return scene.lagrangian->structure().x_absent && !scene.force &&
         std::ranges::all_of(scene.constraints,
                             [](const auto& rows) { return rows->constant() && !rows->holonomic(); });
}

}  // namespace diracstep
