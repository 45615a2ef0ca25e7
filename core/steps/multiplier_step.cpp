#include <cmath>
#include <diracstep/core/steps/multiplier_step.hpp>
#include <diracstep/core/steps/step_data.hpp>

namespace diracstep {

namespace {

/// The graph is solved for its end by S itself; what is left is c(q0, q1(p0 + A(q0)ᵀλ)) = 0 for hλ.
class MultiplierStep final : public StepProblem {
 public:
  MultiplierStep(std::unique_ptr<GeneratingFunction> s, const Scene& scene, const ConstraintRule& rule,
                 bool dense)
      : s_(std::move(s)),
        graph_(*s_->explicit_graph()),
        data_(scene, s_->dimension(), rule),
        displacement_(graph_.mobility_pattern(), false, data_.start_rows.pattern(), true),
        response_(data_.discrete_constraint.pattern(), false, displacement_.pattern(), false) {
    layout_.add(response_.pattern(), 0, 0);
    pattern_ = layout_.assemble(dense);
    if (data_.rows() > 0) blocks_.push_back({"constraint", data_.rows()});
    for (Vector* column : {&p_hat_, &q1_, &p1_}) column->setZero(data_.n);
    mobility_.setZero(graph_.mobility_pattern().nonzeros());
    displacement_values_.setZero(displacement_.pattern().nonzeros());
    response_values_.setZero(response_.pattern().nonzeros());
    last_x_.setConstant(size(), std::nan(""));
    increment_.setZero(data_.n);
    row_scales_ = RowScales(size());
  }

  int size() const override { return data_.rows(); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }

  StepTraits traits() const override {
    return {size() == 0 ? "none" : "multipliers (" + std::to_string(size()) + ")", size()};
  }

  void begin(Interval step, const State& start, const StepMemory&) override {
    data_.freeze(step, start);
    if (size() == 0) return;
    last_x_[0] = std::nan("");
    blocks_[0].scale = data_.constraint_scale();
  }

  void guess(ConstVectorRef, VectorRef x) override { x.setZero(); }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    data_.discrete_constraint.residual(data_.step, data_.q0, q1_, f);
  }

  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) override {
    increment_ = q1_ - data_.q0;
    if (data_.bound(increment_, f.data(), RowScales::margin * level)) return nullptr;
    data_.scale_rows(increment_, level, 0, blocks_[0].scale, row_scales_);
    return row_scales_.unsolved(f, level);
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    data_.discrete_constraint.end_derivative(data_.step, data_.q0, q1_, data_.end_derivative);
    graph_.mobility(data_.step, mobility_);
    displacement_.multiply(mobility_.data(), data_.start_rows.coefficients().data(),
                           displacement_values_.data());
    response_.multiply(data_.end_derivative.data(), displacement_values_.data(), response_values_.data());
    values.setZero();
    layout_.add_to(values.data(), 0, 1.0 / data_.step.size, response_values_.data());
  }

  void finish(ConstVectorRef x, StepEnd& end) override {
    evaluate(x);
    end.at.q = q1_;
    end.at.p = p1_;
    end.at.v = (q1_ - data_.q0) / data_.step.size;
    end.impulse = x / data_.step.size;
    end.memory.known = true;  // there is nothing to know
  }

 private:
  void evaluate(ConstVectorRef x) {
    if (size() > 0 && last_x_ == x) return;
    last_x_ = x;
    p_hat_ = data_.p0;
    if (size() > 0) data_.start_rows.add_annihilator(x, p_hat_, 1.0 / data_.step.size);
    graph_.map(data_.step, data_.q0, p_hat_, q1_, p1_);
    if (size() > 0) data_.raise_constraint_scale(q1_ - data_.q0, blocks_[0].scale);
  }

  std::unique_ptr<GeneratingFunction> s_;
  ExplicitGraph& graph_;
  StepData data_;
  PatternProduct displacement_;  ///< ∂q1/∂p0 A(q0)ᵀ
  PatternProduct response_;      ///< ∂c/∂q1 times that
  SparsityPattern pattern_;
  BlockPattern layout_{data_.rows(), data_.rows()};
  std::vector<ResidualBlock> blocks_;
  RowScales row_scales_;
  Vector increment_, last_x_, p_hat_, q1_, p1_, mobility_, displacement_values_, response_values_;
};

}  // namespace

std::unique_ptr<StepProblem> multiplier_step(std::unique_ptr<GeneratingFunction> generating_function,
                                             const Scene& scene, const ConstraintRule& rule, bool dense) {
  return std::make_unique<MultiplierStep>(std::move(generating_function), scene, rule, dense);
}

}  // namespace diracstep
