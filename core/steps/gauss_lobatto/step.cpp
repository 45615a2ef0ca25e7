#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/affine.hpp>
#include <diracstep/core/steps/gauss_lobatto/momentum.hpp>
#include <diracstep/core/steps/gauss_lobatto/points.hpp>
#include <diracstep/core/steps/gauss_lobatto/row_scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/rows.hpp>
#include <diracstep/core/steps/gauss_lobatto/sizes.hpp>
#include <diracstep/core/steps/gauss_lobatto/splitting.hpp>
#include <diracstep/core/steps/gauss_lobatto/step.hpp>
#include <diracstep/core/steps/gauss_lobatto/step_sums.hpp>
#include <diracstep/core/steps/length_of_rows.hpp>
#include <optional>

namespace diracstep {

namespace {

/// Compensated sums are worth an iteration more: the residual must fall to this part of its usual bound.
constexpr double last_bit = 0.01;
constexpr int largest_split = 40;  // the splitting takes full matrices

class GaussLobattoStep final : public StepProblem {
 public:
  GaussLobattoStep(int s, const Scene& scene, bool dense)
      : s_(s),
        n_(scene.dimension()),
        m_(scene.rows()),
        points_(s, n_),
        sums_(s, n_, m_),
        momentum_(scene.lagrangian, scene.force, s, dense),
        layout_(size(), size()),
        row_scales_(s_, scene),
        length_(length_of_rows(scene)),
        affine_(affine(scene)) {
    int row = n_ * s_;
    for (const auto& block : scene.constraints) {
      rows_.emplace_back(block, s_, row, m_);
      row += block->rows();
    }
    last_x_.setZero(size());
    impulses_.setZero(n_, s_);
    p0_.setZero(n_);
    if (n_ + m_ <= largest_split) splitting_.emplace(points_.weights.table, rows_, *scene.lagrangian);
    momentum_.plan(layout_);
    for (StageRows& rows : rows_) rows.plan(layout_);
    pattern_ = layout_.assemble(dense);
    if (dense && !scene.force && rows_.size() <= 1) fixed_ = fixed_stages(arrays());
    blocks_.push_back({"momentum", n_ * s_});
    if (m_ > 0) blocks_.push_back({"constraint", m_ * s_});
  }

  int size() const override { return s_ * (n_ + m_); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }

  StepTraits traits() const override {
    StepTraits traits{"stage velocities (" + std::to_string(s_ * n_) + ")", s_ * n_, StageSizes::stored,
                      m_ * s_};
    if (m_ > 0) traits.unknowns += ", multipliers (" + std::to_string(s_ * m_) + ")";
    if (s_ == 1) return traits;  // one stage is no polynomial
    const GaussLobattoTableau& table = points_.weights.table;
    const Vector lobatto_c = table.lobatto_c.head(s_);
    traits.stages.push_back({n_, lagrange_basis(table.c, table.c.array() + 1.0).transpose()});
    if (m_ > 0) traits.stages.push_back({m_, lagrange_basis(lobatto_c, lobatto_c.array() + 1.0).transpose()});
    return traits;
  }

  bool compensate() override {
    sums_.compensate();
    fixed_.reset();
    return true;
  }

  double constant_jacobian_parameter() const override { return affine_ ? step_size() : std::nan(""); }

  bool has_splitting() const override { return splitting_.has_value(); }
  void solve_splitting(VectorRef f) override {
    if (!splitting_known_) take_splitting();
    splitting_known_ = true;
    if (fixed_)
      fixed_->solve_splitting(f.data());
    else
      splitting_->solve(f);
  }
  Contraction contract(VectorRef x, VectorRef f, const ContractionLimits& limits) override {
    const bool at_rest = blocks_[0].scale <= smallest_scale || blocks_.back().scale <= smallest_scale;
    if (!fixed_ || at_rest) return StepProblem::contract(x, f, limits);
    evaluated_ = false;
    const auto prepare = [&] {
      evaluated_at(x.data());
      take_splitting();
    };
    FixedStages::Scales scales{blocks_[0].scale, m_ > 0 ? blocks_[1].scale : 1.0,
                               sizes_.row_curvature * sizes_.position};
    const Contraction end = fixed_->contract(x.data(), f.data(), limits, scales, std::ref(prepare));
    blocks_[0].scale = scales.momentum;
    if (!scales.moved) evaluated_at(x.data());
    return end;
  }

  void begin(Interval step, const State& start, const StepMemory& memory) override {
    points_.begin(step);
    sums_.begin(start);
    p0_ = start.p;
    points_.lobatto.col(0) = start.q;
    splitting_known_ = false;
    sizes_.begin(memory, largest_entry(start.q.data(), start.q.size()));
    for (StageRows& rows : rows_) rows.begin(points_);
    last_impulse_ = memory.known && m_ > 0 ? impulse_scale(impulse_size(rows_, memory.multipliers)) : 0.0;
    update_scales();
    known_ = {blocks_[0].scale, blocks_.back().scale};
    evaluated_ = false;
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    for (int i = 0; i < s_; ++i) x.segment(n_ * i, n_) = v0;
    x.tail(m_ * s_).setZero();
    if (!sizes_.known) sample_start(v0);
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    if (fixed_) {
      fixed_->residual(x.data(), f.data());
      if (m_ > 0) rows_.front().set_gauss_known(true);
      return;
    }
    sums_.momentum_rows(points_, stage_columns(), p0_, f);
    for (StageRows& rows : rows_) rows.residual(points_, x, f);
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    if (momentum_.second_derivatives(points_, x)) sizes_.curvature = momentum_.curvature_size();
    if (fixed_) {
      for (StageRows& rows : rows_) rows.second_derivatives(points_, x);
      fixed_->jacobian(momentum_.jacobian_known(points_), values.data());
    } else {
      momentum_.set_jacobian(points_, points_.weights, layout_, values);
      for (StageRows& rows : rows_) rows.add_to_jacobian(points_, layout_, x, values);
    }
    sizes_.row_curvature = 0.0;
    for (const StageRows& rows : rows_) {
      sizes_.row_curvature = std::max(sizes_.row_curvature, rows.curvature_size());
    }
  }

  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) override {
    return row_scales_.unsolved({points_, momentum_, rows_, p0_, last_x_}, f, level, blocks_, part());
  }

  void finish(ConstVectorRef x, StepEnd& end) override {
    evaluate(x);
    sums_.end(points_, stage_columns(), p0_, x, end);
    end.at.v = (end.at.q - points_.lobatto.col(0)) / step_size();
    // The impulse at q0 is that part of λ_0 which enters there.
    end.impulse = points_.weights.table.lobatto_b[0] * x.segment(n_ * s_, m_);
    measure(x, end.memory);
  }

 private:
  /// The arrays hold what belongs to this x, as far as the residual looks at it.
  void evaluated_at(const double* x) {
    std::copy_n(x, size(), last_x_.data());
    evaluated_ = true;
    if (m_ > 0) rows_.front().set_gauss_known(true);
  }

  StageColumns stage_columns() const { return {momentum_.momenta(), momentum_.forces(), impulses_}; }
  StageArrays arrays() {
    StageArrays arrays{};
    arrays.points = &points_;
    arrays.p0 = p0_.data();
    arrays.impulses = impulses_.data();
    momentum_.place(arrays);
    for (StageRows& rows : rows_) rows.place(arrays);
    return arrays;
  }
  void take_splitting() {
    if (!fixed_) return splitting_->move_to(points_, momentum_, rows_, last_x_);
    for (StageRows& rows : rows_) rows.evaluate_constraint(points_);
    fixed_->take_splitting(splitting_->inverse_mass(points_, momentum_, last_x_).data());
  }

  double step_size() const { return points_.step.size; }
  /// Everything the residual is made of, at x, unless x is where it was last taken.
  void evaluate(ConstVectorRef x) {
    if (evaluated_ &&
        std::memcmp(x.data(), last_x_.data(), sizeof(double) * static_cast<std::size_t>(size())) == 0)
      return;
    evaluated_ = true;
    const double impulse = evaluate_points(x), forces = largest_entry(momentum_.forces().data(), n_ * s_);
    double terms =
        std::max(largest_entry(momentum_.momenta().data(), n_ * s_), std::abs(step_size()) * forces);
    const double mass = m_ > 0 ? largest_entry(momentum_.mass(0).data(), momentum_.mass(0).size()) : 0.0,
                 speed = m_ > 0 ? largest_entry(x.data(), n_ * s_) : 0.0;
    if (known_[0] <= at_rest * mass * speed) terms = std::max(terms, mass * speed);  // rows hold it at rest
    terms = std::max(terms, m_ > 0 ? impulse_scale(impulse) : 0.0);
    if (std::isfinite(terms)) blocks_[0].scale = std::max(known_[0], part() * terms);
    if (m_ == 0) return;
    blocks_[1].scale =
        std::max(known_[1], scale_of(part() * form_size(rows_) * speed_at_rest(speed, terms, mass)));
  }

  /// What an iteration leaves of the residual is no random error: it is a smooth function of the state and
  /// drives the energy one way.  So compensated sums are solved for to the last bit.
  double part() const { return sums_.compensated() ? last_bit : 1.0; }

  /// Gives the largest term of an impulse.
  double evaluate_points(ConstVectorRef x) {
    if (fixed_) {
      std::copy_n(x.data(), size(), last_x_.data());
      if (m_ > 0) rows_.front().set_gauss_known(false);
      return fixed_->evaluate(x.data());
    }
    last_x_ = x;
    sums_.move(points_, x);
    momentum_.evaluate(points_, x);
    if (m_ == 0) return 0.0;
    impulses_.setZero();
    for (StageRows& rows : rows_) rows.add_impulses(points_, x, impulses_);
    return impulse_size(rows_, x.tail(m_ * s_));
  }

  /// Sizes at x, for the next step.
  void measure(ConstVectorRef x, StepMemory& memory) {
    StageSizes sizes = sizes_;
    sizes.force = largest_entry(momentum_.forces().data(), momentum_.forces().size());
    if (!sizes.known && sizes.curvature == 0.0) {  // solved without a Jacobian
      (void)momentum_.second_derivatives(points_, last_x_);
      sizes.curvature = momentum_.curvature_size();
    }
    sizes.store(memory);
    memory.multipliers = x.tail(m_ * s_);
  }

  /// Size of the impulses of such multipliers, and of what they lose to the round-off of positions.
  double impulse_scale(double size_of_impulses) const {
    return size_of_impulses + sizes_.row_curvature * sizes_.position;
  }

  /// Before the first solve: the derivatives at the start, for the round-off scales.
  void sample_start(ConstVectorRef v0) {
    momentum_.evaluate_start(points_.step.start, points_.lobatto.col(0), v0);
    const double before = blocks_[0].scale;  // of impulses nothing is known yet
    sizes_.force = largest_entry(momentum_.forces().data(), n_);
    sizes_.curvature = momentum_.curvature_size(1);
    evaluated_ = false;
    update_scales();
    blocks_[0].scale = std::max(blocks_[0].scale, before);
    known_ = {blocks_[0].scale, blocks_.back().scale};
  }

  /// Terms of the momentum rows are momenta, those of the last step where this one is not solved yet; a
  /// velocity of size |q|/h loses ε|q|/h to round-off.
  void update_scales() {
    const double h = std::abs(step_size()),
                 velocity = std::max(sizes_.position, part_of_length * length_) / h;
    blocks_[0].scale = scale_of(sizes_.momentum(h, largest_entry(p0_.data(), n_)) + last_impulse_);
    if (m_ > 0) blocks_[1].scale = scale_of(form_size(rows_) * velocity);
    for (ResidualBlock& block : blocks_) block.scale *= part();
  }

  int s_, n_, m_;
  StagePoints points_;
  StepSums sums_;
  StageMomentum momentum_;
  std::vector<StageRows> rows_;
  SparsityPattern pattern_;
  BlockPattern layout_;
  std::vector<ResidualBlock> blocks_;
  std::array<double, 2> known_{};       ///< their scales before this step; at rest they may say nothing of it
  std::unique_ptr<FixedStages> fixed_;  ///< of few coordinates, rows and stages, without a force
  Vector p0_, last_x_;
  StageRowScales row_scales_;
  Columns impulses_;  ///< A(Q~_j)ᵀ λ_j
  StageSizes sizes_;
  double last_impulse_ = 0.0;  ///< size of it with the multipliers of the step before, at this start
  std::optional<StageSplitting> splitting_;  ///< of small scenes
  bool splitting_known_ = false;
  double length_;           ///< of the rows
  bool affine_;             ///< the residual is affine in the unknowns
  bool evaluated_ = false;  ///< at last_x_
};

}  // namespace

std::unique_ptr<StepProblem> gauss_lobatto_step(int s, const Scene& scene, bool dense) {
  return std::make_unique<GaussLobattoStep>(s, scene, dense);
}

}  // namespace diracstep
