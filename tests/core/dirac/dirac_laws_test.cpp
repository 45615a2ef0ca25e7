/// What must hold for every registered method on every constraint class; a new method is covered by being
/// registered.  Where rows act inside the step, its membership is in the Dirac structure of the stage space:
/// tests/validation/laws holds that, for every method and class as well.
#include <gtest/gtest.h>

#include <diracstep/core/dirac/discrete_action.hpp>
#include <diracstep/core/dirac/discrete_vector_field.hpp>
#include <diracstep/core/runs/run.hpp>

#include "differences.hpp"
#include "methods.hpp"
#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"
#include "trajectories.hpp"

namespace diracstep {
namespace {

using testing::basis_of_distribution;
using testing::differential;
using testing::h;
using testing::join;
using testing::random_variation;
using testing::samples_of;
using testing::SingleStep;
using testing::steps;
using testing::sum_derivative;
using testing::Trajectory;
using testing::trajectory_of;
using testing::Variation;

class DiracLaws : public ::testing::TestWithParam<std::string> {
 protected:
  Method method() const { return Registry::with_built_ins().method(GetParam()); }
  IntegratorOptions options() const { return {.method = GetParam(), .step = h}; }
};

/// Laws of some of the methods.
class LawsOfTransforms : public DiracLaws {};
class LawsOfTypesOneToThree : public DiracLaws {};  ///< no structure, principle or force is stated for type 4
class LawsOfOrderOne : public DiracLaws {};

/// All but the damping family, which has no generating function; its laws are in steps/radau_test.cpp.
template <class Condition>
std::vector<std::string> methods_where(Condition holds) {
  std::vector<std::string> names = testing::every_method();
  const Registry registry = Registry::with_built_ins();
  std::erase_if(names, [&](const std::string& name) {
    const MethodInfo info = registry.method(name).info;
    return info.damped || !holds(info);
  });
  return names;
}

using laws::generating_function_determines;

TEST_P(DiracLaws, UnconstrainedStepIsSymplectic) {
  EXPECT_LT(laws::symplecticity_defect(method(), *testing::unconstrained(), h), 1e-10);
}

TEST_P(DiracLaws, TakeTheStepOfTheGeneratingFunctionThatTheyState) {
  const Method stated = method();
  std::vector<std::shared_ptr<const Scene>> scenes{testing::driven()};
  for (const auto& scene : testing::every_constraint_class()) {
    scenes.push_back(scene);
    if (stated.info.type != GeneratingType::four) scenes.push_back(testing::forced(scene));
  }
  int compared = 0;
  for (const auto& scene : scenes) {
    if (!generating_function_determines(stated, *scene)) continue;
    EXPECT_LT(laws::stated_step_defect(stated, *scene, h), 1e-13) << scene->name;
    ++compared;
  }
  EXPECT_GE(compared, 1);
}

TEST_P(LawsOfTransforms, GiveTheTrajectoryOfTheirDiscreteLagrangian) {
  const std::string original = GetParam().substr(15, GetParam().size() - 16);
  for (const auto& scene : testing::every_constraint_class()) {
    const auto transformed = samples_of(scene, options(), steps);
    const auto expected = samples_of(scene, {.method = original, .step = h}, steps);
    for (std::size_t k = 0; k < expected.size(); ++k) {
      EXPECT_LT((transformed[k].q - expected[k].q).lpNorm<Eigen::Infinity>(), 2e-13)
          << scene->name << " " << k;
      EXPECT_LT((transformed[k].p - expected[k].p).lpNorm<Eigen::Infinity>(), 5e-12)
          << scene->name << " " << k;
    }
  }
}

TEST_P(DiracLaws, PlusAndMinusSystemsShareConfigurationsAndDifferByTheImpulse) {
  for (const auto& scene : testing::every_constraint_class()) {
    const auto plus = samples_of(scene, options(), steps, Momentum::plus);
    const auto minus = samples_of(scene, options(), steps, Momentum::minus);
    SingleStep step(method(), *scene);
    for (std::size_t k = 0; k + 1 < plus.size(); ++k) {
      EXPECT_LT((plus[k].q - minus[k].q).lpNorm<Eigen::Infinity>(), 1e-14) << scene->name;
      const auto end = step({plus[k].time, h}, plus[k].q, plus[k].p, plus[k].v);
      Vector expected = plus[k].p;
      if (scene->rows() > 0) {
        ConstraintsAtPoint rows(scene->constraints, scene->dimension());
        rows.evaluate(plus[k].time, plus[k].q);
        rows.add_annihilator(end.impulse, expected);
        EXPECT_GT((minus[k].p - plus[k].p).norm(), 1e-6) << "the impulse vanishes, so nothing is tested";
      }
      EXPECT_LT((minus[k].p - expected).lpNorm<Eigen::Infinity>(), 5e-12) << scene->name;
    }
  }
}

TEST_P(LawsOfTypesOneToThree, EveryStepIsAMemberOfTheDiscreteDiracStructure) {
  const auto type = method().info.type.value();
  for (const auto& scene : testing::every_constraint_class()) {
    if (!generating_function_determines(method(), *scene)) continue;
    const auto s = method().generating_function(*scene);
    const Trajectory t = trajectory_of(scene, options());
    DiscreteDiracStructure structure(scene->constraints, scene->dimension(), method().info.constraint_rule);
    const auto memberships_of = [&](std::size_t k, const Vector& q1) {
      const Interval step{static_cast<double>(k) * h, h};
      std::vector<Membership> memberships;
      if (type != GeneratingType::three)
        memberships.push_back(
            structure.plus(step, {t.q[k], t.plus[k]}, {q1, t.plus[k + 1]}, differential(*s, t, k, true)));
      if (type != GeneratingType::two)
        memberships.push_back(
            structure.minus(step, {t.q[k], t.minus[k]}, {q1, t.minus[k + 1]}, differential(*s, t, k, false)));
      return memberships;
    };
    for (std::size_t k = 0; k < steps; ++k)
      for (const Membership& m : memberships_of(k, t.q[k + 1])) {
        EXPECT_LT(m.constraint, 1e-14) << scene->name << " " << k;
        EXPECT_LT(m.annihilator, 5e-12) << scene->name << " " << k;
        EXPECT_LE(m.annihilator_of_class, m.annihilator + 1e-14) << scene->name << " " << k;
      }
    for (const Membership& m : memberships_of(0, t.q[1] + Vector::Constant(3, 1e-3))) {
      if (scene->rows() > 0) {
        EXPECT_GT(m.constraint, 1e-4) << scene->name << ": a wrong end passes";
      }
      EXPECT_GT(m.annihilator, 9e-4) << scene->name << ": a wrong end passes";
      EXPECT_GT(m.annihilator_of_class, 9e-4) << scene->name << ": a wrong end passes";
    }
  }
}

TEST_P(LawsOfTypesOneToThree, TrajectoriesAreStationaryForTheirPrinciple) {
  const auto type = method().info.type.value();
  for (const auto& scene : testing::every_constraint_class()) {
    if (!generating_function_determines(method(), *scene)) continue;
    const auto s = method().generating_function(*scene);
    Trajectory t = trajectory_of(scene, options());
    DiscreteDiracStructure structure(scene->constraints, scene->dimension(), method().info.constraint_rule);
    const auto residual = [&](const std::vector<Vector>& p) {
      return stationarity_residual(*s, structure, curve_of(0.0, h, t.q, p));
    };
    if (type != GeneratingType::three) {
      EXPECT_LT(residual(t.plus), 5e-12) << scene->name;
    }
    if (type != GeneratingType::two) {
      EXPECT_LT(residual(t.minus), 5e-12) << scene->name;
    }
    t.q[steps / 2] += Vector::Constant(3, 1e-3);
    EXPECT_GT(residual(type == GeneratingType::three ? t.minus : t.plus), 1e-5) << "a wrong curve passes";
  }
}

/// The principles (7.1), (8.1), (8.2), (9.10), (9.11), (10.1), (10.3) themselves: the sums are varied.
TEST_P(LawsOfTypesOneToThree, TheSumOfATrajectoryChangesToSecondOrderOnly) {
  const auto type = method().info.type.value();
  for (const auto& scene : testing::every_constraint_class()) {
    if (!generating_function_determines(method(), *scene)) continue;
    const auto s = method().generating_function(*scene);
    const Trajectory t = trajectory_of(scene, options());
    std::srand(31);
    for (const auto* p : {&t.plus, &t.minus}) {
      if (p == &t.plus ? type == GeneratingType::three : type == GeneratingType::two) continue;
      const DiscreteCurve curve = testing::first_steps(curve_of(0.0, h, t.q, *p), 4);
      Variation v = random_variation(*scene, curve, type);
      EXPECT_NEAR(sum_derivative(*s, curve, v), 0.0, 2e-10) << scene->name;
      // A variation off Δ_Q does change it, by the impulse; so do other momenta.
      DiscreteCurve other = curve;
      other.p[2] += Vector{{0.1, -0.2, 0.3}};
      v.q0[2] = v.q1[1] = basis_of_distribution(*scene, 2.0 * h, curve.q0[2]).col(0);
      if (type == GeneratingType::one) v.q1[1].setZero();
      EXPECT_GT(std::abs(sum_derivative(*s, other, v)), 1e-3) << scene->name << ": nothing is tested";
      if (scene->rows() == 0) continue;
      v = random_variation(*scene, curve, type);
      // (+) momenta differ from −D1L_d by the impulse, (−) momenta from D2L_d.
      v.q0[2].setConstant(type == GeneratingType::one && p == &t.minus ? 0.0 : 1.0);
      v.q1[1].setConstant(type == GeneratingType::one && p == &t.plus ? 0.0 : 1.0);
      EXPECT_GT(std::abs(sum_derivative(*s, curve, v)), 1e-5) << scene->name << ": the rows do nothing";
    }
  }
}

/// (iii) of Theorems 8.4 and 10.4.
TEST_P(LawsOfTypesOneToThree, TrajectoriesAreIntegralCurvesOfTheDiscreteVectorFields) {
  for (const auto& scene : testing::every_constraint_class()) {
    if (!generating_function_determines(method(), *scene)) continue;
    const auto s = method().generating_function(*scene);
    const Trajectory t = trajectory_of(scene, options());
    DiscreteDiracStructure structure(scene->constraints, scene->dimension(), method().info.constraint_rule);
    for (std::size_t k = 1; k < 4; ++k) {
      const Interval step{static_cast<double>(k) * h, h};
      const auto plus =
          discrete_vector_field_plus(*s, structure, step, {t.q[k], t.plus[k]}, {t.q[k], t.plus[k]});
      ASSERT_TRUE(plus) << scene->name;
      EXPECT_LT((plus->q - t.q[k + 1]).lpNorm<Eigen::Infinity>(), 1e-12) << scene->name;
      EXPECT_LT((plus->p - t.plus[k + 1]).lpNorm<Eigen::Infinity>(), 1e-11) << scene->name;
      const auto minus = discrete_vector_field_minus(*s, structure, step, {t.q[k + 1], t.minus[k + 1]},
                                                     {t.q[k + 1], t.minus[k + 1]});
      ASSERT_TRUE(minus) << scene->name;
      EXPECT_LT((minus->q - t.q[k]).lpNorm<Eigen::Infinity>(), 1e-12) << scene->name;
      EXPECT_LT((minus->p - t.minus[k]).lpNorm<Eigen::Infinity>(), 1e-11) << scene->name;
    }
  }
}

/// Error against a run with a far finer step, maximum norm over q and projected p at t = 1.
double error_at(const std::shared_ptr<const Scene>& scene, const IntegratorOptions& options,
                const Sample& reference) {
  const StepGrid grid = fit_steps(0.0, 1.0, options.step);
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(), options);
  EXPECT_TRUE(run_steps(integrator, grid.steps, Momentum::projected, 1, nullptr).ok());
  Sample end;
  EXPECT_TRUE(integrator.sample(Momentum::projected, end).ok());
  return (join(end.q, end.p) - join(reference.q, reference.p)).lpNorm<Eigen::Infinity>();
}

double measured_order(const std::shared_ptr<const Scene>& scene, IntegratorOptions options, double coarse) {
  const auto reference = samples_of(scene, {.method = "type1/gl:6", .step = 1.0 / 32.0}, 32).back();
  options.step = coarse;
  const double first = error_at(scene, options, reference);
  options.step = coarse / 2.0;
  return std::log2(first / error_at(scene, options, reference));
}

/// A step small enough for the order to show, with an error that lies above round-off.
double step_to_measure(int order) {
  if (order <= 2) return 1.0 / 160.0;
  return order <= 4 ? 1.0 / 20.0 : order <= 6 ? 1.0 / 6.0 : 1.0 / 3.0;
}

TEST_P(DiracLaws, MeasuredOrderIsTheStatedOne) {
  const int stated = method().info.order;
  for (const auto& scene : testing::every_constraint_class()) {
    const double order = measured_order(scene, options(), step_to_measure(stated));
    EXPECT_NEAR(order, stated, stated <= 2 ? 0.1 : 0.4) << scene->name;
  }
}

TEST_P(LawsOfTypesOneToThree, ForcesKeepTheStatedOrder) {
  for (const auto& scene : testing::every_constraint_class()) {
    const int stated = method().info.order;
    const double order = measured_order(testing::forced(scene), options(), step_to_measure(stated));
    EXPECT_NEAR(order, stated, stated <= 2 ? 0.1 : 0.4) << scene->name;
  }
}

TEST_P(LawsOfOrderOne, SymmetrisedWithItsAdjointTheOrderIsTwo) {
  for (const auto& scene : testing::every_constraint_class()) {
    IntegratorOptions symmetric = options();
    symmetric.order = 2;
    EXPECT_NEAR(measured_order(scene, symmetric, 1.0 / 40.0), 2.0, 0.1) << scene->name;
  }
}

TEST_P(DiracLaws, AdjointStepIsTheInverseOfTheBackwardStep) {
  const Method original = method(), adjoint = Registry::with_built_ins().adjoint_of(original);
  for (const auto& scene : testing::every_constraint_class()) {
    // From one projected point to the next with the step, and back with its adjoint run backwards.
    const Sample start = samples_of(scene, options(), 0).front();
    const auto there = samples_of(scene, options(), 1).back();
    auto back = std::make_shared<Scene>(*scene);
    back->start = {0.0, there.q, there.v};
    const auto again = samples_of(back, {.method = adjoint.info.name, .step = -h}, 1).back();
    EXPECT_LT((again.q - start.q).lpNorm<Eigen::Infinity>(), 1e-13) << scene->name;
    EXPECT_LT((again.p - start.p).lpNorm<Eigen::Infinity>(), 5e-12) << scene->name;
  }
}

TEST_P(DiracLaws, HolonomicRowsDoNotDrift) {
  const auto scene = testing::mixed();
  const auto samples = samples_of(scene, options(), 400);
  Vector phi(1);
  scene->constraints.front()->position(0.0, samples.back().q, phi);
  EXPECT_LT(std::abs(phi[0]), 1e-14);
}

const auto by_name = [](const auto& test) { return testing::test_name(test.param); };
INSTANTIATE_TEST_SUITE_P(EveryMethod, DiracLaws,
                         ::testing::ValuesIn(methods_where([](const auto&) { return true; })), by_name);
INSTANTIATE_TEST_SUITE_P(EveryTransform, LawsOfTransforms,
                         ::testing::ValuesIn(methods_where([](const auto& m) {
                           return m.name.find("legendre") != std::string::npos;
                         })),
                         by_name);
INSTANTIATE_TEST_SUITE_P(EveryMethod, LawsOfTypesOneToThree,
                         ::testing::ValuesIn(methods_where([](const auto& m) {
                           return m.type != GeneratingType::four;
                         })),
                         by_name);
INSTANTIATE_TEST_SUITE_P(EveryMethod, LawsOfOrderOne,
                         ::testing::ValuesIn(methods_where([](const auto& m) { return m.order == 1; })),
                         by_name);

}  // namespace
}  // namespace diracstep
