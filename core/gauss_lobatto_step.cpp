#include <algorithm>
#include <cmath>
#include <diracstep/core/constraint_distribution.hpp>
#include <diracstep/core/gauss_lobatto_step.hpp>
#include <diracstep/core/gauss_lobatto_tableau.hpp>
#include <diracstep/core/scales.hpp>

namespace diracstep {

namespace {

class GaussLobattoStep final : public StepProblem {
 public:
  GaussLobattoStep(int s, const Scene& scene, bool dense)
      : lagrangian_(scene.lagrangian),
        force_(scene.force),
        s_(s),
        n_(scene.dimension()),
        m_(scene.rows()),
        table_(gauss_lobatto_tableau(s)),
        next_velocities_(lagrange_basis(table_.c, table_.c.array() + 1.0)),
        next_impulses_(lagrange_basis(table_.lobatto_c.head(s), table_.lobatto_c.head(s).array() + 1.0)),
        mirror_(lagrangian_->pattern().transposed_positions()) {
    for (Columns* stages : {&q_, &lq_, &lv_}) stages->setZero(n_, s_);
    lobatto_q_.setZero(n_, s_ + 1);
    impulses_.setZero(n_, s_);
    const int nonzeros = lagrangian_->pattern().nonzeros();
    for (Columns* blocks : {&lqq_, &lqv_, &lvv_}) blocks->setZero(nonzeros, s_);
    if (force_) {
      f_.setZero(n_);
      fq_.setZero(force_->pattern().nonzeros(), s_);
      fv_ = fq_;
    }
    int row = 0;
    for (const auto& block : scene.constraints) {
      rows_.emplace_back(block, row, s_);
      row += block->rows();
    }
    last_x_.setConstant(size(), std::nan(""));
    plan_blocks(dense);
    blocks_.push_back({"momentum", n_ * s_});
    if (m_ > 0) blocks_.push_back({"constraint", m_ * s_});
  }

  int size() const override { return s_ * (n_ + m_); }
  int leading_unknowns() const override { return s_ * n_; }

  bool extrapolate_stages(ConstVectorRef last, VectorRef x) const override {
    x.setZero();
    for (int i = 0; i < s_; ++i)
      for (int k = 0; k < s_; ++k) {
        x.segment(n_ * i, n_) += next_velocities_(i, k) * last.segment(n_ * k, n_);
        x.segment(row_of(i), m_) += next_impulses_(i, k) * last.segment(row_of(k), m_);
      }
    return true;
  }

  void keep() override {
    force_size_ = max_norm(lq_);
    if (curvature_known_) curvature_size_ = max_norm(lqq_);
  }
  void reset() override { force_size_ = curvature_size_ = 0.0; }
  void save(Snapshot& to) const override {
    to.put(force_size_);
    to.put(curvature_size_);
  }
  void restore(Snapshot& from) override {
    force_size_ = from.number();
    curvature_size_ = from.number();
  }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }

  std::string unknowns() const override {
    std::string text = "stage velocities (" + std::to_string(s_ * n_) + ")";
    if (m_ > 0) text += ", multipliers (" + std::to_string(s_ * m_) + ")";
    return text;
  }

  void begin(Interval step, const Vector& q0, const Vector& p0) override {
    step_ = step;
    q0_ = q0;
    p0_ = p0;
    last_x_[0] = std::nan("");
    curvature_known_ = false;
    for (Rows& rows : rows_) rows.evaluate_impulse_rows(step_.start, q0_, 0);
    update_scales();
  }

  void guess(const Vector& v0, VectorRef x) override {
    for (int i = 0; i < s_; ++i) x.segment(n_ * i, n_) = v0;
    x.tail(m_ * s_).setZero();
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    const double h = step_.size;
    for (int i = 0; i < s_; ++i) {
      auto momentum = f.segment(n_ * i, n_);
      momentum = lv_.col(i) - p0_;
      for (int j = 0; j < s_; ++j) momentum -= h * table_.a_hat(i, j) * lq_.col(j);
      if (m_ > 0)
        for (int j = 0; j < s_; ++j) momentum -= table_.e(i, j) * impulses_.col(j);
    }
    for (Rows& rows : rows_)
      for (int j = 0; j < s_; ++j) {
        auto out = f.segment(row_of(j) + rows.first, rows.block->rows());
        if (rows.block->holonomic()) {
          rows.block->position(lobatto_time(j + 1), lobatto_q_.col(j + 1), out);
          out /= h;
        } else {
          rows.velocity_residual(gauss_time(j), q_.col(j), x.segment(n_ * j, n_), out);
        }
      }
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    curvature_known_ = true;
    for (int i = 0; i < s_; ++i) {
      lagrangian_->hessian(gauss_time(i), q_.col(i), x.segment(n_ * i, n_), lqq_.col(i), lqv_.col(i),
                           lvv_.col(i));
      if (force_)
        force_->derivatives(gauss_time(i), q_.col(i), x.segment(n_ * i, n_), fq_.col(i), fv_.col(i));
    }
    values.setZero();
    for (int i = 0; i < s_; ++i)
      for (int k = 0; k < s_; ++k) add_momentum_block(i, k, values);
    for (Rows& rows : rows_) add_rows(rows, x, values);
  }

  void finish(ConstVectorRef x, Vector& q1, Vector& p1, Vector& impulse) override {
    evaluate(x);
    q1 = lobatto_q_.col(s_);
    p1 = p0_;
    for (int j = 0; j < s_; ++j) {
      p1 += step_.size * table_.b[j] * lq_.col(j);
      if (m_ > 0) p1 += table_.lobatto_b[j] * impulses_.col(j);
    }
    // The impulse at q0 is that part of λ_0 which enters there.
    impulse = table_.lobatto_b[0] * x.segment(n_ * s_, m_);
  }

 private:
  /// One block of constraint rows with what it needs at the nodes of the step.
  struct Rows {
    Rows(std::shared_ptr<const ConstraintRows> constraint_rows, int first_row, int s)
        : block(std::move(constraint_rows)), first(first_row) {
      const int nonzeros = block->pattern().nonzeros();
      at_lobatto.setZero(nonzeros, s + 1);
      at_gauss.setZero(nonzeros, s);
      derivative.setZero(nonzeros);
      curvature.setZero(block->curvature_pattern().nonzeros(), s);
      offset.setZero(block->rows());
    }

    void evaluate_impulse_rows(double t, ConstVectorRef q, int node) {
      block->coefficients(t, q, at_lobatto.col(node), offset);
    }

    void velocity_residual(double t, ConstVectorRef q, ConstVectorRef v, VectorRef out) {
      block->coefficients(t, q, derivative, offset);
      out = offset;
      block->pattern().multiply_add(derivative.data(), v.data(), out.data());
    }

    std::shared_ptr<const ConstraintRows> block;
    int first;           ///< its first row among the scene's
    Columns at_lobatto;  ///< A at the Lobatto nodes
    Columns at_gauss;    ///< A at the Gauss nodes, nonholonomic rows only
    Columns curvature;   ///< ∂(Aᵀλ_j)/∂q at the Lobatto nodes
    Vector derivative, offset;
    std::vector<int> impulse_places, row_places;  ///< layout numbers, one for each (stage, node)
    std::vector<int> curvature_places;
  };

  double gauss_time(int i) const { return step_.start + table_.c[i] * step_.size; }
  double lobatto_time(int j) const { return step_.start + table_.lobatto_c[j] * step_.size; }
  int row_of(int j) const { return n_ * s_ + m_ * j; }

  /// Everything the residual is made of, at x, unless x is where it was last taken.
  void evaluate(ConstVectorRef x) {
    if (last_x_ == x) return;
    last_x_ = x;
    const double h = step_.size;
    const auto v = x.head(n_ * s_).reshaped(n_, s_);
    for (int i = 0; i < s_; ++i) {
      q_.col(i) = h * table_.a(i, 0) * v.col(0);
      for (int k = 1; k < s_; ++k) q_.col(i) += h * table_.a(i, k) * v.col(k);
      q_.col(i) += q0_;
      lagrangian_->gradient(gauss_time(i), q_.col(i), v.col(i), lq_.col(i), lv_.col(i));
      if (force_) {
        force_->value(gauss_time(i), q_.col(i), v.col(i), f_);
        lq_.col(i) += f_;
      }
    }
    lobatto_q_.col(0) = q0_;
    for (int j = m_ > 0 ? 1 : s_; j <= s_; ++j) {
      lobatto_q_.col(j) = h * table_.lobatto_a(j, 0) * v.col(0);
      for (int k = 1; k < s_; ++k) lobatto_q_.col(j) += h * table_.lobatto_a(j, k) * v.col(k);
      lobatto_q_.col(j) += q0_;
    }
    if (m_ == 0) return;
    impulses_.setZero();
    for (Rows& rows : rows_)
      for (int j = 0; j < s_; ++j) {
        if (j > 0) rows.evaluate_impulse_rows(lobatto_time(j), lobatto_q_.col(j), j);
        rows.block->pattern().transposed_multiply_add(
            rows.at_lobatto.col(j).data(), x.data() + row_of(j) + rows.first, impulses_.col(j).data());
      }
  }

  void plan_blocks(bool dense) {
    BlockPattern layout(size(), size());
    for (int i = 0; i < s_; ++i)
      for (int k = 0; k < s_; ++k) {
        layout.add(lagrangian_->pattern(), n_ * i, n_ * k);
        if (force_) force_places_.push_back(layout.add(force_->pattern(), n_ * i, n_ * k));
        for (Rows& rows : rows_) {
          const SparsityPattern& a = rows.block->pattern();
          rows.impulse_places.push_back(layout.add(a, n_ * i, row_of(k) + rows.first, true));
          rows.row_places.push_back(layout.add(a, row_of(i) + rows.first, n_ * k));
          rows.curvature_places.push_back(layout.add(rows.block->curvature_pattern(), n_ * i, n_ * k));
        }
      }
    blocks_per_stage_ = 1 + (force_ ? 1 : 0) + 3 * static_cast<int>(rows_.size());
    pattern_ = layout.assemble(dense);
    layout_ = std::move(layout);
  }

  /// ∂(momentum row i)/∂V_k without the curvature of the rows.
  void add_momentum_block(int i, int k, VectorRef values) const {
    const double h = step_.size;
    const auto& places = layout_.positions((i * s_ + k) * blocks_per_stage_);
    for (std::size_t e = 0; e < places.size(); ++e) {
      const auto r = static_cast<Eigen::Index>(e);
      double sum = -h * table_.a_hat(i, k) * lqv_(r, k) + h * table_.a(i, k) * lqv_(mirror_[e], i);
      for (int j = 0; j < s_; ++j) sum -= h * h * table_.a_hat(i, j) * table_.a(j, k) * lqq_(r, j);
      if (i == k) sum += lvv_(r, i);
      values[places[e]] += sum;
    }
    if (!force_) return;
    const auto& force_places = layout_.positions(force_places_[static_cast<std::size_t>(i * s_ + k)]);
    for (std::size_t e = 0; e < force_places.size(); ++e) {
      const auto r = static_cast<Eigen::Index>(e);
      double sum = -h * table_.a_hat(i, k) * fv_(r, k);
      for (int j = 0; j < s_; ++j) sum -= h * h * table_.a_hat(i, j) * table_.a(j, k) * fq_(r, j);
      values[force_places[e]] += sum;
    }
  }

  /// The columns of the impulses, their curvature, and the rows of the constraint.
  void add_rows(Rows& rows, ConstVectorRef x, VectorRef values) {
    const double h = step_.size;
    const auto at = [this](int i, int k) { return static_cast<std::size_t>(i * s_ + k); };
    for (int j = 1; j < s_; ++j)
      rows.block->annihilator_derivative(lobatto_time(j), lobatto_q_.col(j),
                                         x.segment(row_of(j) + rows.first, rows.block->rows()),
                                         rows.curvature.col(j));
    for (int i = 0; i < s_; ++i)
      for (int k = 0; k < s_; ++k) {
        add(values, rows.impulse_places[at(i, k)], -table_.e(i, k), rows.at_lobatto.col(k).data());
        for (int j = 1; j < s_; ++j)
          add(values, rows.curvature_places[at(i, k)], -h * table_.e(i, j) * table_.lobatto_a(j, k),
              rows.curvature.col(j).data());
      }
    for (int j = 0; j < s_; ++j) add_constraint_rows(rows, j, x, values);
  }

  void add_constraint_rows(Rows& rows, int j, ConstVectorRef x, VectorRef values) {
    const double h = step_.size;
    const auto place = [&](int k) { return rows.row_places[static_cast<std::size_t>(j * s_ + k)]; };
    if (rows.block->holonomic()) {
      rows.evaluate_impulse_rows(lobatto_time(j + 1), lobatto_q_.col(j + 1), j + 1);
      for (int k = 0; k < s_; ++k)
        add(values, place(k), table_.lobatto_a(j + 1, k), rows.at_lobatto.col(j + 1).data());
      return;
    }
    rows.block->coefficients(gauss_time(j), q_.col(j), rows.at_gauss.col(j), rows.offset);
    add(values, place(j), 1.0, rows.at_gauss.col(j).data());
    rows.block->derivative(gauss_time(j), q_.col(j), x.segment(n_ * j, n_), 1.0, rows.derivative);
    for (int k = 0; k < s_; ++k) add(values, place(k), h * table_.a(j, k), rows.derivative.data());
  }

  void add(VectorRef values, int layout, double factor, const double* block) const {
    const auto& places = layout_.positions(layout);
    for (std::size_t k = 0; k < places.size(); ++k) values[places[k]] += factor * block[k];
  }

  /// Terms of the momentum rows are momenta; a velocity of size |q|/h loses ε|q|/h to round-off.
  void update_scales() {
    const double h = std::abs(step_.size);
    const double velocity = max_norm(q0_) / h;
    double one_forms = 0.0;
    for (const Rows& rows : rows_) one_forms = std::max(one_forms, max_norm(rows.at_lobatto.col(0)));
    blocks_[0].scale = usable_scale(max_norm(p0_) + h * force_size_ + h * curvature_size_ * max_norm(q0_));
    if (m_ > 0) blocks_[1].scale = usable_scale(one_forms * velocity);
  }

  std::shared_ptr<const Lagrangian> lagrangian_;
  std::shared_ptr<const Force> force_;
  int s_, n_, m_;
  GaussLobattoTableau table_;
  Columns next_velocities_, next_impulses_;  ///< stages of the next step from those of this one
  std::vector<int> mirror_;
  std::vector<Rows> rows_;
  SparsityPattern pattern_;
  BlockPattern layout_{0, 0};
  int blocks_per_stage_ = 1;
  std::vector<int> force_places_;
  std::vector<ResidualBlock> blocks_;

  Interval step_{0.0, 1.0};
  Vector q0_, p0_;
  Vector last_x_, f_;
  Columns q_, lobatto_q_;  ///< configurations at the Gauss and the Lobatto nodes
  Columns lq_, lv_;        ///< ∂L/∂q + f and ∂L/∂v at the Gauss nodes
  Columns impulses_;       ///< A(Q~_j)ᵀ λ_j
  Columns lqq_, lqv_, lvv_, fq_, fv_;
  bool curvature_known_ = false;                    ///< lqq_ was evaluated in this step
  double force_size_ = 0.0, curvature_size_ = 0.0;  ///< of ∂L/∂q and ∂²L/∂q² in the last step kept
};

}  // namespace

std::unique_ptr<StepProblem> gauss_lobatto_step(int s, const Scene& scene, bool dense) {
  return std::make_unique<GaussLobattoStep>(s, scene, dense);
}

}  // namespace diracstep
