/// The sums of the principles, on curves that solve nothing and on trajectories.
#include <gtest/gtest.h>

#include <diracstep/core/dirac/discrete_action.hpp>
#include <diracstep/core/methods/registry.hpp>

#include "differences.hpp"
#include "scenes.hpp"
#include "trajectories.hpp"

namespace diracstep {
namespace {

using testing::h;
using testing::random_variation;
using testing::sum_derivative;
using testing::Trajectory;
using testing::trajectory_of;
using testing::Variation;

/// A curve that solves nothing, q¹_k ≠ q⁰_{k+1}.
DiscreteCurve arbitrary_curve() {
  std::srand(41);
  DiscreteCurve curve{0.0, h, {}, {}, {}};
  const Vector middle = testing::unconstrained()->start.q;
  for (int k = 0; k < 4; ++k) {
    curve.q0.emplace_back(middle + 0.1 * Vector::Random(3));
    curve.q1.emplace_back(middle + 0.1 * Vector::Random(3));
  }
  for (int k = 0; k < 5; ++k) curve.p.emplace_back(Vector::Random(3));
  return curve;
}

DiscreteLagrangianAt at_step(GeneratingFunction& l_d, const DiscreteCurve& curve, std::size_t k) {
  Columns y(3, 2);
  y << curve.q0[k], curve.q1[k];
  return evaluate(l_d, curve.interval(k), y);
}

/// (7.2), (8.1): δΣ = Σ (D1L_d + p_k)·δq⁰_k + (D2L_d − p_{k+1})·δq¹_k − (q¹_k − q⁰_{k+1})·δp_{k+1}, on any
/// curve.
TEST(DiscreteAction, VariationOfTheHamiltonPontryaginSumIsThatOfThePaper) {
  const auto scene = testing::unconstrained();
  const auto l_d = Registry::with_built_ins().method("type1/midpoint").generating_function(*scene);
  const DiscreteCurve curve = arbitrary_curve();
  const Variation v = random_variation(*scene, curve, GeneratingType::one);
  double expected = 0.0, size = 0.0;
  for (std::size_t k = 0; k < curve.steps(); ++k) {
    const DiscreteLagrangianAt l = at_step(*l_d, curve, k);
    const bool inner = k + 1 < curve.steps();
    const double at_start = (l.d1 + curve.p[k]).dot(v.q0[k]), at_end = (l.d2 - curve.p[k + 1]).dot(v.q1[k]);
    const double curve_condition = inner ? -(curve.q1[k] - curve.q0[k + 1]).dot(v.p[k + 1]) : 0.0;
    expected += at_start + at_end + curve_condition;
    size += std::abs(at_start) + std::abs(at_end) + std::abs(curve_condition);
  }
  EXPECT_GT(size, 1.0);
  EXPECT_NEAR(sum_derivative(*l_d, curve, v), expected, 1e-8);
}

/// (7.17), (7.19): the sums are Σ G_{d±} − E_{d±}, up to what stands at the fixed ends.
TEST(DiscreteAction, HamiltonPontryaginSumIsThatOfMomentumFunctionsLessEnergies) {
  const auto l_d =
      Registry::with_built_ins().method("type1/midpoint").generating_function(*testing::unconstrained());
  const DiscreteCurve curve = arbitrary_curve();
  double plus = 0.0, minus = 0.0;
  const std::size_t last = curve.steps() - 1;
  for (std::size_t k = 0; k < curve.steps(); ++k) {
    const DiscreteLagrangianAt l = at_step(*l_d, curve, k);
    plus -= generalised_energy_plus(l, curve.p[k + 1]);
    minus -= generalised_energy_minus(l, curve.p[k]);
    if (k < last)
      plus += momentum_function_plus({curve.q0[k], curve.p[k]}, {curve.q0[k + 1], curve.p[k + 1]});
    if (k > 0) minus += momentum_function_minus({curve.q1[k - 1], curve.p[k]}, {curve.q1[k], curve.p[k + 1]});
  }
  plus += curve.p.back().dot(curve.q1.back());
  minus -= curve.p.front().dot(curve.q0.front());
  const double sum = hamilton_pontryagin_sum(*l_d, curve);
  EXPECT_NEAR(plus, sum, 1e-13);
  EXPECT_NEAR(minus, sum, 1e-13);
  // ⟨p, q¹ − q⁰⟩ counts with a minus sign, and each of its terms.
  for (std::size_t k = 1; k <= last; ++k) {
    DiscreteCurve other = curve;
    other.p[k] += Vector::Unit(3, 0);
    EXPECT_NEAR(hamilton_pontryagin_sum(*l_d, other) - sum, -(curve.q1[k - 1] - curve.q0[k])[0], 1e-14);
  }
}

/// K_{d±} (6.16)–(6.19) is where E_{d±} is stationary by q1, or q0: at p1 = D2L_d, or p0 = −D1L_d.
TEST(DiscreteAction, GeneralisedEnergiesAreStationaryOnTheImageOfTheLegendreTransforms) {
  const auto l_d =
      Registry::with_built_ins().method("type1/midpoint").generating_function(*testing::unconstrained());
  const DiscreteCurve curve = arbitrary_curve();
  const DiscreteLagrangianAt l = at_step(*l_d, curve, 0);
  const auto slope = [&](bool plus, const Vector& p) {
    const auto energy = [&](const Vector& q) {
      DiscreteCurve moved = curve;
      (plus ? moved.q1 : moved.q0)[0] = q;
      const DiscreteLagrangianAt at = at_step(*l_d, moved, 0);
      return Vector::Constant(1, plus ? generalised_energy_plus(at, p) : generalised_energy_minus(at, p));
    };
    return Vector(testing::difference_jacobian(energy, plus ? l.q1 : l.q0).transpose());
  };
  EXPECT_LT(slope(true, legendre_plus(l).p).lpNorm<Eigen::Infinity>(), 1e-7);
  EXPECT_LT(slope(false, legendre_minus(l).p).lpNorm<Eigen::Infinity>(), 1e-7);
  const Vector more = Vector{{0.3, -0.2, 0.1}};
  EXPECT_LT((slope(true, legendre_plus(l).p + more) - more).lpNorm<Eigen::Infinity>(), 1e-7);
  EXPECT_LT((slope(false, legendre_minus(l).p + more) + more).lpNorm<Eigen::Infinity>(), 1e-7);
}

TEST(DiscreteAction, SumsOfLagrangianAndHamiltonianAgreeOnATrajectory) {
  const auto scene = testing::nonholonomic();
  const auto make = [&](const char* name) {
    return Registry::with_built_ins().method(name).generating_function(*scene);
  };
  const Trajectory t = trajectory_of(scene, {.method = "type1/midpoint", .step = h});
  const auto curve = curve_of(0.0, h, t.q, t.plus), curve_minus = curve_of(0.0, h, t.q, t.minus);
  const double sum = hamilton_pontryagin_sum(*make("type1/midpoint"), curve);
  EXPECT_NEAR(phase_space_sum(*make("type2/legendre(type1/midpoint)"), curve), sum, 1e-12);
  EXPECT_NEAR(phase_space_sum(*make("type3/legendre(type1/midpoint)"), curve_minus), sum, 1e-12);
}

}  // namespace
}  // namespace diracstep
