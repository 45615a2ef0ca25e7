#include <gtest/gtest.h>

#include <complex>
#include <diracstep/core/spaces/axioms.hpp>

#include "misuse.hpp"

namespace diracstep {
namespace {

using spaces::Retraction;

void expect_axioms(const Space& space, const std::string& name) {
  for (const AxiomDefect& found : space_axiom_defects(space))
    EXPECT_LT(found.defect, found.allowed) << name << ": " << found.axiom;
}

TEST(SpaceAxioms, HoldForEveryFactorWithBothRetractionsAndForProducts) {
  expect_axioms(*space(spaces::R<3>{}), "R3");
  expect_axioms(*space(spaces::S1{}), "S1");
  expect_axioms(*space(spaces::S2{}), "S2");
  expect_axioms(*space(spaces::SO3{}), "SO3");
  expect_axioms(*space(spaces::SE2{}), "SE2");
  expect_axioms(*space(spaces::SE3{}), "SE3");
  expect_axioms(*space(spaces::CircleBy<Retraction::cayley>{}), "S1, Cayley");
  expect_axioms(*space(spaces::SphereBy<Retraction::cayley>{}), "S2, Cayley");
  expect_axioms(*space(spaces::RotationsBy<Retraction::cayley>{}), "SO3, Cayley");
  expect_axioms(*space(spaces::PlaneMotionsBy<Retraction::cayley>{}), "SE2, Cayley");
  expect_axioms(*space(spaces::MotionsBy<Retraction::cayley>{}), "SE3, Cayley");
  expect_axioms(*space(spaces::SO3{}, spaces::R<2>{}, spaces::S2{}, spaces::SE2{}), "a product");
}

/// Rotations with a tangent map of the wrong side: right-trivialised.
struct RightTrivialised : spaces::SO3 {
  template <class T>
  static Rate<T> dtau(const Rate<T>& x, const Rate<T>& v) {
    return spaces::SO3::dtau(Rate<T>{-x[0], -x[1], -x[2]}, v);
  }
};

/// Rotations with a retraction that is not symmetric: τ(−x) ≠ τ(x)⁻¹.
struct NotSymmetric : spaces::SO3 {
  template <class T>
  static Rotation<T> retract(const Rate<T>& x) {
    return spaces::SO3::retract(Rate<T>{x[0], x[1], x[2] + T(0.1) * x[0] * x[0]});
  }
};

double defect_of(const Space& space, const std::string& axiom) {
  for (const AxiomDefect& found : space_axiom_defects(space))
    if (found.axiom == axiom) return found.defect;
  ADD_FAILURE() << "no axiom " << axiom;
  return 0.0;
}

TEST(SpaceAxioms, FailForTypesThatAreWrong) {
  EXPECT_GT(defect_of(*space(RightTrivialised{}), "dtau_x by jets"), 1e-2);
  EXPECT_GT(defect_of(*space(NotSymmetric{}), "tau(x) tau(-x) = e"), 1e-2);
  EXPECT_LT(defect_of(*space(RightTrivialised{}), "tau(x) tau(-x) = e"), 1e-14);
}

/// The motions of the line x ↦ a x + b with the wrong sign in the bracket, in Ad, or in dτ.
enum class Fault { none, bracket, adjoint, tangent };

template <Fault fault>
struct LineMaps {
  static constexpr int storage = 2, group = 2, dimension = 2;
  static constexpr const char* name = "Aff1";
  template <class T>
  using Pair = spaces::Numbers<T, 2>;

  template <class T>
  static Pair<T> identity() {
    return {T(1.0), T(0.0)};
  }
  template <class T>
  static Pair<T> product(const Pair<T>& a, const Pair<T>& b) {
    return {a[0] * b[0], a[0] * b[1] + a[1]};
  }
  /// Cayley's: (1 − x/2)⁻¹ (1 + x/2) of the matrix ((x0, x1), (0, 0)).
  template <class T>
  static Pair<T> retract(const Pair<T>& x) {
    const T f = T(1.0) / (T(1.0) - T(0.5) * x[0]);
    return {f * (T(1.0) + T(0.5) * x[0]), f * x[1]};
  }
  template <class T>
  static Pair<T> dtau(const Pair<T>& x, const Pair<T>& v) {
    const T f = T(1.0) / (T(1.0) + T(0.5) * x[0]), g = T(1.0) / (T(1.0) - T(0.5) * x[0]);
    const T turned = fault == Fault::tangent ? -x[1] : x[1];
    return {f * g * v[0], f * (v[1] + T(0.5) * g * turned * v[0])};
  }
  template <class T>
  static Pair<T> adjoint(const Pair<T>& g, const Pair<T>& v) {
    const T shift = g[1] * v[0];
    return {v[0], fault == Fault::adjoint ? g[0] * v[1] + shift : g[0] * v[1] - shift};
  }
  template <class T>
  static Pair<T> bracket(const Pair<T>& v, const Pair<T>& w) {
    const T value = v[0] * w[1] - v[1] * w[0];
    return {T(0.0), fault == Fault::bracket ? -value : value};
  }
  static void normalise(Pair<double>&) {}
  static double part_of_chart(const Pair<double>& x) { return std::abs(x[0]); }  // half-way to the pole
};

TEST(SpaceAxioms, ASpaceOfOnesOwnIsHeldToThemByName) {
  EXPECT_NO_THROW(require_space_axioms(*space(LineMaps<Fault::none>{})));
  testing::expect_misuse([] { require_space_axioms(*space(LineMaps<Fault::bracket>{})); },
                         {"space Aff1", "d Ad = ad, by", "is allowed"});
  testing::expect_misuse([] { require_space_axioms(*space(LineMaps<Fault::adjoint>{})); },
                         {"space Aff1", "dtau_{-x} = Ad dtau_x, by"});
  testing::expect_misuse([] { require_space_axioms(*space(LineMaps<Fault::tangent>{})); },
                         {"space Aff1", "dtau_x by jets, by"});
}

/// dτ against complex steps, an independent way to the derivative: on both sides of where the coefficients
/// change from a series to functions, and at zero.
TEST(SpaceAxioms, TangentMapAgreesWithComplexSteps) {
  using Complex = std::complex<double>;
  using spaces::SE3;
  constexpr double tiny = 1e-150;
  for (const double angle : {0.0, 1e-8, 0.5, 0.999999, 1.000001, 3.0, 3.999999, 4.000001, 5.0}) {
    std::array<double, 6> x{0.6 * angle, 0.0, 0.8 * angle, 0.3, -0.7, 1.1}, v{0.4, -1.2, 0.7, 0.5, 0.9, -0.3};
    std::array<Complex, 6> moved;
    for (std::size_t i = 0; i < 6; ++i) moved[i] = {x[i], tiny * v[i]};
    const auto there = SE3::retract(moved);
    const auto g = SE3::retract(x);
    const Vector at = Vector::Map(g.data(), 7);
    const Vector rate =
        space(SE3{})->storage_derivative(at, Vector::Zero(6)) * Vector::Map(SE3::dtau(x, v).data(), 6);
    for (std::size_t i = 0; i < 7; ++i)
      EXPECT_NEAR(there[i].imag() / tiny, rate[static_cast<Eigen::Index>(i)], 2e-15) << angle << " " << i;
  }
}

TEST(SpaceAxioms, StumpffFunctionsAndTheirDerivativesAreContinuousWhereTheSeriesEnds) {
  for (const double s : {1.0, 16.0})
    for (int k = 0; k <= 5; ++k) {
      const auto below = stumpff(k, Jet<1, 2>::variable(s * (1.0 - 1e-13), 0)),
                 above = stumpff(k, Jet<1, 2>::variable(s * (1.0 + 1e-13), 0));
      EXPECT_NEAR(below.value(), above.value(), 1e-12) << k;
      EXPECT_NEAR(below.gradient(0), above.gradient(0), 1e-12) << k;
      EXPECT_NEAR(below.hessian(0, 0), above.hessian(0, 0), 1e-12) << k;
    }
}

TEST(Space, IsAProductOfItsFactorsInOrder) {
  const auto product = space(spaces::SO3{}, spaces::R<2>{}, spaces::S2{});
  EXPECT_EQ(product->name(), "SO3 x R2 x S2");
  EXPECT_EQ(product->storage_size(), 10);
  EXPECT_EQ(product->dimension(), 7);
  EXPECT_EQ(product->group_dimension(), 8);
  EXPECT_EQ(product->turns(), std::vector<int>{7});
  const Vector e = product->identity();
  EXPECT_EQ(e, (Vector(10) << 1, 0, 0, 0, 0, 0, 1, 0, 0, 0).finished());
  // a quarter turn about the third axis
  const double half = std::acos(-1.0) / 4.0;
  const Vector q = product->moved(e, (Vector(7) << 0, 0, 2.0 * half, 0.5, -2.0, 0, 0).finished());
  EXPECT_NEAR(q[0], std::cos(half), 1e-15);
  EXPECT_NEAR(q[3], std::sin(half), 1e-15);
  EXPECT_EQ(q[4], 0.5);
  EXPECT_EQ(q[5], -2.0);
  testing::expect_misuse([] { Space none({}); }, {"one factor or more"});
}

}  // namespace
}  // namespace diracstep
