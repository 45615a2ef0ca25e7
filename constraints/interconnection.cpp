#include <algorithm>
#include <diracstep/constraints/interconnection.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <sstream>

namespace diracstep {

namespace {

/// Both patterns on the diagonal.  The values of the first stand before those of the second.
SparsityPattern diagonal_sum(const SparsityPattern& first, const SparsityPattern& second) {
  BlockPattern layout(first.rows() + second.rows(), first.columns() + second.columns());
  layout.add(first, 0, 0);
  layout.add(second, first.rows(), first.columns());
  return layout.assemble(false);
}

PhaseStructure common(const PhaseStructure& a, const PhaseStructure& b) {
  return {a.separable && b.separable,
          a.y_hessian_constant && b.y_hessian_constant,
          a.y_hessian_diagonal && b.y_hessian_diagonal,
          a.quadratic && b.quadratic,
          a.y_hessian_zero && b.y_hessian_zero,
          a.autonomous && b.autonomous};
}

/// f1(x1, y1) + f2(x2, y2).
template <class Base>
class Sum final : public Base {
 public:
  Sum(std::shared_ptr<const Base> first, std::shared_ptr<const Base> second)
      : Base(diagonal_sum(first->pattern(), second->pattern()),
             common(first->structure(), second->structure())),
        first_(std::move(first)),
        second_(std::move(second)),
        n_(first_->dimension()),
        m_(second_->dimension()),
        k_(first_->pattern().nonzeros()),
        l_(second_->pattern().nonzeros()) {}

  double value(double t, ConstVectorRef x, ConstVectorRef y) const override {
    return first_->value(t, x.head(n_), y.head(n_)) + second_->value(t, x.tail(m_), y.tail(m_));
  }
  void gradient(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fx, VectorRef fy) const override {
    first_->gradient(t, x.head(n_), y.head(n_), fx.head(n_), fy.head(n_));
    second_->gradient(t, x.tail(m_), y.tail(m_), fx.tail(m_), fy.tail(m_));
  }
  void hessian(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    first_->hessian(t, x.head(n_), y.head(n_), fxx.head(k_), fxy.head(k_), fyy.head(k_));
    second_->hessian(t, x.tail(m_), y.tail(m_), fxx.tail(l_), fxy.tail(l_), fyy.tail(l_));
  }
  void gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fyt) const override {
    first_->gradient_rate(t, x.head(n_), y.head(n_), fyt.head(n_));
    second_->gradient_rate(t, x.tail(m_), y.tail(m_), fyt.tail(m_));
  }
  void position_gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxt) const override {
    first_->position_gradient_rate(t, x.head(n_), y.head(n_), fxt.head(n_));
    second_->position_gradient_rate(t, x.tail(m_), y.tail(m_), fxt.tail(m_));
  }

 private:
  std::shared_ptr<const Base> first_, second_;
  Eigen::Index n_, m_, k_, l_;
};

/// A part of a column, and the same rows or force on the whole of it.
SparsityPattern moved(const SparsityPattern& pattern, int rows, int row, int columns, int column) {
  auto entries = pattern.entries();
  for (auto& [i, j] : entries) {
    i += row;
    j += column;
  }
  return {rows, columns, entries};
}

class PartForce final : public Force {
 public:
  PartForce(std::shared_ptr<const Force> force, int offset, int n)
      : Force(moved(force->pattern(), n, offset, n, offset)), force_(std::move(force)), offset_(offset) {}

  void value(double t, ConstVectorRef q, ConstVectorRef v, VectorRef f) const override {
    f.setZero();
    force_->value(t, part(q), part(v), f.segment(offset_, force_->dimension()));
  }
  void derivatives(double t, ConstVectorRef q, ConstVectorRef v, VectorRef fq, VectorRef fv) const override {
    force_->derivatives(t, part(q), part(v), fq, fv);
  }

 private:
  Vector part(ConstVectorRef x) const { return x.segment(offset_, force_->dimension()); }
  std::shared_ptr<const Force> force_;
  int offset_;
};

class BothForces final : public Force {
 public:
  BothForces(std::shared_ptr<const Force> first, std::shared_ptr<const Force> second)
      : Force(diagonal_sum(first->pattern(), second->pattern())),
        first_(std::move(first)),
        second_(std::move(second)),
        n_(first_->dimension()),
        m_(second_->dimension()),
        k_(first_->pattern().nonzeros()),
        l_(second_->pattern().nonzeros()) {}

  void value(double t, ConstVectorRef q, ConstVectorRef v, VectorRef f) const override {
    first_->value(t, q.head(n_), v.head(n_), f.head(n_));
    second_->value(t, q.tail(m_), v.tail(m_), f.tail(m_));
  }
  void derivatives(double t, ConstVectorRef q, ConstVectorRef v, VectorRef fq, VectorRef fv) const override {
    first_->derivatives(t, q.head(n_), v.head(n_), fq.head(k_), fv.head(k_));
    second_->derivatives(t, q.tail(m_), v.tail(m_), fq.tail(l_), fv.tail(l_));
  }

 private:
  std::shared_ptr<const Force> first_, second_;
  Eigen::Index n_, m_, k_, l_;
};

class PartRows final : public ConstraintRows {
 public:
  PartRows(std::shared_ptr<const ConstraintRows> rows, const std::string& prefix, int offset, int n)
      : ConstraintRows(rows->holonomic(), moved(rows->pattern(), rows->rows(), 0, n, offset),
                       moved(rows->curvature_pattern(), n, offset, n, offset),
                       prefixed(rows->names(), prefix)),
        rows_(std::move(rows)),
        offset_(offset) {}

  static std::vector<std::string> prefixed(std::vector<std::string> names, const std::string& prefix) {
    for (std::string& name : names) name.insert(0, prefix + ".");
    return names;
  }
  bool workless() const override { return rows_->workless(); }
  void position(double t, ConstVectorRef q, VectorRef phi) const override {
    rows_->position(t, part(q), phi);
  }
  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    rows_->coefficients(t, part(q), a, b);
  }
  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override {
    rows_->derivative(t, part(q), part(w), s, d);
  }
  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override {
    rows_->time_derivative(t, part(q), part(v), d);
  }
  void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    rows_->annihilator_derivative(t, part(q), lambda, d);
  }

 private:
  Vector part(ConstVectorRef x) const { return x.segment(offset_, rows_->dimension()); }
  std::shared_ptr<const ConstraintRows> rows_;
  int offset_;
};

std::shared_ptr<const Force> sum_of_forces(const Scene& first, const Scene& second) {
  const int n = first.dimension() + second.dimension();
  if (first.force && second.force) return std::make_shared<const BothForces>(first.force, second.force);
  if (first.force) return std::make_shared<const PartForce>(first.force, 0, n);
  if (second.force) return std::make_shared<const PartForce>(second.force, first.dimension(), n);
  return nullptr;
}

template <class Base>
std::shared_ptr<const Base> sum(const std::shared_ptr<const Base>& first,
                                const std::shared_ptr<const Base>& second) {
  if (!first || !second) return nullptr;
  return std::make_shared<const Sum<Base>>(first, second);
}

Vector joined(const Vector& first, const Vector& second) {
  Vector both(first.size() + second.size());
  both << first, second;
  return both;
}

void require_compatible(const Scene& first, const Scene& second) {
  if (first.name == second.name)
    throw Misuse("both scenes are named '" + first.name + "'; their names tell their coordinates apart");
  if (first.start.time == second.start.time) return;
  std::ostringstream message;
  message << "the scenes start at different times, " << first.start.time << " and " << second.start.time;
  throw Misuse(message.str());
}

}  // namespace

Scene interconnection(const std::string& name, const Scene& first, const Scene& second,
                      const ConstraintBlocks& interaction) {
  require_compatible(first, second);
  const auto a = completed(std::make_shared<const Scene>(first)),
             b = completed(std::make_shared<const Scene>(second));
  Scene whole;
  whole.name = name;
  const int n = a->dimension() + b->dimension();
  for (const Scene* part : {a.get(), b.get()}) {
    const int offset = whole.dimension();
    for (const auto& coordinate : part->coordinates)
      whole.coordinates.push_back(part->name + "." + coordinate);
    for (const auto& rows : part->constraints)
      whole.constraints.push_back(std::make_shared<const PartRows>(rows, part->name, offset, n));
  }
  whole.constraints.insert(whole.constraints.end(), interaction.begin(), interaction.end());
  whole.lagrangian = sum(a->lagrangian, b->lagrangian);
  whole.hamiltonian = sum(a->hamiltonian, b->hamiltonian);
  whole.lagrangian_derived = whole.lagrangian && a->by_hamiltonian() && b->by_hamiltonian();
  whole.force = sum_of_forces(*a, *b);
  whole.start = {a->start.time, joined(a->start.q, b->start.q), joined(a->start.v, b->start.v)};
  if (whole.by_hamiltonian()) whole.start.p = joined(a->start.p, b->start.p);
  require_well_formed(whole);
  return whole;
}

}  // namespace diracstep
