#include <algorithm>
#include <cmath>
#include <diracstep/core/compensated_sums.hpp>
#include <diracstep/core/constraint_distribution.hpp>
#include <diracstep/core/gauss_lobatto_step.hpp>
#include <diracstep/core/gauss_lobatto_tableau.hpp>
#include <diracstep/core/scales.hpp>
#include <diracstep/core/stage_splitting.hpp>
#include <optional>

namespace diracstep {

namespace {

/// Compensated sums are worth an iteration more: the residual must fall to this part of its usual bound.
constexpr double last_bit = 0.01;

/// The splitting takes full matrices.
constexpr int largest_split = 40;

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
    affine_ = lagrangian_->structure().quadratic && !force_ &&
              std::ranges::all_of(scene.constraints, [](const auto& block) { return block->constant(); });
    last_x_.setZero(size());
    kept_.multipliers.setZero(m_ * s_);
    q0_.setZero(n_);
    p0_.setZero(n_);
    const auto holonomic = [](const auto& block) { return block->holonomic(); };
    const auto kinds = std::ranges::count_if(scene.constraints, holonomic);
    if (n_ + m_ <= largest_split && (kinds == 0 || kinds == std::ssize(scene.constraints)))
      splitting_.emplace(table_, n_, m_, kinds > 0);
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

  bool compensate() override {
    sums_.emplace(s_, n_);
    return true;
  }

  void keep() override {
    if (!kept_.known && curvature_ == 0.0) second_derivatives(last_x_);  // solved without a Jacobian
    kept_.known = true;
    kept_.force = max_norm(lq_);
    kept_.curvature = curvature_;
    kept_.row_curvature = row_curvature_;
    kept_.multipliers = last_x_.tail(m_ * s_);
    if (sums_) sums_->keep();
  }
  void reset() override {
    if (sums_) sums_->forget();
    kept_ = {.multipliers = Vector::Zero(m_ * s_)};
    hessians_known_ = mass_known_ = false;
  }
  void save(Snapshot& to) const override {
    to.put(kept_.known ? 1.0 : 0.0);
    for (const double size : {kept_.force, kept_.curvature, kept_.row_curvature}) to.put(size);
    to.put(kept_.multipliers);
    if (!sums_) return;
    to.put(q0_);
    to.put(p0_);
    sums_->save(to);
  }
  void restore(Snapshot& from) override {
    kept_.known = from.whole_number(1) == 1;
    for (double* size : {&kept_.force, &kept_.curvature, &kept_.row_curvature}) *size = from.number();
    from.read(kept_.multipliers);
    if (!sums_) return;
    from.read(q0_);
    from.read(p0_);
    sums_->restore(from);
  }
  double constant_jacobian_parameter() const override { return affine_ ? step_.size : std::nan(""); }

  bool has_splitting() const override { return splitting_.has_value(); }
  void solve_splitting(VectorRef f) override {
    if (!splitting_known_) move_splitting();
    splitting_->solve(f);
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
    if (sums_) sums_->begin(q0, p0, q0_, p0_);
    q0_ = q0;
    p0_ = p0;
    splitting_known_ = false;
    force_size_ = kept_.force;
    curvature_ = kept_.curvature;
    row_curvature_ = kept_.row_curvature;
    for (Rows& rows : rows_) rows.evaluate_impulse_rows(step_.start, q0_, 0);
    update_scales();
    last_x_[0] = std::nan("");
  }

  void guess(const Vector& v0, VectorRef x) override {
    for (int i = 0; i < s_; ++i) x.segment(n_ * i, n_) = v0;
    x.tail(m_ * s_).setZero();
    if (!kept_.known) sample_start(v0);
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    const double h = step_.size;
    for (int i = 0; i < s_; ++i) {
      if (sums_) {
        sums_->momentum_row(i, h, lv_.col(i), p0_, lq_, impulses_, f.segment(n_ * i, n_));
        continue;
      }
      double* const momentum = f.data() + n_ * i;
      for (int k = 0; k < n_; ++k) momentum[k] = lv_(k, i) - p0_[k];
      for (int j = 0; j < s_; ++j) add_scaled(-h * table_.a_hat(i, j), lq_.col(j).data(), momentum);
      if (m_ > 0)
        for (int j = 0; j < s_; ++j) add_scaled(-table_.e(i, j), impulses_.col(j).data(), momentum);
    }
    rows_at_gauss_known_ = true;
    for (Rows& rows : rows_)
      for (int j = 0; j < s_; ++j) {
        auto out = f.segment(row_of(j) + rows.first, rows.block->rows());
        if (rows.block->holonomic()) {
          rows.block->position(lobatto_time(j + 1), lobatto_q_.col(j + 1), out);
          out /= h;
        } else {
          rows.velocity_residual(gauss_time(j), q_.col(j), x.segment(n_ * j, n_), j, out);
        }
      }
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    if (!rows_at_gauss_known_) evaluate_rows_at_gauss();
    second_derivatives(x);
    row_curvature_ = 0.0;
    values.setZero();
    for (int i = 0; i < s_; ++i)
      for (int k = 0; k < s_; ++k) add_momentum_block(i, k, values);
    for (Rows& rows : rows_) add_rows(rows, x, values);
  }

  void finish(ConstVectorRef x, Vector& q1, Vector& p1, Vector& impulse) override {
    evaluate(x);
    if (sums_) {
      sums_->end(step_.size, q0_, p0_, velocities(x), lq_, impulses_, q1, p1);
    } else {
      q1 = lobatto_q_.col(s_);
      p1 = p0_;
      for (int j = 0; j < s_; ++j) {
        add_scaled(step_.size * table_.b[j], lq_.col(j).data(), p1.data());
        if (m_ > 0) add_scaled(table_.lobatto_b[j], impulses_.col(j).data(), p1.data());
      }
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

    void velocity_residual(double t, ConstVectorRef q, ConstVectorRef v, int node, VectorRef out) {
      block->coefficients(t, q, at_gauss.col(node), offset);
      out = offset;
      block->pattern().multiply_add(at_gauss.col(node).data(), v.data(), out.data());
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

  Eigen::Map<const Columns> velocities(ConstVectorRef x) const { return {x.data(), n_, s_}; }

  /// Everything the residual is made of, at x, unless x is where it was last taken.
  void evaluate(ConstVectorRef x) {
    if (last_x_ == x) return;
    last_x_ = x;
    rows_at_gauss_known_ = false;
    for (int i = 0; i < s_; ++i) {
      const auto v = x.segment(n_ * i, n_);
      if (sums_)
        sums_->position(step_.size, sums_->table.a.row(i), q0_, velocities(x), q_.col(i));
      else
        move(table_.a, i, x, q_.col(i).data());
      lagrangian_->gradient(gauss_time(i), q_.col(i), v, lq_.col(i), lv_.col(i));
      if (force_) {
        force_->value(gauss_time(i), q_.col(i), v, f_);
        lq_.col(i) += f_;
      }
    }
    for (int j = m_ > 0 ? 1 : s_; j <= s_; ++j)
      if (sums_)
        sums_->position(step_.size, sums_->table.lobatto_a.row(j), q0_, velocities(x), lobatto_q_.col(j));
      else
        move(table_.lobatto_a, j, x, lobatto_q_.col(j).data());
    if (m_ == 0) return;
    impulses_.setZero();
    for (Rows& rows : rows_)
      for (int j = 0; j < s_; ++j) {
        if (j > 0) rows.evaluate_impulse_rows(lobatto_time(j), lobatto_q_.col(j), j);
        rows.block->pattern().transposed_multiply_add(
            rows.at_lobatto.col(j).data(), x.data() + row_of(j) + rows.first, impulses_.col(j).data());
      }
    blocks_[0].scale = std::max(blocks_[0].scale, (sums_ ? last_bit : 1.0) * impulse_scale(x.tail(m_ * s_)));
  }

  void evaluate_rows_at_gauss() {
    for (Rows& rows : rows_)
      for (int j = 0; j < s_ && !rows.block->holonomic(); ++j)
        rows.block->coefficients(gauss_time(j), q_.col(j), rows.at_gauss.col(j), rows.offset);
    rows_at_gauss_known_ = true;
  }

  /// to += factor · from, n entries.
  void add_scaled(double factor, const double* from, double* to) const {
    for (int k = 0; k < n_; ++k) to[k] += factor * from[k];
  }

  /// q = q0 + h Σ_k a(row, k) V_k, the small terms summed first.
  void move(const Columns& a, int row, ConstVectorRef x, double* q) const {
    const double h = step_.size;
    std::fill_n(q, n_, 0.0);
    for (int k = 0; k < s_; ++k) add_scaled(h * a(row, k), x.data() + n_ * k, q);
    add_scaled(1.0, q0_.data(), q);
  }

  /// Those of L and of the force at the Gauss nodes; of a quadratic L they are taken once.
  void second_derivatives(ConstVectorRef x) {
    for (int i = 0; i < s_; ++i) {
      const auto v = x.segment(n_ * i, n_);
      if (!hessians_known_)
        lagrangian_->hessian(gauss_time(i), q_.col(i), v, lqq_.col(i), lqv_.col(i), lvv_.col(i));
      if (force_) force_->derivatives(gauss_time(i), q_.col(i), v, fq_.col(i), fv_.col(i));
    }
    if (!hessians_known_) curvature_ = max_norm(lqq_);
    hessians_known_ = lagrangian_->structure().quadratic;
  }

  /// The splitting is taken in the middle of the step, at the stages that were evaluated last.
  void move_splitting() {
    const int middle = s_ / 2;
    if (!mass_known_) {
      lagrangian_->hessian(gauss_time(middle), q_.col(middle), last_x_.segment(n_ * middle, n_),
                           lqq_.col(middle), lqv_.col(middle), lvv_.col(middle));
      splitting_->set_mass(lagrangian_->pattern(), lvv_.col(middle));
      mass_known_ = lagrangian_->structure().y_hessian_constant;
    }
    for (Rows& rows : rows_)
      splitting_->set_rows(rows.first, rows.block->pattern(), rows.at_lobatto.col(middle));
    if (m_ > 0) splitting_->factor_rows();
    splitting_known_ = true;
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
    if (s_ > 1) row_curvature_ = std::max(row_curvature_, max_norm(rows.curvature));
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
    add(values, place(j), 1.0, rows.at_gauss.col(j).data());
    rows.block->derivative(gauss_time(j), q_.col(j), x.segment(n_ * j, n_), 1.0, rows.derivative);
    for (int k = 0; k < s_; ++k) add(values, place(k), h * table_.a(j, k), rows.derivative.data());
  }

  void add(VectorRef values, int layout, double factor, const double* block) const {
    const auto& places = layout_.positions(layout);
    for (std::size_t k = 0; k < places.size(); ++k) values[places[k]] += factor * block[k];
  }

  /// Size of the impulses of such multipliers, and of what they lose to the round-off of positions.
  double impulse_scale(ConstVectorRef multipliers) const {
    double largest = 0.0;
    for (const Rows& rows : rows_) {
      const auto places = rows.block->pattern().row_indices();
      for (int j = 0; j < s_; ++j) {
        const double* const a = rows.at_lobatto.col(0).data();
        const double* const lambda = multipliers.data() + m_ * j + rows.first;
        for (std::size_t k = 0; k < places.size(); ++k)
          largest = std::max(largest, std::abs(a[k] * lambda[places[k]]));
      }
    }
    return largest + row_curvature_ * max_norm(q0_);
  }

  /// Before the first solve: the derivatives at the start, for the round-off scales.
  void sample_start(const Vector& v0) {
    lagrangian_->gradient(step_.start, q0_, v0, lq_.col(0), lv_.col(0));
    lagrangian_->hessian(step_.start, q0_, v0, lqq_.col(0), lqv_.col(0), lvv_.col(0));
    const double before = blocks_[0].scale;  // of impulses nothing is known yet
    force_size_ = max_norm(lq_.col(0));
    curvature_ = max_norm(lqq_.col(0));
    last_x_[0] = std::nan("");
    update_scales();
    blocks_[0].scale = std::max(blocks_[0].scale, before);
  }

  /// Terms of the momentum rows are momenta, those of the last step where this one is not solved yet; a
  /// velocity of size |q|/h loses ε|q|/h to round-off.
  void update_scales() {
    const double h = std::abs(step_.size);
    const double size = max_norm(q0_), velocity = size / h;
    one_forms_ = 0.0;
    for (const Rows& rows : rows_) one_forms_ = std::max(one_forms_, max_norm(rows.at_lobatto.col(0)));
    double momentum = max_norm(p0_) + h * force_size_ + h * curvature_ * size;
    if (m_ > 0) momentum += impulse_scale(kept_.multipliers);
    blocks_[0].scale = usable_scale(momentum);
    if (m_ > 0) blocks_[1].scale = usable_scale(one_forms_ * velocity);
    // What an iteration leaves of the residual is no random error: it is a smooth function of the state and
    // drives the energy one way.  So solve to the last bit.
    if (sums_)
      for (ResidualBlock& block : blocks_) block.scale *= last_bit;
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

  std::optional<CompensatedSums> sums_;

  Interval step_{0.0, 1.0};
  Vector q0_, p0_;
  Vector last_x_, f_;
  Columns q_, lobatto_q_;  ///< configurations at the Gauss and the Lobatto nodes
  Columns lq_, lv_;        ///< ∂L/∂q + f and ∂L/∂v at the Gauss nodes
  Columns impulses_;       ///< A(Q~_j)ᵀ λ_j
  Columns lqq_, lqv_, lvv_, fq_, fv_;
  /// Sizes in the last step kept, by which the next one judges round-off.
  struct Kept {
    bool known = false;
    double force = 0.0, curvature = 0.0, row_curvature = 0.0;
    Vector multipliers = {};
  };
  Kept kept_;
  double one_forms_ = 0.0, row_curvature_ = 0.0;  ///< of A(q0) and of ∂(Aᵀλ)/∂q
  double force_size_ = 0.0, curvature_ = 0.0;     ///< of ∂L/∂q and ∂²L/∂q²
  std::optional<StageSplitting> splitting_;       ///< small scenes with rows of one kind
  bool splitting_known_ = false, mass_known_ = false;
  bool affine_ = false;  ///< the residual is affine in the unknowns
  bool hessians_known_ = false, rows_at_gauss_known_ = false;
};

}  // namespace

std::unique_ptr<StepProblem> gauss_lobatto_step(int s, const Scene& scene, bool dense) {
  return std::make_unique<GaussLobattoStep>(s, scene, dense);
}

}  // namespace diracstep
