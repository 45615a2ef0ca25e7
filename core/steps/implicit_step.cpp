#include <algorithm>
#include <cmath>
#include <diracstep/core/dirac/discrete_force.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/steps/implicit_step.hpp>
#include <diracstep/core/steps/step_data.hpp>
#include <optional>

namespace diracstep {

namespace {

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
        inner_(n_ * s_->inner_columns()) {
    y_.setZero(n_, s_->columns());
    gradient_ = y_;
    hessian_.setZero(s_->pattern().nonzeros(), s_->pairs());
    last_x_.setZero(size());
    q1_.setZero(n_);
    terms_.setZero(s_->columns());
    multipliers_.setZero(m_);
    if (scene.force) {
      if (s_->type() == GeneratingType::four) throw Misuse("generating functions of type 4 take no forces");
      force_.emplace(scene.force, rule.nodes);
      force_by_end_.setZero(force_->pattern().nonzeros());
    }
    plan_blocks(dense);
    blocks_.push_back({"momentum", n_});
    if (m_ > 0) blocks_.push_back({"constraint", m_});
    if (inner_ > 0) blocks_.push_back({"stationarity", inner_});
  }

  int size() const override { return n_ + m_ + inner_; }
  int leading_unknowns() const override { return n_; }
  void keep() override {
    if (hessian_known_) measure_terms();
    hessian_known_ = false;
    terms_known_ = true;
    multipliers_ = last_x_.segment(n_, m_);
  }
  void reset() override {
    terms_known_ = hessian_known_ = false;
    multipliers_.setZero();
  }
  void save(Snapshot& to) const override {
    for (const bool known : {terms_known_, hessian_known_}) to.put(known ? 1.0 : 0.0);
    to.put(terms_);
    to.put(multipliers_);
    if (hessian_known_) to.put(hessian_.reshaped());  // solved and not kept yet: keep() measures it
  }
  void restore(Snapshot& from) override {
    for (bool* known : {&terms_known_, &hessian_known_}) *known = from.whole_number(1) == 1;
    from.read(terms_);
    from.read(multipliers_);
    if (hessian_known_) from.read(hessian_.reshaped());
  }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }

  std::string unknowns() const override {
    std::string text = (graph_.ends_at_position ? "q1 (" : "p1 (") + std::to_string(n_) + ")";
    if (m_ > 0) text += ", multipliers (" + std::to_string(m_) + ")";
    if (inner_ > 0) text += ", inner columns (" + std::to_string(inner_) + ")";
    return text;
  }

  void begin(Interval step, const Vector& q0, const Vector& p0) override {
    data_.freeze(step, q0, p0);
    last_x_[0] = std::nan("");
    if (!terms_known_) sample_hessian();
    hessian_known_ = false;
    update_scales();
  }

  void guess(const Vector& v0, VectorRef x) override {
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
    values.setZero();
    for (const HessianBlock& block : hessian_blocks_) {
      const double factor = block.row_factor(*this) * block.column_factor(*this);
      layout_.add_to(values.data(), block.layout, factor, hessian_.col(block.pair).data());
    }
    if (force_) add_force(values);
    if (m_ == 0) return;
    data_.discrete_constraint.end_derivative(data_.step, data_.q0, q1_, data_.end_derivative);
    add_constraint_columns(values);
    add_constraint_rows(values);
  }

  void finish(ConstVectorRef x, Vector& q1, Vector& p1, Vector& impulse) override {
    evaluate(x);
    q1 = q1_;
    if (graph_.ends_at_position)
      p1 = graph_.end_sign * gradient_.col(1);
    else
      p1 = y_.col(1);
    if (force_) p1 += force_->plus();
    impulse = x.segment(n_, m_) / data_.step.size;
  }

 private:
  /// A block of the Jacobian that is a block of the Hessian of S times factors of h.
  struct HessianBlock {
    int row_column;  ///< the column of S whose derivative is the row: 0 graph, 2… stationarity
    int unknown;     ///< the column of S that is the unknown: 1 end, 2… inner
    int pair;
    int layout;
    double row_factor(const ImplicitStep& step) const {
      return row_column == 0 ? -step.graph_.start_sign * step.row_factor() : 1.0;
    }
    double column_factor(const ImplicitStep& step) const { return unknown == 1 ? step.end_factor() : 1.0; }
  };

  /// A product of the constraint's rows or columns with a block of the Hessian of S, for what enters through
  /// p̂0 or leaves through q1 = ±D2S.
  struct ProductBlock {
    int column;  ///< the column of S that the row belongs to, or that the unknown is
    int pair;
    int layout;
    PatternProduct product;
    Vector values;
  };

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

  int row_of(int column) const { return column == 0 ? 0 : n_ + m_ + n_ * (column - 2); }
  int place_of(int column) const { return column == 1 ? 0 : n_ + m_ + n_ * (column - 2); }

  void plan_blocks(bool dense) {
    BlockPattern layout(size(), size());
    for (int row = 0; row < s_->columns(); ++row)
      for (int unknown = 1; unknown < s_->columns(); ++unknown) {
        if (row == 1) continue;
        const bool lower = row > unknown;
        const int pair = s_->pair(std::min(row, unknown), std::max(row, unknown));
        const int place = layout.add(s_->pattern(), row_of(row), place_of(unknown), lower);
        hessian_blocks_.push_back({row, unknown, pair, place});
      }
    if (m_ > 0) plan_constraint_blocks(layout);
    if (force_) plan_force_blocks(layout);
    pattern_ = layout.assemble(dense);
    layout_ = std::move(layout);
  }

  void plan_constraint_blocks(BlockPattern& layout) {
    const SparsityPattern& a0 = data_.start_rows.pattern();
    const SparsityPattern& c1 = data_.discrete_constraint.pattern();
    if (graph_.starts_from_position) {
      impulse_layout_ = layout.add(a0, 0, n_, true);
    } else {
      for (int row = 0; row < s_->columns(); ++row) {
        if (row == 1 && graph_.ends_at_position) continue;
        // Row `row` of S holds a = p̂0 = p0 + A0ᵀλ; block (row, a) is the transpose of pair (a, row).
        PatternProduct product(s_->pattern(), row > 0, a0, true);
        const int place = row == 1 ? -1 : layout.add(product.pattern(), row_of(row), n_);
        const Vector values = Vector::Zero(product.pattern().nonzeros());
        columns_of_impulse_.push_back({row, s_->pair(0, row), place, std::move(product), values});
      }
    }
    if (graph_.ends_at_position) {
      end_layout_ = layout.add(c1, n_, 0);
      return;
    }
    for (int unknown = 1; unknown < s_->columns(); ++unknown) {
      PatternProduct product(c1, false, s_->pattern(), false);
      const int place = layout.add(product.pattern(), n_, place_of(unknown));
      const Vector values = Vector::Zero(product.pattern().nonzeros());
      rows_of_end_.push_back({unknown, s_->pair(1, unknown), place, std::move(product), values});
    }
    if (!graph_.starts_from_position) {
      impulse_through_end_ = PatternProduct(c1, false, columns_of_impulse_[1].product.pattern(), false);
      impulse_through_end_layout_ = layout.add(impulse_through_end_.pattern(), n_, n_);
    }
    through_end_values_.setZero(impulse_through_end_.pattern().nonzeros());
  }

  /// F⁻ depends on the end: directly (one), through q1 = D2S (two), and as part of the argument p̂0 (three).
  void plan_force_blocks(BlockPattern& layout) {
    const SparsityPattern& f1 = force_->pattern();
    const auto plan = [&](int column, int pair, int row, int place, PatternProduct product) {
      const Vector values = Vector::Zero(product.pattern().nonzeros());
      const int number = layout.add(product.pattern(), row, place);
      force_products_.push_back({column, pair, number, std::move(product), values});
    };
    if (graph_.ends_at_position && graph_.starts_from_position) {
      force_layout_ = layout.add(f1, 0, 0);
    } else if (graph_.ends_at_position) {
      for (int row = 0; row < s_->columns(); ++row)
        if (row != 1)
          plan(row, s_->pair(0, row), row_of(row), 0, PatternProduct(s_->pattern(), row > 0, f1, false));
    } else {
      for (int unknown = 1; unknown < s_->columns(); ++unknown)
        plan(unknown, s_->pair(1, unknown), 0, place_of(unknown),
             PatternProduct(f1, false, s_->pattern(), false));
    }
  }

  void add_force(VectorRef& values) {
    force_->minus_by_end(data_.step, data_.q0, q1_, force_by_end_);
    if (force_layout_ >= 0)
      return layout_.add_to(values.data(), force_layout_, row_factor(), force_by_end_.data());
    for (ProductBlock& block : force_products_) {
      const double* s = hessian_.col(block.pair).data();
      const double* f = force_by_end_.data();
      const bool in_argument = graph_.ends_at_position;
      block.product.multiply(in_argument ? s : f, in_argument ? f : s, block.values.data());
      double factor = 1.0;
      if (!in_argument) factor = row_factor() * graph_.end_sign * (block.column == 1 ? end_factor() : 1.0);
      if (in_argument && block.column == 0) factor = -graph_.start_sign;
      layout_.add_to(values.data(), block.layout, factor, block.values.data());
    }
  }

  /// ∂/∂(hλ) of the graph and stationarity rows.
  void add_constraint_columns(VectorRef& values) {
    const Vector& a0 = data_.start_rows.coefficients();
    if (graph_.starts_from_position) return layout_.add_to(values.data(), impulse_layout_, 1.0, a0.data());
    for (ProductBlock& block : columns_of_impulse_) {
      block.product.multiply(hessian_.col(block.pair).data(), a0.data(), block.values.data());
      if (block.column == 1) continue;  // the end is no row; see add_constraint_rows
      const double factor = block.column == 0 ? -graph_.start_sign : 1.0;
      layout_.add_to(values.data(), block.layout, factor / data_.step.size, block.values.data());
    }
  }

  /// The rows c(q0,q1): ∂/∂(end) and ∂/∂(inner), and ∂/∂(hλ) for type four.
  void add_constraint_rows(VectorRef& values) {
    const Vector& c1 = data_.end_derivative;
    if (graph_.ends_at_position) return layout_.add_to(values.data(), end_layout_, 1.0, c1.data());
    for (ProductBlock& block : rows_of_end_) {
      block.product.multiply(c1.data(), hessian_.col(block.pair).data(), block.values.data());
      const double factor = block.column == 1 ? end_factor() : 1.0;
      layout_.add_to(values.data(), block.layout, graph_.end_sign * factor, block.values.data());
    }
    if (graph_.starts_from_position) return;
    impulse_through_end_.multiply(c1.data(), columns_of_impulse_[1].values.data(),
                                  through_end_values_.data());
    layout_.add_to(values.data(), impulse_through_end_layout_, graph_.end_sign / data_.step.size,
                   through_end_values_.data());
  }

  /// Before the first solve: the Hessian at a plausible point, for the round-off scales.
  void sample_hessian() {
    y_.col(0) = graph_.starts_from_position ? data_.q0 : data_.p0;
    y_.col(1) = graph_.ends_at_position ? data_.q0 : data_.p0;
    if (inner_ > 0)
      s_->guess_inner(data_.step, data_.q0, data_.p0, Vector::Zero(n_), y_.rightCols(s_->inner_columns()));
    s_->hessian(data_.step, y_, hessian_);
    measure_terms();
  }

  void measure_terms() {
    for (int i = 0; i < s_->columns(); ++i)
      if (i != 1) terms_[i] = cancelling_terms(i);  // the end is no row
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
  SparsityPattern pattern_;
  BlockPattern layout_{0, 0};
  std::vector<HessianBlock> hessian_blocks_;
  int impulse_layout_ = -1, end_layout_ = -1, impulse_through_end_layout_ = -1;
  std::vector<ProductBlock> columns_of_impulse_, rows_of_end_;
  PatternProduct impulse_through_end_;
  std::optional<DiscreteForce> force_;
  Vector force_by_end_;
  int force_layout_ = -1;
  std::vector<ProductBlock> force_products_;
  Vector through_end_values_;
  std::vector<ResidualBlock> blocks_;
  Vector last_x_, q1_;
  Columns y_, gradient_, hessian_;
  Vector terms_;        ///< size of the terms of each column of the gradient, in the last step kept
  Vector multipliers_;  ///< in that step
  bool terms_known_ = false, hessian_known_ = false;
};

}  // namespace

std::unique_ptr<StepProblem> implicit_step(std::unique_ptr<GeneratingFunction> generating_function,
                                           const Scene& scene, const ConstraintRule& rule, bool dense) {
  return std::make_unique<ImplicitStep>(std::move(generating_function), scene, rule, dense);
}

}  // namespace diracstep
