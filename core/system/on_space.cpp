#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/on_space.hpp>
#include <utility>

namespace diracstep {

namespace {

/// A velocity of the space as one of R^N, further entries zero.
Vector padded(const Space& space, ConstVectorRef v) {
  Vector whole = Vector::Zero(space.storage_size());
  whole.head(v.size()) = v;
  return whole;
}

void require_numbers(const Space& space, int given, const char* what) {
  require_size(std::string(what) + " on " + space.name() + ", as a function of stored numbers", given,
               space.storage_size());
}

PhaseStructure structure_on_space(PhaseStructure structure) {
  structure.quadratic = false;  // moves along two tangent vectors do not commute
  return structure;
}

class LagrangianOnSpace final : public Lagrangian {
 public:
  LagrangianOnSpace(std::shared_ptr<const Space> space, std::shared_ptr<const Lagrangian> inner)
      : Lagrangian(SparsityPattern::dense(space->dimension(), space->dimension()),
                   structure_on_space(inner->structure())),
        space_(std::move(space)),
        inner_(std::move(inner)) {}

  double value(double t, ConstVectorRef x, ConstVectorRef y) const override {
    return inner_->value(t, x, padded(*space_, y));
  }

  void gradient(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fx, VectorRef fy) const override {
    const int numbers = space_->storage_size();
    Vector work(2 * numbers);
    auto by_numbers = work.head(numbers), by_velocity = work.tail(numbers);
    inner_->gradient(t, x, padded(*space_, y), by_numbers, by_velocity);
    if (structure().x_absent)
      fx.setZero();
    else
      space_->pull_back(x, by_numbers, fx);
    fy = by_velocity.head(fy.size());
  }

  void hessian(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    const int n = dimension(), numbers = space_->storage_size(), nonzeros = inner_->pattern().nonzeros();
    const Vector whole = padded(*space_, y);
    Vector work(3 * nonzeros + 2 * numbers);
    auto xx = work.head(nonzeros), xy = work.segment(nonzeros, nonzeros),
         yy = work.segment(2 * nonzeros, nonzeros);
    inner_->hessian(t, x, whole, xx, xy, yy);
    with_full(yy, [&](const auto& full) { fyy.reshaped(n, n) = full.topLeftCorner(n, n); });
    if (structure().x_absent) {
      fxx.setZero();
      fxy.setZero();
      return;
    }
    auto by_numbers = work.segment(3 * nonzeros, numbers);
    inner_->gradient(t, x, whole, by_numbers, work.tail(numbers));
    const Columns basis = space_->tangent_basis(x);
    with_full(xx, [&](const auto& full) {
      fxx.reshaped(n, n) =
          basis.transpose() * full.lazyProduct(basis) + space_->basis_curvature(x, by_numbers);
    });
    with_full(
        xy, [&](const auto& full) { fxy.reshaped(n, n) = basis.transpose().lazyProduct(full.leftCols(n)); });
  }

  void gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fyt) const override {
    Vector whole(space_->storage_size());
    inner_->gradient_rate(t, x, padded(*space_, y), whole);
    fyt = whole.head(fyt.size());
  }

  void position_gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxt) const override {
    Vector whole(space_->storage_size());
    inner_->position_gradient_rate(t, x, padded(*space_, y), whole);
    fxt = space_->tangent_basis(x).transpose() * whole;
  }

 private:
  /// Calls use(the matrix of values on the pattern of the inner function), without a copy where that is full.
  template <class Use>
  void with_full(ConstVectorRef values, Use use) const {
    const int numbers = space_->storage_size();
    if (values.size() == static_cast<Eigen::Index>(numbers) * numbers)
      use(Eigen::Map<const Columns>(values.data(), numbers, numbers));
    else
      use(inner_->pattern().full(values));
  }

  std::shared_ptr<const Space> space_;
  std::shared_ptr<const Lagrangian> inner_;
};

class RowsOnSpace final : public ConstraintRows {
 public:
  RowsOnSpace(std::shared_ptr<const Space> space, std::shared_ptr<const ConstraintRows> inner)
      : ConstraintRows(inner->holonomic(), SparsityPattern::dense(inner->rows(), space->dimension()),
                       SparsityPattern::dense(space->dimension(), space->dimension()), inner->names()),
        space_(std::move(space)),
        inner_(std::move(inner)) {}

  std::string origin(int row) const override { return inner_->origin(row); }
  bool constant() const override { return !holonomic() && inner_->constant(); }
  bool workless() const override { return inner_->workless(); }
  void position(double t, ConstVectorRef q, VectorRef phi) const override { inner_->position(t, q, phi); }

  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    const Columns of_numbers = inner_forms(t, q, b);
    if (holonomic())
      forms(a) = of_numbers * space_->tangent_basis(q);
    else
      forms(a) = of_numbers.leftCols(dimension());
  }

  /// Of A w for holonomic rows: ∂φ/∂q B w, where B turns with q as well.
  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override {
    Vector values(inner_->pattern().nonzeros());
    const Columns basis = space_->tangent_basis(q);
    inner_->derivative(t, q, holonomic() ? Vector(basis * w) : padded(*space_, w), s, values);
    forms(d) = inner_->pattern().full(values) * basis;
    if (!holonomic()) return;
    Vector b(rows());
    const Columns of_numbers = inner_forms(t, q, b);
    for (int r = 0; r < rows(); ++r)
      forms(d).row(r) += w.transpose() * space_->basis_curvature(q, of_numbers.row(r).transpose());
  }

  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override {
    inner_->time_derivative(t, q, holonomic() ? Vector(space_->tangent_basis(q) * v) : padded(*space_, v), d);
  }

  void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    Vector values(inner_->curvature_pattern().nonzeros());
    inner_->annihilator_derivative(t, q, lambda, values);
    const Columns basis = space_->tangent_basis(q), curvature = inner_->curvature_pattern().full(values);
    const int n = dimension();
    auto out = d.reshaped(n, n);
    if (!holonomic()) {
      out = curvature.topRows(n) * basis;
      return;
    }
    Vector b(rows());
    const Columns of_numbers = inner_forms(t, q, b);
    out = basis.transpose() * curvature * basis + space_->basis_curvature(q, of_numbers.transpose() * lambda);
  }

 private:
  Columns inner_forms(double t, ConstVectorRef q, VectorRef b) const {
    Vector values(inner_->pattern().nonzeros());
    inner_->coefficients(t, q, values, b);
    return inner_->pattern().full(values);
  }
  Eigen::Map<Columns> forms(VectorRef values) const { return {values.data(), rows(), dimension()}; }

  std::shared_ptr<const Space> space_;
  std::shared_ptr<const ConstraintRows> inner_;
};

class ForceOnSpace final : public Force {
 public:
  ForceOnSpace(std::shared_ptr<const Space> space, std::shared_ptr<const Force> inner)
      : Force(SparsityPattern::dense(space->dimension(), space->dimension())),
        space_(std::move(space)),
        inner_(std::move(inner)) {}

  void value(double t, ConstVectorRef q, ConstVectorRef v, VectorRef f) const override {
    Vector whole(space_->storage_size());
    inner_->value(t, q, padded(*space_, v), whole);
    f = whole.head(f.size());
  }

  void derivatives(double t, ConstVectorRef q, ConstVectorRef v, VectorRef fq, VectorRef fv) const override {
    const int n = dimension();
    Vector by_numbers(inner_->pattern().nonzeros()), by_velocity(by_numbers);
    inner_->derivatives(t, q, padded(*space_, v), by_numbers, by_velocity);
    fq.reshaped(n, n) = inner_->pattern().full(by_numbers).topRows(n) * space_->tangent_basis(q);
    fv.reshaped(n, n) = inner_->pattern().full(by_velocity).topLeftCorner(n, n);
  }

 private:
  std::shared_ptr<const Space> space_;
  std::shared_ptr<const Force> inner_;
};

}  // namespace

std::shared_ptr<const Lagrangian> on_space(std::shared_ptr<const Space> space,
                                           std::shared_ptr<const Lagrangian> of_numbers) {
  require_numbers(*space, of_numbers->dimension(), "a Lagrangian");
  return std::make_shared<LagrangianOnSpace>(std::move(space), std::move(of_numbers));
}

std::shared_ptr<const ConstraintRows> on_space(std::shared_ptr<const Space> space,
                                               std::shared_ptr<const ConstraintRows> of_numbers) {
  require_numbers(*space, of_numbers->dimension(), "rows");
  return std::make_shared<RowsOnSpace>(std::move(space), std::move(of_numbers));
}

std::shared_ptr<const Force> on_space(std::shared_ptr<const Space> space,
                                      std::shared_ptr<const Force> of_numbers) {
  require_numbers(*space, of_numbers->dimension(), "a force");
  return std::make_shared<ForceOnSpace>(std::move(space), std::move(of_numbers));
}

}  // namespace diracstep
