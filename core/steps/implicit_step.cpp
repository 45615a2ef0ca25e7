#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/dirac/discrete_force.hpp>
#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/core/steps/implicit_jacobian.hpp>
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
        data_(scene, s_->dimension(), rule),
        n_(data_.n),
        m_(data_.rows()),
        inner_(n_ * s_->inner_columns()),
        force_(DiscreteForce::of(scene.force, rule.nodes, s_->type())),
        jacobian_(*s_,
                  {data_.start_rows.pattern(), data_.discrete_constraint.pattern(),
                   force_ ? &force_->pattern() : nullptr},
                  dense) {
    y_.setZero(n_, s_->columns());
    gradient_ = y_;
    at_end_ = hessian_ = Columns::Zero(s_->pattern().nonzeros(), s_->pairs());
    last_x_.setZero(size());
    for (Vector* column : {&q1_, &increment_, &sizes_, &largest_, &as_largest_}) column->setZero(n_);
    row_scales_ = RowScales(size());
    quadratic_ = scene.stepped_function().structure().quadratic && !scene.force;
    by_increment_ = s_->type() == GeneratingType::one && s_->take_increments();
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
    const char* const end = by_increment_ ? "q1 - q0 (" : graph_.ends_at_position ? "q1 (" : "p1 (";
    std::string text = end + std::to_string(n_) + ")";
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
    for (std::size_t b = 0; b < blocks_.size(); ++b) known_[b] = blocks_[b].scale;
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    const double h = data_.step.size;
    if (by_increment_)
      x.head(n_) = h * v0;
    else if (graph_.ends_at_position)
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
      data_.discrete_constraint.residual(data_.step, data_.q0, q1_, increment_, f.segment(n_, m_));
    }
    if (inner_ > 0) f.tail(inner_) = gradient_.rightCols(s_->inner_columns()).reshaped();
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    s_->hessian(data_.step, y_, hessian_);
    hessian_known_ = true;
    if (force_) force_->minus_by_end(data_.step, data_.q0, q1_, increment_, force_by_end_);
    if (m_ > 0) data_.discrete_constraint.end_derivative(data_.step, data_.q0, q1_, data_.end_derivative);
    jacobian_.assemble(
        {data_.step.size, hessian_, data_.start_rows.coefficients(), data_.end_derivative, force_by_end_},
        values);
  }

  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) override {
    const double factor = std::abs(row_factor());
    const Vector& start = graph_.starts_from_position ? data_.p0 : data_.q0;
    bool solved = RowScales::solved(f.data(), start.data(), n_, factor * level);
    solved &= data_.bound(increment_, f.data() + n_, RowScales::margin * level);
    // Of rows of inner columns nothing is known but that they are as light as the momentum.
    const double of_inner = inner_ > 0 ? blocks_.back().scale / scale_of(max_norm(start)) : 0.0;
    for (int i = 2; i < s_->columns(); ++i)
      solved = solved && RowScales::solved(f.data() + n_ * (i - 1) + m_, start.data(), n_, of_inner * level);
    if (solved) return nullptr;
    size_terms(factor, level);
    return row_scales_.unsolved(f, level);
  }

  void finish(ConstVectorRef x, StepEnd& end) override {
    evaluate(x);
    end.at.q = q1_;
    if (graph_.ends_at_position)
      end.at.p = graph_.end_sign * gradient_.col(1);
    else
      end.at.p = y_.col(1);
    if (force_) end.at.p += force_->plus();
    end.at.v = increment_ / data_.step.size;
    end.impulse = x.segment(n_, m_) / data_.step.size;
    end.memory.known = true;
    end.memory.scales = terms_;
    if (hessian_known_) measure_terms(end.memory.scales);
    end.memory.multipliers = x.segment(n_, m_);
  }

 private:
  double row_factor() const { return graph_.starts_from_position ? data_.step.size : 1.0; }

  /// Columns, gradient and end at x, unless x is where they were last taken.
  void evaluate(ConstVectorRef x) {
    if (last_x_ == x) return;
    last_x_ = x;
    y_.col(0) = graph_.starts_from_position ? data_.q0 : data_.p0;
    if (!graph_.starts_from_position && m_ > 0)
      data_.start_rows.add_annihilator(x.segment(n_, m_), y_.col(0), 1.0 / data_.step.size);
    y_.col(1) = (graph_.ends_at_position ? 1.0 : 1.0 / data_.step.size) * x.head(n_);
    if (by_increment_) {
      increment_ = x.head(n_);
      q1_ = data_.q0 + increment_;
    } else if (graph_.ends_at_position) {
      q1_ = x.head(n_);
      increment_ = q1_ - data_.q0;
    }
    if (force_ && graph_.ends_at_position) {
      force_->evaluate(data_.step, data_.q0, q1_, increment_);
      if (!graph_.starts_from_position) y_.col(0) += force_->minus();
    }
    if (inner_ > 0) y_.rightCols(s_->inner_columns()) = x.tail(inner_).reshaped(n_, s_->inner_columns());
    s_->gradient(data_.step, y_, gradient_);
    if (!graph_.ends_at_position) {
      q1_ = graph_.end_sign * gradient_.col(1);
      increment_ = q1_ - data_.q0;
      if (force_) force_->evaluate(data_.step, data_.q0, q1_, increment_);
    }
    if (m_ > 0) data_.raise_constraint_scale(increment_, blocks_[1].scale);
    // Terms at x, where those known before this step are smaller, as at rest.
    const auto& p1 = graph_.ends_at_position ? gradient_ : y_;
    double own = std::max(max_norm(gradient_.col(0)),
                          graph_.starts_from_position ? max_norm(p1.col(1)) : max_norm(q1_));
    if (force_) own = std::max(own, max_norm(force_->minus()));
    blocks_[0].scale = std::max(known_[0], scale_of(std::abs(row_factor()) * own));
    // Inner columns are positions between the ends, with terms as large as the momentum.
    if (inner_ > 0) blocks_.back().scale = std::max(known_[blocks_.size() - 1], scale_of(own));
  }

  /// Where nothing is known of an earlier step: the Hessian at a plausible point, for the round-off scales.
  void sample_terms() {
    y_.col(0) = graph_.starts_from_position ? data_.q0 : data_.p0;
    y_.col(1) = graph_.ends_at_position ? data_.q0 : data_.p0;
    if (by_increment_) y_.col(1) = data_.step.size * data_.v0;
    if (inner_ > 0)
      s_->guess_inner(data_.step, data_.q0, data_.p0, Vector::Zero(n_), y_.rightCols(s_->inner_columns()));
    s_->hessian(data_.step, y_, hessian_);
    q1_ = data_.q0;
    increment_ = data_.step.size * data_.v0;
    measure_terms(terms_);
  }

  void measure_terms(Vector& terms) {
    for (int i = 0; i < s_->columns(); ++i)
      if (i != 1) terms[i] = cancelling_terms(i);  // the end is no row
    if (!force_ || !graph_.starts_from_position) return;
    sizes_.setZero();
    force_->add_sizes(data_.step, data_.q0, q1_, increment_, sizes_);
    terms[0] = std::max(terms[0], max_norm(sizes_));
  }

  void update_scales() {
    const double own =
        graph_.starts_from_position ? std::abs(data_.step.size) * max_norm(data_.p0) : max_norm(data_.q0);
    // The impulse, as large as it was in the last step.
    const double impulse = graph_.starts_from_position && m_ > 0 ? data_.impulse_scale(multipliers_) : 0.0;
    blocks_[0].scale = scale_of(std::max({own, impulse, std::abs(row_factor()) * terms_[0]}));
    if (m_ > 0) blocks_[1].scale = data_.constraint_scale();
    if (inner_ == 0) return;
    blocks_.back().scale = scale_of(terms_.tail(s_->columns() - 2).maxCoeff());
  }

  /// Size of the terms that make up column i of the gradient: second derivatives times what they multiply.
  double cancelling_terms(int i) const {
    double largest = 0.0;
    for (int j = 0; j < s_->columns(); ++j) {
      const auto block = hessian_.col(s_->pair(std::min(i, j), std::max(i, j)));
      const bool both = by_increment_ && j == 0;
      const double size = both ? (block + hessian_.col(1)).lpNorm<Eigen::Infinity>() : max_norm(block);
      largest = std::max(largest, size * max_norm(y_.col(j)));
    }
    return largest;
  }

  bool is_position(int column) const {
    return column == 0 ? graph_.starts_from_position : column == 1 && graph_.ends_at_position;
  }
  /// The same row by row, and with the other terms of each row.
  void size_terms(double factor, double level) {
    s_->hessian(data_.step, y_, at_end_);
    for (int i = 0; i < s_->columns(); ++i) {
      if (i == 1) continue;  // the end is no row
      sizes_ = gradient_.col(i).cwiseAbs();
      largest_.setZero();
      for (int j = 0; j < s_->columns(); ++j) {
        add_sizes(i, j, y_.col(j), sizes_);
        RowScales::set_largest(as_largest_, quadratic_ ? 0.0 : max_norm(y_.col(j)),
                               is_position(j) ? data_.tolerances : none_, level);
        add_sizes(i, j, as_largest_, largest_);
      }
      if (i > 1) {
        row_scales_.set(n_ * (i - 1) + m_, sizes_, largest_, blocks_.back().scale);
        continue;
      }
      sizes_ += (graph_.starts_from_position ? data_.p0 : data_.q0).cwiseAbs();
      if (force_) force_->add_sizes(data_.step, data_.q0, q1_, increment_, sizes_);
      sizes_ *= factor;
      if (m_ > 0 && graph_.starts_from_position) data_.add_impulse_sizes(last_x_.segment(n_, m_), sizes_);
      largest_ *= factor;
      row_scales_.set(0, sizes_, largest_, blocks_[0].scale);
    }
    if (m_ > 0) data_.scale_rows(increment_, level, n_, blocks_[1].scale, row_scales_);
  }

  /// sizes += |∂²S/∂y_i∂y_j| |y|.
  void add_sizes(int i, int j, ConstVectorRef y, Vector& sizes) const {
    const int pair = s_->pair(std::min(i, j), std::max(i, j));
    s_->pattern().for_each([&](Eigen::Index e, int r, int c) {
      const double both = by_increment_ && j == 0 ? at_end_(e, 1) : 0.0;  // with the increment kept
      const double derivative = std::abs(at_end_(e, pair) + both);
      if (i <= j)
        sizes[r] += derivative * std::abs(y[c]);
      else
        sizes[c] += derivative * std::abs(y[r]);
    });
  }

  std::unique_ptr<GeneratingFunction> s_;
  GraphOf graph_;
  StepData data_;
  int n_, m_, inner_;
  std::optional<DiscreteForce> force_;
  ImplicitJacobian jacobian_;
  Vector force_by_end_;
  std::vector<ResidualBlock> blocks_;
  std::array<double, 3> known_{};  ///< their scales before this step
  RowScales row_scales_;
  Vector last_x_, q1_, increment_;
  Vector sizes_, largest_, as_largest_, none_;  ///< workspaces of size_terms(), but for an empty one
  bool quadratic_ = false;                      ///< L without force
  bool by_increment_ = false;                   ///< the unknown is q1 − q0 instead of q1
  Columns y_, gradient_, hessian_, at_end_;     ///< the last one at the last point, for size_terms()
  Vector terms_, multipliers_;  ///< of the last step: sizes of the terms of each column of the gradient, λ
  bool hessian_known_ = false;  ///< hessian_ was taken in this step
};

}  // namespace

std::unique_ptr<StepProblem> implicit_step(std::unique_ptr<GeneratingFunction> generating_function,
                                           const Scene& scene, const ConstraintRule& rule, bool dense) {
  return std::make_unique<ImplicitStep>(std::move(generating_function), scene, rule, dense);
}

}  // namespace diracstep
