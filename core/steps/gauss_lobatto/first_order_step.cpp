#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/first_order_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <vector>

namespace diracstep {

namespace {

class FirstOrderStep final : public StepProblem {
 public:
  FirstOrderStep(int s, const Scene& scene, const FirstOrderMotions& motions)
      : scene_(scene),
        s_(s),
        n_(scene.dimension()),
        m_(scene.rows()),
        holonomic_(only_holonomic(scene.constraints)),
        mh_(row_count(holonomic_)),
        inert_(static_cast<int>(motions.u.cols())),
        table_(gauss_lobatto_tableau(s)),
        motions_(motions),
        stages_(static_cast<std::size_t>(s), FirstOrderPoint(scene_, motions)),
        at_start_(holonomic_, n_),
        at_end_(holonomic_, n_),
        pattern_(SparsityPattern::dense(size(), size())) {
    if (inert_ > 0) blocks_.push_back({"momentum", inert_ * s_});
    blocks_.push_back({"force", (n_ - inert_) * s_});
    if (m_ + mh_ > 0) blocks_.push_back({"constraint", m_ * s_ + (mh_ > 0 ? n_ + mh_ : 0)});
  }

  int size() const override { return s_ * (n_ + m_) + (mh_ > 0 ? n_ + mh_ : 0); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }
  StepTraits traits() const override {
    StepTraits traits{"stage velocities (" + std::to_string(s_ * n_) + ")", s_ * n_};
    if (m_ > 0) traits.unknowns += ", forces of rows (" + std::to_string(s_ * m_) + ")";
    if (mh_ > 0) traits.unknowns += ", projection (" + std::to_string(n_ + mh_) + ")";
    if (s_ == 1) return traits;  // one stage is no polynomial
    const Columns ahead = lagrange_basis(table_.c, table_.c.array() + 1.0).transpose();
    traits.stages.push_back({n_, ahead});
    if (m_ > 0) traits.stages.push_back({m_, ahead});
    if (mh_ > 0) traits.stages.push_back({n_ + mh_, Columns::Ones(1, 1)});
    return traits;
  }

  Vector zeta(ConstVectorRef x) const { return x.segment(s_ * (n_ + m_), n_); }
  Vector kappa(ConstVectorRef x) const { return x.tail(mh_); }

  void begin(Interval step, const State& start, const StepMemory&) override {
    step_ = step;
    q0_ = start.q;
    p0_ = start.p;
    if (mh_ > 0) {
      at_start_.evaluate(step.start, q0_);
      start_forms_ = at_start_.pattern().full(at_start_.coefficients()).transpose();
    }
    evaluated_ = false;
    for (ResidualBlock& block : blocks_) block.scale = smallest_scale;
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    x.setZero();
    for (int i = 0; i < s_; ++i) x.segment(n_ * i, n_) = v0;
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    const double h = step_.size;
    const int first = n_ - inert_;
    for (int i = 0; i < s_; ++i) {
      const FirstOrderPoint& at = stages_[static_cast<std::size_t>(i)];
      Vector momentum = at.momentum() - p0_;
      for (int j = 0; j < s_; ++j)
        momentum -= h * table_.a(i, j) * stages_[static_cast<std::size_t>(j)].force();
      f.segment(inert_ * i, inert_) = motions_.u.transpose() * momentum;
      f.segment(inert_ * s_ + first * i, first) =
          h * (motions_.w.transpose() * (at.momentum_rate() - at.force()));
      f.segment(n_ * s_ + m_ * i, m_) = at.row_residual();
    }
    if (mh_ == 0) return;
    f.segment(s_ * (n_ + m_), n_) = zeta(x);
    at_end_.add_annihilator(kappa(x), f.segment(s_ * (n_ + m_), n_), -1.0);
    f.tail(mh_) = end_position_ / h;
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    for (FirstOrderPoint& at : stages_) at.differentiate();
    auto j = values.reshaped(size(), size());
    j.setZero();
    for (int i = 0; i < s_; ++i) {
      for (int k = 0; k < s_; ++k) add_stage(j, i, k);
      if (mh_ > 0) add_projection(j, i);
    }
    if (mh_ > 0) add_end(j, x);
  }

  void finish(ConstVectorRef x, StepEnd& end) override {
    evaluate(x);
    end.at.q = q1_;
    end.at.v = (q1_ - q0_) / step_.size;
    Vector p = p0_, lq(n_), theta(n_);
    for (int j = 0; j < s_; ++j) p += step_.size * table_.b[j] * stages_[static_cast<std::size_t>(j)].force();
    scene_.lagrangian->gradient(step_.end(), q1_, x.segment(n_ * (s_ - 1), n_), lq, theta);
    // Of theta the part along W counts, which depends on no velocity.
    Columns both(n_, n_);
    both << motions_.u, motions_.w;
    Vector parts(n_);
    parts << motions_.u.transpose() * p, motions_.w.transpose() * theta;
    end.at.p = inert_ == 0 ? theta : Vector(both.transpose().partialPivLu().solve(parts));
    end.impulse = m_ > 0 ? Vector(step_.size * table_.b[0] * x.segment(n_ * s_, m_)) : Vector();
    end.memory.known = true;
  }

 private:
  int projection() const { return s_ * (n_ + m_) + n_; }  ///< place of κ, behind ζ

  void evaluate(ConstVectorRef x) {
    if (evaluated_ && last_x_ == x) return;
    evaluated_ = true;
    last_x_ = x;
    const double h = step_.size;
    Vector base = q0_;
    if (mh_ > 0) base += start_forms_ * kappa(x);
    q1_ = base;
    for (int k = 0; k < s_; ++k) q1_ += h * table_.b[k] * x.segment(n_ * k, n_);
    double momentum = max_norm(p0_), force = 0.0, velocity = 0.0;
    for (int i = 0; i < s_; ++i) {
      Vector q = base;
      for (int k = 0; k < s_; ++k) q += h * table_.a(i, k) * x.segment(n_ * k, n_);
      FirstOrderPoint& at = stages_[static_cast<std::size_t>(i)];
      at.evaluate(step_.start + table_.c[i] * h, q, x.segment(n_ * i, n_), x.segment(n_ * s_ + m_ * i, m_));
      momentum = std::max({momentum, max_norm(at.momentum()), std::abs(h) * max_norm(at.force())});
      force = std::max({force, max_norm(at.force()), max_norm(at.momentum_rate())});
      velocity = std::max(velocity, max_norm(x.segment(n_ * i, n_)));
    }
    if (mh_ > 0) evaluate_end(x);
    std::size_t b = 0;
    if (inert_ > 0) raise(b++, momentum);
    raise(b++, std::abs(h) * force);
    if (m_ + mh_ > 0) raise(b, std::max(velocity, mh_ > 0 ? max_norm(q0_) / std::abs(h) : 0.0));
  }

  void evaluate_end(ConstVectorRef x) {
    q1_ += zeta(x);
    at_end_.evaluate(step_.end(), q1_);
    end_position_.resize(mh_);
    int row = 0;
    for (const auto& block : holonomic_) {
      block->position(step_.end(), q1_, end_position_.segment(row, block->rows()));
      row += block->rows();
    }
  }

  void raise(std::size_t block, double terms) {
    if (std::isfinite(terms)) blocks_[block].scale = scale_of(terms);
  }

  /// What positions of stage i bring into row block i: the rows of the momentum hold those of all stages.
  template <class Matrix>
  void add_stage(Matrix& j, int i, int k) {
    const double h = step_.size, a = table_.a(i, k);
    const FirstOrderPoint &at = stages_[static_cast<std::size_t>(i)],
                          &other = stages_[static_cast<std::size_t>(k)];
    const int first = n_ - inert_, row_w = inert_ * s_ + first * i, row_a = n_ * s_ + m_ * i;
    if (inert_ > 0) {
      Columns block = h * a * at.momentum_by_q() - h * a * other.force_by_v();
      for (int l = 0; l < s_; ++l)
        block -= h * h * table_.a(i, l) * table_.a(l, k) * stages_[static_cast<std::size_t>(l)].force_by_q();
      if (i == k) block += at.mass();
      j.block(inert_ * i, n_ * k, inert_, n_) += motions_.u.transpose() * block;
      j.block(inert_ * i, n_ * s_ + m_ * k, inert_, m_) -=
          h * a * motions_.u.transpose() * other.rows().transpose();
    }
    Columns block = h * h * a * (at.rate_by_q() - at.force_by_q());
    if (i == k) block += h * (at.momentum_by_q() - at.force_by_v());
    j.block(row_w, n_ * k, first, n_) += motions_.w.transpose() * block;
    if (i == k)
      j.block(row_w, n_ * s_ + m_ * k, first, m_) -= h * motions_.w.transpose() * at.rows().transpose();
    j.block(row_a, n_ * k, m_, n_) += h * a * at.row_by_q();
    if (i == k) j.block(row_a, n_ * k, m_, n_) += at.rows();
  }

  template <class Matrix>
  void add_projection(Matrix& j, int i) {
    const double h = step_.size;
    const FirstOrderPoint& at = stages_[static_cast<std::size_t>(i)];
    const int first = n_ - inert_, column = projection();
    if (inert_ > 0) {
      Columns block = at.momentum_by_q();
      for (int l = 0; l < s_; ++l)
        block -= h * table_.a(i, l) * stages_[static_cast<std::size_t>(l)].force_by_q();
      j.block(inert_ * i, column, inert_, mh_) += motions_.u.transpose() * block * start_forms_;
    }
    j.block(inert_ * s_ + first * i, column, first, mh_) +=
        h * motions_.w.transpose() * (at.rate_by_q() - at.force_by_q()) * start_forms_;
    j.block(n_ * s_ + m_ * i, column, m_, mh_) += at.row_by_q() * start_forms_;
  }

  template <class Matrix>
  void add_end(Matrix& j, ConstVectorRef x) {
    const double h = step_.size;
    const int row = s_ * (n_ + m_), column = projection();
    const Columns forms = at_end_.pattern().full(at_end_.coefficients());
    Columns curvature = Columns::Zero(n_, n_);
    int first = 0;
    for (const auto& block : holonomic_) {
      Vector d(block->curvature_pattern().nonzeros());
      block->annihilator_derivative(step_.end(), q1_, kappa(x).segment(first, block->rows()), d);
      curvature += block->curvature_pattern().full(d);
      first += block->rows();
    }
    for (int k = 0; k < s_; ++k) {
      j.block(row, n_ * k, n_, n_) -= h * table_.b[k] * curvature;
      j.block(row + n_, n_ * k, mh_, n_) += table_.b[k] * forms;
    }
    j.block(row, row, n_, n_) += Columns::Identity(n_, n_) - curvature;
    j.block(row + n_, row, mh_, n_) += forms / h;
    j.block(row, column, n_, mh_) -= forms.transpose() + curvature * start_forms_;
    j.block(row + n_, column, mh_, mh_) += forms * start_forms_ / h;
  }

  Scene scene_;
  int s_, n_, m_;
  ConstraintBlocks holonomic_;
  int mh_, inert_;
  GaussLobattoTableau table_;
  FirstOrderMotions motions_;
  std::vector<FirstOrderPoint> stages_;
  ConstraintsAtPoint at_start_, at_end_;
  SparsityPattern pattern_;
  std::vector<ResidualBlock> blocks_;
  Interval step_{0.0, 1.0};
  Vector q0_, p0_, q1_, last_x_, end_position_;
  Columns start_forms_;  ///< A_h(q0)ᵀ
  bool evaluated_ = false;
};

}  // namespace

std::unique_ptr<StepProblem> first_order_step(int s, const Scene& scene, const FirstOrderMotions& motions) {
  require_determined(scene, motions);
  return std::make_unique<FirstOrderStep>(s, scene, motions);
}

}  // namespace diracstep
