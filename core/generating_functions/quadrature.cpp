#include <diracstep/core/generating_functions/quadrature.hpp>

namespace diracstep {

namespace {

class QuadratureLagrangian final : public GeneratingFunction {
 public:
  QuadratureLagrangian(std::shared_ptr<const Lagrangian> lagrangian, StepRule rule)
      : GeneratingFunction(GeneratingType::one, lagrangian->pattern()),
        lagrangian_(std::move(lagrangian)),
        nodes_(step_nodes(rule)),
        mirror_(pattern().transposed_positions()) {
    const int n = dimension();
    for (Vector* column : {&q_, &v_, &lq_, &lv_}) column->resize(n);
    for (Vector* values : {&lqq_, &lqv_, &lvv_}) values->resize(pattern().nonzeros());
  }

  double value(Interval step, ConstVectorRef q0, ConstVectorRef q1) override {
    double sum = 0.0;
    for (const StepNode& node : nodes_) {
      move_to(node, step, q0, q1);
      sum += node.weight * lagrangian_->value(t_, q_, v_);
    }
    return step.size * sum;
  }

  void gradient(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef d1, VectorRef d2) override {
    const double h = step.size;
    d1.setZero();
    d2.setZero();
    for (const StepNode& node : nodes_) {
      move_to(node, step, q0, q1);
      lagrangian_->gradient(t_, q_, v_, lq_, lv_);
      d1 += node.weight * (h * (1.0 - node.c) * lq_ - lv_);
      d2 += node.weight * (h * node.c * lq_ + lv_);
    }
  }

  void hessian(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef aa, VectorRef ab,
               VectorRef bb) override {
    const double h = step.size;
    aa.setZero();
    ab.setZero();
    bb.setZero();
    for (const StepNode& node : nodes_) {
      const double c = node.c, d = 1.0 - node.c, w = node.weight;
      move_to(node, step, q0, q1);
      lagrangian_->hessian(t_, q_, v_, lqq_, lqv_, lvv_);
      for (Eigen::Index k = 0; k < lqq_.size(); ++k) {
        const double lvq = lqv_[mirror_[static_cast<std::size_t>(k)]];
        if (aa.size() > 0) aa[k] += w * (h * d * d * lqq_[k] - d * (lqv_[k] + lvq) + lvv_[k] / h);
        if (ab.size() > 0) ab[k] += w * (h * c * d * lqq_[k] + d * lqv_[k] - c * lvq - lvv_[k] / h);
        if (bb.size() > 0) bb[k] += w * (h * c * c * lqq_[k] + c * (lqv_[k] + lvq) + lvv_[k] / h);
      }
    }
  }

 private:
  void move_to(const StepNode& node, Interval step, ConstVectorRef q0, ConstVectorRef q1) {
    t_ = step.start + node.c * step.size;
    q_ = (1.0 - node.c) * q0 + node.c * q1;
    v_ = (q1 - q0) / step.size;
  }

  std::shared_ptr<const Lagrangian> lagrangian_;
  std::span<const StepNode> nodes_;
  std::vector<int> mirror_;
  double t_ = 0.0;
  Vector q_, v_, lq_, lv_, lqq_, lqv_, lvv_;
};

}  // namespace

std::unique_ptr<GeneratingFunction> quadrature_lagrangian(std::shared_ptr<const Lagrangian> lagrangian,
                                                          StepRule rule) {
  return std::make_unique<QuadratureLagrangian>(std::move(lagrangian), rule);
}

}  // namespace diracstep
