/// Which steps are members of the discrete Dirac structure, by how much others are off, and the maps and
/// functions of (4.4) to (7.19) that the structures are made of.
#include <gtest/gtest.h>

#include <diracstep/core/dirac/discrete_vector_field.hpp>
#include <diracstep/core/methods/registry.hpp>

#include "misuse.hpp"
#include "scenes.hpp"
#include "trajectories.hpp"

namespace diracstep {
namespace {

using testing::differential;
using testing::h;
using testing::Trajectory;
using testing::trajectory_of;

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
  const Interval interval{0.0, h};
  const auto row_at = [&](double time, const Vector& q) {
    ConstraintsAtPoint rows(scene->constraints, scene->dimension());
    rows.evaluate(time, q);
    Vector covector = Vector::Zero(q.size());
    rows.add_annihilator(Vector::Ones(scene->rows()), covector);
    return covector;
  };
  const Vector other = Vector::LinSpaced(scene->dimension(), 1.0, 2.0);
  const auto plus = [&](const Vector& change) {
    return structure.plus(interval, {t.q[0], t.plus[0]}, {t.q[1], t.plus[1] + change},
                          differential(*s, t, 0, true));
  };
  const auto minus = [&](const Vector& change) {
    return structure.minus(interval, {t.q[0], t.minus[0] + change}, {t.q[1], t.minus[1]},
                           differential(*s, t, 0, false));
  };
  for (const auto& [in_class, outside] : {std::pair(plus(row_at(interval.end(), t.q[1])), plus(other)),
                                          std::pair(minus(row_at(interval.start, t.q[0])), minus(other))}) {
    EXPECT_GT(in_class.annihilator, 0.1);
    EXPECT_LT(in_class.annihilator_of_class, 5e-12);
    EXPECT_GT(outside.annihilator_of_class, 0.1);
  }
}

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
  const Interval interval{0.0, h};
  const auto l_d = Registry::with_built_ins().method("type1/midpoint").generating_function(*scene);
  Columns y(3, 2);
  y.col(0) = scene->start.q;
  y.col(1) = scene->start.q + h * scene->start.v;
  const DiscreteLagrangianAt l = evaluate(*l_d, interval, y);
  // H_{d±} as the generating functions of types 2 and 3, whose own arguments are found by the transform.
  for (const bool plus : {true, false}) {
    const auto h_d = Registry::with_built_ins()
                         .method(plus ? "type2/legendre(type1/midpoint)" : "type3/legendre(type1/midpoint)")
                         .generating_function(*scene);
    Columns z(3, 3);
    z.col(0) = plus ? l.q0 : legendre_minus(l).p;
    z.col(1) = plus ? legendre_plus(l).p : l.q1;
    z.col(2) = (plus ? l.q1 : l.q0) + Vector::Constant(3, 0.01);
    ASSERT_TRUE(make_stationary(*h_d, interval, z));
    EXPECT_NEAR(h_d->value(interval, z), plus ? discrete_hamiltonian_plus(l) : discrete_hamiltonian_minus(l),
                1e-13);
    EXPECT_LT((z.col(2) - (plus ? l.q1 : l.q0)).norm(), 1e-13);
  }
}

}  // namespace
}  // namespace diracstep
