#include <Eigen/QR>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <utility>

namespace diracstep {

namespace {

/// Room for the numbers of one factor, on the stack for every group here.
class Buffer {
 public:
  double* of(int count) {
    const auto size = static_cast<std::size_t>(count);
    if (size <= few_.size()) return few_.data();
    many_.resize(size);
    return many_.data();
  }

 private:
  std::array<double, 216> few_;
  std::vector<double> many_;
};

}  // namespace

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

/// Whether such a matrix is one block, which lies in memory without gaps.
bool Space::is_one_factor(ColumnsRef whole) const {
  return factors_.size() == 1 && !factors_.front().space->flat() && whole.outerStride() == whole.rows();
}

void Space::maps(ConstVectorRef x, ColumnsRef adjoint, ColumnsRef adjoint_back, ColumnsRef dtau,
                 ColumnsRef dtau_back) const {
  if (is_one_factor(adjoint) && is_one_factor(adjoint_back) && is_one_factor(dtau) &&
      is_one_factor(dtau_back)) {
    factors_.front().space->maps(x.data(), adjoint.data(), adjoint_back.data(), dtau.data(),
                                 dtau_back.data());
    return;
  }
  const std::array<ColumnsRef*, 4> wholes{&adjoint, &adjoint_back, &dtau, &dtau_back};
  for (ColumnsRef* whole : wholes) whole->setIdentity();
  std::array<Columns, 4> own;
  for (const Factor& factor : factors_) {
    if (factor.space->flat()) continue;
    const int d = factor.sizes.group, at = factor.group;
    for (Columns& map : own) map.resize(d, d);
    factor.space->maps(x.data() + at, own[0].data(), own[1].data(), own[2].data(), own[3].data());
    for (std::size_t k = 0; k < own.size(); ++k) wholes[k]->block(at, at, d, d) = own[k];
  }
}

Vector Space::bracket(ConstVectorRef v, ConstVectorRef w) const {
  Vector out(sizes_.group);
  for (const Factor& factor : factors_)
    factor.space->bracket(v.data() + factor.group, w.data() + factor.group, out.data() + factor.group);
  return out;
}

/// A matrix with a block of each factor that is not flat, which visit(factor, block by columns) fills.
template <class Visit>
void Space::diagonal_blocks(ColumnsRef whole, Visit visit) const {
  if (is_one_factor(whole)) {
    visit(factors_.front(), whole.data());
    return;
  }
  whole.setZero();
  Columns own;
  for (const Factor& factor : factors_) {
    if (factor.space->flat()) continue;
    own.resize(factor.sizes.group, factor.sizes.group);
    visit(factor, own.data());
    whole.block(factor.group, factor.group, own.rows(), own.cols()) = own;
  }
}

void Space::coadjoint(ConstVectorRef p, ColumnsRef k) const {
  diagonal_blocks(
      k, [&](const Factor& factor, double* out) { factor.space->coadjoint(p.data() + factor.group, out); });
}

/// Calls visit(first component, size, derivative of dτ) for the factors where it is not zero.
template <class Visit>
void Space::for_each_derivative(ConstVectorRef x, Visit visit) const {
  Buffer buffer;
  for (const Factor& factor : factors_) {
    if (factor.space->flat()) continue;
    const int d = factor.sizes.group;
    double* const values = buffer.of(d * d * d);
    factor.space->dtau_derivative(x.data() + factor.group, values);
    visit(factor.group, factor.sizes.group, values);
  }
}

void Space::dtau_along(ConstVectorRef x, ConstVectorRef v, ColumnsRef out) const {
  out.setZero();
  for_each_derivative(x, [&](int at, int d, const double* value) {
    for (int k = 0; k < d; ++k)
      for (int j = 0; j < d; ++j)
        for (int i = 0; i < d; ++i) out(at + i, at + k) += *value++ * v[at + j];
  });
}

void Space::dtau_transposed_along(ConstVectorRef x, ConstVectorRef p, ColumnsRef out) const {
  out.setZero();
  for_each_derivative(x, [&](int at, int d, const double* value) {
    for (int k = 0; k < d; ++k)
      for (int j = 0; j < d; ++j)
        for (int i = 0; i < d; ++i) out(at + j, at + k) += *value++ * p[at + i];
  });
}

void Space::pairing_hessian(ConstVectorRef x, ConstVectorRef v, ConstVectorRef p, ColumnsRef h) const {
  diagonal_blocks(h, [&](const Factor& factor, double* out) {
    factor.space->pairing_hessian(x.data() + factor.group, v.data() + factor.group, p.data() + factor.group,
                                  out);
  });
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
  Columns whole = Columns::Zero(sizes_.storage, sizes_.dimension), own;
  for (const Factor& factor : factors_) {
    const auto [storage, d, n] = factor.sizes;
    own.resize(storage, d);
    factor.space->basis(q.data() + factor.storage, own.data());
    whole.block(factor.storage, factor.tangent, storage, n) = own.leftCols(n);
  }
  return whole;
}

void Space::pull_back(ConstVectorRef q, ConstVectorRef w, VectorRef out) const {
  Buffer buffer;
  for (const Factor& factor : factors_) {
    const auto [storage, d, n] = factor.sizes;
    double* entry = buffer.of(storage * d);
    factor.space->basis(q.data() + factor.storage, entry);
    for (int j = 0; j < n; ++j) {
      double sum = 0.0;
      for (int k = 0; k < storage; ++k) sum += *entry++ * w[factor.storage + k];
      out[factor.tangent + j] = sum;
    }
  }
}

Columns Space::basis_curvature(ConstVectorRef q, ConstVectorRef w) const {
  Columns whole = Columns::Zero(sizes_.dimension, sizes_.dimension), own;
  for (const Factor& factor : factors_) {
    if (factor.space->flat()) continue;
    const auto [storage, d, n] = factor.sizes;
    own.resize(d, d);
    factor.space->basis_curvature(q.data() + factor.storage, w.data() + factor.storage, own.data());
    whole.block(factor.tangent, factor.tangent, n, n) = own.topLeftCorner(n, n);
  }
  return whole;
}

Vector moved(const Space* space, ConstVectorRef q, ConstVectorRef x) {
  return space != nullptr ? space->moved(q, x) : Vector(q + x);
}

}  // namespace diracstep
