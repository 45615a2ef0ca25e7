#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/levelled_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>
#include <diracstep/core/system/detail/differenced.hpp>

namespace diracstep {

namespace {

constexpr double levelled_difference = 1e-4;  ///< of the Jacobian, in relation to what is varied

class LevelledStep final : public StepProblem {
 public:
  LevelledStep(int s, const Scene& scene, const FirstOrderMotions& motions)
      : equations_(scene, motions),
        s_(s),
        n_(scene.dimension()),
        m_(scene.rows()),
        inert_(equations_.inert()),
        constraints_(equations_.constraint_count()),
        rates_(static_cast<int>(motions.levels.front().left.size())),
        table_(gauss_lobatto_tableau(s)),
        pattern_(SparsityPattern::dense(size(), size())) {
    const int nodes = s_ + 1;
    if (n_ + m_ > rates_) blocks_.push_back({"equations of motion", (n_ + m_ - rates_) * nodes});
    blocks_.push_back({"rate of hidden equations", rates_ * nodes});
    if (inert_ > 0) blocks_.push_back({"momentum rate", inert_ * s_});
    blocks_.push_back({"projection", n_ + inert_});
    blocks_.push_back({"constraint", constraints_});
  }

  int size() const override { return shift_place() + n_ + inert_ + constraints_; }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }
  StepTraits traits() const override {
    return {"velocities and forces of rows at the stages and the end (" +
                std::to_string((s_ + 1) * (n_ + m_)) + "), rates of momenta (" + std::to_string(s_ * inert_) +
                "), projection (" + std::to_string(n_ + inert_ + constraints_) + ")",
            s_ * (n_ + m_)};
  }

  void begin(Interval step, const State& start, const StepMemory&) override {
    step_ = step;
    z0_ = equations_.state(start.q, start.p);
    evaluated_ = false;
    for (ResidualBlock& block : blocks_) block.scale = smallest_scale;
  }

  void guess(ConstVectorRef v0, VectorRef x) override {
    x.setZero();
    for (int i = 0; i <= s_; ++i) x.segment(place(i), n_) = v0;
  }

  void residual(ConstVectorRef x, VectorRef f) override {
    evaluate(x);
    const int equal = n_ + m_ - rates_, nodes = s_ + 1;
    for (int i = 0; i < nodes; ++i) {
      f.segment(equal * i, equal) = at_node(i).k.head(equal);
      f.segment(equal * nodes + rates_ * i, rates_) = at_node(i).k.tail(rates_);
    }
    for (int i = 0; i < s_; ++i)
      f.segment((n_ + m_) * nodes + inert_ * i, inert_) =
          x.segment(rate_place(i), inert_) - at_node(i).g.tail(inert_);
    f.segment(shift_place(), n_ + inert_) = (x.segment(shift_place(), n_ + inert_) - moved_) / step_.size;
    f.tail(constraints_) = off_ / step_.size;
  }

  void jacobian(ConstVectorRef x, VectorRef values) override {
    evaluate(x);
    const Vector at = x;
    auto j = values.reshaped(size(), size());
    j.setZero();
    const int equal = n_ + m_ - rates_, nodes = s_ + 1;
    for (int i = 0; i < nodes; ++i) {
      const Columns by_x = by_unknowns(i);  // of z
      const Columns by = differences(i, at.segment(place(i), n_ + m_), i == s_);
      Columns chained = by.leftCols(z0_.size()) * by_x;
      chained.middleCols(place(i), n_ + m_) += by.rightCols(n_ + m_);
      j.middleRows(equal * i, equal) = chained.topRows(equal);
      j.middleRows(equal * nodes + rates_ * i, rates_) = chained.middleRows(equal, rates_);
      const auto rest = chained.bottomRows(chained.rows() - n_ - m_);
      if (i < s_) {
        const int row = (n_ + m_) * nodes + inert_ * i;
        j.middleRows(row, inert_) = -rest;
        j.block(row, rate_place(i), inert_, inert_).diagonal().array() += 1.0;
      } else {
        j.bottomRows(constraints_) = rest / step_.size;
      }
    }
    const Eigen::Index states = z0_.size();
    j.block(shift_place(), shift_place(), states, states).diagonal().setConstant(1.0 / step_.size);
    j.block(shift_place(), shift_place() + states, states, constraints_) = -directions_ / step_.size;
  }

  void finish(ConstVectorRef x, StepEnd& done) override {
    evaluate(x);
    done.at.q = at_node(s_).z.head(n_);
    done.at.v = (done.at.q - z0_.head(n_)) / step_.size;
    equations_.evaluate(node_time(s_), at_node(s_).z, x.segment(place(s_), n_ + m_));
    done.at.p = equations_.momentum();
    done.impulse = m_ > 0 ? Vector(step_.size * table_.b[0] * x.segment(place(0) + n_, m_)) : Vector();
    done.memory.known = true;
  }

 private:
  struct Node {
    Vector z, k, g;
  };

  int place(int i) const { return (n_ + m_) * i; }
  int rate_place(int i) const { return (n_ + m_) * (s_ + 1) + inert_ * i; }
  int shift_place() const { return (n_ + m_) * (s_ + 1) + inert_ * s_; }
  double node_time(int i) const { return step_.start + (i < s_ ? table_.c[i] : 1.0) * step_.size; }
  Node& at_node(int i) { return nodes_[static_cast<std::size_t>(i)]; }
  double weight(int i, int k) const { return i < s_ ? table_.a(i, k) : table_.b[k]; }

  /// ∂Z_i/∂x.
  Columns by_unknowns(int i) {
    Columns by = Columns::Zero(z0_.size(), size());
    for (int k = 0; k < s_; ++k) {
      by.block(0, place(k), n_, n_).diagonal().setConstant(step_.size * weight(i, k));
      by.block(n_, rate_place(k), inert_, inert_).diagonal().setConstant(step_.size * weight(i, k));
    }
    by.block(0, shift_place(), z0_.size(), z0_.size()).diagonal().setConstant(i < s_ ? 1.0 : 2.0);
    return by;
  }

  /// K, and g's part of momenta or at the end C, by (z,w) at a node.
  Columns differences(int i, const Vector& w, bool end) {
    const double t = node_time(i);
    const Eigen::Index states = z0_.size();
    const auto all = [&](const Vector& there) {
      const auto z = there.head(states), unknowns = there.tail(there.size() - states);
      const Vector k = equations_.evaluate(t, z, unknowns);
      const Vector rest =
          end ? equations_.constraints(t, z, unknowns) : Vector(equations_.rate().tail(inert_));
      Vector both(k.size() + rest.size());
      both << k, rest;
      return both;
    };
    Vector at(states + w.size());
    at << at_node(i).z, w;
    return differenced(all, at, states, levelled_difference, false);
  }

  void evaluate(ConstVectorRef x) {
    if (evaluated_ && last_x_ == x) return;
    evaluated_ = true;
    last_x_ = x;
    const double h = step_.size;
    Columns d(z0_.size(), s_);
    for (int i = 0; i < s_; ++i) d.col(i) << x.segment(place(i), n_), x.segment(rate_place(i), inert_);
    const Vector shift = x.segment(shift_place(), z0_.size());
    directions_.setZero(z0_.size(), constraints_);
    nodes_.resize(static_cast<std::size_t>(s_) + 1);
    double terms = 0.0, rate = 0.0;
    for (int i = 0; i <= s_; ++i) {
      Node& node = at_node(i);
      node.z = z0_ + (i < s_ ? 1.0 : 2.0) * shift;
      for (int k = 0; k < s_; ++k) node.z += h * weight(i, k) * d.col(k);
      if (i < s_)
        directions_ +=
            table_.b[i] *
            equations_.constraint_derivative(node_time(i), node.z, x.segment(place(i), n_ + m_)).transpose();
      node.k = equations_.evaluate(node_time(i), node.z, x.segment(place(i), n_ + m_));
      node.g = equations_.rate();
      terms = std::max(terms, equations_.terms());
      rate = std::max(rate, equations_.rate_terms());
    }
    moved_ = directions_ * x.tail(constraints_);
    off_ = equations_.constraints(node_time(s_), at_node(s_).z, x.segment(place(s_), n_ + m_));
    raise_scales(terms, rate);
  }

  void raise_scales(double terms, double rate) {
    std::size_t b = 0;
    const auto raise = [&](bool present, double size) {
      if (!present) return;
      if (std::isfinite(size)) blocks_[b].scale = std::max(blocks_[b].scale, scale_of(size));
      ++b;
    };
    const double above = rate * equations_.resolved();  // of the last constraints, which rates are of
    raise(n_ + m_ > rates_, terms);
    raise(true, rate);
    raise(inert_ > 0, terms);
    raise(true, max_norm(z0_) / std::abs(step_.size));
    raise(true, std::max(above, max_norm(z0_)) / std::abs(step_.size));
  }

  LevelledEquations equations_;
  int s_, n_, m_, inert_, constraints_, rates_;
  GaussLobattoTableau table_;
  SparsityPattern pattern_;
  std::vector<ResidualBlock> blocks_;
  Interval step_{0.0, 1.0};
  Vector z0_, last_x_, moved_, off_;
  Columns directions_;  ///< G, in the Jacobian with what depends on Z_i left out
  std::vector<Node> nodes_;
  bool evaluated_ = false;
};

}  // namespace

std::unique_ptr<StepProblem> levelled_step(int s, const Scene& scene, const FirstOrderMotions& motions) {
  require_determined(scene, motions);
  return std::make_unique<LevelledStep>(s, scene, motions);
}

}  // namespace diracstep
