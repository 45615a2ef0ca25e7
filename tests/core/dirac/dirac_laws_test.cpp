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

namespace diracstep {
namespace {

using testing::join;
using testing::samples_of;
using testing::SingleStep;

constexpr double h = 0.05;
constexpr long steps = 20;

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

/// The trajectory with both momentum representatives.
struct Trajectory {
  std::vector<Vector> q, plus, minus;
};

Trajectory trajectory_of(const std::shared_ptr<const Scene>& scene, const IntegratorOptions& options) {
  Trajectory t;
  for (const Sample& s : samples_of(scene, options, steps, Momentum::plus)) {
    t.q.push_back(s.q);
    t.plus.push_back(s.p);
  }
  for (const Sample& s : samples_of(scene, options, steps, Momentum::minus)) t.minus.push_back(s.p);
  return t;
}

/// The covector that a method's S gives over step k: D^±L_d or dH_{d±}, inner columns stationary.
Covector differential(GeneratingFunction& s, const Trajectory& t, std::size_t k, bool plus) {
  const GraphOf graph = graph_of(s.type());
  const Interval step{static_cast<double>(k) * h, h};
  Columns y(s.dimension(), s.columns()), g(s.dimension(), s.columns());
  y.col(0) = graph.starts_from_position ? t.q[k] : t.minus[k];
  y.col(1) = graph.ends_at_position ? t.q[k + 1] : t.plus[k + 1];
  if (s.inner_columns() > 0) {
    s.guess_inner(step, t.q[k], t.minus[k], (t.q[k + 1] - t.q[k]) / h, y.rightCols(s.inner_columns()));
    EXPECT_TRUE(make_stationary(s, step, y));
  }
  s.gradient(step, y, g);
  Covector d{y.col(0), y.col(1), g.col(0), g.col(1)};
  if (s.type() != GeneratingType::one) return d;
  return plus ? gamma_plus(d) : gamma_minus(d);
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

/// Moved by an element of the annihilator at its far end, a (+) or (−) step is a member in the sense of
/// (4.28) and (8.3), which look at momentum classes, and not in that of equal momenta; moved by another
/// covector, in neither.
TEST(DiscreteDiracStructure, ReadsTheBasePointAsAMomentumOrAsItsClass) {
  const auto scene = testing::every_constraint_class().at(1);
  ASSERT_GT(scene->rows(), 0);
  const auto method = Registry::with_built_ins().method("type1/midpoint");
  DiscreteDiracStructure structure(scene->constraints, scene->dimension(), method.info.constraint_rule);
  const Trajectory t = trajectory_of(scene, {.method = "type1/midpoint", .step = h});
  const auto s = method.generating_function(*scene);
  const Interval step{0.0, h};
  const auto row_at = [&](double time, const Vector& q) {
    ConstraintsAtPoint rows(scene->constraints, scene->dimension());
    rows.evaluate(time, q);
    Vector covector = Vector::Zero(q.size());
    rows.add_annihilator(Vector::Ones(scene->rows()), covector);
    return covector;
  };
  const Vector other = Vector::LinSpaced(scene->dimension(), 1.0, 2.0);
  const auto plus = [&](const Vector& change) {
    return structure.plus(step, {t.q[0], t.plus[0]}, {t.q[1], t.plus[1] + change},
                          differential(*s, t, 0, true));
  };
  const auto minus = [&](const Vector& change) {
    return structure.minus(step, {t.q[0], t.minus[0] + change}, {t.q[1], t.minus[1]},
                           differential(*s, t, 0, false));
  };
  for (const auto& [in_class, outside] : {std::pair(plus(row_at(step.end(), t.q[1])), plus(other)),
                                          std::pair(minus(row_at(step.start, t.q[0])), minus(other))}) {
    EXPECT_GT(in_class.annihilator, 0.1);
    EXPECT_LT(in_class.annihilator_of_class, 5e-12);
    EXPECT_GT(outside.annihilator_of_class, 0.1);
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

/// A basis of Δ_Q at a configuration.
Columns basis_of_distribution(const Scene& scene, double t, const Vector& q) {
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  rows.evaluate(t, q);
  if (scene.rows() == 0) return Columns::Identity(q.size(), q.size());
  return rows.pattern().full(rows.coefficients()).fullPivLu().kernel();
}

/// Variations of a curve: those of a principle keep the ends, lie in Δ_Q and, for a sum on the phase space,
/// move q¹_k together with q⁰_{k+1}.
struct Variation {
  std::vector<Vector> q0, q1, p;
};

Vector admissible(const Scene& scene, double t, const Vector& q) {
  const Columns basis = basis_of_distribution(scene, t, q);
  return basis * Vector::Random(basis.cols());
}

Variation random_variation(const Scene& scene, const DiscreteCurve& curve, GeneratingType type) {
  Variation v{curve.q0, curve.q1, curve.p};
  const std::size_t n = curve.steps();
  for (Vector& p : v.p) p = Vector::Random(p.size());
  for (std::size_t k = 0; k < n; ++k) {
    v.q0[k] = admissible(scene, curve.interval(k).start, curve.q0[k]);
    v.q1[k] = admissible(scene, curve.interval(k).end(), curve.q1[k]);
  }
  v.q0.front().setZero();
  v.q1.back().setZero();
  if (type != GeneratingType::one)
    for (std::size_t k = 0; k + 1 < n; ++k) v.q1[k] = v.q0[k + 1];
  return v;
}

DiscreteCurve moved_curve(DiscreteCurve curve, const Variation& v, double e) {
  for (std::size_t k = 0; k < curve.p.size(); ++k) curve.p[k] += e * v.p[k];
  for (std::size_t k = 0; k < curve.steps(); ++k) {
    curve.q0[k] += e * v.q0[k];
    curve.q1[k] += e * v.q1[k];
  }
  return curve;
}

/// The derivative of the sum of S along a variation, by fourth-order differences.
double sum_derivative(GeneratingFunction& s, const DiscreteCurve& curve, const Variation& v) {
  const double e = 1e-3;
  const auto sum = [&](double at) {
    const DiscreteCurve moved = moved_curve(curve, v, at);
    return s.type() == GeneratingType::one ? hamilton_pontryagin_sum(s, moved) : phase_space_sum(s, moved);
  };
  return (8.0 * (sum(e) - sum(-e)) - (sum(2.0 * e) - sum(-2.0 * e))) / (12.0 * e);
}

DiscreteCurve first_steps(DiscreteCurve curve, std::size_t n) {
  curve.q0.resize(n);
  curve.q1.resize(n);
  curve.p.resize(n + 1);
  return curve;
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
      const DiscreteCurve curve = first_steps(curve_of(0.0, h, t.q, *p), 4);
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

/// A method of type 1 and its membership on a step of a scene, with the parts of ((z0,z1),α) changed.
struct ChangedStep {
  explicit ChangedStep(const char* method_name)
      : method(Registry::with_built_ins().method(method_name)),
        scene(testing::nonholonomic()),
        structure(scene->constraints, 3, method.info.constraint_rule),
        t(trajectory_of(scene, {.method = method_name, .step = h})),
        s(method.generating_function(*scene)) {}

  PhasePoint start(bool plus) const { return {t.q[0], plus ? t.plus[0] : t.minus[0]}; }
  PhasePoint end(bool plus) const { return {t.q[1], plus ? t.plus[1] : t.minus[1]}; }
  Covector alpha(bool plus) const { return differential(*s, t, 0, plus); }
  Membership of(const PhasePoint& z0, const PhasePoint& z1, const Covector& a, bool plus) {
    return plus ? structure.plus({0.0, h}, z0, z1, a) : structure.minus({0.0, h}, z0, z1, a);
  }

  Method method;
  std::shared_ptr<const Scene> scene;
  DiscreteDiracStructure structure;
  Trajectory t;
  std::unique_ptr<GeneratingFunction> s;
};

TEST(DiscreteDiracStructure, ResidualsAreTheAmountsByWhichAStepIsOff) {
  ChangedStep of("type1/midpoint");
  const Vector off = Vector{{0.0, 1e-3, 0.0}};  // no element of the annihilator of dx + y dz
  for (const bool plus : {true, false}) {
    const PhasePoint z0 = of.start(plus), z1 = of.end(plus);
    const Covector a = of.alpha(plus);
    EXPECT_LT(of.of(z0, z1, a, plus).annihilator, 1e-12);
    // Every part in turn: the momentum at either end, the components of α, the base point.
    EXPECT_NEAR(of.of({z0.q, z0.p + off}, z1, a, plus).annihilator, 1e-3, 1e-12) << plus;
    EXPECT_NEAR(of.of(z0, {z1.q, z1.p + off}, a, plus).annihilator, 1e-3, 1e-12) << plus;
    EXPECT_NEAR(of.of(z0, z1, {a.x, a.y, a.xi + off, a.eta}, plus).annihilator, 1e-3, 1e-12) << plus;
    EXPECT_NEAR(of.of(z0, z1, {a.x, a.y, a.xi, a.eta + off}, plus).annihilator, 1e-3, 1e-12) << plus;
    EXPECT_NEAR(of.of(z0, z1, {a.x + off, a.y, a.xi, a.eta}, plus).annihilator, 1e-3, 1e-12) << plus;
    EXPECT_NEAR(of.of(z0, z1, {a.x, a.y + off, a.xi, a.eta}, plus).annihilator, 1e-3, 1e-12) << plus;
    // c = (x1 − x0) + (y0 + y1)/2 (z1 − z0)
    const PhasePoint wrong{z1.q + Vector{{1e-3, 0.0, 0.0}}, z1.p};
    EXPECT_NEAR(of.of(z0, wrong, a, plus).constraint, 1e-3, 1e-14) << plus;
    EXPECT_GT(of.of(z0, wrong, a, plus).annihilator, 9e-4) << plus;
  }
}

TEST(DiscreteDiracStructure, StepsByOneSidedRulesAreMembersOfTheContinuousStructure) {
  ChangedStep left("type1/left"), right("type1/right");
  ASSERT_EQ(left.method.info.constraint_rule, StepRule::left);
  ASSERT_EQ(right.method.info.constraint_rule, StepRule::right);
  DiracStructure structure(left.scene->constraints, 3);
  const FlowAndEffort forward = flow_and_effort_plus(left.start(true), left.end(true), left.alpha(true));
  EXPECT_LT(structure.at(0.0, left.t.q[0]).outside(forward.flow, forward.effort), 1e-12);
  EXPECT_GT(structure.at(0.0, left.t.q[1]).outside(forward.flow, forward.effort), 1e-5);
  const FlowAndEffort back = flow_and_effort_minus(right.start(false), right.end(false), right.alpha(false));
  EXPECT_LT(structure.at(h, right.t.q[1]).outside(back.flow, back.effort), 1e-12);
  EXPECT_GT(structure.at(0.0, right.t.q[0]).outside(back.flow, back.effort), 1e-5);
}

TEST(DiscreteVectorFields, WhatHasNoneIsRefusedOrTold) {
  ChangedStep of("type1/midpoint");
  const PhasePoint z = of.start(true), small{Vector::Zero(2), Vector::Zero(2)};
  const auto type_four =
      Registry::with_built_ins().method("type4/legendre(type1/left)").generating_function(*of.scene);
  testing::expect_misuse(
      [&] {
        discrete_vector_field_plus(*type_four, of.structure, {0.0, h}, z, z);
      },
      {"type 4"});
  testing::expect_misuse(
      [&] {
        discrete_vector_field_plus(*of.s, of.structure, {0.0, h}, small, z);
      },
      {"phase space"});
  testing::expect_misuse(
      [&] {
        discrete_vector_field_minus(*of.s, of.structure, {0.0, h}, z, small);
      },
      {"guess"});
  const auto edge = testing::edge_of_the_domain();  // no force beyond x = 1
  const auto s = of.method.generating_function(*edge);
  DiscreteDiracStructure structure({}, 1, StepRule::midpoint);
  const PhasePoint beyond{Vector::Constant(1, 2.0), Vector::Zero(1)};
  EXPECT_FALSE(discrete_vector_field_plus(*s, structure, {0.0, h}, beyond, beyond));
  const auto transformed =
      Registry::with_built_ins().method("type2/legendre(type1/midpoint)").generating_function(*edge);
  Columns y = Columns::Constant(1, 3, 2.0);
  EXPECT_FALSE(make_stationary(*transformed, {0.0, h}, y));
}

/// Divided by h, flow and effort of a step tend to those of the motion: D_{d±} beside D_{Δ_Q}.
TEST(DiscreteDiracStructure, StepsTendToMembersOfTheContinuousStructure) {
  const auto scene = testing::nonholonomic();
  const auto method = Registry::with_built_ins().method("type1/midpoint");
  const auto s = method.generating_function(*scene);
  DiscreteDiracStructure discrete(scene->constraints, 3, method.info.constraint_rule);
  DiracStructure continuous(scene->constraints, 3);
  Vector lq(3), p(3);
  scene->lagrangian->gradient(0.0, scene->start.q, scene->start.v, lq, p);
  const auto outside = [&](double size, bool plus) {
    const PhasePoint z{scene->start.q, p};
    const auto other = plus ? discrete_vector_field_plus(*s, discrete, {0.0, size}, z, z)
                            : discrete_vector_field_minus(*s, discrete, {-size, size}, z, z);
    const PhasePoint z0 = plus ? z : *other, z1 = plus ? *other : z;
    Columns y(3, 2);
    y << z0.q, z1.q;
    const DiscreteLagrangianAt l = evaluate(*s, {plus ? 0.0 : -size, size}, y);
    const FlowAndEffort at = plus ? flow_and_effort_plus(z0, z1, differential_plus(l))
                                  : flow_and_effort_minus(z0, z1, differential_minus(l));
    return continuous.at(0.0, z.q).outside(at.flow / size, at.effort / size);
  };
  for (const bool plus : {true, false}) {
    EXPECT_LT(outside(0.01, plus), 0.02);
    EXPECT_NEAR(outside(0.01, plus) / outside(0.005, plus), 2.0, 0.1);
  }
}

TEST(DiracStructure, MomentumFunctionsAreThePotentialsOfTheSumOfTheOneForms) {
  std::srand(3);
  const auto random_point = [] { return PhasePoint{Vector::Random(4), Vector::Random(4)}; };
  const PhasePoint z0 = random_point(), z1 = random_point(), w0 = random_point(), w1 = random_point();
  const auto pairing = [](const Covector& a, const Vector& x, const Vector& y) {
    return a.xi.dot(x) + a.eta.dot(y);
  };
  const auto moved = [](const PhasePoint& z, const PhasePoint& w, double e) {
    return PhasePoint{z.q + e * w.q, z.p + e * w.p};
  };
  const auto derivative = [&](auto g) {  // exact: the functions are bilinear
    return (g(moved(z0, w0, 1.0), moved(z1, w1, 1.0)) - g(moved(z0, w0, -1.0), moved(z1, w1, -1.0))) / 2.0;
  };
  const double lambda = pairing(discrete_kappa(z0, z1), w0.q, w1.q);
  EXPECT_NEAR(lambda + pairing(omega_flat_plus(z0, z1), w0.q, w1.p), derivative(momentum_function_plus),
              1e-14);
  EXPECT_NEAR(lambda + pairing(omega_flat_minus(z0, z1), w0.p, w1.q), derivative(momentum_function_minus),
              1e-14);
}

TEST(DiracStructure, MapsComposeAsStated) {
  std::srand(4);
  const PhasePoint z0{Vector::Random(2), Vector::Random(2)}, z1{Vector::Random(2), Vector::Random(2)};
  const auto same = [](const Covector& a, const Covector& b) {
    return a.x == b.x && a.y == b.y && a.xi == b.xi && a.eta == b.eta;
  };
  EXPECT_TRUE(same(gamma_plus(discrete_kappa(z0, z1)), omega_flat_plus(z0, z1)));
  EXPECT_TRUE(same(gamma_minus(discrete_kappa(z0, z1)), omega_flat_minus(z0, z1)));
  const PhaseVelocity z{z0.q, z0.p, z1.q, z1.p};
  EXPECT_TRUE(same(gamma(kappa(z)), omega_flat(z)));
}

TEST(DiracStructure, LegendreTransformsAndEnergiesOfADiscreteLagrangian) {
  const auto scene = testing::unconstrained();
  const Interval step{0.0, h};
  const auto l_d = Registry::with_built_ins().method("type1/midpoint").generating_function(*scene);
  Columns y(3, 2);
  y.col(0) = scene->start.q;
  y.col(1) = scene->start.q + h * scene->start.v;
  const DiscreteLagrangianAt l = evaluate(*l_d, step, y);
  // H_{d±} as the generating functions of types 2 and 3, whose own arguments are found by the transform.
  for (const bool plus : {true, false}) {
    const auto h_d = Registry::with_built_ins()
                         .method(plus ? "type2/legendre(type1/midpoint)" : "type3/legendre(type1/midpoint)")
                         .generating_function(*scene);
    Columns z(3, 3);
    z.col(0) = plus ? l.q0 : legendre_minus(l).p;
    z.col(1) = plus ? legendre_plus(l).p : l.q1;
    z.col(2) = (plus ? l.q1 : l.q0) + Vector::Constant(3, 0.01);
    ASSERT_TRUE(make_stationary(*h_d, step, z));
    EXPECT_NEAR(h_d->value(step, z), plus ? discrete_hamiltonian_plus(l) : discrete_hamiltonian_minus(l),
                1e-13);
    EXPECT_LT((z.col(2) - (plus ? l.q1 : l.q0)).norm(), 1e-13);
  }
}

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
