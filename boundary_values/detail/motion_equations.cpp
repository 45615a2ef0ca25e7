#include <diracstep/boundary_values/detail/motion_equations.hpp>
#include <diracstep/core/integrator/step_design.hpp>
#include <diracstep/core/integrator/time_kinks.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/sensitivities/detail/linearised_motion.hpp>
#include <numeric>
#include <utility>

namespace diracstep::boundary {

namespace {

Sparse sparse(const Columns& matrix) { return matrix.sparseView(); }

Sparse transposed(const Sparse& matrix) { return matrix.transpose(); }

}  // namespace

MotionEquations::MotionEquations(const Integrator& integrator, const Registry& registry, long steps,
                                 BoundaryConditions conditions, std::optional<StepParameters> parameters)
    : conditions_(std::move(conditions)),
      parameters_(std::move(parameters)),
      step_size_(integrator.options().step) {
  sensitivity::require_lagrangian(integrator);
  prepared_ = std::shared_ptr<const Scene>(std::shared_ptr<const Scene>{}, &integrator.scene());
  n_ = prepared_->dimension();
  nv_ = prepared_->lagrangian->structure().phase_space() ? 0 : n_;
  m_ = prepared_->rows();
  m_h_ = row_count(only_holonomic(prepared_->constraints));
  scene_ = parameters_ ? parameters_->scene
                       : std::make_shared<sensitivity::ExtendedScene>(prepared_, n_, Vector());
  parts_ = sensitivity::stage_equations<Sparse>(integrator, registry, scene_, false);
  start_time_ = integrator.time();
  place_stages(integrator, registry, steps);
}

void MotionEquations::place_stages(const Integrator& integrator, const Registry& registry, long steps) {
  const IntegratorOptions& options = integrator.options();
  const StepDesign design =
      design_step(prepared_, registry, registry.method(integrator.method().name), options, false);
  TimeKinks kinks(prepared_->kinks, prepared_->start.time, options.step);
  int place = 0, row = n_;
  const auto take = [&](Kind kind, int count) {
    kind_.insert(kind_.end(), static_cast<std::size_t>(count), kind);
    return std::exchange(place, place + count);
  };
  const auto take_node = [&] {
    const int node = take(position_kind, n_);
    take(momentum_kind, n_);
    return node;
  };
  take(velocity_kind, nv_);
  int node = take_node();
  step_ends_.emplace_back(start_time_, node);
  std::vector<Interval> pieces;
  for (long k = 0; k < steps; ++k) {
    const double begin = start_time_ + static_cast<double>(k) * options.step;
    kinks.divide({begin, options.step}, pieces);
    for (const Interval& piece : pieces) {
      double t = piece.start;
      for (const auto& [fraction, part] : design.stages) {
        const double h = fraction * piece.size;
        Stage stage{part, {t, h}, node, 0, 0, row, k};
        const int unknowns = parts_[part]->unknowns();
        stage.x = take(unknown_kind, unknowns);
        stage.next = node = take_node();
        row += unknowns + 2 * n_;
        stages_.push_back(stage);
        t += h;
      }
    }
    step_ends_.emplace_back(start_time_ + static_cast<double>(k + 1) * options.step, node);
  }
  end_time_ = step_ends_.back().first;
  end_ = node;
  if (nv_ > 0) {
    take(velocity_kind, n_);
    take(multiplier_kind, m_);
  }
  unknowns_ = place;
}

Interval MotionEquations::step(long k) const {
  return {start_time_ + static_cast<double>(k) * step_size_, step_size_};
}

void MotionEquations::use_parameters(long step_number, const Vector& u) {
  if (!parameters_) return;
  const auto values = u.segment(parameters_at(step_number), parameter_count());
  scene_->set_parameters(values);
  parameters_->use(step(step_number), values);
}

SolvedStage MotionEquations::at(const Stage& stage, const Vector& u) {
  use_parameters(stage.number, u);
  const Vector q = u.segment(stage.node, n_), p = u.segment(stage.node + n_, n_);
  const int own = equations(stage).problem().size();
  const int all = equations(stage).unknowns();
  return {stage.part, stage.step, {q, p, Vector::Zero(n_)}, u.segment(stage.x + all - own, own)};
}

Vector MotionEquations::momentum(double t, const Vector& q, const Vector& v) {
  Vector lq = Vector::Zero(n_), lv = lq;
  prepared_->lagrangian->gradient(t, q, v, lq, lv);
  return lv;
}

Vector MotionEquations::rows_residual(double t, const Vector& q, const Vector& v) const {
  Vector residual = Vector::Zero(m_);
  if (m_ == 0) return residual;
  ConstraintsAtPoint rows(scene().constraints, n_);
  rows.evaluate(t, q);
  rows.velocity_residual(v, residual);
  return residual;
}

Sparse MotionEquations::holonomic(double t, const Vector& q) {
  sensitivity::BlockSum<Sparse> all(m_h_, n_);
  int row = 0;
  for (const auto& block : only_holonomic(scene_->scene().constraints)) {
    all.add(row, 0, scene_->coefficients<Sparse>(*block, t, q));
    row += block->rows();
  }
  return all.result();
}

Vector MotionEquations::guess(const GuessedMotion& path) {
  Vector u = Vector::Zero(parameters_at(steps()));
  for (long k = 0; parameters_ && k < steps(); ++k)
    u.segment(parameters_at(k), parameter_count()) = parameters_->start;
  const auto put_node = [&](int node, double t) {
    const GuessedPoint point = path(t);
    require_size("the guess: positions", point.q.size(), n_);
    require_size("the guess: velocities", point.v.size(), n_);
    u.segment(node, n_) = point.q;
    u.segment(node + n_, n_) = momentum(t, point.q, point.v);
    return point.v;
  };
  const Vector v0 = put_node(nv_, start_time_);
  u.head(nv_) = v0.head(nv_);
  for (const Stage& stage : stages_) {
    const Vector v = path(stage.step.start).v;
    StepProblem& problem = equations(stage).problem();
    SolvedStage begun = at(stage, u);
    sensitivity::begin(problem, begun);
    Vector x = Vector::Zero(problem.size());
    problem.guess(v, x);
    u.segment(stage.next - x.size(), x.size()) = x;
    put_node(stage.next, stage.step.end());
  }
  u.segment(end_ + 2 * n_, nv_) = path(end_time_).v.head(nv_);
  return u;
}

MotionEquations::Residual MotionEquations::residual(const Vector& u) {
  Residual r{Vector::Zero(unknowns_ - freedom()), Vector::Zero(start_rows() + conditions_.value.size())};
  const auto z = [&](int node) { return u.segment(node, 2 * n_); };
  const Vector q0 = u.segment(nv_, n_), qN = u.segment(end_, n_);
  Vector v0 = Vector::Zero(n_), vN = v0;
  v0.head(nv_) = start_velocity(u);
  vN.head(nv_) = end_velocity(u);
  r.motion.head(n_) = momentum(start_time_, q0, v0) - start_momentum(u);
  StepEnd end;
  for (const Stage& stage : stages_) {
    StepProblem& problem = equations(stage).problem();
    const SolvedStage begun = at(stage, u);
    sensitivity::begin(problem, begun);
    Vector f = Vector::Zero(problem.size());
    problem.residual(begun.x, f);
    problem.finish(begun.x, end);
    const int defects = stage.row + equations(stage).unknowns();
    r.motion.segment(defects - f.size(), f.size()) = f;
    r.motion.segment(defects, n_) = z(stage.next).head(n_) - end.at.q;
    r.motion.segment(defects + n_, n_) = z(stage.next).tail(n_) - end.at.p;
  }
  const Vector pN = end_momentum(u);
  if (nv_ > 0) {
    r.motion.segment(end_rows_at(), n_) = momentum(end_time_, qN, vN) - pN;
    r.motion.tail(m_) = rows_residual(end_time_, qN, vN);
    r.ends.head(m_) = rows_residual(start_time_, q0, v0);
  }
  int row = m_;
  for (const auto& block : only_holonomic(scene().constraints)) {
    block->position(start_time_, q0, r.ends.segment(row, block->rows()));
    row += block->rows();
  }
  Vector start(3 * n_), at_end(3 * n_);
  start << q0, v0, start_momentum(u);
  at_end << qN, vN, pN;
  r.ends.tail(conditions_.value.size()) =
      conditions_.at_start * start + conditions_.at_end * at_end - conditions_.value;
  return r;
}

/// By z = (q, θ, p): q and p stand together, θ behind all.
void MotionEquations::add_by_start(const Stage& stage, int row, const Sparse& by_start, double factor,
                                   sensitivity::BlockSum<Sparse>& to) const {
  const int count = parameter_count();
  if (count == 0) return to.add(row, stage.node, by_start, factor);
  to.add(row, stage.node, Sparse(by_start.leftCols(n_)), factor);
  to.add(row, parameters_at(stage.number), Sparse(by_start.middleCols(n_, count)), factor);
  to.add(row, stage.node + n_, Sparse(by_start.rightCols(n_)), factor);
}

MotionEquations::Jacobian MotionEquations::jacobian(const Vector& u) {
  const auto conditions = static_cast<int>(conditions_.value.size());
  const auto columns = static_cast<int>(u.size());
  sensitivity::BlockSum<Sparse> motion(unknowns_ - freedom(), columns),
      ends(start_rows() + conditions, columns);
  sensitivity::ExtendedScene::LagrangianAt<Sparse> point;
  const Vector q0 = u.segment(nv_, n_), qN = u.segment(end_, n_);
  Vector v0 = Vector::Zero(n_), vN = v0;
  v0.head(nv_) = start_velocity(u);
  vN.head(nv_) = end_velocity(u);
  scene_->take(start_time_, q0, v0, false, point);
  motion.add(0, nv_, point.v_by_point);
  if (nv_ > 0) motion.add(0, 0, point.v_by_velocity);
  motion.add_identity(0, nv_ + n_, n_, -1.0);
  sensitivity::StageJacobians<Sparse> stage_jacobians;
  for (const Stage& stage : stages_) {
    equations(stage).take(at(stage, u), stage_jacobians);
    const int defects = stage.row + equations(stage).unknowns();
    motion.add(stage.row, stage.x, stage_jacobians.by_unknowns);
    add_by_start(stage, stage.row, stage_jacobians.by_start, 1.0, motion);
    motion.add_identity(defects, stage.next, 2 * n_);
    motion.add(defects, stage.x, stage_jacobians.end_by_unknowns, -1.0);
    add_by_start(stage, defects, stage_jacobians.end_by_start, -1.0, motion);
  }
  // Of what the conditions name at the end, by q, p and μ there: p + Aᵀμ.
  const Sparse by_p = sparse(conditions_.at_end.rightCols(n_));
  const int first = start_rows(), end_v = end_ + 2 * n_;
  ends.add(first, end_, sparse(conditions_.at_end.leftCols(n_)));
  ends.add(first, end_ + n_, by_p);
  ends.add(first, nv_, sparse(conditions_.at_start.leftCols(n_)));
  ends.add(first, nv_ + n_, sparse(conditions_.at_start.rightCols(n_)));
  if (nv_ > 0) {
    const int end_rows = end_rows_at();
    scene_->take(end_time_, qN, vN, false, point);
    motion.add(end_rows, end_, point.v_by_point);
    motion.add(end_rows, end_v, point.v_by_velocity);
    motion.add_identity(end_rows, end_ + n_, n_, -1.0);
    ends.add(first, 0, sparse(conditions_.at_start.middleCols(n_, n_)));
    ends.add(first, end_v, sparse(conditions_.at_end.middleCols(n_, n_)));
    if (m_ > 0) {
      const auto a = scene_->all_coefficients<Sparse>(end_time_, qN);
      const auto curvature =
          scene_->all_annihilator_derivatives<Sparse>(end_time_, qN, u.segment(end_v + n_, m_));
      motion.add(end_rows, end_, curvature, -1.0);
      motion.add(end_rows, end_v + n_, transposed(a), -1.0);
      motion.add(end_rows + n_, end_, scene_->all_derivatives<Sparse>(end_time_, qN, vN, 1.0));
      motion.add(end_rows + n_, end_v, a);
      ends.add(first, end_, Sparse(by_p * curvature));
      ends.add(first, end_v + n_, Sparse(by_p * transposed(a)));
      ends.add(0, nv_, scene_->all_derivatives<Sparse>(start_time_, q0, v0, 1.0));
      ends.add(0, 0, scene_->all_coefficients<Sparse>(start_time_, q0));
    }
  }
  if (m_h_ > 0) ends.add(m_, nv_, holonomic(start_time_, q0));
  return {motion.result(), ends.result()};
}

Columns MotionEquations::slack(const Vector& u) {
  const auto conditions = conditions_.value.size();
  Columns slack = Columns::Zero(start_rows() + conditions,
                                m_h_ * (int{conditions_.start_held} + int{conditions_.end_held}));
  if (slack.cols() == 0) return slack;
  if (conditions_.start_held)
    slack.block(start_rows(), 0, n_, m_h_) = Columns(holonomic(start_time_, u.segment(nv_, n_))).transpose();
  if (conditions_.end_held)
    slack.bottomRightCorner(n_, m_h_) = Columns(holonomic(end_time_, u.segment(end_, n_))).transpose();
  return slack;
}

std::vector<int> MotionEquations::start_unknowns() const {
  std::vector<int> places(static_cast<std::size_t>(n_ + nv_));
  std::iota(places.begin(), places.begin() + n_, nv_);
  std::iota(places.begin() + n_, places.end(), 0);
  return places;
}

std::vector<int> MotionEquations::end_unknowns() const {
  std::vector<int> places(static_cast<std::size_t>(n_ + nv_));
  std::iota(places.begin(), places.begin() + n_, end_);
  std::iota(places.begin() + n_, places.end(), end_ + 2 * n_);
  return places;
}

std::vector<MotionEquations::Node> MotionEquations::nodes(const Vector& u) const {
  std::vector<Node> nodes;
  for (const auto& [t, node] : step_ends_)
    nodes.push_back({t, u.segment(node, n_), u.segment(node + n_, n_)});
  return nodes;
}

Vector MotionEquations::end_momentum(const Vector& u) {
  Vector p = u.segment(end_ + n_, n_);
  if (nv_ == 0 || m_ == 0) return p;
  ConstraintsAtPoint rows(scene().constraints, n_);
  rows.evaluate(end_time_, u.segment(end_, n_));
  rows.add_annihilator(u.segment(end_ + 3 * n_, m_), p);
  return p;
}

std::optional<double> MotionEquations::action(const Vector& u) {
  double sum = 0.0;
  for (const Stage& stage : stages_) {
    const std::optional<double> part = equations(stage).action(at(stage, u));
    if (!part) return std::nullopt;
    sum += *part;
  }
  return sum;
}

}  // namespace diracstep::boundary
