#include <algorithm>
#include <cmath>
#include <diracstep/core/dirac/discrete_force.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/steps/implicit_jacobian.hpp>
#include <diracstep/core/steps/implicit_step.hpp>
#include <diracstep/core/steps/step_data.hpp>
#include <optional>

namespace diracstep {

namespace {

std::optional<DiscreteForce> force_in(const Scene& scene, const ConstraintRule& rule, GeneratingType type) {
  if (!scene.force) return std::nullopt;
  if (type == GeneratingType::four) throw Misuse("generating functions of type 4 take no forces");
  return DiscreteForce(scene.force, rule.nodes);
}

/// The graph and the constraint solved together.
class ImplicitStep final : public StepProblem {
 public:
  ImplicitStep(std::unique_ptr<GeneratingFunction> s, const Scene& scene, const ConstraintRule& rule,
               bool dense)
      : s_(std::move(s)),
        graph_(graph_of(s_->type())),
        data_(scene.constraints, s_->dimension(), rule),
        n_(data_.n),
        m_(data_.rows()),
        inner_(n_ * s_->inner_columns()),
        force_(force_in(scene, rule, s_->type())),
        jacobian_(*s_,
                  {data_.start_rows.pattern(), data_.discrete_constraint.pattern(),
                   force_ ? &force_->pattern() : nullptr},
                  dense) {
    y_.setZero(n_, s_->columns());
    gradient_ = y_;
    hessian_.setZero(s_->pattern().nonzeros(), s_->pairs());
    last_x_.setZero(size());
    q1_.setZero(n_);
    terms_.setZero(s_->columns());
    multipliers_.setZero(m_);
    if (force_) force_by_end_.setZero(force_->pattern().nonzeros());
    blocks_.push_back({"momentum", n_});
    if (m_ > 0) blocks_.push_back({"constraint", m_});
    if (inner_ > 0) blocks_.push_back({"stationarity", inner_});
  }

  int size() const override { return n_ + m_ + inner_; }
  const SparsityPattern& pattern() const override { return jacobian_.pattern(); }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }

  StepTraits traits() const override {
    std::string text = (graph_.ends_at_position ? "q1 (" : "p1 (") + std::to_string(n_) + ")";
    if (m_ > 0) text += ", multipliers (" + std::to_string(m_) + ")";
    if (inner_ > 0) text += ", inner columns (" + std::to_string(inner_) + ")";
    return {text, n_, s_->columns(), m_};
  }

  void begin(Interval step, const State& start, const StepMemory& memory) override {
    data_.freeze(step, start);
    last_x_[0] = std::nan("");
    if (memory.known) {
      terms_ = memory.scales;
      multipliers_ = memory.multipliers;
    } else {
      sample_terms();
      multipliers_.setZero();
    }
    hessian_known_ = false;
    update_scales();
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    const double h = data_.step.size;
    if (graph_.ends_at_position)
      x.head(n_) = data_.q0 + h * v0;
    else
      x.head(n_) = h * data_.p0;
    x.segment(n_, m_).setZero();
    if (inner_ > 0)
      s_->guess_inner(data_.step, data_.q0, data_.p0, v0,
                      Eigen::Map<Columns>(x.data() + n_ + m_, n_, s_->inner_columns()));
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    auto graph = f.head(n_);
    if (graph_.starts_from_position)
      graph = row_factor() * (data_.p0 - graph_.start_sign * gradient_.col(0));
    else
      graph = data_.q0 - graph_.start_sign * gradient_.col(0);
    if (force_ && graph_.starts_from_position) graph += row_factor() * force_->minus();
    if (m_ > 0) {
      if (graph_.starts_from_position) data_.start_rows.add_annihilator(x.segment(n_, m_), graph);
      data_.discrete_constraint.residual(data_.step, data_.q0, q1_, f.segment(n_, m_));
    }
    if (inner_ > 0) f.tail(inner_) = gradient_.rightCols(s_->inner_columns()).reshaped();
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    s_->hessian(data_.step, y_, hessian_);
    hessian_known_ = true;
    if (force_) force_->minus_by_end(data_.step, data_.q0, q1_, force_by_end_);
    if (m_ > 0) data_.discrete_constraint.end_derivative(data_.step, data_.q0, q1_, data_.end_derivative);
    jacobian_.assemble(
        {data_.step.size, hessian_, data_.start_rows.coefficients(), data_.end_derivative, force_by_end_},
        values);
  }

  void finish(ConstVectorRef x, StepEnd& end) override {
    evaluate(x);
    end.at.q = q1_;
    if (graph_.ends_at_position)
      end.at.p = graph_.end_sign * gradient_.col(1);
    else
      end.at.p = y_.col(1);
    if (force_) end.at.p += force_->plus();
    end.at.v = (q1_ - data_.q0) / data_.step.size;
    end.impulse = x.segment(n_, m_) / data_.step.size;
    end.memory.known = true;
    end.memory.scales = terms_;
    if (hessian_known_) measure_terms(end.memory.scales);
    end.memory.multipliers = x.segment(n_, m_);
  }

 private:
  double row_factor() const { return graph_.starts_from_position ? data_.step.size : 1.0; }
  /// ∂(end argument)/∂(first unknowns).
  double end_factor() const { return graph_.ends_at_position ? 1.0 : 1.0 / data_.step.size; }

  /// Columns, gradient and end configuration at x, unless x is where they were last taken.
  void evaluate(ConstVectorRef x) {
    if (last_x_ == x) return;
    last_x_ = x;
    const double h = data_.step.size;
    y_.col(0) = graph_.starts_from_position ? data_.q0 : data_.p0;
    if (!graph_.starts_from_position && m_ > 0)
      data_.start_rows.add_annihilator(x.segment(n_, m_), y_.col(0), 1.0 / h);
    y_.col(1) = end_factor() * x.head(n_);
    if (force_ && graph_.ends_at_position) {
      force_->evaluate(data_.step, data_.q0, y_.col(1));
      if (!graph_.starts_from_position) y_.col(0) += force_->minus();
    }
    if (inner_ > 0) y_.rightCols(s_->inner_columns()) = x.tail(inner_).reshaped(n_, s_->inner_columns());
    s_->gradient(data_.step, y_, gradient_);
    if (graph_.ends_at_position)
      q1_ = y_.col(1);
    else
      q1_ = graph_.end_sign * gradient_.col(1);
    if (force_ && !graph_.ends_at_position) force_->evaluate(data_.step, data_.q0, q1_);
  }

  /// Where nothing is known of an earlier step: the Hessian at a plausible point, for the round-off scales.
  void sample_terms() {
    y_.col(0) = graph_.starts_from_position ? data_.q0 : data_.p0;
    y_.col(1) = graph_.ends_at_position ? data_.q0 : data_.p0;
    if (inner_ > 0)
      s_->guess_inner(data_.step, data_.q0, data_.p0, Vector::Zero(n_), y_.rightCols(s_->inner_columns()));
    s_->hessian(data_.step, y_, hessian_);
    measure_terms(terms_);
  }

  void measure_terms(Vector& terms) const {
    for (int i = 0; i < s_->columns(); ++i)
      if (i != 1) terms[i] = cancelling_terms(i);  // the end is no row
  }

  void update_scales() {
    const double own =
        graph_.starts_from_position ? std::abs(data_.step.size) * max_norm(data_.p0) : max_norm(data_.q0);
    // The impulse, as large as it was in the last step.
    const double impulse = graph_.starts_from_position && m_ > 0 ? data_.impulse_scale(multipliers_) : 0.0;
    blocks_[0].scale = usable_scale(std::max({own, impulse, std::abs(row_factor()) * terms_[0]}));
    if (m_ > 0) blocks_[1].scale = data_.constraint_scale();
    if (inner_ == 0) return;
    double largest = 0.0;
    for (int i = 2; i < s_->columns(); ++i) largest = std::max(largest, terms_[i]);
    blocks_.back().scale = usable_scale(largest);
  }

  /// Size of the terms that make up column i of the gradient: second derivatives times what they multiply.
  double cancelling_terms(int i) const {
    double largest = 0.0;
    for (int j = 0; j < s_->columns(); ++j) {
      const auto block = hessian_.col(s_->pair(std::min(i, j), std::max(i, j)));
      largest = std::max(largest, max_norm(block) * max_norm(y_.col(j)));
    }
    return largest;
  }

  std::unique_ptr<GeneratingFunction> s_;
  GraphOf graph_;
  StepData data_;
  int n_, m_, inner_;
  std::optional<DiscreteForce> force_;
  ImplicitJacobian jacobian_;
  Vector force_by_end_;
  std::vector<ResidualBlock> blocks_;
  Vector last_x_, q1_;
  Columns y_, gradient_, hessian_;
  Vector terms_;        ///< size of the terms of each column of the gradient, as the last step knew it
  Vector multipliers_;  ///< of the last step
  bool hessian_known_ = false;  ///< hessian_ was taken in this step
};

}  // namespace

std::unique_ptr<StepProblem> implicit_step(std::unique_ptr<GeneratingFunction> generating_function,
                                           const Scene& scene, const ConstraintRule& rule, bool dense) {
  return std::make_unique<ImplicitStep>(std::move(generating_function), scene, rule, dense);
}

}  // namespace diracstep
