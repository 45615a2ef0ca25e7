#include <algorithm>
#include <cmath>
#include <diracstep/core/methods/quadrature.hpp>

namespace diracstep {

namespace {

/// For L = ½ vᵀMv + b(q)... with constant diagonal M and no term that mixes q and v, and nodes at the ends
/// only: D1S holds q1 linearly, so  q1 = q0 + h M⁻¹ (p0 − ∂(the rest)/∂v + h w_0 ∂L/∂q(q0)).
class SeparableEnds final : public ExplicitGraph {
 public:
  SeparableEnds(const Lagrangian& lagrangian, std::span<const StepNode> nodes, const Vector& mass)
      : lagrangian_(lagrangian),
        pattern_(SparsityPattern::diagonal(lagrangian.dimension())),
        inverse_mass_(mass.cwiseInverse()) {
    for (const StepNode& node : nodes) (node.c == 0.0 ? start_weight_ : end_weight_) += node.weight;
    const int n = lagrangian.dimension();
    for (Vector* column : {&zero_, &rest_momentum_, &force_, &ignored_}) column->setZero(n);
  }

  /// The constant diagonal of M; zero where the pattern has no entry.
  static Vector mass_of(const Lagrangian& lagrangian) {
    const SparsityPattern& pattern = lagrangian.pattern();
    const Vector zero = Vector::Zero(lagrangian.dimension());
    Vector lqq(pattern.nonzeros()), lqv(pattern.nonzeros()), lvv(pattern.nonzeros()), mass = zero;
    lagrangian.hessian(0.0, zero, zero, lqq, lqv, lvv);
    for (int i = 0; i < mass.size(); ++i)
      if (const int place = pattern.position(i, i); place >= 0) mass[i] = lvv[place];
    return mass;
  }

  const SparsityPattern& mobility_pattern() const override { return pattern_; }

  void map(Interval step, ConstVectorRef q0, ConstVectorRef p0, VectorRef q1, VectorRef p1) override {
    const double h = step.size;
    lagrangian_.gradient(step.start, q0, zero_, force_, rest_momentum_);
    q1 = p0 - rest_momentum_ + h * start_weight_ * force_;
    p1 = q1;
    q1 = q0 + h * inverse_mass_.cwiseProduct(q1);
    lagrangian_.gradient(step.end(), q1, zero_, force_, ignored_);
    p1 += rest_momentum_ + h * end_weight_ * force_;
  }

  void mobility(Interval step, VectorRef values) override { values = step.size * inverse_mass_; }

 private:
  const Lagrangian& lagrangian_;
  SparsityPattern pattern_;
  double start_weight_ = 0.0, end_weight_ = 0.0;
  Vector inverse_mass_, zero_, rest_momentum_, force_, ignored_;
};

class QuadratureLagrangian final : public GeneratingFunction {
 public:
  QuadratureLagrangian(std::shared_ptr<const Lagrangian> lagrangian, StepRule rule)
      : GeneratingFunction(GeneratingType::one, lagrangian->pattern()),
        lagrangian_(std::move(lagrangian)),
        rule_(rule),
        mirror_(pattern().transposed_positions()) {
    const int n = dimension();
    for (Vector* column : {&q_, &v_, &lq_, &lv_}) column->resize(n);
    for (Vector* values : {&lqq_, &lqv_, &lvv_}) values->resize(pattern().nonzeros());
    const PhaseStructure& structure = lagrangian_->structure();
    const bool at_ends =
        std::ranges::all_of(rule_.nodes(), [](StepNode node) { return node.c == 0.0 || node.c == 1.0; });
    if (!at_ends || !structure.separable || !structure.y_hessian_constant || !structure.y_hessian_diagonal)
      return;
    const Vector mass = SeparableEnds::mass_of(*lagrangian_);
    if ((mass.array() != 0.0).all() && mass.allFinite())
      explicit_ = std::make_unique<SeparableEnds>(*lagrangian_, rule_.nodes(), mass);
  }

  double value(Interval step, ConstColumnsRef y) override {
    double sum = 0.0;
    for (const StepNode& node : rule_.nodes()) {
      move_to(node, step, y);
      sum += node.weight * lagrangian_->value(t_, q_, v_);
    }
    return step.size * sum;
  }

  void gradient(Interval step, ConstColumnsRef y, ColumnsRef g) override {
    const double h = step.size;
    g.setZero();
    for (const StepNode& node : rule_.nodes()) {
      move_to(node, step, y);
      lagrangian_->gradient(t_, q_, v_, lq_, lv_);
      g.col(0) += node.weight * (h * (1.0 - node.c) * lq_ - lv_);
      g.col(1) += node.weight * (h * node.c * lq_ + lv_);
    }
  }

  void hessian(Interval step, ConstColumnsRef y, ColumnsRef blocks) override {
    const double h = step.size;
    blocks.setZero();
    for (const StepNode& node : rule_.nodes()) {
      const double c = node.c, d = 1.0 - node.c, w = node.weight;
      move_to(node, step, y);
      lagrangian_->hessian(t_, q_, v_, lqq_, lqv_, lvv_);
      for (Eigen::Index k = 0; k < lqq_.size(); ++k) {
        const double lvq = lqv_[mirror_[static_cast<std::size_t>(k)]];
        blocks(k, 0) += w * (h * d * d * lqq_[k] - d * (lqv_[k] + lvq) + lvv_[k] / h);
        blocks(k, 1) += w * (h * c * d * lqq_[k] + d * lqv_[k] - c * lvq - lvv_[k] / h);
        blocks(k, 2) += w * (h * c * c * lqq_[k] + c * (lqv_[k] + lvq) + lvv_[k] / h);
      }
    }
  }

  ExplicitGraph* explicit_graph() override { return explicit_.get(); }
  bool take_increments() override { return increments_ = true; }

 private:
  void move_to(const StepNode& node, Interval step, ConstColumnsRef y) {
    t_ = step.start + node.c * step.size;
    if (increments_) {
      q_ = y.col(0) + node.c * y.col(1);
      v_ = y.col(1) / step.size;
      return;
    }
    q_ = (1.0 - node.c) * y.col(0) + node.c * y.col(1);
    v_ = (y.col(1) - y.col(0)) / step.size;
  }

  std::shared_ptr<const Lagrangian> lagrangian_;
  StepRule rule_;
  std::vector<int> mirror_;
  std::unique_ptr<SeparableEnds> explicit_;
  bool increments_ = false;
  double t_ = 0.0;
  Vector q_, v_, lq_, lv_, lqq_, lqv_, lvv_;
};

}  // namespace

std::unique_ptr<GeneratingFunction> quadrature_lagrangian(std::shared_ptr<const Lagrangian> lagrangian,
                                                          StepRule rule) {
  return std::make_unique<QuadratureLagrangian>(std::move(lagrangian), rule);
}

}  // namespace diracstep
