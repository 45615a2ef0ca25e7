#include <algorithm>
#include <cmath>
#include <cstring>
#include <diracstep/core/numerics/combination.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/compensated_sums.hpp>
#include <diracstep/core/steps/gauss_lobatto/momentum.hpp>
#include <diracstep/core/steps/gauss_lobatto/points.hpp>
#include <diracstep/core/steps/gauss_lobatto/row_scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/rows.hpp>
#include <diracstep/core/steps/gauss_lobatto/sizes.hpp>
#include <diracstep/core/steps/gauss_lobatto/splitting.hpp>
#include <diracstep/core/steps/gauss_lobatto/step.hpp>
#include <diracstep/core/system/length_of_rows.hpp>
#include <optional>

namespace diracstep {

namespace {

/// Compensated sums are worth an iteration more: the residual must fall to this part of its usual bound.
constexpr double last_bit = 0.01;

/// The splitting takes full matrices.
constexpr int largest_split = 40;

bool affine(const Scene& scene) {
  const auto constant = [](const auto& block) { return block->constant(); };
  return scene.lagrangian->structure().quadratic && !scene.force &&
         std::ranges::all_of(scene.constraints, constant);
}

class GaussLobattoStep final : public StepProblem {
 public:
  GaussLobattoStep(int s, const Scene& scene, bool dense)
      : s_(s),
        n_(scene.dimension()),
        m_(scene.rows()),
        points_(s, n_),
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
    const auto holonomic = [](const auto& block) { return block->holonomic(); };
    const auto kinds = std::ranges::count_if(scene.constraints, holonomic);
    if (n_ + m_ <= largest_split && (kinds == 0 || kinds == std::ssize(scene.constraints)))
      splitting_.emplace(points_.weights.table, m_, kinds > 0, *scene.lagrangian);
    momentum_.plan(layout_);
    for (StageRows& rows : rows_) rows.plan(layout_);
    pattern_ = layout_.assemble(dense);
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
    sums_.emplace(s_, n_);
    return true;
  }

  double constant_jacobian_parameter() const override { return affine_ ? step_size() : std::nan(""); }

  bool has_splitting() const override { return splitting_.has_value(); }
  void solve_splitting(VectorRef f) override {
    if (!splitting_known_) splitting_->move_to(points_, momentum_, rows_, last_x_);
    splitting_known_ = true;
    splitting_->solve(f);
  }

  void begin(Interval step, const State& start, const StepMemory& memory) override {
    points_.step = step;
    points_.weights.scale_to(step.size);
    if (sums_) sums_->begin(start.rest);
    p0_ = start.p;
    points_.lobatto.col(0) = start.q;
    splitting_known_ = false;
    sizes_.begin(memory, largest_entry(start.q.data(), start.q.size()));
    for (StageRows& rows : rows_) rows.begin(points_);
    last_impulse_ = memory.known && m_ > 0 ? impulse_scale(memory.multipliers) : 0.0;
    update_scales();
    evaluated_ = false;
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    for (int i = 0; i < s_; ++i) x.segment(n_ * i, n_) = v0;
    x.tail(m_ * s_).setZero();
    if (!sizes_.known) sample_start(v0);
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    const Columns& lv = momentum_.momenta();
    for (int i = 0; i < s_; ++i) {
      double* const momentum = f.data() + n_ * i;
      if (sums_) {
        sums_->momentum_row(i, step_size(), lv.col(i), p0_, momentum_.forces(), impulses_,
                            f.segment(n_ * i, n_));
        continue;
      }
      for_each_piece(n_, [&](int first, int rows) {
        for (int k = first; k < first + rows; ++k) momentum[k] = lv(k, i) - p0_[k];
        add_forces_and_impulses(first, rows, &points_.weights.force(0, i), &points_.weights.impulse(0, i),
                                momentum, momentum);
      });
    }
    for (StageRows& rows : rows_) rows.residual(points_, x, f);
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    if (momentum_.second_derivatives(points_, x)) sizes_.curvature = curvature_size();
    momentum_.set_jacobian(points_, layout_, values);
    sizes_.row_curvature = 0.0;
    for (StageRows& rows : rows_) {
      rows.add_to_jacobian(points_, layout_, x, values);
      sizes_.row_curvature = std::max(sizes_.row_curvature, rows.curvature_size());
    }
  }

  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) override {
    return row_scales_.unsolved({points_, momentum_, rows_, p0_, last_x_}, f, level, blocks_, part());
  }

  void finish(ConstVectorRef x, StepEnd& end) override {
    evaluate(x);
    const StageWeights& weights = points_.weights;
    const auto q0 = points_.lobatto.col(0);
    if (sums_) {
      sums_->end(step_size(), q0, p0_, velocities(x), momentum_.forces(), impulses_, end);
    } else {
      end.at.q.resize(n_);
      end.at.p.resize(n_);
      if (m_ > 0) end.at.q = points_.lobatto.col(s_);
      for_each_piece(n_, [&](int first, int rows) {
        if (m_ == 0)  // nothing else looks there
          combine_piece(first, rows, n_, s_, &weights.lobatto(0, s_), x.data(), points_.lobatto.data(),
                        end.at.q.data());
        add_forces_and_impulses(first, rows, weights.end_force.data(), weights.table.lobatto_b.data(),
                                p0_.data(), end.at.p.data());
      });
    }
    end.at.v = (end.at.q - q0) / step_size();
    // The impulse at q0 is that part of λ_0 which enters there.
    end.impulse = weights.table.lobatto_b[0] * x.segment(n_ * s_, m_);
    measure(x, end.memory);
  }

 private:
  double step_size() const { return points_.step.size; }
  int row_of(int j) const { return n_ * s_ + m_ * j; }

  Eigen::Map<const Columns> velocities(ConstVectorRef x) const { return {x.data(), n_, s_}; }

  /// Everything the residual is made of, at x, unless x is where it was last taken.
  void evaluate(ConstVectorRef x) {
    if (evaluated_ &&
        std::memcmp(x.data(), last_x_.data(), sizeof(double) * static_cast<std::size_t>(size())) == 0)
      return;
    evaluated_ = true;
    move_points(x);
    momentum_.evaluate(points_, x);
    if (m_ == 0) return;
    impulses_.setZero();
    for (StageRows& rows : rows_) rows.add_impulses(points_, x, impulses_);
    blocks_[0].scale = std::max(blocks_[0].scale, part() * impulse_scale(x.tail(m_ * s_)));
    if (blocks_[1].scale <= smallest_scale)  // at rest in the origin
      blocks_[1].scale = scale_of(part() * form_size(rows_) * largest_entry(x.data(), n_ * s_));
  }

  /// What an iteration leaves of the residual is no random error: it is a smooth function of the state and
  /// drives the energy one way.  So compensated sums are solved for to the last bit.
  double part() const { return sums_ ? last_bit : 1.0; }

  /// to = base + Σ_j force_j ∂L/∂q_j + Σ_j impulse_j Aᵀλ_j in these rows.
  void add_forces_and_impulses(int first, int rows, const double* force, const double* impulse,
                               const double* base, double* to) const {
    combine_piece(first, rows, n_, s_, force, momentum_.forces().data(), base, to);
    if (m_ > 0) combine_piece(first, rows, n_, s_, impulse, impulses_.data(), to, to);
  }

  /// q0 + h Σ_k a_ik V_k at the Gauss nodes, and so at those Lobatto nodes that are looked at; x is kept.
  void move_points(ConstVectorRef x) {
    const int first_lobatto = m_ > 0 ? 1 : s_ + 1;
    if (sums_) {
      last_x_ = x;
      const ExtendedGaussLobattoTableau& table = sums_->table;
      const auto start = points_.lobatto.col(0);
      for (int i = 0; i < s_; ++i)
        sums_->position(step_size(), table.a.row(i), start, velocities(x), points_.gauss.col(i));
      for (int j = first_lobatto; j <= s_; ++j)
        sums_->position(step_size(), table.lobatto_a.row(j), start, velocities(x), points_.lobatto.col(j));
      return;
    }
    const StageWeights& weights = points_.weights;
    const double* const q0 = points_.lobatto.data();
    for_each_piece(n_, [&](int first, int rows) {
      for (int i = 0; i < s_; ++i) {
        std::copy_n(x.data() + n_ * i + first, rows, last_x_.data() + n_ * i + first);
        combine_piece(first, rows, n_, s_, &weights.position(0, i), x.data(), q0, &points_.gauss(0, i));
      }
      for (int j = first_lobatto; j <= s_; ++j)
        combine_piece(first, rows, n_, s_, &weights.lobatto(0, j), x.data(), q0, &points_.lobatto(0, j));
    });
    last_x_.tail(m_ * s_) = x.tail(m_ * s_);
  }

  /// Sizes at x, for the next step.
  void measure(ConstVectorRef x, StepMemory& memory) {
    StageSizes sizes = sizes_;
    sizes.force = largest_entry(momentum_.forces().data(), momentum_.forces().size());
    if (!sizes.known && sizes.curvature == 0.0) {  // solved without a Jacobian
      (void)momentum_.second_derivatives(points_, last_x_);
      sizes.curvature = curvature_size();
    }
    sizes.store(memory);
    memory.multipliers = x.tail(m_ * s_);
  }

  double curvature_size() const {
    return largest_entry(momentum_.curvatures().data(), momentum_.curvatures().size());
  }

  /// Size of the impulses of such multipliers, and of what they lose to the round-off of positions.
  double impulse_scale(ConstVectorRef multipliers) const {
    return impulse_size(rows_, multipliers) + sizes_.row_curvature * sizes_.position;
  }

  /// Before the first solve: the derivatives at the start, for the round-off scales.
  void sample_start(ConstVectorRef v0) {
    momentum_.evaluate_start(points_, v0);
    const double before = blocks_[0].scale;  // of impulses nothing is known yet
    sizes_.force = largest_entry(momentum_.forces().data(), n_);
    sizes_.curvature = largest_entry(momentum_.curvatures().data(), momentum_.curvatures().rows());
    evaluated_ = false;
    update_scales();
    blocks_[0].scale = std::max(blocks_[0].scale, before);
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
  StageMomentum momentum_;
  std::vector<StageRows> rows_;
  SparsityPattern pattern_;
  BlockPattern layout_;
  std::vector<ResidualBlock> blocks_;
  std::optional<CompensatedSums> sums_;
  Vector p0_, last_x_;
  StageRowScales row_scales_;
  Columns impulses_;  ///< A(Q~_j)ᵀ λ_j
  StageSizes sizes_;
  double last_impulse_ = 0.0;  ///< size of it with the multipliers of the step before, at this start
  std::optional<StageSplitting> splitting_;  ///< small scenes with rows of one kind
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
