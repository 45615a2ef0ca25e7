#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <diracstep/core/step_problem.hpp>

namespace diracstep {

namespace {

double max_norm(ConstVectorRef x) { return x.size() == 0 ? 0.0 : x.lpNorm<Eigen::Infinity>(); }

/// A positive finite size of terms, 1 where none is known.
double usable_scale(double scale) { return scale > 0.0 && std::isfinite(scale) ? scale : 1.0; }

class GeneratingFunctionStep final : public StepProblem {
 public:
  GeneratingFunctionStep(std::unique_ptr<GeneratingFunction> s, const ConstraintBlocks& constraints,
                         StepRule rule, bool dense)
      : s_(std::move(s)),
        type_(s_->type()),
        discrete_constraint_(constraints, rule),
        start_rows_(discrete_constraint_.blocks()),
        n_(s_->dimension()),
        m_(discrete_constraint_.rows()),
        products_(m_ > 0 && type_ != GeneratingType::one),
        dense_(dense || products_) {
    for (Vector* column : {&q0_, &p0_, &q1_, &a_, &b_, &d1_, &d2_}) column->setZero(n_);
    last_x_.setConstant(size(), std::nan(""));
    const int nonzeros = s_->pattern().nonzeros();
    ab_.setZero(nonzeros);
    if (products_ && type_ != GeneratingType::two) aa_.setZero(nonzeros);
    if (products_ && type_ != GeneratingType::three) bb_.setZero(nonzeros);
    assemble_pattern();
    blocks_.push_back({"momentum", n_});
    if (m_ > 0) blocks_.push_back({"constraint", m_});
  }

  int size() const override { return n_ + m_; }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }

  void begin(Interval step, const Vector& q0, const Vector& p0) override {
    step_ = step;
    q0_ = q0;
    p0_ = p0;
    last_x_[0] = std::nan("");
    if (m_ > 0) start_rows_.evaluate(step.start, q0);
    if (stiffness_ == 0.0) {
      a_ = starts_from_position() ? q0 : p0;
      b_ = ends_at_position() ? q0 : p0;
      s_->hessian(step_, a_, b_, aa_, ab_, bb_);
      measure_stiffness();
    }
    update_scales();
  }

  void guess(const Vector& v0, VectorRef x) const override {
    const double h = step_.size;
    if (ends_at_position())
      x.head(n_) = q0_ + h * v0;
    else
      x.head(n_) = h * p0_;
    x.tail(m_).setZero();
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    const double h = step_.size;
    auto momentum = f.head(n_);
    switch (type_) {
      case GeneratingType::one: momentum = h * (p0_ + d1_); break;
      case GeneratingType::two: momentum = h * (p0_ - d1_); break;
      case GeneratingType::three: momentum = q0_ + d1_; break;
      case GeneratingType::four: momentum = q0_ - d1_; break;
    }
    if (m_ == 0) return;
    if (starts_from_position()) start_rows_.add_annihilator(x.tail(m_), momentum);
    discrete_constraint_.residual(step_, q0_, q1_, f.tail(m_));
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    s_->hessian(step_, a_, b_, aa_, ab_, bb_);
    measure_stiffness();
    if (m_ > 0) discrete_constraint_.differentiate(step_, q0_, q1_);
    values.setZero();
    const auto& places = layout_.positions(0);
    const double factor = graph_factor();
    for (std::size_t k = 0; k < places.size(); ++k)
      values[places[k]] = factor * ab_[static_cast<Eigen::Index>(k)];
    if (products_)
      add_dense_products(values);
    else
      add_constraint_blocks(values);
  }

  void finish(ConstVectorRef x, Vector& q1, Vector& p1, Vector& impulse) override {
    evaluate(x);
    q1 = q1_;
    switch (type_) {
      case GeneratingType::one: p1 = d2_; break;
      case GeneratingType::three: p1 = -d2_; break;
      default: p1 = b_;
    }
    impulse = x.tail(m_) / step_.size;
  }

 private:
  bool starts_from_position() const {
    return type_ == GeneratingType::one || type_ == GeneratingType::two;
  }
  bool ends_at_position() const { return type_ == GeneratingType::one || type_ == GeneratingType::three; }

  /// ∂(momentum rows)/∂(first unknowns) = graph_factor · ab.
  double graph_factor() const {
    switch (type_) {
      case GeneratingType::one: return step_.size;
      case GeneratingType::two: return -1.0;
      case GeneratingType::three: return 1.0;
      case GeneratingType::four: return -1.0 / step_.size;
    }
    return 0.0;
  }

  /// Arguments, first derivatives and end configuration at x, unless x is where they were last taken.
  void evaluate(ConstVectorRef x) {
    if (last_x_ == x) return;
    last_x_ = x;
    const double h = step_.size;
    if (starts_from_position()) {
      a_ = q0_;
    } else {
      a_ = p0_;
      if (m_ > 0) start_rows_.add_annihilator(x.tail(m_), a_, 1.0 / h);
    }
    if (ends_at_position())
      b_ = x.head(n_);
    else
      b_ = x.head(n_) / h;
    s_->gradient(step_, a_, b_, d1_, d2_);
    switch (type_) {
      case GeneratingType::two: q1_ = d2_; break;
      case GeneratingType::four: q1_ = -d2_; break;
      default: q1_ = b_;
    }
  }

  void assemble_pattern() {
    BlockPattern layout(size(), size());
    layout.add(s_->pattern(), 0, 0);
    int row = n_;
    for (const auto& block : discrete_constraint_.blocks()) {
      if (!products_) {
        layout.add(block->pattern(), 0, row, true);
        layout.add(block->pattern(), row, 0);
      }
      row += block->rows();
    }
    pattern_ = layout.assemble(dense_);
    layout_ = std::move(layout);
  }

  /// Type one: A(q0)ᵀ beside the graph rows, ∂c/∂q1 below them.
  void add_constraint_blocks(VectorRef values) const {
    for (std::size_t k = 0; k < discrete_constraint_.blocks().size(); ++k) {
      const Vector& impulse = start_rows_.coefficients(k);
      const Vector& constraint = discrete_constraint_.end_derivative(k);
      const auto& impulse_places = layout_.positions(1 + 2 * static_cast<int>(k));
      const auto& constraint_places = layout_.positions(2 + 2 * static_cast<int>(k));
      for (std::size_t e = 0; e < impulse_places.size(); ++e) {
        values[impulse_places[e]] = impulse[static_cast<Eigen::Index>(e)];
        values[constraint_places[e]] = constraint[static_cast<Eigen::Index>(e)];
      }
    }
  }

  /// Types two to four with rows: the chain rule through p̂0 and through q1 = ±D2S, as full matrices.
  void add_dense_products(VectorRef values) const {
    using Eigen::MatrixXd;
    const double h = step_.size;
    MatrixXd impulse = MatrixXd::Zero(n_, m_), end = MatrixXd::Zero(m_, n_);
    int row = 0;
    for (std::size_t k = 0; k < discrete_constraint_.blocks().size(); ++k) {
      const auto& block = *discrete_constraint_.blocks()[k];
      impulse.middleCols(row, block.rows()) = full(block.pattern(), start_rows_.coefficients(k)).transpose();
      end.middleRows(row, block.rows()) = full(block.pattern(), discrete_constraint_.end_derivative(k));
      row += block.rows();
    }
    Eigen::Map<MatrixXd> j(values.data(), size(), size());
    switch (type_) {
      case GeneratingType::one: break;  // sparse, see add_constraint_blocks
      case GeneratingType::two:
        j.topRightCorner(n_, m_) = impulse;
        j.bottomLeftCorner(m_, n_) = end * full(s_->pattern(), bb_) / h;
        break;
      case GeneratingType::three:
        j.topRightCorner(n_, m_) = full(s_->pattern(), aa_) * impulse / h;
        j.bottomLeftCorner(m_, n_) = end;
        break;
      case GeneratingType::four:
        j.topRightCorner(n_, m_) = -full(s_->pattern(), aa_) * impulse / h;
        j.bottomLeftCorner(m_, n_) = -end * full(s_->pattern(), bb_) / h;
        j.bottomRightCorner(m_, m_) = -end * full(s_->pattern(), ab_).transpose() * impulse / h;
        break;
    }
  }

  static Eigen::MatrixXd full(const SparsityPattern& pattern, const Vector& values) {
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(pattern.rows(), pattern.columns());
    for (int column = 0, k = 0; column < pattern.columns(); ++column)
      for (; k < pattern.column_starts()[static_cast<std::size_t>(column) + 1]; ++k)
        matrix(pattern.row_indices()[static_cast<std::size_t>(k)], column) = values[k];
    return matrix;
  }

  void measure_stiffness() { stiffness_ = usable_scale(std::abs(graph_factor()) * max_norm(ab_)); }

  void update_scales() {
    const double h = std::abs(step_.size);
    const double position = max_norm(q0_), momentum = h * max_norm(p0_);
    const bool graph_at_position = !starts_from_position();
    blocks_[0].scale = usable_scale(std::max(graph_at_position ? position : momentum,
                                             stiffness_ * (ends_at_position() ? position : momentum)));
    if (m_ == 0) return;
    double one_forms = 0.0;
    for (std::size_t k = 0; k < discrete_constraint_.blocks().size(); ++k)
      one_forms = std::max(one_forms, max_norm(start_rows_.coefficients(k)));
    blocks_[1].scale = usable_scale(one_forms * position);
  }

  std::unique_ptr<GeneratingFunction> s_;
  GeneratingType type_;
  DiscreteConstraint discrete_constraint_;
  ConstraintsAtPoint start_rows_;
  int n_;
  int m_;
  bool products_;  ///< the Jacobian holds products of blocks, so it is a full matrix
  bool dense_;
  SparsityPattern pattern_;
  BlockPattern layout_{0, 0};
  std::vector<ResidualBlock> blocks_;

  Interval step_{0.0, 1.0};
  Vector q0_, p0_;
  double stiffness_ = 0.0;  ///< size of the graph rows' derivative, for the round-off scale

  Vector last_x_, q1_, a_, b_, d1_, d2_, aa_, ab_, bb_;
};

}  // namespace

std::unique_ptr<StepProblem> generating_function_step(std::unique_ptr<GeneratingFunction> generating_function,
                                                      const ConstraintBlocks& constraints, StepRule rule,
                                                      bool dense) {
  return std::make_unique<GeneratingFunctionStep>(std::move(generating_function), constraints, rule, dense);
}

}  // namespace diracstep
