#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <diracstep/core/numerics/combination.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/affine.hpp>
#include <diracstep/core/steps/gauss_lobatto/regular_two_form.hpp>
#include <diracstep/core/steps/gauss_lobatto/sizes.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/steps/length_of_rows.hpp>
#include <diracstep/core/steps/radau/rows.hpp>
#include <diracstep/core/steps/radau/step.hpp>
#include <diracstep/core/system/first_order_motions.hpp>

namespace diracstep {

namespace {

class RadauStep final : public StepProblem {
 public:
  RadauStep(int s, const Scene& scene, bool dense, bool velocities_by_force)
      : s_(s),
        n_(scene.dimension()),
        table_(radau_tableau(s)),
        points_(s, n_),
        momentum_(scene.lagrangian, scene.force, s, dense),
        rows_(scene, table_),
        m_(rows_.rows()),
        m_h_(rows_.holonomic_rows()),
        layout_(size(), size()),
        tolerances_(scene.tolerances),
        length_(length_of_rows(scene)),
        affine_(affine(scene)),
        quadratic_(scene.lagrangian->structure().quadratic && !scene.force),
        velocities_by_force_(velocities_by_force),
        coupled_masses_(scene.lagrangian->structure().y_hessian_constant &&
                        !scene.lagrangian->structure().y_hessian_diagonal),
        none_of_q_(Vector::Zero(n_)),
        row_scales_(size()) {
    impulses_.setZero(n_, s_);
    for (Vector* column : {&q0_, &p0_, &q_, &v_, &largest_q_, &largest_v_, &sizes_, &largest_})
      column->setZero(n_);
    last_x_.setZero(size());
    momentum_.plan(layout_);
    rows_.plan(layout_, momentum_, scene.force.get());
    pattern_ = layout_.assemble(dense);
    blocks_.push_back({"momentum", n_ * s_});
    if (m_ > 0) blocks_.push_back({"velocity constraint", m_ * s_});
    if (m_h_ > 0) blocks_.push_back({"position constraint", m_h_ * s_});
  }

  int size() const override { return s_ * (n_ + m_ + m_h_); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }
  double constant_jacobian_parameter() const override { return affine_ ? points_.step.size : std::nan(""); }

  StepTraits traits() const override {
    const auto counted = [this](const char* what, int each) {
      return std::string(what) + " (" + std::to_string(s_ * each) + ")";
    };
    StepTraits traits{counted("stage velocities", n_), s_ * n_, StageSizes::stored, m_ * s_};
    if (m_ > 0) traits.unknowns += ", " + counted("multipliers", m_);
    if (m_h_ > 0) traits.unknowns += ", " + counted("projections", m_h_);
    traits.damped = true;
    if (s_ == 1) return traits;  // one stage is no polynomial
    const Columns ahead = lagrange_basis(table_.c, table_.c.array() + 1.0).transpose();
    for (const int each : {n_, m_, m_h_})
      if (each > 0) traits.stages.push_back({each, ahead});
    return traits;
  }

  void begin(Interval step, const State& start, const StepMemory& memory) override {
    points_.step = step;
    for (int i = 0; i < s_; ++i) points_.gauss_times[i] = step.start + table_.c[i] * step.size;
    points_.gauss_times[s_ - 1] = step.end();
    if (step.size != scaled_to_) weights_.scale(step.size, table_.a, table_.a);
    scaled_to_ = step.size;
    q0_ = start.q;
    p0_ = start.p;
    rows_.begin(step.start, q0_);
    sizes_of_terms_.begin(memory, max_norm(q0_));
    evaluated_ = false;
    set_scales();
    if (m_ > 0) scale_rows(rows_.form_size_at_start(), max_norm(start.v), max_norm(q0_));
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    x.setZero();
    for (int i = 0; i < s_; ++i) x.segment(n_ * i, n_) = v0;
    if (!sizes_of_terms_.known) sample_start(v0);
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    for (int i = 0; i < s_; ++i) {
      auto row = f.segment(n_ * i, n_);
      row = momentum_.momenta().col(i) - p0_;
      for (int j = 0; j < s_; ++j) {
        row += weights_.force(j, i) * momentum_.forces().col(j);
        if (m_ > 0) row -= table_.a(i, j) * impulses_.col(j);
      }
    }
    rows_.residual(points_, x.data(), f.data());
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    if (momentum_.second_derivatives(points_, x)) sizes_of_terms_.curvature = momentum_.curvature_size();
    momentum_.set_jacobian(points_, weights_, layout_, values);
    rows_.add_to_jacobian(points_, x.data(), momentum_, layout_, values);
    sizes_of_terms_.row_curvature = rows_.curvature_size();
  }

  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) override;

  void finish(ConstVectorRef x, StepEnd& end) override {
    evaluate(x);
    end.at.q = points_.gauss.col(s_ - 1);
    end.at.p = momentum_.momenta().col(s_ - 1);
    if (velocities_by_force_)
      end.at.v = x.segment(n_ * (s_ - 1), n_);
    else
      end.at.v = (end.at.q - q0_) / points_.step.size;
    end.impulse.setZero(m_);
    StageSizes sizes = sizes_of_terms_;
    sizes.force = largest_entry(momentum_.forces().data(), momentum_.forces().size());
    if (!sizes.known && sizes.curvature == 0.0) {  // solved without a Jacobian
      (void)momentum_.second_derivatives(points_, last_x_);
      sizes.curvature = momentum_.curvature_size();
    }
    sizes.store(end.memory);
    end.memory.multipliers = x.segment(n_ * s_, m_ * s_);
  }

 private:
  /// Everything the residual is made of, at x, unless x is where it was last taken.
  void evaluate(ConstVectorRef x) {
    if (evaluated_ &&
        std::memcmp(x.data(), last_x_.data(), sizeof(double) * static_cast<std::size_t>(size())) == 0)
      return;
    last_x_ = x;
    evaluated_ = true;
    for (int i = 0; i < s_; ++i)
      combine(n_, s_, weights_.position.col(i).data(), x.data(), q0_.data(), points_.gauss.col(i).data());
    rows_.project(x.data(), points_);
    momentum_.evaluate(points_, x);
    if (m_ > 0) rows_.evaluate(points_, x.data(), impulses_);
    raise_scales(x);
  }

  /// By what is known before the step.
  void set_scales() {
    const double h = std::abs(points_.step.size);
    known_momentum_ = scale_of(sizes_of_terms_.momentum(h, max_norm(p0_)) +
                               (m_ > 0 ? sizes_of_terms_.row_curvature * sizes_of_terms_.position : 0.0));
    blocks_[0].scale = known_momentum_;
  }

  /// And by the terms at x: momenta, forces and impulses; velocities and positions over h in the rows.
  void raise_scales(ConstVectorRef x) {
    const double h = std::abs(points_.step.size);
    double terms = std::max(largest_entry(momentum_.momenta().data(), n_ * s_),
                            h * largest_entry(momentum_.forces().data(), n_ * s_));
    if (m_ > 0) terms = std::max(terms, rows_.impulse_size(x.data() + n_ * s_));
    if (coupled_masses_) {  // as of tight inductors, whose flux is a small difference
      sizes_.setZero();
      v_ = x.segment(n_ * (s_ - 1), n_).cwiseAbs();
      momentum_.add_sizes(0.0, none_of_q_, v_, sizes_);
      terms = std::max(terms, max_norm(sizes_));
    }
    if (std::isfinite(terms)) blocks_[0].scale = std::max(known_momentum_, terms);
    if (m_ == 0) return;
    const double position = largest_entry(points_.gauss.data(), n_ * s_),
                 mass = largest_entry(momentum_.mass(0).data(), momentum_.mass(0).size());
    scale_rows(rows_.form_size(), speed_at_rest(largest_entry(x.data(), n_ * s_), terms, mass), position);
    blocks_[1].scale = std::max(blocks_[1].scale, rows_.rate_size(points_.gauss));
  }

  /// For such sizes of A, of velocities and of positions.
  void scale_rows(double form, double velocity, double position) {
    const double way = std::max(position, part_of_length * length_) / std::abs(points_.step.size);
    form_ = form;
    for (std::size_t b = 1; b < blocks_.size(); ++b)
      blocks_[b].scale = scale_of(form * std::max(velocity, way));
  }

  /// Before the first solve: the derivatives at the start, for the round-off scales.
  void sample_start(ConstVectorRef v0) {
    momentum_.evaluate_start(points_.step.start, q0_, v0);
    sizes_of_terms_.force = largest_entry(momentum_.forces().data(), n_);
    sizes_of_terms_.curvature = momentum_.curvature_size(1);
    evaluated_ = false;
    set_scales();
  }

  int s_, n_;
  RadauTableau table_;
  NodeWeights weights_;
  NodePoints points_;
  StageMomentum momentum_;
  RadauRows rows_;
  int m_, m_h_;
  SparsityPattern pattern_;
  BlockPattern layout_;
  std::vector<ResidualBlock> blocks_;
  Vector tolerances_;
  double length_;   ///< of the rows
  bool affine_;     ///< the residual is affine in the unknowns
  bool quadratic_;  ///< L, without a force
  bool velocities_by_force_, coupled_masses_;
  Vector none_of_q_;
  RowScales row_scales_;
  Columns impulses_;  ///< A(Q_j)ᵀ λ_j
  Vector q0_, p0_, last_x_;
  StageSizes sizes_of_terms_;
  double scaled_to_ = std::nan(""), known_momentum_ = 0.0, form_ = 0.0;
  bool evaluated_ = false;                                                      ///< at last_x_
  Vector q_, v_, largest_q_, largest_v_, sizes_, largest_, rows_sizes_, none_;  ///< workspaces
};

/// Terms of a row of the momentum: p0, ∂L/∂v and h (∂L/∂q + f) with the terms that cancel in them, the
/// impulses and what these lose to round-off of positions.  Of a row of the constraint: A times velocities or
/// positions over h.
const double* RadauStep::scales_of_unsolved_rows(ConstVectorRef f, double level) {
  bool solved = true;
  for (int i = 0; i < s_; ++i) solved &= RowScales::solved(f.data() + n_ * i, p0_.data(), n_, level);
  if (solved && m_ == 0) return nullptr;
  const double h = std::abs(points_.step.size);
  q_ = q0_.cwiseAbs().cwiseMax(points_.gauss.col(s_ - 1).cwiseAbs());
  v_ = last_x_.segment(n_ * (s_ - 1), n_).cwiseAbs();
  RowScales::set_largest(largest_q_, quadratic_ ? 0.0 : max_norm(q_), tolerances_, level);
  RowScales::set_largest(largest_v_, quadratic_ ? 0.0 : max_norm(v_), tolerances_, h * level);
  momentum_.prepare_sizes(points_, last_x_);
  sizes_ = p0_.cwiseAbs();
  for (int i = 0; i < s_; ++i)
    sizes_ += momentum_.momenta().col(i).cwiseAbs() + h * momentum_.forces().col(i).cwiseAbs();
  largest_.setZero();
  momentum_.add_sizes(h, q_, v_, sizes_);
  momentum_.add_sizes(h, largest_q_, largest_v_, largest_);
  if (m_ > 0) rows_.add_impulse_sizes(last_x_.data(), q_, sizes_);
  for (int i = 0; i < s_; ++i) row_scales_.set(n_ * i, sizes_, largest_, blocks_[0].scale);
  if (m_ > 0) {
    v_ = v_.cwiseMax(q_ / h);
    rows_.size_velocity_terms(v_, rows_sizes_);
    none_.setZero(m_);
    for (int i = 0; i < s_; ++i) row_scales_.set(n_ * s_ + m_ * i, rows_sizes_, none_, blocks_[1].scale);
  }
  if (m_h_ > 0) {
    rows_.size_position_terms(v_, rows_sizes_);
    none_.setConstant(m_h_, form_ * part_of_length * length_ / h);
    for (int i = 0; i < s_; ++i)
      row_scales_.set((n_ + m_) * s_ + m_h_ * i, rows_sizes_, none_, blocks_[2].scale);
  }
  return row_scales_.unsolved(f, level);
}

}  // namespace

std::unique_ptr<StepProblem> radau_step(int s, const Scene& scene, bool dense) {
  if (!scene.lagrangian) (void)lagrangian_of(scene);  // throws
  const FirstOrderMotions motions = first_order_motions(scene);
  if (motions.exist()) {
    if (motions.hide_equations())
      throw Misuse("scene '" + scene.name +
                   "': the kernel of ∂²L/∂v² moves or hides equations, which Radau IIA does not keep; use "
                   "type1/midpoint or typeN/gl:S");
    if (scene.rows() == 0 && !scene.force && motions.u.cols() == 0)
      require_regular_two_form(scene);
    else
      require_determined(scene, motions);
  }
  return std::make_unique<RadauStep>(s, scene, dense, motions.by_force);
}

}  // namespace diracstep
