#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/hamiltonian_stages.hpp>
#include <diracstep/core/steps/gauss_lobatto/hamiltonian_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/points.hpp>
#include <diracstep/core/steps/gauss_lobatto/rows.hpp>
#include <diracstep/core/steps/gauss_lobatto/step_sums.hpp>
#include <diracstep/core/steps/length_of_rows.hpp>

namespace diracstep {

namespace {

/// As in GL(s) of a Lagrangian: compensated sums are solved for to the last bit.
constexpr double last_bit_of_stages = 0.01;

/// Sizes of terms, by which the round-off of a step is judged before its own are known.
struct HamiltonianSizes {
  static constexpr int stored = 6;  ///< numbers in StepMemory::scales

  double force = 0.0, velocity = 0.0;   ///< of −∂H/∂q + f and ∂H/∂p
  double qq = 0.0, qp = 0.0, pp = 0.0;  ///< of second derivatives of H
  double row_curvature = 0.0;           ///< of ∂(Aᵀλ)/∂q

  void load(const Vector& from) {
    force = from[0];
    velocity = from[1];
    qq = from[2];
    qp = from[3];
    pp = from[4];
    row_curvature = from[5];
  }
  void store(Vector& to) const {
    to.resize(stored);
    to << force, velocity, qq, qp, pp, row_curvature;
  }
};

class HamiltonianStep final : public StepProblem {
 public:
  HamiltonianStep(int s, const Scene& scene, bool dense)
      : s_(s),
        n_(scene.dimension()),
        m_(scene.rows()),
        points_(s, n_),
        sums_(s, n_, m_),
        stages_(scene.hamiltonian, scene.force, s),
        layout_(size(), size()),
        row_scales_(size()),
        tolerances_(scene.tolerances),
        length_(length_of_rows(scene)),
        quadratic_(scene.hamiltonian->structure().quadratic && !scene.force),
        affine_(quadratic_ &&
                std::ranges::all_of(scene.constraints, [](const auto& block) { return block->constant(); })) {
    int row = 2 * n_ * s_;
    for (const auto& block : scene.constraints) {
      rows_.emplace_back(block, s_, row, m_);
      row += block->rows();
    }
    last_x_.setZero(size());
    impulses_.setZero(n_, s_);
    for (Vector* column : {&p0_, &q_, &p_, &v_, &largest_q_, &largest_p_, &largest_v_, &momenta_,
                           &velocities_, &largest_momenta_, &largest_velocities_})
      column->setZero(n_);
    for (Vector* column : {&row_sizes_, &largest_rows_}) column->setZero(n_ * s_ + m_);
    stages_.plan(layout_);
    for (StageRows& rows : rows_) rows.plan(layout_);
    pattern_ = layout_.assemble(dense);
    blocks_ = {{"momentum", n_ * s_}, {"velocity", n_ * s_}};
    if (m_ > 0) blocks_.push_back({"constraint", m_ * s_});
  }

  int size() const override { return s_ * (2 * n_ + m_); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }

  StepTraits traits() const override {
    const std::string each = std::to_string(s_ * n_);
    StepTraits traits{"stage velocities (" + each + "), stage momenta (" + each + ")", 2 * s_ * n_,
                      HamiltonianSizes::stored, m_ * s_};
    if (m_ > 0) traits.unknowns += ", multipliers (" + std::to_string(s_ * m_) + ")";
    if (s_ == 1) return traits;  // one stage is no polynomial
    const GaussLobattoTableau& table = points_.weights.table;
    const Vector lobatto_c = table.lobatto_c.head(s_);
    const Columns ahead = lagrange_basis(table.c, table.c.array() + 1.0).transpose();
    traits.stages = {{n_, ahead}, {n_, ahead}};
    if (m_ > 0) traits.stages.push_back({m_, lagrange_basis(lobatto_c, lobatto_c.array() + 1.0).transpose()});
    return traits;
  }

  bool compensate() override {
    sums_.compensate();
    return true;
  }

  double constant_jacobian_parameter() const override { return affine_ ? step_size() : std::nan(""); }

  void begin(Interval step, const State& start, const StepMemory& memory) override {
    points_.begin(step);
    sums_.begin(start);
    p0_ = start.p;
    points_.lobatto.col(0) = start.q;
    for (StageRows& rows : rows_) rows.begin(points_);
    if (memory.known)
      sizes_.load(memory.scales);
    else
      sample_start(start);
    if (memory.known && m_ > 0) {
      multipliers_.setZero((n_ + m_) * s_);
      multipliers_.tail(m_ * s_) = memory.multipliers;
      last_impulse_ = impulse_size(rows_, multipliers_);
    } else {
      last_impulse_ = 0.0;
    }
    set_known_scales();
    evaluated_ = false;
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    for (int i = 0; i < s_; ++i) {
      x.segment(n_ * i, n_) = v0;
      x.segment(n_ * (s_ + i), n_) = p0_;
    }
    x.tail(m_ * s_).setZero();
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    sums_.momentum_rows(points_, stage_columns(), p0_, f);
    f.segment(n_ * s_, n_ * s_) = x.head(n_ * s_) - stages_.velocities().reshaped();
    for (StageRows& rows : rows_) rows.residual(points_, x, f);
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    stages_.set_jacobian(points_, points_.weights, layout_, x, values);
    take_second_sizes();
    sizes_.row_curvature = 0.0;
    for (StageRows& rows : rows_) {
      rows.add_to_jacobian(points_, layout_, x, values);
      sizes_.row_curvature = std::max(sizes_.row_curvature, rows.curvature_size());
    }
  }

  /// Terms of the rows of the momentum: p0, P, h F and the impulses; of those of the velocity: V and what
  /// cancels in ∂H/∂p; of those of the constraint: A times velocities and times positions over h.
  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) override {
    if (beside_known_terms(f.data(), part() * level)) return nullptr;
    const double h = std::abs(step_size());
    q_ = points_.lobatto.col(0);
    p_ = p0_;
    v_ = last_x_.head(n_);
    RowScales::set_largest(largest_q_, quadratic_ ? 0.0 : max_norm(q_), tolerances_, level);
    largest_p_.setConstant(quadratic_ ? 0.0 : max_norm(p_));
    RowScales::set_largest(largest_v_, max_norm(v_), tolerances_, h * level);
    stages_.prepare_sizes(points_);
    momenta_ = p0_.cwiseAbs();
    velocities_ = v_.cwiseAbs();
    for (int i = 0; i < s_; ++i) {
      momenta_ += stages_.momenta().col(i).cwiseAbs() + h * stages_.forces().col(i).cwiseAbs();
      velocities_ += stages_.velocities().col(i).cwiseAbs();
    }
    largest_momenta_.setZero();
    largest_velocities_.setZero();
    stages_.add_sizes(h, q_, p_, momenta_, velocities_);
    stages_.add_sizes(h, largest_q_, largest_p_, largest_momenta_, largest_velocities_);
    for (StageRows& rows : rows_) {
      rows.add_impulse_sizes(points_, last_x_, q_, momenta_);
      rows.size_terms(h, q_, velocities_, row_sizes_);
      if (!rows.rows().constant()) largest_q_ = largest_q_.cwiseMax(part_of_length * length_);
      rows.size_terms(h, largest_q_, largest_v_, largest_rows_);
    }
    for (int i = 0; i < s_; ++i) {
      set_row_scales(n_ * i, momenta_, largest_momenta_, 0);
      set_row_scales(n_ * (s_ + i), velocities_, largest_velocities_, 1);
      if (m_ > 0) set_row_scales(2 * n_ * s_ + m_ * i, row_sizes_.tail(m_), largest_rows_.tail(m_), 2);
    }
    return row_scales_.unsolved(f, level);
  }

  void finish(ConstVectorRef x, StepEnd& end) override {
    evaluate(x);
    sums_.end(points_, stage_columns(), p0_, x, end);
    end.at.v = (end.at.q - points_.lobatto.col(0)) / step_size();
    // The impulse at q0 is that part of λ_0 which enters there.
    end.impulse = points_.weights.table.lobatto_b[0] * x.segment(2 * n_ * s_, m_);
    HamiltonianSizes sizes = sizes_;
    sizes.force = max_norm(stages_.forces());
    sizes.velocity = max_norm(stages_.velocities());
    end.memory.known = true;
    sizes.store(end.memory.scales);
    end.memory.multipliers = x.tail(m_ * s_);
  }

 private:
  StageColumns stage_columns() const { return {stages_.momenta(), stages_.forces(), impulses_}; }
  double step_size() const { return points_.step.size; }
  double part() const { return sums_.compensated() ? last_bit_of_stages : 1.0; }

  /// Everything the residual is made of, at x, unless x is where it was last taken.
  void evaluate(ConstVectorRef x) {
    if (evaluated_ && last_x_ == x) return;
    evaluated_ = true;
    last_x_ = x;
    sums_.move(points_, x);
    stages_.evaluate(points_, x);
    double impulse = 0.0;
    if (m_ > 0) {
      impulses_.setZero();
      for (StageRows& rows : rows_) rows.add_impulses(points_, x, impulses_);
      impulse = impulse_size(rows_, x.tail((n_ + m_) * s_)) +
                sizes_.row_curvature * max_norm(points_.lobatto.col(0));
    }
    const double velocity = std::max(max_norm(x.head(n_ * s_)), max_norm(stages_.velocities()));
    raise(0, std::max(
                 {max_norm(stages_.momenta()), std::abs(step_size()) * max_norm(stages_.forces()), impulse}));
    raise(1, velocity);
    if (m_ > 0) raise(2, form_size(rows_) * velocity);
  }

  void raise(std::size_t block, double terms) {
    blocks_[block].scale = std::max(known_[block], scale_of(part() * terms));
  }

  void sample_start(const State& start) {
    stages_.evaluate_start(points_.step.start, start.q, start.p, start.v);
    sizes_ = {};
    sizes_.force = max_norm(stages_.forces().col(0));
    sizes_.velocity = max_norm(stages_.velocities().col(0));
    take_second_sizes();
  }

  void take_second_sizes() {
    const HamiltonianStages::Largest largest = stages_.largest();
    sizes_.qq = largest.qq;
    sizes_.qp = largest.qp;
    sizes_.pp = largest.pp;
  }

  /// Of momenta and of what they lose to round-off of positions and momenta, and so of velocities; a velocity
  /// of size |q|/h loses ε|q|/h to round-off.
  void set_known_scales() {
    const double h = std::abs(step_size()), q = max_norm(points_.lobatto.col(0)), p = max_norm(p0_);
    blocks_[0].scale = scale_of(p + h * (sizes_.force + sizes_.qq * q + sizes_.qp * p) + last_impulse_ +
                                sizes_.row_curvature * q);
    blocks_[1].scale = scale_of(sizes_.velocity + sizes_.qp * q + sizes_.pp * p);
    if (m_ > 0) blocks_[2].scale = scale_of(form_size(rows_) * std::max(q, part_of_length * length_) / h);
    for (std::size_t b = 0; b < blocks_.size(); ++b) known_[b] = blocks_[b].scale *= part();
  }

  bool beside_known_terms(const double* f, double level) const {
    bool all = true;
    for (int i = 0; i < s_; ++i) {
      all = all && RowScales::solved(f + n_ * i, p0_.data(), n_, level) &&
            RowScales::solved(f + n_ * (s_ + i), stages_.velocities().col(i).data(), n_, level);
    }
    for (const StageRows& rows : rows_)
      all = all && rows.bound(points_, last_x_.data(), f, RowScales::margin * level);
    return all;
  }

  void set_row_scales(Eigen::Index first, const Vector& terms, const Vector& largest, std::size_t block) {
    row_scales_.set(first, part() * terms, part() * largest, blocks_[block].scale);
  }

  int s_, n_, m_;
  StagePoints points_;
  StepSums sums_;
  HamiltonianStages stages_;
  std::vector<StageRows> rows_;
  SparsityPattern pattern_;
  BlockPattern layout_;
  std::vector<ResidualBlock> blocks_;
  std::array<double, 3> known_{};  ///< their scales before the step
  RowScales row_scales_;
  Vector tolerances_;
  double length_;  ///< of the rows
  bool quadratic_, affine_;
  Vector p0_, last_x_;
  Columns impulses_;  ///< A(Q~_j)ᵀ λ_j
  HamiltonianSizes sizes_;
  double last_impulse_ = 0.0;  ///< size of it with the multipliers of the step before, at this start
  Vector multipliers_, q_, p_, v_, largest_q_, largest_p_, largest_v_;  ///< workspaces
  Vector momenta_, velocities_, row_sizes_, largest_momenta_, largest_velocities_, largest_rows_;
  bool evaluated_ = false;  ///< at last_x_
};

}  // namespace

std::unique_ptr<StepProblem> hamiltonian_step(int s, const Scene& scene, bool dense) {
  return std::make_unique<HamiltonianStep>(s, scene, dense);
}

}  // namespace diracstep
