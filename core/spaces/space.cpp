#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <utility>

namespace diracstep {

Space::Space(std::vector<std::shared_ptr<const SpaceFactor>> factors) {
  if (factors.empty()) throw Misuse("a configuration space has one factor or more");
  for (auto& factor : factors) {
    const SpaceSizes own = factor->sizes();
    for (int i = 0; i < own.group; ++i) (i < own.dimension ? tangent_ : turns_).push_back(sizes_.group + i);
    factors_.push_back({std::move(factor), own, sizes_.storage, sizes_.group, sizes_.dimension});
    sizes_.storage += own.storage;
    sizes_.group += own.group;
    sizes_.dimension += own.dimension;
  }
}

std::string Space::name() const {
  std::string names;
  for (const Factor& factor : factors_) names += (names.empty() ? "" : " x ") + factor.space->name();
  return names;
}

void Space::embed(ConstVectorRef v, VectorRef group) const {
  group.setZero();
  for (std::size_t i = 0; i < tangent_.size(); ++i) group[tangent_[i]] = v[static_cast<Eigen::Index>(i)];
}

void Space::restrict(ConstVectorRef group, VectorRef v) const {
  for (std::size_t i = 0; i < tangent_.size(); ++i) v[static_cast<Eigen::Index>(i)] = group[tangent_[i]];
}

Vector Space::identity() const {
  Vector q(sizes_.storage);
  for (const Factor& factor : factors_) factor.space->identity(q.data() + factor.storage);
  return q;
}

Vector Space::normalised(Vector q) const {
  for (const Factor& factor : factors_) factor.space->normalise(q.data() + factor.storage);
  return q;
}

void Space::move(ConstVectorRef q, ConstVectorRef x, VectorRef out) const {
  for (const Factor& factor : factors_)
    factor.space->move(q.data() + factor.storage, x.data() + factor.group, out.data() + factor.storage);
}

Vector Space::moved(ConstVectorRef q, ConstVectorRef x) const {
  Vector out(sizes_.storage);
  if (x.size() == sizes_.group) {
    move(q, x, out);
    return out;
  }
  Vector group(sizes_.group);
  embed(x, group);
  move(q, group, out);
  return out;
}

/// With τ(x)⁻¹ q⁻¹ other = τ(η) the change of x is dτ_x⁻¹ η, and η follows from how far q τ(x) is from other.
Vector Space::difference(ConstVectorRef q, ConstVectorRef other) const {
  constexpr int most = 50;
  constexpr double small = 1e-15;
  Vector x = Vector::Zero(sizes_.group);
  double last = HUGE_VAL;
  for (int iteration = 0; iteration < most; ++iteration) {
    const Columns derivative = storage_derivative(q, x);
    const Vector change = derivative.householderQr().solve(other - moved(q, x));
    if (!change.allFinite()) break;
    x += change;
    const double size = change.norm();
    if (size <= small * (1.0 + x.norm()) || (size <= 1e-10 && size >= 0.5 * last)) {
      const bool there = max_norm(moved(q, x) - other) <= 1e-10 * (1.0 + max_norm(other));
      return there ? x : Vector::Constant(sizes_.group, std::nan(""));
    }
    last = size;
  }
  return Vector::Constant(sizes_.group, std::nan(""));
}

double Space::part_of_chart(ConstVectorRef x) const {
  double part = 0.0;
  for (const Factor& factor : factors_)
    part = std::max(part, factor.space->part_of_chart(x.data() + factor.group));
  return part;
}

void Space::maps(ConstVectorRef x, ColumnsRef adjoint, ColumnsRef dtau) const {
  adjoint.setIdentity();
  dtau.setIdentity();
  Columns of_adjoint, of_dtau;
  for (const Factor& factor : factors_) {
    if (factor.space->flat()) continue;
    const int d = factor.sizes.group, at = factor.group;
    of_adjoint.resize(d, d);
    of_dtau.resize(d, d);
    factor.space->maps(x.data() + at, of_adjoint.data(), of_dtau.data());
    adjoint.block(at, at, d, d) = of_adjoint;
    dtau.block(at, at, d, d) = of_dtau;
  }
}

Vector Space::bracket(ConstVectorRef v, ConstVectorRef w) const {
  Vector out(sizes_.group);
  for (const Factor& factor : factors_)
    factor.space->bracket(v.data() + factor.group, w.data() + factor.group, out.data() + factor.group);
  return out;
}

void Space::coadjoint(ConstVectorRef p, ColumnsRef k) const {
  k.setZero();
  for (const Factor& factor : factors_) {
    if (factor.space->flat()) continue;
    const int d = factor.sizes.group, at = factor.group;
    Vector image(d);
    for (int j = 0; j < d; ++j)
      for (int i = 0; i < d; ++i) {
        factor.space->bracket(Vector::Unit(d, j).eval().data(), Vector::Unit(d, i).eval().data(),
                              image.data());
        k(at + i, at + j) = p.segment(at, d).dot(image);
      }
  }
}

/// Calls visit(first component, size, derivative of dτ) for the factors where it is not zero.
template <class Visit>
void Space::for_each_derivative(ConstVectorRef x, Visit visit) const {
  Vector values;
  for (const Factor& factor : factors_) {
    if (factor.space->flat()) continue;
    const int d = factor.sizes.group;
    values.resize(static_cast<Eigen::Index>(d) * d * d);
    factor.space->dtau_derivative(x.data() + factor.group, values.data());
    visit(factor.group, d, values);
  }
}

void Space::dtau_along(ConstVectorRef x, ConstVectorRef v, ColumnsRef out) const {
  out.setZero();
  for_each_derivative(x, [&](int at, int d, const Vector& values) {
    for (int k = 0; k < d; ++k)
      out.block(at, at + k, d, 1) =
          Eigen::Map<const Columns>(values.data() + k * d * d, d, d) * v.segment(at, d);
  });
}

void Space::dtau_transposed_along(ConstVectorRef x, ConstVectorRef p, ColumnsRef out) const {
  out.setZero();
  for_each_derivative(x, [&](int at, int d, const Vector& values) {
    for (int k = 0; k < d; ++k)
      out.block(at, at + k, d, 1) =
          Eigen::Map<const Columns>(values.data() + k * d * d, d, d).transpose() * p.segment(at, d);
  });
}

void Space::pairing_hessian(ConstVectorRef x, ConstVectorRef v, ConstVectorRef p, ColumnsRef h) const {
  h.setZero();
  Columns own;
  for (const Factor& factor : factors_) {
    if (factor.space->flat()) continue;
    const int d = factor.sizes.group, at = factor.group;
    own.resize(d, d);
    factor.space->pairing_hessian(x.data() + at, v.data() + at, p.data() + at, own.data());
    h.block(at, at, d, d) = own;
  }
}

Columns Space::storage_derivative(ConstVectorRef q, ConstVectorRef x) const {
  Columns whole = Columns::Zero(sizes_.storage, sizes_.group), own;
  for (const Factor& factor : factors_) {
    own.resize(factor.sizes.storage, factor.sizes.group);
    factor.space->storage_derivative(q.data() + factor.storage, x.data() + factor.group, own.data());
    whole.block(factor.storage, factor.group, own.rows(), own.cols()) = own;
  }
  return whole;
}

Columns Space::tangent_basis(ConstVectorRef q) const {
  return storage_derivative(q, Vector::Zero(sizes_.group))(Eigen::all, tangent_);
}

/// e_j B_i = ∂²(q τ(x))/∂x_i∂x_j + B [e_j, e_i]/2, by the formula of Baker, Campbell and Hausdorff.
Columns Space::basis_curvature(ConstVectorRef q, ConstVectorRef w) const {
  Columns whole = Columns::Zero(sizes_.dimension, sizes_.dimension);
  for (const Factor& factor : factors_) {
    if (factor.space->flat()) continue;
    const auto [storage, d, n] = factor.sizes;
    Columns curvature(storage, d * d), basis(storage, d);
    const Vector zero = Vector::Zero(d), weights = w.segment(factor.storage, storage);
    factor.space->storage_curvature(q.data() + factor.storage, curvature.data());
    factor.space->storage_derivative(q.data() + factor.storage, zero.data(), basis.data());
    const Vector first = basis.transpose() * weights, second = curvature.transpose() * weights;
    Vector image(d);
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        factor.space->bracket(Vector::Unit(d, j).eval().data(), Vector::Unit(d, i).eval().data(),
                              image.data());
        whole(factor.tangent + i, factor.tangent + j) = second[i + d * j] + 0.5 * first.dot(image);
      }
  }
  return whole;
}

}  // namespace diracstep
