#include <diracstep/sensitivities/detail/gauss_lobatto_products.hpp>
#include <utility>

namespace diracstep::sensitivity {

GaussLobattoProducts::GaussLobattoProducts(std::shared_ptr<ExtendedScene> scene, int s)
    : scene_(std::move(scene)),
      s_(s),
      n_(scene_->n()),
      size_(scene_->size()),
      m_(scene_->rows()),
      table_(gauss_lobatto_tableau(s)),
      nodes_(static_cast<std::size_t>(s)) {
  int first = 0;
  for (const auto& block : scene_->scene().constraints) {
    rows_.push_back({block.get(), first, Columns(block->pattern().nonzeros(), s + 1),
                     Columns(block->curvature_pattern().nonzeros(), s),
                     Columns(block->holonomic() ? 0 : block->pattern().nonzeros(), s)});
    first += block->rows();
  }
}

void GaussLobattoProducts::take(const SolvedStage& at) {
  const Lagrangian& l = *scene_->scene().lagrangian;
  const Force* const force = scene_->scene().force.get();
  const auto v = at.x.head(n_ * s_).reshaped(n_, s_);
  h_ = at.step.size;
  for (int i = 0; i < s_; ++i) {
    Node& node = nodes_[static_cast<std::size_t>(i)];
    const double t = at.step.start + table_.c[i] * h_;
    const Vector& point = scene_->point(at.start.q + h_ * v * table_.a.row(i).transpose());
    const Vector& velocity = scene_->velocity(v.col(i));
    for (Vector* values : {&node.qq, &node.qv, &node.vv}) values->resize(l.pattern().nonzeros());
    l.hessian(t, point, velocity, node.qq, node.qv, node.vv);
    if (force == nullptr) continue;
    for (Vector* values : {&node.force_by_point, &node.force_by_velocity})
      values->resize(force->pattern().nonzeros());
    force->derivatives(t, point, velocity, node.force_by_point, node.force_by_velocity);
  }
  for (RowsAt& rows : rows_) take_rows(rows, at);
}

void GaussLobattoProducts::take_rows(RowsAt& at, const SolvedStage& stage) const {
  const ConstraintRows& rows = *at.rows;
  const auto v = stage.x.head(n_ * s_).reshaped(n_, s_);
  Vector offsets(rows.rows());
  for (int j = 0; j <= s_; ++j) {
    if (j == s_ && !rows.holonomic()) break;
    const double t = stage.step.start + table_.lobatto_c[j] * h_;
    const Vector& q = scene_->point(stage.start.q + h_ * v * table_.lobatto_a.row(j).transpose());
    rows.coefficients(t, q, at.a.col(j), offsets);
    if (j < s_)
      rows.annihilator_derivative(t, q, stage.x.segment(row(j, at), rows.rows()), at.curvature.col(j));
  }
  for (int i = 0; !rows.holonomic() && i < s_; ++i)
    rows.derivative(stage.step.start + table_.c[i] * h_,
                    scene_->point(stage.start.q + h_ * v * table_.a.row(i).transpose()),
                    scene_->velocity(v.col(i)), 1.0, at.derivative.col(i));
}

Vector GaussLobattoProducts::padded(ConstVectorRef column) const {
  Vector y = Vector::Zero(size_);
  y.head(n_) = column;
  return y;
}

void GaussLobattoProducts::add_by_point(const Node& node, const Vector& y, double* sum) const {
  const Scene& scene = scene_->scene();
  scene.lagrangian->pattern().transposed_multiply_add(node.qq.data(), y.data(), sum);
  if (scene.force) scene.force->pattern().transposed_multiply_add(node.force_by_point.data(), y.data(), sum);
}

Columns GaussLobattoProducts::end_by_unknowns(const Columns& end) const {
  const Scene& scene = scene_->scene();
  Columns result = Columns::Zero(n_ * s_ + m_ * s_, end.cols());
  for (Eigen::Index column = 0; column < end.cols(); ++column) {
    const Vector p = padded(end.col(column).tail(n_));
    auto to = result.col(column);
    Columns by_point = Columns::Zero(size_, s_), at_rows = by_point;
    for (int j = 0; j < s_; ++j) {
      const Node& node = nodes_[static_cast<std::size_t>(j)];
      add_by_point(node, p, by_point.col(j).data());
      Vector by_velocity = Vector::Zero(size_);
      scene.lagrangian->pattern().transposed_multiply_add(node.qv.data(), p.data(), by_velocity.data());
      if (scene.force)
        scene.force->pattern().transposed_multiply_add(node.force_by_velocity.data(), p.data(),
                                                       by_velocity.data());
      to.segment(n_ * j, n_) += h_ * table_.b[j] * (end.col(column).head(n_) + by_velocity.head(n_));
    }
    for (const RowsAt& at : rows_)
      for (int j = 0; j < s_; ++j) {
        at.rows->curvature_pattern().transposed_multiply_add(at.curvature.col(j).data(), p.data(),
                                                             at_rows.col(j).data(), table_.lobatto_b[j]);
        at.rows->pattern().multiply_add(at.a.col(j).data(), p.data(), to.data() + row(j, at),
                                        table_.lobatto_b[j]);
      }
    auto stages = to.head(n_ * s_).reshaped(n_, s_);
    const Columns weights = (h_ * h_) * (table_.b.asDiagonal() * table_.a);
    stages += by_point.topRows(n_) * weights;
    if (m_ > 0) stages += h_ * (at_rows.topRows(n_) * table_.lobatto_a.topRows(s_));
  }
  return result;
}

Columns GaussLobattoProducts::by_start(const Columns& end, const Columns& w) const {
  Columns result = Columns::Zero(size_ + n_, end.cols());
  for (Eigen::Index column = 0; column < end.cols(); ++column) {
    const auto p = end.col(column).tail(n_);
    const auto stages = w.col(column).head(n_ * s_).reshaped(n_, s_);
    double* const to = result.col(column).data();
    result.col(column).head(n_) = end.col(column).head(n_);
    result.col(column).tail(n_) = p + stages.rowwise().sum();
    const Columns forces = h_ * (p * table_.b.transpose() + stages * table_.a_hat);
    for (int j = 0; j < s_; ++j) {
      const Node& node = nodes_[static_cast<std::size_t>(j)];
      add_by_point(node, padded(forces.col(j)), to);
      scene_->scene().lagrangian->pattern().multiply_add(node.qv.data(), padded(stages.col(j)).data(), to,
                                                         -1.0);
    }
    for (const RowsAt& at : rows_)
      for (int j = 0; j < s_; ++j) {
        const Vector impulse = table_.lobatto_b[j] * p + stages * table_.e.col(j);
        at.rows->curvature_pattern().transposed_multiply_add(at.curvature.col(j).data(),
                                                             padded(impulse).data(), to);
        const double* const of_row = w.col(column).data() + row(j, at);
        if (at.rows->holonomic())
          at.rows->pattern().transposed_multiply_add(at.a.col(j + 1).data(), of_row, to, -1.0 / h_);
        else
          at.rows->pattern().transposed_multiply_add(at.derivative.col(j).data(), of_row, to, -1.0);
      }
  }
  return result;
}

}  // namespace diracstep::sensitivity
