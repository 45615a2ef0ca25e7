#pragma once

#include <array>
#include <diracstep/core/numerics/jet.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/spaces/derivatives.hpp>
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
  /// Ad_{τ(x)}, Ad_{τ(−x)}, dτ_x and dτ_{−x}.
  virtual void maps(const double* x, double* adjoint, double* adjoint_back, double* dtau,
                    double* dtau_back) const = 0;
  virtual void bracket(const double* v, const double* w, double* out) const = 0;
  /// K with ⟨K w, u⟩ = ⟨p, ad_w u⟩.
  virtual void coadjoint(const double* p, double* out) const = 0;
  /// ∂(dτ_x)_{ij}/∂x_k at i + d j + d² k.
  virtual void dtau_derivative(const double* x, double* out) const = 0;
  /// ∂²⟨p, dτ_x v⟩/∂x_i∂x_j.
  virtual void pairing_hessian(const double* x, const double* v, const double* p, double* out) const = 0;
  /// ∂(g τ(x))/∂x, storage×group, at any x, and at 0.
  virtual void storage_derivative(const double* g, const double* x, double* out) const = 0;
  virtual void basis(const double* g, double* out) const = 0;
  /// Σ_k w_k (derivative of the basis' entry (k, i) along e_j) at (i, j).
  virtual void basis_curvature(const double* g, const double* w, double* out) const = 0;
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

  /// Ad_{τ(x)}, Ad_{τ(−x)}, dτ_x and dτ_{−x}.
  void maps(ConstVectorRef x, ColumnsRef adjoint, ColumnsRef adjoint_back, ColumnsRef dtau,
            ColumnsRef dtau_back) const;
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
  /// Bᵀ w: the derivative along the space of a function of stored numbers with these derivatives w.
  void pull_back(ConstVectorRef q, ConstVectorRef w, VectorRef out) const;
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
  bool is_one_factor(ColumnsRef whole) const;
  template <class Visit>
  void diagonal_blocks(ColumnsRef whole, Visit visit) const;
  template <class Visit>
  void for_each_derivative(ConstVectorRef x, Visit visit) const;

  std::vector<Factor> factors_;
  SpaceSizes sizes_;
  std::vector<int> tangent_, turns_;
};

namespace detail {

template <class G>
class FactorOf final : public SpaceFactor {
  static constexpr std::size_t d = static_cast<std::size_t>(G::group),
                               numbers_stored = static_cast<std::size_t>(G::storage);
  using Derivatives = spaces::FactorDerivatives<G>;

  template <std::size_t N>
  static std::array<double, N> numbers(const double* from) {
    std::array<double, N> to;
    for (std::size_t i = 0; i < N; ++i) to[i] = from[i];
    return to;
  }
  static auto element(const double* g) { return numbers<numbers_stored>(g); }
  static auto algebra(const double* x) { return numbers<d>(x); }
  static std::array<double, d> unit(std::size_t i) {
    std::array<double, d> e{};
    e[i] = 1.0;
    return e;
  }

 public:
  SpaceSizes sizes() const override { return {G::storage, G::group, G::dimension}; }
  std::string name() const override {
    return flat() ? G::name + std::to_string(G::group) : std::string(G::name);
  }
  bool flat() const override { return std::string(G::name) == "R"; }
  void identity(double* g) const override {
    for (const double entry : G::template identity<double>()) *g++ = entry;
  }
  void normalise(double* g) const override {
    auto element_of = element(g);
    G::normalise(element_of);
    for (const double entry : element_of) *g++ = entry;
  }
  double part_of_chart(const double* x) const override { return G::part_of_chart(algebra(x)); }
  void move(const double* g, const double* x, double* q) const override {
    auto moved = G::product(element(g), G::retract(algebra(x)));
    G::normalise(moved);
    for (const double entry : moved) *q++ = entry;
  }
  void maps(const double* x, double* adjoint, double* adjoint_back, double* dtau,
            double* dtau_back) const override {
    Derivatives::maps(algebra(x), adjoint, adjoint_back, dtau, dtau_back);
  }
  void bracket(const double* v, const double* w, double* out) const override {
    for (const double entry : G::bracket(algebra(v), algebra(w))) *out++ = entry;
  }
  void coadjoint(const double* p, double* out) const override {
    for (std::size_t j = 0; j < d; ++j)
      for (std::size_t i = 0; i < d; ++i)
        *out++ = spaces::detail::dot(algebra(p), G::bracket(unit(j), unit(i)));
  }
  void dtau_derivative(const double* x, double* out) const override {
    Derivatives::dtau_derivative(algebra(x), out);
  }
  void pairing_hessian(const double* x, const double* v, const double* p, double* out) const override {
    Derivatives::pairing_hessian(algebra(x), algebra(v), algebra(p), out);
  }
  void storage_derivative(const double* g, const double* x, double* out) const override {
    using T = Jet<G::group, 1>;
    std::array<T, numbers_stored> at;
    std::array<T, d> along;
    for (std::size_t i = 0; i < numbers_stored; ++i) at[i] = T(g[i]);
    for (std::size_t i = 0; i < d; ++i) along[i] = T::variable(x[i], static_cast<int>(i));
    const auto moved = G::product(at, G::retract(along));
    for (int j = 0; j < G::group; ++j)
      for (const T& entry : moved) *out++ = entry.gradient(j);
  }
  void basis(const double* g, double* out) const override { Derivatives::basis(element(g), out); }
  void basis_curvature(const double* g, const double* w, double* out) const override {
    Derivatives::basis_curvature(element(g), element(w), out);
  }
};

}  // namespace detail

/// q τ(x) on a space, q + x in R^n, where `space` is null.
Vector moved(const Space* space, ConstVectorRef q, ConstVectorRef x);

/// The product of factors: `space(spaces::SO3{}, spaces::R<3>{})`; a type of one's own is a factor as well.
template <class... Factors>
std::shared_ptr<const Space> space(const Factors&...) {
  return std::make_shared<const Space>(std::vector<std::shared_ptr<const SpaceFactor>>{
      std::make_shared<const detail::FactorOf<Factors>>()...});
}

}  // namespace diracstep
