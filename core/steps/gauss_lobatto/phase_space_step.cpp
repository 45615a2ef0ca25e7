#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/combination.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/lu.hpp>
#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/phase_space_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/regular_two_form.hpp>
#include <diracstep/core/steps/gauss_lobatto/stage_sums.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/system/lagrangian_derivatives.hpp>

namespace diracstep {

namespace {

class PhaseSpaceStep final : public StepProblem {
 public:
  PhaseSpaceStep(int s, const Scene& scene, bool dense)
      : lagrangian_(scene.lagrangian),
        s_(s),
        n_(scene.dimension()),
        sign_(s % 2 == 0 ? 1.0 : -1.0),
        table_(gauss_lobatto_tableau(s)),
        mirror_(lagrangian_->pattern().transposed_positions()),
        zero_(Vector::Zero(n_)),
        sum_(stage_sum(n_, s)),
        start_(*lagrangian_),
        end_(*lagrangian_),
        end_along_(*lagrangian_) {
    for (Columns* stages : {&q_, &lq_, &lv_}) stages->setZero(n_, s_);
    for (Columns* stages : {&lqq_, &lqv_, &lvv_}) stages->setZero(lagrangian_->pattern().nonzeros(), s_);
    times_.setZero(s_);
    stiffness_.setZero(lqq_.rows());
    for (Vector* column : {&q0_, &p0_, &q1_, &p_start_, &p_end_, &along_, &sizes_, &largest_, &largest_q_})
      column->setZero(n_);
    last_x_.setConstant(size(), std::nan(""));
    dense_ = dense;
    tolerances_ = scene.tolerances;
    Columns weights = Columns::Ones(s_ + 1, s_ + 1);
    weights.topLeftCorner(s_, s_) = table_.a;
    weights.bottomLeftCorner(1, s_) = table_.b.transpose();
    weights(s_, s_) = 1.0 + sign_;
    unmix_ = weights.inverse().transpose();
    two_form_.setZero(n_, n_);
    for (Columns* stages : {&split_, &mixed_}) stages->setZero(n_, s_ + 1);
    BlockPattern layout(size(), size());
    for (int row = 0; row <= s_; ++row)
      for (int column = 0; column <= s_; ++column) layout.add(lagrangian_->pattern(), n_ * row, n_ * column);
    pattern_ = layout.assemble(dense);
    layout_ = std::move(layout);
    blocks_ = {{"momentum", n_ * s_}, {"primary constraint", n_}};
  }

  int size() const override { return n_ * (s_ + 1); }
  const SparsityPattern& pattern() const override { return pattern_; }

  /// With B = Dθ − Dθᵀ at the middle of the step and the terms of higher order in h left out, the Jacobian is
  /// [a 1; bᵀ 1+σ] ⊗ B in the unknowns (hV, ν).
  bool has_splitting() const override { return dense_; }
  void solve_splitting(VectorRef f) override {
    if (!two_form_known_) factor_two_form();
    split_ = f.reshaped(n_, s_ + 1);
    mixed_ = split_.lazyProduct(unmix_);
    solve_into(two_form_factors_, mixed_, split_);
    split_.leftCols(s_) /= step_.size;
    f = split_.reshaped();
  }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }
  StepTraits traits() const override {
    return {"stage velocities (" + std::to_string(n_ * s_) + "), projection (" + std::to_string(n_) + ")",
            n_ * s_,
            0,
            0,
            {{n_, lagrange_basis(table_.c, table_.c.array() + 1.0).transpose()}, {n_, Columns::Ones(1, 1)}}};
  }

  void begin(Interval step, const State& start, const StepMemory&) override {
    step_ = step;
    for (int i = 0; i < s_; ++i) times_[i] = step.start + table_.c[i] * step.size;
    if (step.size != scaled_to_) scale_weights(step.size);
    q0_ = start.q;
    p0_ = start.p;
    last_x_[0] = std::nan("");
    two_form_known_ = false;
    start_.take_second(*lagrangian_, step.start, q0_, zero_);
    start_.take_first(*lagrangian_, step.start, q0_, zero_);
    const double size = std::max(max_norm(p0_), max_norm(start_.qv) * max_norm(q0_));
    blocks_[0].scale = blocks_[1].scale = scale_of(size + std::abs(step.size) * max_norm(start_.q));
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    for (int i = 0; i < s_; ++i) x.segment(n_ * i, n_) = v0;
    x.tail(n_).setZero();
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    for (int i = 0; i < s_; ++i)
      for (int r = 0; r < n_; ++r) f[n_ * i + r] = lv_(r, i) - p_start_[r];
    add_stages(lq_.data(), force_weights_, f.data());
    f.tail(n_) = end_.v - p_end_ - sign_ / enlarged_ * (end_along_.q - end_.q);
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    lagrangian_->hessians({s_, times_.data(), q_.data(), x.data()}, lqq_.data(), lqv_.data(), lvv_.data());
    end_.take_second(*lagrangian_, step_.end(), q1_, zero_);
    end_along_.take_second(*lagrangian_, step_.end(), q1_, along_);
    values.setZero();
    for (int row = 0; row < s_; ++row) {
      for (int k = 0; k < s_; ++k) {
        combine(static_cast<int>(stiffness_.size()), s_, &stiffness_weights_(0, row * s_ + k), lqq_.data(),
                nullptr, stiffness_.data());
        set_block(values, row, k, [&](Eigen::Index e) { return stage_by_velocity(row, k, e); });
      }
      set_block(values, row, s_, [&](Eigen::Index e) { return stage_by_projection(row, e); });
    }
    for (int k = 0; k < s_; ++k)
      set_block(values, s_, k, [&](Eigen::Index e) { return end_by_velocity(k, e); });
    set_block(values, s_, s_, [&](Eigen::Index e) { return end_by_projection(e); });
  }

  /// Terms of a row: p0, Dθ(q0) q0 and h ∂L/∂q.
  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) override {
    bool solved = true;
    for (int i = 0; i <= s_; ++i)
      solved = solved && RowScales::solved(f.data() + n_ * i, p0_.data(), n_, level);
    if (solved) return nullptr;
    sizes_ = p0_.cwiseAbs() + std::abs(step_.size) * start_.q.cwiseAbs();
    largest_.setZero();
    RowScales::set_largest(largest_q_, lagrangian_->structure().quadratic ? 0.0 : max_norm(q0_), tolerances_,
                           level);
    lagrangian_->pattern().for_each([&](Eigen::Index e, int r, int c) {
      const double momentum = std::abs(start_.qv[e]), impulse = std::abs(step_.size * start_.qq[e]);
      sizes_[c] += momentum * std::abs(q0_[r]);
      sizes_[r] += impulse * std::abs(q0_[c]);
      largest_[c] += momentum * largest_q_[r];
      largest_[r] += impulse * largest_q_[c];
    });
    for (int i = 0; i <= s_; ++i) row_scales_.set(n_ * i, sizes_, largest_, blocks_[0].scale);
    return row_scales_.unsolved(f, level);
  }

  void finish(ConstVectorRef x, StepEnd& end) override {
    evaluate(x);
    end.at.q = q1_;
    end.at.p = end_.v;  // θ(q1): equal to the projected p̃1 at a solution
    end.at.v = (q1_ - q0_) / step_.size;
    end.impulse.resize(0);
    end.memory.known = true;  // its scales are those of the start
  }

 private:
  /// y_i += Σ_k weights(k, i) x_k.
  void add_stages(const double* x, const Columns& weights, double* y) const {
    if (sum_ != nullptr) return sum_(x, weights.data(), y, n_, y);
    for (int i = 0; i < s_; ++i)
      combine(n_, s_, weights.col(i).data(), x, y + static_cast<long>(n_) * i, y + static_cast<long>(n_) * i);
  }

  void scale_weights(double h) {
    scaled_to_ = h;
    position_weights_ = h * table_.a.transpose();
    force_weights_ = -h * table_.a_hat.transpose();
    stiffness_weights_.setZero(s_, s_ * s_);
    for (int i = 0; i < s_; ++i)
      for (int k = 0; k < s_; ++k)
        for (int j = 0; j < s_; ++j)
          stiffness_weights_(j, i * s_ + k) = -h * h * table_.a_hat(i, j) * table_.a(j, k);
  }

  void factor_two_form() {
    const int middle = s_ / 2;
    lagrangian_->hessian(times_[middle], q_.col(middle), last_x_.segment(n_ * middle, n_), lqq_.col(middle),
                         lqv_.col(middle), lvv_.col(middle));
    const auto starts = lagrangian_->pattern().column_starts();
    const auto rows = lagrangian_->pattern().row_indices();
    Eigen::Index e = 0;
    for (int j = 0; j < n_; ++j)
      for (; e < starts[static_cast<std::size_t>(j) + 1]; ++e)
        two_form_(rows[static_cast<std::size_t>(e)], j) = theta_at(middle, e) - lqv_(e, middle);
    two_form_factors_.compute(two_form_);
    two_form_known_ = true;
  }

  void evaluate(ConstVectorRef x) {
    if (last_x_ == x) return;
    last_x_ = x;
    const double h = step_.size;
    const auto v = x.head(n_ * s_).reshaped(n_, s_);
    const auto nu = x.tail(n_);
    p_start_ = p0_;
    lagrangian_->pattern().multiply_add(start_.qv.data(), nu.data(), p_start_.data());  // Dθ(q0)ᵀν
    p_end_ = p_start_;
    q1_ = q0_ + (1.0 + sign_) * nu;
    for (int i = 0; i < s_; ++i)
      for (int r = 0; r < n_; ++r) q_(r, i) = q0_[r] + nu[r];
    add_stages(x.data(), position_weights_, q_.data());
    lagrangian_->gradients({s_, times_.data(), q_.data(), x.data()}, lq_.data(), lv_.data());
    for (int i = 0; i < s_; ++i)
      for (int r = 0; r < n_; ++r) {
        p_end_[r] += h * table_.b[i] * lq_(r, i);
        q1_[r] += h * table_.b[i] * v(r, i);
      }
    end_.take_first(*lagrangian_, step_.end(), q1_, zero_);
    enlarge(nu, x.head(n_ * s_));
    end_along_.take_first(*lagrangian_, step_.end(), q1_, along_);
    if (blocks_[0].scale <= smallest_scale)  // no term was known before: at rest in the origin
      blocks_[0].scale = blocks_[1].scale = scale_of(std::max(std::abs(h) * max_norm(lq_), max_norm(lv_)));
  }

  /// Dθ(q1)ᵀν is a difference of ∂L/∂q, which is linear in v: with ν made as large as the velocities it loses
  /// no digits beside ∂H/∂q, whatever the unit of the time.
  void enlarge(ConstVectorRef nu, ConstVectorRef velocities) {
    const double factor = max_norm(velocities) / max_norm(nu);
    enlarged_ = std::isfinite(factor) && factor > 0.0 ? std::exp2(std::round(std::log2(factor))) : 1.0;
    along_ = enlarged_ * nu;
  }

  template <class Entry>
  void set_block(VectorRef values, int row, int column, Entry entry) const {
    const auto& places = layout_.positions(row * (s_ + 1) + column);
    for (std::size_t e = 0; e < places.size(); ++e) values[places[e]] += entry(static_cast<Eigen::Index>(e));
  }

  // Value e of the blocks; `theta` is Dθ = L_vq, the transpose of L_qv.
  double theta(const LagrangianDerivatives& d, Eigen::Index e) const {
    return d.qv[mirror_[static_cast<std::size_t>(e)]];
  }
  double theta_at(int i, Eigen::Index e) const { return lqv_(mirror_[static_cast<std::size_t>(e)], i); }
  /// Of the blocks of stage i and velocity k, with Σ_j h² â_ij a_jk ∂²L/∂q²_j in stiffness_.
  double stage_by_velocity(int i, int k, Eigen::Index e) const {
    return position_weights_(k, i) * theta_at(i, e) + force_weights_(k, i) * lqv_(e, k) + stiffness_[e];
  }
  double stage_by_projection(int i, Eigen::Index e) const {
    double sum = theta_at(i, e) - start_.qv[e];
    for (int j = 0; j < s_; ++j) sum -= step_.size * table_.a_hat(i, j) * lqq_(e, j);
    return sum;
  }
  /// ∂(θ(q1) − σ Dθ(q1)ᵀν)/∂q1.
  double end_by_position(Eigen::Index e) const {
    return theta(end_, e) - sign_ / enlarged_ * (end_along_.qq[e] - end_.qq[e]);
  }
  double end_by_velocity(int k, Eigen::Index e) const {
    const double h = step_.size;
    double sum = h * table_.b[k] * (end_by_position(e) - lqv_(e, k));
    for (int j = 0; j < s_; ++j) sum -= h * h * table_.b[j] * table_.a(j, k) * lqq_(e, j);
    return sum;
  }
  double end_by_projection(Eigen::Index e) const {
    double sum = (1.0 + sign_) * end_by_position(e) - start_.qv[e] - sign_ * end_.qv[e];
    for (int j = 0; j < s_; ++j) sum -= step_.size * table_.b[j] * lqq_(e, j);
    return sum;
  }

  std::shared_ptr<const Lagrangian> lagrangian_;
  int s_, n_;
  double sign_;
  GaussLobattoTableau table_;
  std::vector<int> mirror_;
  SparsityPattern pattern_;
  BlockPattern layout_{0, 0};
  std::vector<ResidualBlock> blocks_;
  RowScales row_scales_{n_ * (s_ + 1)};
  Vector tolerances_, sizes_, largest_, largest_q_;

  Interval step_{0.0, 1.0};
  Vector zero_;
  Vector q0_, p0_, q1_, p_start_, p_end_, along_, last_x_;
  Columns q_;
  StageSum sum_;  ///< null for many coordinates
  double scaled_to_ = 0.0;
  Columns position_weights_, force_weights_;  ///< h a_ik and −h â_ik, column i
  Columns stiffness_weights_;                 ///< −h² â_ij a_jk over j, column i s + k
  Vector times_, stiffness_;
  Columns lq_, lv_, lqq_, lqv_, lvv_;      ///< derivatives of L at the stages
  LagrangianDerivatives start_;            ///< at q0 with v = 0
  LagrangianDerivatives end_, end_along_;  ///< at q1 with v = 0 and with v = along_
  double enlarged_ = 1.0;                  ///< times ν is along_
  Columns unmix_, two_form_, split_, mixed_;
  Eigen::PartialPivLU<Columns> two_form_factors_;
  bool dense_ = false, two_form_known_ = false;
};

}  // namespace

std::unique_ptr<StepProblem> phase_space_step(int s, const Scene& scene, bool dense) {
  const std::string prefix = "scene '" + scene.name + "': ";
  if (!scene.lagrangian->structure().phase_space())
    throw Misuse(prefix + "its Lagrangian is not linear in v");
  if (scene.rows() > 0 || scene.force)
    throw Misuse(prefix + "rows and forces on a Lagrangian that is linear in v are not supported");
  require_regular_two_form(scene);
  return std::make_unique<PhaseSpaceStep>(s, scene, dense);
}

}  // namespace diracstep
