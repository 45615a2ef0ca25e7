#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/kernel_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/system/kernel_motions.hpp>
#include <vector>

namespace diracstep {

namespace {

/// Derivatives of what stands at one node by all unknowns.
struct ByUnknowns {
  Columns q, v, force;
};

class KernelStep final : public StepProblem {
 public:
  KernelStep(int s, const Scene& scene, const FirstOrderMotions& motions)
      : scene_(scene),
        s_(s),
        n_(scene.dimension()),
        m_(scene.rows()),
        holonomic_(only_holonomic(scene.constraints)),
        mh_(row_count(holonomic_)),
        inert_(static_cast<int>(motions.inert.size())),
        table_(gauss_lobatto_tableau(s)),
        motions_(motions),
        stages_(static_cast<std::size_t>(s), KernelPoint(scene_, motions)),
        ends_(stages_),
        forms_(static_cast<std::size_t>(s), ConstraintsAtPoint(holonomic_, n_)),
        pattern_(SparsityPattern::dense(size(), size())) {
    const auto along = static_cast<std::ptrdiff_t>(motions.along.size());
    hidden_along_ =
        static_cast<int>(std::count(motions.hidden.begin(), motions.hidden.begin() + along, true));
    hidden_rows_ = static_cast<int>(std::count(motions.hidden.begin() + along, motions.hidden.end(), true));
    const int kernel = n_ - inert_;
    const std::array<ResidualBlock, 6> all{{{"momentum", 2 * inert_ * s_},
                                            {"force", (kernel - hidden_along_) * s_},
                                            {"velocity", (m_ - hidden_rows_) * s_},
                                            {"hidden force", hidden_along_ * s_},
                                            {"hidden velocity", hidden_rows_ * s_},
                                            {"position", mh_ * s_}}};
    for (std::size_t kind = 0; kind < all.size(); ++kind)
      if (all.at(kind).rows > 0) {
        blocks_.push_back(all.at(kind));
        kinds_.push_back(kind);
      }
  }

  int size() const override { return s_ * (n_ + m_ + mh_ + inert_); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }
  StepTraits traits() const override {
    StepTraits traits{"rates of positions (" + std::to_string(s_ * n_) + ")", s_ * n_};
    if (m_ > 0) traits.unknowns += ", forces of rows (" + std::to_string(s_ * m_) + ")";
    if (mh_ > 0) traits.unknowns += ", projections (" + std::to_string(s_ * mh_) + ")";
    traits.unknowns += ", velocities at the Lobatto nodes (" + std::to_string(s_ * inert_) + ")";
    if (s_ == 1) return traits;  // one stage is no polynomial
    const Columns ahead = lagrange_basis(table_.c, table_.c.array() + 1.0).transpose();
    for (const int rows : {n_, m_, mh_})
      if (rows > 0) traits.stages.push_back({rows, ahead});
    // The s Lobatto nodes behind the start.
    const Vector nodes = table_.lobatto_c.tail(s_);
    if (inert_ > 0) traits.stages.push_back({inert_, lagrange_basis(nodes, nodes.array() + 1.0).transpose()});
    return traits;
  }

  void begin(Interval step, const State& start, const StepMemory&) override {
    step_ = step;
    q0_ = start.q;
    p0_ = start.p;
    v0_ = start.v;
    evaluated_ = false;
    for (ResidualBlock& block : blocks_) block.scale = smallest_scale;
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    x.setZero();
    for (int i = 0; i < s_; ++i) {
      x.segment(n_ * i, n_) = v0;
      x.segment(end_place(i), inert_) = v0(motions_.inert);
    }
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    const double h = step_.size;
    for (int i = 0; i < s_; ++i) {
      f.segment(inert_ * i, inert_) =
          stage(i).inert(stage(i).full().momentum() - p0_ - h * impulse(i, table_.a));
      f.segment(inert_ * (s_ + i), inert_) =
          end(i).inert(end(i).full().momentum() - p0_ - h * impulse(i + 1, table_.lobatto_a));
    }
    Eigen::Index row = 2 * inert_ * s_;
    for_each_equation([&](int i, bool hidden, bool of_row, int k) {
      const KernelPoint& at = hidden ? end(i) : stage(i);
      f[row++] = (of_row ? at.full().row_residual()[k] : at.along()[k]) / (hidden ? h : 1.0);
    });
    f.tail(mh_ * s_) = positions_ / h;
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    const double h = step_.size;
    auto j = values.reshaped(size(), size());
    j.setZero();
    differentiate(x);
    for (int i = 0; i < s_; ++i) {
      Columns momentum =
          stage(i).full().momentum_by_q() * of_stage(i).q + stage(i).full().mass() * of_stage(i).v;
      Columns at_end = end(i).full().momentum_by_q() * of_end(i).q + end(i).full().mass() * of_end(i).v;
      for (int k = 0; k < s_; ++k) {
        momentum -= h * table_.a(i, k) * of_stage(k).force;
        at_end -= h * table_.lobatto_a(i + 1, k) * of_stage(k).force;
      }
      j.middleRows(inert_ * i, inert_) = momentum(motions_.inert, Eigen::all);
      j.middleRows(inert_ * (s_ + i), inert_) = at_end(motions_.inert, Eigen::all);
    }
    Eigen::Index row = 2 * inert_ * s_;
    for_each_equation([&](int i, bool hidden, bool of_row, int k) {
      const KernelPoint& at = hidden ? end(i) : stage(i);
      const ByUnknowns& by = hidden ? of_end(i) : of_stage(i);
      j.row(row) = of_row ? at.full().row_by_q().row(k) * by.q + at.full().rows().row(k) * by.v
                          : at.along_by_q().row(k) * by.q + at.along_by_v().row(k) * by.v;
      if (!hidden && !of_row) j.block(row, force_place(i), 1, m_) += at.along_by_lambda().row(k);
      if (hidden) j.row(row) /= h;
      ++row;
    });
    for (int i = 0; i < s_ && mh_ > 0; ++i) {
      forms(i).evaluate(end_time(i), end_positions_.col(i));
      j.middleRows(row + mh_ * i, mh_) = forms(i).pattern().full(forms(i).coefficients()) * of_end(i).q / h;
    }
  }

  void finish(ConstVectorRef x, StepEnd& done) override {
    evaluate(x);
    done.at.q = end_positions_.col(s_ - 1);
    done.at.v = (done.at.q - q0_) / step_.size;
    done.at.p = end(s_ - 1).full().momentum();
    done.impulse = m_ > 0 ? Vector(step_.size * table_.b[0] * x.segment(force_place(0), m_)) : Vector();
    done.memory.known = true;
  }

 private:
  int force_place(int i) const { return s_ * n_ + m_ * i; }
  int projection_place(int i) const { return s_ * (n_ + m_) + mh_ * i; }
  int end_place(int j) const { return s_ * (n_ + m_ + mh_) + inert_ * j; }
  double end_time(int j) const { return step_.start + table_.lobatto_c[j + 1] * step_.size; }
  KernelPoint& stage(int i) { return stages_[static_cast<std::size_t>(i)]; }
  KernelPoint& end(int j) { return ends_[static_cast<std::size_t>(j)]; }
  ConstraintsAtPoint& forms(int i) { return forms_[static_cast<std::size_t>(i)]; }
  const ByUnknowns& of_stage(int i) const { return by_stage_[static_cast<std::size_t>(i)]; }
  const ByUnknowns& of_end(int j) const { return by_end_[static_cast<std::size_t>(j)]; }

  /// Σ_k weights(row, k) F_k.
  Vector impulse(int row, const Columns& weights) {
    Vector sum = Vector::Zero(n_);
    for (int k = 0; k < s_; ++k) sum += weights(row, k) * stage(k).full().force();
    return sum;
  }

  /// E and rows in the order of the blocks: take(node, hidden, of a row, its number).
  template <class Take>
  void for_each_equation(Take take) const {
    const int kernel = n_ - inert_;
    for (const bool hidden : {false, true})
      for (const bool of_row : {false, true})
        for (int i = 0; i < s_; ++i)
          for (int k = 0; k < (of_row ? m_ : kernel); ++k)
            if (motions_.hidden[static_cast<std::size_t>(of_row ? kernel + k : k)] == hidden)
              take(i, hidden, of_row, k);
  }

  void evaluate(ConstVectorRef x) {
    if (evaluated_ && last_x_ == x) return;
    evaluated_ = true;
    last_x_ = x;
    const double h = step_.size;
    const auto rates = x.head(s_ * n_).reshaped(n_, s_);
    end_positions_ = (h * rates * table_.lobatto_a.bottomRows(s_).transpose()).colwise() + q0_;
    positions_.resize(mh_ * s_);
    Vector none = Vector::Zero(m_);
    for (int i = 0; i < s_; ++i) {
      const Vector q = q0_ + h * rates * table_.a.row(i).transpose();
      const double t = step_.start + table_.c[i] * h;
      Vector v = rates.col(i);
      if (mh_ > 0) {
        forms(i).evaluate(t, q);
        forms(i).add_annihilator(x.segment(projection_place(i), mh_), v, -1.0);
      }
      stage(i).evaluate(t, q, v, x.segment(force_place(i), m_));
      Vector at_end = v0_;
      at_end(motions_.inert) = x.segment(end_place(i), inert_);
      end(i).evaluate(end_time(i), end_positions_.col(i), at_end, none);
      int row = mh_ * i;
      for (const auto& block : holonomic_) {
        block->position(end_time(i), end_positions_.col(i), positions_.segment(row, block->rows()));
        row += block->rows();
      }
    }
    raise_scales(rates);
  }

  void raise_scales(ConstColumnsRef rates) {
    const double h = std::abs(step_.size);
    double momentum = max_norm(p0_), force = 0.0, hidden = 0.0;
    const double velocity = max_norm(rates);
    for (int i = 0; i < s_; ++i) {
      momentum =
          std::max({momentum, max_norm(stage(i).full().momentum()), h * max_norm(stage(i).full().force())});
      force = std::max(force, stage(i).terms());
      hidden = std::max(hidden, end(i).terms());
    }
    const std::array terms{momentum, force, velocity, hidden / h, velocity / h, max_norm(q0_) / h + velocity};
    for (std::size_t b = 0; b < blocks_.size(); ++b)
      if (const double size = terms.at(kinds_[b]); std::isfinite(size)) blocks_[b].scale = scale_of(size);
  }

  void differentiate(ConstVectorRef x) {
    const double h = step_.size;
    by_stage_.assign(static_cast<std::size_t>(s_), {});
    by_end_ = by_stage_;
    for (int i = 0; i < s_; ++i) {
      stage(i).differentiate();
      end(i).differentiate();
      ByUnknowns &at = by_stage_[static_cast<std::size_t>(i)], &behind = by_end_[static_cast<std::size_t>(i)];
      at.q = at.v = behind.q = behind.v = Columns::Zero(n_, size());
      for (int k = 0; k < s_; ++k) {
        at.q.middleCols(n_ * k, n_).diagonal().setConstant(h * table_.a(i, k));
        behind.q.middleCols(n_ * k, n_).diagonal().setConstant(h * table_.lobatto_a(i + 1, k));
      }
      at.v.middleCols(n_ * i, n_).setIdentity();
      if (mh_ > 0) {
        at.v -= curvature(i, x.segment(projection_place(i), mh_)) * at.q;
        at.v.middleCols(projection_place(i), mh_) -=
            forms(i).pattern().full(forms(i).coefficients()).transpose();
      }
      at.force = stage(i).full().force_by_q() * at.q + stage(i).full().force_by_v() * at.v;
      at.force.middleCols(force_place(i), m_) += stage(i).full().rows().transpose();
      for (int k = 0; k < inert_; ++k)
        behind.v(motions_.inert[static_cast<std::size_t>(k)], end_place(i) + k) = 1.0;
    }
  }

  /// ∂(A_hᵀκ)/∂q at the Gauss node i.
  Columns curvature(int i, ConstVectorRef kappa) {
    Columns sum = Columns::Zero(n_, n_);
    const double t = step_.start + table_.c[i] * step_.size;
    const Vector q = q0_ + step_.size * last_x_.head(s_ * n_).reshaped(n_, s_) * table_.a.row(i).transpose();
    forms(i).evaluate(t, q);
    int first = 0;
    for (const auto& block : holonomic_) {
      Vector d(block->curvature_pattern().nonzeros());
      block->annihilator_derivative(t, q, kappa.segment(first, block->rows()), d);
      sum += block->curvature_pattern().full(d);
      first += block->rows();
    }
    return sum;
  }

  Scene scene_;
  int s_, n_, m_;
  ConstraintBlocks holonomic_;
  int mh_, inert_, hidden_along_ = 0, hidden_rows_ = 0;
  GaussLobattoTableau table_;
  FirstOrderMotions motions_;
  std::vector<KernelPoint> stages_, ends_;  ///< at the Gauss nodes, at the Lobatto nodes behind the start
  std::vector<ConstraintsAtPoint> forms_;   ///< A_h
  SparsityPattern pattern_;
  std::vector<ResidualBlock> blocks_;  ///< those with rows
  std::vector<std::size_t> kinds_;     ///< which of the six each one is
  Interval step_{0.0, 1.0};
  Vector q0_, p0_, v0_, last_x_, positions_;
  Columns end_positions_;
  std::vector<ByUnknowns> by_stage_, by_end_;
  bool evaluated_ = false;
};

}  // namespace

std::unique_ptr<StepProblem> kernel_step(int s, const Scene& scene, const FirstOrderMotions& motions) {
  require_determined(scene, motions);
  return std::make_unique<KernelStep>(s, scene, motions);
}

}  // namespace diracstep
