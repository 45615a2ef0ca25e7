#include <diracstep/core/methods/euler.hpp>
#include <vector>

namespace diracstep {

namespace {

/// For separable H the Euler graphs are explicit:
///   type two     p1 = p0 − h H_q(q0),   q1 = q0 + h H_p(p1)
///   type three   q1 = q0 + h H_p(p0),   p1 = p0 − h H_q(q1)
class SeparableEuler final : public ExplicitGraph {
 public:
  SeparableEuler(const Hamiltonian& hamiltonian, bool kick_first)
      : hamiltonian_(hamiltonian), kick_first_(kick_first) {
    const int n = hamiltonian.dimension(), nonzeros = hamiltonian.pattern().nonzeros();
    for (Vector* column : {&hq_, &hp_, &q_, &p_}) column->resize(n);
    for (Vector* values : {&hqq_, &hqp_, &hpp_}) values->resize(nonzeros);
  }

  const SparsityPattern& mobility_pattern() const override { return hamiltonian_.pattern(); }

  void map(Interval step, ConstVectorRef q0, ConstVectorRef p0, VectorRef q1, VectorRef p1) override {
    const double h = step.size;
    t_ = kick_first_ ? step.start : step.end();
    q_ = q0;
    p_ = p0;
    if (kick_first_) {
      hamiltonian_.gradient(t_, q_, p_, hq_, hp_);
      p_ -= h * hq_;
    }
    hamiltonian_.gradient(t_, q_, p_, hq_, hp_);
    q1 = q_ + h * hp_;
    p1 = p_;
    if (kick_first_) return;
    hamiltonian_.gradient(t_, q1, p_, hq_, hp_);
    p1 -= h * hq_;
  }

  void mobility(Interval step, VectorRef values) override {
    hamiltonian_.hessian(t_, q_, p_, hqq_, hqp_, hpp_);
    values = step.size * hpp_;
  }

 private:
  const Hamiltonian& hamiltonian_;
  bool kick_first_;
  double t_ = 0.0;
  Vector hq_, hp_, q_, p_, hqq_, hqp_, hpp_;
};

/// S = σ p·q + h H(q,p) with (q,p) = (q0,p1), σ = 1 for type two and (q,p) = (q1,p0), σ = −1 for type three.
class EulerHamiltonian final : public GeneratingFunction {
 public:
  EulerHamiltonian(GeneratingType type, std::shared_ptr<const Hamiltonian> hamiltonian)
      : GeneratingFunction(type, hamiltonian->pattern().with_diagonal()),
        hamiltonian_(std::move(hamiltonian)),
        sign_(type == GeneratingType::two ? 1.0 : -1.0),
        q_(type == GeneratingType::two ? 0 : 1),
        p_(1 - q_),
        mirror_(hamiltonian_->pattern().transposed_positions()) {
    const int n = dimension(), nonzeros = hamiltonian_->pattern().nonzeros();
    for (Vector* column : {&hq_, &hp_}) column->resize(n);
    for (Vector* values : {&hqq_, &hqp_, &hpp_}) values->resize(nonzeros);
    for (int i = 0; i < n; ++i) diagonal_.push_back(pattern().position(i, i));
    for (const auto& [row, column] : hamiltonian_->pattern().entries())
      places_.push_back(pattern().position(row, column));
    if (hamiltonian_->structure().separable)
      explicit_ = std::make_unique<SeparableEuler>(*hamiltonian_, type == GeneratingType::two);
  }

  double value(Interval step, ConstColumnsRef y) override {
    return sign_ * y.col(0).dot(y.col(1)) + step.size * hamiltonian_->value(time(step), y.col(q_), y.col(p_));
  }

  void gradient(Interval step, ConstColumnsRef y, ColumnsRef g) override {
    hamiltonian_->gradient(time(step), y.col(q_), y.col(p_), hq_, hp_);
    g.col(q_) = sign_ * y.col(p_) + step.size * hq_;
    g.col(p_) = sign_ * y.col(q_) + step.size * hp_;
  }

  void hessian(Interval step, ConstColumnsRef y, ColumnsRef blocks) override {
    hamiltonian_->hessian(time(step), y.col(q_), y.col(p_), hqq_, hqp_, hpp_);
    blocks.setZero();
    for (std::size_t k = 0; k < places_.size(); ++k) {
      const auto e = static_cast<Eigen::Index>(k);
      blocks(places_[k], pair(q_, q_)) = step.size * hqq_[e];
      blocks(places_[k], pair(p_, p_)) = step.size * hpp_[e];
      blocks(places_[k], 1) = step.size * (q_ == 0 ? hqp_[e] : hqp_[mirror_[k]]);
    }
    for (const int k : diagonal_) blocks(k, 1) += sign_;
  }

  ExplicitGraph* explicit_graph() override { return explicit_.get(); }

 private:
  double time(Interval step) const { return q_ == 0 ? step.start : step.end(); }

  std::shared_ptr<const Hamiltonian> hamiltonian_;
  double sign_;
  int q_, p_;                           ///< the columns that hold them
  std::vector<int> mirror_;             ///< of the Hamiltonian's own pattern
  std::vector<int> places_, diagonal_;  ///< of its values, and of the diagonal, in this pattern
  std::unique_ptr<SeparableEuler> explicit_;
  Vector hq_, hp_, hqq_, hqp_, hpp_;
};

}  // namespace

std::unique_ptr<GeneratingFunction> euler_type2(std::shared_ptr<const Hamiltonian> hamiltonian) {
  return std::make_unique<EulerHamiltonian>(GeneratingType::two, std::move(hamiltonian));
}

std::unique_ptr<GeneratingFunction> euler_type3(std::shared_ptr<const Hamiltonian> hamiltonian) {
  return std::make_unique<EulerHamiltonian>(GeneratingType::three, std::move(hamiltonian));
}

}  // namespace diracstep
