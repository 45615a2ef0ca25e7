#include <algorithm>
#include <diracstep/core/integrator/step_design.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/steps/matrix_form.hpp>
#include <diracstep/core/system/row_subset.hpp>
#include <diracstep/core/system/rows_along_motions.hpp>
#include <diracstep/sensitivities/detail/linear_factor.hpp>
#include <diracstep/sensitivities/detail/linearised_motion.hpp>
#include <diracstep/sensitivities/detail/stage_equations.hpp>
#include <utility>

namespace diracstep::sensitivity {

namespace {

/// The extended scene with the rows of the prepared one: without those that were dropped, and with the hidden
/// ones.
std::shared_ptr<const Scene> prepared_like(const Scene& prepared, const ParametricScene& given) {
  auto extended = completed(given.extended);
  const std::vector<std::string> kept = prepared.row_names();
  std::vector<std::string> dropped;
  for (const std::string& name : extended->row_names())
    if (std::ranges::find(kept, name) == kept.end()) dropped.push_back(name);
  auto result = std::make_shared<Scene>(*without_rows(*extended, dropped));
  for (const auto& rows : prepared.constraints)
    if (auto hidden = rows_along_motions_in(*rows, *extended)) result->constraints.push_back(hidden);
  if (result->row_names() != kept)
    throw Misuse("scene '" + prepared.name + "': the scene with its parameters has other rows");
  return result;
}

/// The parts of a step as StepDesign has them: the method and where it is composed its adjoint.
std::vector<Method> methods_of(const Integrator& integrator, const Registry& registry) {
  std::vector<Method> methods{registry.method(integrator.method().name)};
  const MethodInfo& info = methods.front().info;
  if (integrator.options().order != info.order && !info.self_adjoint)
    methods.push_back(registry.adjoint_of(methods.front()));
  return methods;
}

/// The rule that part `number` is asked to take; none: its own.
std::optional<ConstraintRule> asked_rule(const IntegratorOptions& options, std::size_t number) {
  const std::optional<ConstraintRule>& given = options.constraint_rule;
  if (given && given->own)
    throw Misuse(
        "discrete rows of one's own state no derivative by q0, so that steps with them have no "
        "sensitivities");
  if (!given || number == 0) return given;
  return ConstraintRule(mirrored(given->nodes));
}

template <class Matrix>
std::unique_ptr<StageEquations<Matrix>> equations_of(const Integrator& integrator, const Method& method,
                                                     std::size_t number, bool full,
                                                     const std::shared_ptr<ExtendedScene>& extended) {
  const Scene& scene = integrator.scene();
  const std::optional<ConstraintRule> rule = asked_rule(integrator.options(), number);
  const bool forced = integrator.options().force_degenerate;
  StageParts parts{method.make_step(scene, {full, rule, forced}), extended};
  const MethodInfo& info = method.info;
  if (info.damped) return radau_equations<Matrix>(std::move(parts), (info.order + 1) / 2);
  if (info.stages > 0 && scene.lagrangian->structure().phase_space() && !forced)
    return phase_space_equations<Matrix>(std::move(parts), info.stages);
  const StepRule nodes = rule ? rule->nodes : info.constraint_rule;
  if (info.stages > 0 && nodes == info.constraint_rule)
    return gauss_lobatto_equations<Matrix>(std::move(parts), info.stages);
  if (!method.generating_function)
    throw Misuse("method '" + info.name + "' states no generating function, so that it has no sensitivities");
  return generating_function_equations<Matrix>(std::move(parts),
                                               method.generating_function(extended->scene()), nodes);
}

template <class Matrix>
class LinearisedMotionIn final : public LinearisedMotion {
 public:
  LinearisedMotionIn(const Integrator& integrator, const Registry& registry,
                     std::shared_ptr<ExtendedScene> scene, bool full)
      : scene_(std::move(scene)),
        n_(scene_->n()),
        size_(scene_->size()),
        m_(scene_->rows()),
        phase_space_(integrator.scene().lagrangian->structure().phase_space()) {
    parts_ = stage_equations<Matrix>(integrator, registry, scene_, full);
  }

  void push(std::span<const SolvedStage> step, Directions& z) override {
    for (const SolvedStage& stage : step) {
      take(stage);
      Columns dx = jacobians_.by_start * z;
      factor_.solve(dx);
      const Columns end = jacobians_.end_by_start * z - jacobians_.end_by_unknowns * dx;
      z.topRows(n_) = end.topRows(n_);
      z.bottomRows(n_) = end.bottomRows(n_);
    }
  }

  void pull(std::span<const SolvedStage> step, Directions& z) override {
    for (auto stage = step.rbegin(); stage != step.rend(); ++stage) {
      StageEquations<Matrix>& equations = *parts_[stage->part];
      factor_.compute(equations.take_transposed(*stage));
      Columns end(2 * n_, z.cols());
      end << z.topRows(n_), z.bottomRows(n_);
      Columns w = equations.pull_end(end);
      factor_.solve_transposed(w);
      const Columns theta = z.middleRows(n_, size_ - n_);
      z = equations.pull_start(end, w);
      z.middleRows(n_, size_ - n_) += theta;
    }
  }

  ReadDirections push_reading(const Point& at, const Directions& z) override {
    const auto x = z.topRows(size_);
    scene_->take(at.t, at.q, at.v, false, node_);
    ReadDirections read{z.topRows(n_), {}, node_.v_by_point * x};
    if (phase_space_) return read;
    take_reading(at);
    Columns change = reading_by_point_ * x;
    change.topRows(n_) = z.bottomRows(n_) - change.topRows(n_);
    change.bottomRows(m_) *= -1.0;
    reading_.solve(change);
    read.v = change.topRows(n_);
    read.p += node_.v_by_velocity * read.v;
    return read;
  }

  Directions pull_reading(const Point& at, const ReadDirections& read) override {
    const Eigen::Index count = std::max({read.q.cols(), read.v.cols(), read.p.cols()});
    Directions z = Directions::Zero(size_ + n_, count);
    if (read.q.size() > 0) z.topRows(n_) = read.q;
    scene_->take(at.t, at.q, at.v, false, node_);
    if (read.p.size() > 0) z.topRows(size_) += node_.v_by_point.transpose() * read.p;
    if (phase_space_) {
      if (read.v.size() > 0)
        throw Misuse("the velocity of a Lagrangian that is linear in v is not differentiated");
      return z;
    }
    take_reading(at);
    Columns w = Columns::Zero(n_ + m_, count);
    if (read.v.size() > 0) w.topRows(n_) = read.v;
    if (read.p.size() > 0) w.topRows(n_) += node_.v_by_velocity.transpose() * read.p;
    reading_.solve_transposed(w);
    z.bottomRows(n_) += w.topRows(n_);
    z.topRows(size_) -= reading_by_point_.transpose() * w;
    return z;
  }

  Directions push_start(const Point& at, ConstColumnsRef dq, ConstColumnsRef dv,
                        ConstColumnsRef dtheta) override {
    Directions z(size_ + n_, dq.cols());
    z.topRows(n_) = dq;
    z.middleRows(n_, size_ - n_) = dtheta;
    scene_->take(at.t, at.q, at.v, false, node_);
    z.bottomRows(n_) = node_.v_by_point * z.topRows(size_) + node_.v_by_velocity * dv;
    return z;
  }

  StartCotangents pull_start(const Point& at, const Directions& z) override {
    scene_->take(at.t, at.q, at.v, false, node_);
    const Columns x = z.topRows(size_) + node_.v_by_point.transpose() * z.bottomRows(n_);
    return {x.topRows(n_), node_.v_by_velocity.transpose() * z.bottomRows(n_), x.bottomRows(size_ - n_)};
  }

 private:
  void take(const SolvedStage& stage) {
    parts_[stage.part]->take(stage, jacobians_);
    factor_.compute(jacobians_.by_unknowns);
  }

  /// ∂L/∂v − Aᵀμ = p, A v + b = 0 with unknowns (v, μ): its Jacobian, and its left sides by X.  μ comes from
  /// one step of Newton's method, which leaves v alone.
  void take_reading(const Point& at) {
    BlockSum<Matrix> saddle(n_ + m_, n_ + m_), by_point(n_ + m_, size_);
    saddle.add(0, 0, node_.v_by_velocity);
    by_point.add(0, 0, node_.v_by_point);
    if (m_ > 0) {
      const Matrix a = scene_->template all_coefficients<Matrix>(at.t, at.q);
      saddle.add(0, n_, Matrix(a.transpose()), -1.0);
      saddle.add(n_, 0, a);
    }
    reading_.compute(saddle.result());
    if (m_ > 0) {
      Columns mu = Columns::Zero(n_ + m_, 1);
      Vector lq = Vector::Zero(size_), lv = lq;
      scene_->scene().lagrangian->gradient(at.t, scene_->point(at.q), scene_->velocity(at.v), lq, lv);
      mu.topRows(n_) = at.p - lv.head(n_);
      reading_.solve(mu);
      by_point.add(0, 0, scene_->template all_annihilator_derivatives<Matrix>(at.t, at.q, mu.col(0).tail(m_)),
                   -1.0);
      by_point.add(n_, 0, scene_->template all_derivatives<Matrix>(at.t, at.q, at.v, 1.0));
    }
    reading_by_point_ = by_point.result();
  }

  std::shared_ptr<ExtendedScene> scene_;
  int n_, size_, m_;
  bool phase_space_;
  std::vector<std::unique_ptr<StageEquations<Matrix>>> parts_;
  StageJacobians<Matrix> jacobians_;
  LinearFactor<Matrix> factor_, reading_;
  ExtendedScene::LagrangianAt<Matrix> node_;
  Matrix reading_by_point_;
};

}  // namespace

template <class Matrix>
std::vector<std::unique_ptr<StageEquations<Matrix>>> stage_equations(
    const Integrator& integrator, const Registry& registry, const std::shared_ptr<ExtendedScene>& extended,
    bool full) {
  std::vector<std::unique_ptr<StageEquations<Matrix>>> parts;
  for (const Method& method : methods_of(integrator, registry))
    parts.push_back(equations_of<Matrix>(integrator, method, parts.size(), full, extended));
  return parts;
}
template std::vector<std::unique_ptr<StageEquations<Columns>>> stage_equations(
    const Integrator&, const Registry&, const std::shared_ptr<ExtendedScene>&, bool);
template std::vector<std::unique_ptr<StageEquations<Sparse>>> stage_equations(
    const Integrator&, const Registry&, const std::shared_ptr<ExtendedScene>&, bool);

void require_lagrangian(const Integrator& integrator) {
  if (!integrator.scene().lagrangian)
    throw Misuse("scene '" + integrator.scene().name +
                 "' has a degenerate Hamiltonian and no Lagrangian: its motion is not differentiated");
}

std::unique_ptr<LinearisedMotion> linearised_motion(const Integrator& integrator, const Registry& registry,
                                                    const ParametricScene& scene) {
  require_lagrangian(integrator);
  const std::shared_ptr<const Scene> prepared(std::shared_ptr<const Scene>{}, &integrator.scene());
  auto extended = std::make_shared<ExtendedScene>(scene.extended ? prepared_like(*prepared, scene) : prepared,
                                                  prepared->dimension(), scene.parameters);
  const bool full = matrix_form(*prepared, integrator.options().dense_limit).full;
  if (full) return std::make_unique<LinearisedMotionIn<Columns>>(integrator, registry, extended, full);
  return std::make_unique<LinearisedMotionIn<Sparse>>(integrator, registry, extended, full);
}

}  // namespace diracstep::sensitivity
