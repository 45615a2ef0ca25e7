#pragma once

#include <array>
#include <diracstep/core/numerics/jet.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/spaces/groups.hpp>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// Sizes of a configuration space: numbers that a configuration is stored in, of the Lie algebra, and of a
/// velocity of a scene.
struct SpaceSizes {
  int storage = 0, group = 0, dimension = 0;
};

/// A factor of a configuration space behind one interface, at its derivatives by jets.  Columns are arrays of
/// the sizes above; matrices are group×group by columns where not said otherwise.
class SpaceFactor {
 public:
  virtual ~SpaceFactor() = default;
  virtual SpaceSizes sizes() const = 0;
  virtual std::string name() const = 0;
  /// Whether τ(x) = x: R^n.
  virtual bool flat() const = 0;
  virtual void identity(double* g) const = 0;
  virtual void normalise(double* g) const = 0;
  virtual double part_of_chart(const double* x) const = 0;
  /// q ← g τ(x)
  virtual void move(const double* g, const double* x, double* q) const = 0;
  /// Ad_{τ(x)} and dτ_x.
  virtual void maps(const double* x, double* adjoint, double* dtau) const = 0;
  virtual void bracket(const double* v, const double* w, double* out) const = 0;
  /// ∂(dτ_x)_{ij}/∂x_k at i + d j + d² k.
  virtual void dtau_derivative(const double* x, double* out) const = 0;
  /// ∂²⟨p, dτ_x v⟩/∂x_i∂x_j.
  virtual void pairing_hessian(const double* x, const double* v, const double* p, double* out) const = 0;
  /// ∂(g τ(x))/∂x, storage×group, at any x.
  virtual void storage_derivative(const double* g, const double* x, double* out) const = 0;
  /// The symmetric ∂²(g τ(x))/∂x_i∂x_j at x = 0, storage×group×group.
  virtual void storage_curvature(const double* g, double* out) const = 0;
};

/// A configuration space: a product of Lie groups, spheres and R^n (groups.hpp).
///
/// The one convention: left-trivialised; increments multiply from the right, velocities and momenta are in
/// the body, and a rotation is stored as a unit quaternion (w, x, y, z).  A configuration lists the stored
/// numbers of the factors one after the other, a velocity or a momentum their components.  Columns of the
/// Lie algebra, "group columns" below, have further ones where a factor is a sphere: turns that nothing sees.
/// A value: copies share their factors, which are immutable and may be used from several threads at once.
class Space {
 public:
  /// Throws Misuse where there are none.
  explicit Space(std::vector<std::shared_ptr<const SpaceFactor>> factors);

  int storage_size() const { return sizes_.storage; }
  int group_dimension() const { return sizes_.group; }
  int dimension() const { return sizes_.dimension; }
  /// "SO3 x R3"
  std::string name() const;

  /// Which component of a group column each of a velocity is, and which are none.
  const std::vector<int>& tangent() const { return tangent_; }
  const std::vector<int>& turns() const { return turns_; }
  /// A velocity or momentum as a group column, further components zero; and back.
  void embed(ConstVectorRef v, VectorRef group) const;
  void restrict(ConstVectorRef group, VectorRef v) const;

  Vector identity() const;
  /// Onto the space, from round-off beside it.
  Vector normalised(Vector q) const;
  /// q τ(x), normalised, for a group column or a velocity times a time.
  Vector moved(ConstVectorRef q, ConstVectorRef x) const;
  void move(ConstVectorRef q, ConstVectorRef x, VectorRef out) const;
  /// x, a group column with q τ(x) = other, by Newton's method; NaN where there is none near.
  Vector difference(ConstVectorRef q, ConstVectorRef other) const;
  /// |x| in parts of what τ is injective up to; the factor where it is largest.
  double part_of_chart(ConstVectorRef x) const;

  /// Ad_{τ(x)} and dτ_x.
  void maps(ConstVectorRef x, ColumnsRef adjoint, ColumnsRef dtau) const;
  /// ad_v w
  Vector bracket(ConstVectorRef v, ConstVectorRef w) const;
  /// K with K w = ad_wᵀ p, that is ⟨K w, u⟩ = ⟨p, ad_w u⟩.
  void coadjoint(ConstVectorRef p, ColumnsRef k) const;
  /// ∂(dτ_x v)/∂x and ∂(dτ_xᵀ p)/∂x, for several p.
  void dtau_along(ConstVectorRef x, ConstVectorRef v, ColumnsRef d) const;
  void dtau_transposed_along(ConstVectorRef x, ConstVectorRef p, ColumnsRef e) const;
  void pairing_hessian(ConstVectorRef x, ConstVectorRef v, ConstVectorRef p, ColumnsRef h) const;

  /// How stored numbers change along the tangent space: B, storage×dimension, is d/dε q τ(ε e_j) in column j.
  Columns tangent_basis(ConstVectorRef q) const;
  /// ∂(q τ(x))/∂x at any x, storage×group.
  Columns storage_derivative(ConstVectorRef q, ConstVectorRef x) const;
  /// Σ_k w_k (derivative of B_ki along e_j), dimension×dimension at (i, j): for functions of stored numbers
  /// with these first derivatives.  Not symmetric, since moves along e_i and e_j do not commute.
  Columns basis_curvature(ConstVectorRef q, ConstVectorRef w) const;

 private:
  struct Factor {
    std::shared_ptr<const SpaceFactor> space;
    SpaceSizes sizes;
    int storage, group, tangent;  ///< where its parts begin
  };
  template <class Visit>
  void for_each_derivative(ConstVectorRef x, Visit visit) const;

  std::vector<Factor> factors_;
  SpaceSizes sizes_;
  std::vector<int> tangent_, turns_;
};

namespace detail {

template <class G>
class FactorOf final : public SpaceFactor {
  static constexpr int d = G::group;
  static constexpr std::size_t size = static_cast<std::size_t>(G::group);
  template <class T>
  using Element = std::array<T, static_cast<std::size_t>(G::storage)>;
  template <class T>
  using Algebra = std::array<T, size>;

  template <std::size_t N>
  static std::array<double, N> numbers(const double* from) {
    std::array<double, N> to;
    for (std::size_t i = 0; i < N; ++i) to[i] = from[i];
    return to;
  }
  template <class T, std::size_t N>
  static std::array<T, N> constants(const double* from) {
    std::array<T, N> to;
    for (std::size_t i = 0; i < N; ++i) to[i] = T(from[i]);
    return to;
  }
  template <class T>
  static Algebra<T> variables(const double* x) {
    Algebra<T> to;
    for (std::size_t i = 0; i < size; ++i)
      to[i] = T::variable(x == nullptr ? 0.0 : x[i], static_cast<int>(i));
    return to;
  }
  template <class T>
  static Algebra<T> unit(std::size_t i) {
    Algebra<T> e;
    e.fill(T(0.0));
    e[i] = T(1.0);
    return e;
  }
  static Element<double> element(const double* g) { return numbers<static_cast<std::size_t>(G::storage)>(g); }

 public:
  SpaceSizes sizes() const override { return {G::storage, G::group, G::dimension}; }
  std::string name() const override { return flat() ? G::name + std::to_string(d) : std::string(G::name); }
  bool flat() const override { return std::string(G::name) == "R"; }
  void identity(double* g) const override {
    for (const double entry : G::template identity<double>()) *g++ = entry;
  }
  void normalise(double* g) const override {
    auto element_of = element(g);
    G::normalise(element_of);
    for (const double entry : element_of) *g++ = entry;
  }
  double part_of_chart(const double* x) const override { return G::part_of_chart(numbers<size>(x)); }
  void move(const double* g, const double* x, double* q) const override {
    auto moved = G::product(element(g), G::retract(numbers<size>(x)));
    G::normalise(moved);
    for (const double entry : moved) *q++ = entry;
  }
  void maps(const double* x, double* adjoint, double* dtau) const override {
    const auto at = numbers<size>(x);
    const auto g = G::retract(at);
    for (std::size_t j = 0; j < size; ++j) {
      for (const double entry : G::adjoint(g, unit<double>(j))) *adjoint++ = entry;
      for (const double entry : G::dtau(at, unit<double>(j))) *dtau++ = entry;
    }
  }
  void bracket(const double* v, const double* w, double* out) const override {
    for (const double entry : G::bracket(numbers<size>(v), numbers<size>(w))) *out++ = entry;
  }
  void dtau_derivative(const double* x, double* out) const override {
    using T = Jet<d, 1>;
    const auto at = variables<T>(x);
    for (int j = 0; j < d; ++j) {
      const auto column = G::dtau(at, unit<T>(static_cast<std::size_t>(j)));
      for (int k = 0; k < d; ++k)
        for (int i = 0; i < d; ++i)
          out[i + d * (j + d * k)] = column[static_cast<std::size_t>(i)].gradient(k);
    }
  }
  void pairing_hessian(const double* x, const double* v, const double* p, double* out) const override {
    using T = Jet<d, 2>;
    const auto image = G::dtau(variables<T>(x), constants<T, size>(v));
    T sum(0.0);
    for (std::size_t i = 0; i < size; ++i) sum += image[i] * p[i];
    for (int j = 0; j < d; ++j)
      for (int i = 0; i < d; ++i) *out++ = sum.hessian(i, j);
  }
  void storage_derivative(const double* g, const double* x, double* out) const override {
    using T = Jet<d, 1>;
    const auto moved =
        G::product(constants<T, static_cast<std::size_t>(G::storage)>(g), G::retract(variables<T>(x)));
    for (int j = 0; j < d; ++j)
      for (const T& entry : moved) *out++ = entry.gradient(j);
  }
  void storage_curvature(const double* g, double* out) const override {
    using T = Jet<d, 2>;
    const auto moved =
        G::product(constants<T, static_cast<std::size_t>(G::storage)>(g), G::retract(variables<T>(nullptr)));
    for (int j = 0; j < d; ++j)
      for (int i = 0; i < d; ++i)
        for (const T& entry : moved) *out++ = entry.hessian(i, j);
  }
};

}  // namespace detail

/// The product of factors: `space(spaces::SO3{}, spaces::R<3>{})`; a type of one's own is a factor as well.
template <class... Factors>
std::shared_ptr<const Space> space(const Factors&...) {
  return std::make_shared<const Space>(std::vector<std::shared_ptr<const SpaceFactor>>{
      std::make_shared<const detail::FactorOf<Factors>>()...});
}

}  // namespace diracstep
