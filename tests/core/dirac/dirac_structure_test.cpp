/// Dirac structures as linear spaces: both forms, D = D^⊥, composition with ports, and what lies in them.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <diracstep/constraints/discrete.hpp>
#include <diracstep/constraints/interconnection.hpp>
#include <diracstep/constraints/kirchhoff.hpp>
#include <diracstep/core/dirac/dirac_structure.hpp>
#include <diracstep/core/system/saddle_point.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "misuse.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

constexpr double structure_tolerance = 2e-14;

void expect_dirac(const FlowEffortSpace& d, int dimension) {
  EXPECT_EQ(d.size(), dimension);
  EXPECT_EQ(d.dimension(), dimension);
  EXPECT_LT(d.isotropy_defect(), structure_tolerance);
  EXPECT_LT(d.maximality_defect(), structure_tolerance);
  EXPECT_EQ(d.orthogonal().dimension(), dimension);
  EXPECT_LT(d.outside(d.orthogonal()), structure_tolerance);
  EXPECT_LT(d.orthogonal().outside(d), structure_tolerance);
}

void expect_equal(const FlowEffortSpace& a, const FlowEffortSpace& b,
                  double tolerance = structure_tolerance) {
  EXPECT_EQ(a.dimension(), b.dimension());
  EXPECT_LT(a.outside(b), tolerance);
  EXPECT_LT(b.outside(a), tolerance);
}

Columns one_forms_of(const Scene& scene, double t, const Vector& q) {
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  rows.evaluate(t, q);
  return rows.pattern().full(rows.coefficients());
}

/// D_{Δ_Q} from the definition (4.4): all pairs (X, Ω♭(X) + (Aᵀλ, 0)) with A q̇ = 0.
FlowEffortSpace structure_by_definition(const Columns& a) {
  const Eigen::Index n = a.cols();
  const Columns k = a.rows() == 0 ? Columns(Columns::Identity(n, n)) : Columns(a.fullPivLu().kernel());
  const Eigen::Index r = n - k.cols();
  Columns flows = Columns::Zero(2 * n, k.cols() + n + a.rows()), efforts = flows;
  flows.topLeftCorner(n, k.cols()) = efforts.bottomLeftCorner(n, k.cols()) = k;
  flows.block(n, k.cols(), n, n).setIdentity();
  efforts.block(0, k.cols(), n, n) = -Columns::Identity(n, n);
  efforts.topRightCorner(n, a.rows()) = a.transpose();
  EXPECT_LE(r, a.rows());
  return FlowEffortSpace::image_of(flows, efforts);
}

std::vector<std::shared_ptr<const Scene>> structure_scenes() {
  return {testing::unconstrained(), testing::nonholonomic(), testing::holonomic_sphere(),
          testing::mixed(),         testing::driven(),       testing::degenerate_circuit()};
}

TEST(FlowEffortSpace, BothFormsDescribeTheSameSpace) {
  std::srand(11);
  const Columns f = Columns::Random(3, 4), e = Columns::Random(3, 4);
  const FlowEffortSpace d = FlowEffortSpace::kernel_of(f, e);
  EXPECT_EQ(d.size(), 4);
  EXPECT_EQ(d.dimension(), 5);
  EXPECT_LT((f * d.image_flows() + e * d.image_efforts()).cwiseAbs().maxCoeff(), 1e-14);
  const FlowEffortSpace again = FlowEffortSpace::image_of(d.image_flows(), d.image_efforts());
  expect_equal(d, again);
  EXPECT_LT((again.kernel_flows() * d.image_flows() + again.kernel_efforts() * d.image_efforts()).norm(),
            1e-14);
  EXPECT_GT(d.outside(Vector::Ones(4), Vector::Ones(4)), 1e-2) << "(1, 1) is no member of a random space";
}

TEST(FlowEffortSpace, TheOrthogonalIsWhatThePairingGivesZeroWith) {
  std::srand(12);
  const FlowEffortSpace d = FlowEffortSpace::image_of(Columns::Random(4, 3), Columns::Random(4, 3));
  const FlowEffortSpace o = d.orthogonal();
  EXPECT_EQ(o.dimension(), 8 - 3);
  for (int i = 0; i < d.dimension(); ++i)
    for (int j = 0; j < o.dimension(); ++j)
      EXPECT_NEAR(pairing(d.image_flows().col(i), d.image_efforts().col(i), o.image_flows().col(j),
                          o.image_efforts().col(j)),
                  0.0, 1e-14);
  EXPECT_NEAR(pairing(Vector{{1.0, 2.0}}, Vector{{3.0, 4.0}}, Vector{{5.0, 6.0}}, Vector{{7.0, 8.0}}),
              3.0 * 5.0 + 4.0 * 6.0 + 7.0 * 1.0 + 8.0 * 2.0, 0.0);
}

TEST(FlowEffortSpace, SpacesThatAreNoDiracStructureAreTold) {
  const Columns unit = Columns::Identity(2, 2), none = Columns::Zero(2, 2), turn{{0.0, 1.0}, {-1.0, 0.0}};
  expect_dirac(FlowEffortSpace::image_of(unit, turn), 2);                   // the graph of a skew map
  EXPECT_GT(FlowEffortSpace::image_of(unit, unit).isotropy_defect(), 0.1);  // of a symmetric one
  const FlowEffortSpace small = FlowEffortSpace::image_of(unit.leftCols(1), none.leftCols(1));
  EXPECT_LT(small.isotropy_defect(), structure_tolerance);  // isotropic, and yet one dimension short
  EXPECT_EQ(small.dimension(), 1);
  EXPECT_GT(small.maximality_defect(), 0.1);
  EXPECT_GT(small.outside(small.orthogonal()), 0.1);
  const FlowEffortSpace large = FlowEffortSpace::kernel_of(unit.topRows(1), none.topRows(1));
  EXPECT_LT(large.maximality_defect(), structure_tolerance);
  EXPECT_GT(large.isotropy_defect(), 0.1);
}

TEST(FlowEffortSpace, RedundantAndSmallRowsCountOnce) {
  const Columns a{{1.0, 2.0, -1.0}, {2.0, 4.0, -2.0}, {1e-3, 0.0, 1e-3}};
  const FlowEffortSpace d = distribution_structure(a);
  expect_dirac(d, 3);
  EXPECT_LT((a * d.image_flows()).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT(d.outside(Vector::Zero(3), a.transpose() * Vector{{1.0, -3.0, 2.0}}), 1e-14);
  EXPECT_GT(d.outside(Vector::Zero(3), Vector{{1.0, 0.0, 0.0}}), 0.1);
  expect_dirac(distribution_structure(Columns(0, 2)), 2);
}

TEST(FlowEffortSpace, MisuseIsRefused) {
  testing::expect_misuse([] { FlowEffortSpace::kernel_of(Columns(1, 2), Columns(1, 3)); }, {"columns"});
  testing::expect_misuse([] { FlowEffortSpace::image_of(Columns(2, 1), Columns(3, 1)); }, {"rows"});
  const FlowEffortSpace d = distribution_structure(Columns(0, 2));
  testing::expect_misuse([&] { composition(d, d, 3); }, {"3 ports", "2"});
  testing::expect_misuse([&] { d.outside(Vector::Zero(3), Vector::Zero(2)); }, {"flows"});
}

TEST(DiracStructureOfADistribution, IsItsOrthogonalAndWhatTheDefinitionSays) {
  for (const auto& scene : structure_scenes()) {
    SCOPED_TRACE(scene->name);
    const int n = scene->dimension();
    const FlowEffortSpace d = DiracStructure(scene->constraints, n).at(0.3, scene->start.q);
    expect_dirac(d, 2 * n);
    expect_equal(d, structure_by_definition(one_forms_of(*scene, 0.3, scene->start.q)));
  }
}

TEST(DiracStructureOfADistribution, WithoutRowsIsTheGraphOfTheSymplecticForm) {
  const FlowEffortSpace d = DiracStructure({}, 2).at(0.0, Vector::Zero(2));
  std::srand(5);
  const PhaseVelocity x{Vector::Zero(2), Vector::Zero(2), Vector::Random(2), Vector::Random(2)};
  const FlowAndEffort graph = flow_and_effort(x, omega_flat(x));
  EXPECT_LT(d.outside(graph.flow, graph.effort), structure_tolerance);
  EXPECT_GT(d.outside(graph.flow, -graph.effort), 0.1);
}

/// X of the motion at the start of a scene: (q̇,ṗ) from the acceleration that solves the equations of motion.
PhaseVelocity motion_at(const Scene& scene, const Vector& v) {
  const double t = scene.start.time;
  const Vector& q = scene.start.q;
  const int n = scene.dimension();
  AccelerationProblem problem(scene, true);
  problem.begin(t, q, v);
  Vector x = Vector::Zero(problem.size());
  EXPECT_TRUE(kinsol()(problem)->solve(x).ok());
  Vector lq(n), p(n), rate(n), lqq(scene.lagrangian->pattern().nonzeros()), lqv = lqq, lvv = lqq;
  scene.lagrangian->gradient(t, q, v, lq, p);
  scene.lagrangian->gradient_rate(t, q, v, rate);
  scene.lagrangian->hessian(t, q, v, lqq, lqv, lvv);
  const SparsityPattern& pattern = scene.lagrangian->pattern();
  rate += pattern.full(lqv).transpose() * v + pattern.full(lvv) * x.head(n);
  return {q, p, v, rate};
}

std::vector<std::shared_ptr<const Scene>> regular_scenes() {
  auto scenes = structure_scenes();
  scenes.pop_back();
  return scenes;
}

TEST(DiracStructureOfADistribution, HoldsTheMotionWithTheDifferentialsOfLAndH) {
  for (const auto& scene : regular_scenes()) {
    const Vector v = scene->start.v;
    const PhaseVelocity x = motion_at(*scene, v);
    DiracStructure structure(scene->constraints, scene->dimension());
    const Membership of_l = structure.membership(0.0, x, dirac_differential(*scene->lagrangian, 0.0, x.q, v));
    const Membership of_h =
        structure.membership(0.0, x, differential(*hamiltonian_of(*scene), 0.0, x.q, x.p));
    for (const Membership& m : {of_l, of_h}) {
      EXPECT_LT(m.constraint, 1e-14) << scene->name;
      EXPECT_LT(m.annihilator, 1e-13) << scene->name;
      EXPECT_LT(m.annihilator_of_class, 1e-13) << scene->name;
    }
  }
}

TEST(DiracStructureOfADistribution, TellsEachWayOfLeavingIt) {
  const auto scene = testing::nonholonomic();
  const Vector v = scene->start.v;
  const PhaseVelocity x = motion_at(*scene, v);
  const Covector alpha = dirac_differential(*scene->lagrangian, 0.0, x.q, v);
  const Vector row = one_forms_of(*scene, 0.0, x.q).row(0).transpose(), other = Vector::Unit(3, 1);
  DiracStructure structure(scene->constraints, 3);
  const auto changed = [&](auto change) {
    PhaseVelocity moved = x;
    change(moved);
    return structure.membership(0.0, moved, alpha);
  };
  EXPECT_LT(changed([&](auto& z) { z.p_rate += row; }).annihilator, 1e-13) << "a force of the row is none";
  EXPECT_NEAR(changed([&](auto& z) { z.p_rate += other; }).annihilator, 1.0, 1e-13);
  EXPECT_NEAR(changed([&](auto& z) { z.q_rate += row; }).constraint, row.squaredNorm(), 1e-13);
  EXPECT_NEAR(changed([&](auto& z) { z.q_rate += other; }).annihilator, 1.0, 1e-13);
  const Membership in_class = changed([&](auto& z) { z.p += row; });
  EXPECT_NEAR(in_class.annihilator, row.lpNorm<Eigen::Infinity>(), 1e-13);
  EXPECT_LT(in_class.annihilator_of_class, 1e-13);
  EXPECT_NEAR(changed([&](auto& z) { z.p += other; }).annihilator_of_class, 1.0, 1e-13);
}

TEST(DiracStructureOfADistribution, MembershipIsTheKernelFormForLinearRows) {
  std::srand(8);
  for (const auto& scene : {testing::nonholonomic(), testing::holonomic_sphere(), testing::mixed()}) {
    DiracStructure structure(scene->constraints, 3);
    const FlowEffortSpace d = structure.at(0.0, scene->start.q);
    const Vector f = d.image_flows() * Vector::Random(6), e = d.image_efforts() * Vector::Zero(6);
    const Vector z = Vector::Random(6);
    const Vector flow = d.image_flows() * z, effort = d.image_efforts() * z;
    const Vector p = Vector::Random(3);
    const auto membership = [&](const Vector& a, const Vector& b) {
      return structure.membership(0.0, {scene->start.q, p, a.head(3), a.tail(3)},
                                  {scene->start.q, p, b.head(3), b.tail(3)});
    };
    EXPECT_LT(membership(flow, effort).constraint, structure_tolerance);
    EXPECT_LT(membership(flow, effort).annihilator, structure_tolerance);
    EXPECT_GT(membership(f, e).annihilator, 1e-2) << "a flow alone is none";
  }
}

TEST(DiscreteDiracStructure, OnTheDiagonalIsTheContinuousOne) {
  for (const StepRule& rule : {StepRule::left, StepRule::right, StepRule::midpoint, StepRule::trapezoidal})
    for (const auto& scene : {testing::unconstrained(), testing::nonholonomic(), testing::mixed()}) {
      SCOPED_TRACE(scene->name + " " + name(rule));
      const Vector& q = scene->start.q;
      DiscreteDiracStructure discrete(scene->constraints, 3, rule);
      const FlowEffortSpace d = DiracStructure(scene->constraints, 3).at(0.0, q);
      for (const FlowEffortSpace& at :
           {discrete.plus_at({0.0, 0.0}, q, q), discrete.minus_at({0.0, 0.0}, q, q)}) {
        expect_dirac(at, 6);
        expect_equal(at, d);
      }
    }
}

/// Off the diagonal ∂c/∂q1 spans the annihilator at q0 for the left rule alone, ∂c/∂q0 that at q1 for the
/// right one; elsewhere D_{d±} is isotropic up to the order of the step.
TEST(DiscreteDiracStructure, OffTheDiagonalIsADiracStructureForTheOneSidedRules) {
  const auto scene = testing::nonholonomic();
  const auto defects = [&](const StepRule& rule, double size, bool plus) {
    const Vector q0 = scene->start.q, q1 = q0 + size * Vector{{0.3, -0.5, 0.8}};
    DiscreteDiracStructure discrete(scene->constraints, 3, rule);
    const FlowEffortSpace d =
        plus ? discrete.plus_at({0.0, size}, q0, q1) : discrete.minus_at({0.0, size}, q0, q1);
    EXPECT_EQ(d.dimension(), 6);
    return std::max(d.isotropy_defect(), d.maximality_defect());
  };
  EXPECT_LT(defects(StepRule::left, 0.2, true), structure_tolerance);
  EXPECT_LT(defects(StepRule::right, 0.2, false), structure_tolerance);
  for (const auto& [rule, plus] : {std::pair(StepRule::midpoint, true), std::pair(StepRule::midpoint, false),
                                   std::pair(StepRule::right, true), std::pair(StepRule::left, false)}) {
    EXPECT_GT(defects(rule, 0.1, plus), 1e-3) << name(rule) << plus;
    EXPECT_NEAR(defects(rule, 4e-3, plus) / defects(rule, 2e-3, plus), 2.0, 0.1) << name(rule) << plus;
  }
}

TEST(DiscreteDiracStructure, RowsOfOnesOwnHaveTheSameTangentSpaces) {
  const auto scene = testing::nonholonomic();
  const Vector q0 = scene->start.q, q1 = q0 + 0.1 * Vector{{0.3, -0.5, 0.8}};
  const auto own = discrete_rows<3, 1>([]<class T>(const std::array<T, 3>& a, const std::array<T, 3>& b) {
    return std::array<T, 1>{b[0] - a[0] + 0.5 * (a[1] + b[1]) * (b[2] - a[2])};
  });
  DiscreteDiracStructure written(scene->constraints, 3, own),
      by_rule(scene->constraints, 3, StepRule::midpoint);
  expect_equal(written.plus_at({0.0, 0.1}, q0, q1), by_rule.plus_at({0.0, 0.1}, q0, q1));
  expect_equal(written.minus_at({0.0, 0.1}, q0, q1), by_rule.minus_at({0.0, 0.1}, q0, q1), 1e-9);
}

/// The structure of an interconnected scene, its flows in the order (q1,p1,q2,p2) of a composition.
FlowEffortSpace structure_of_parts(const Scene& whole, int first, const Vector& q) {
  const int n = whole.dimension(), second = n - first;
  Columns order = Columns::Zero(2 * n, 2 * n);
  order.block(0, 0, first, first).setIdentity();
  order.block(first, n, first, first).setIdentity();
  order.block(2 * first, first, second, second).setIdentity();
  order.block(2 * first + second, n + first, second, second).setIdentity();
  const FlowEffortSpace d = DiracStructure(whole.constraints, n).at(0.0, q);
  return FlowEffortSpace::image_of(order * d.image_flows(), order * d.image_efforts());
}

TEST(CompositionOfDiracStructures, OfTwoScenesOverARowIsTheStructureOfTheirInterconnection) {
  Scene left = *testing::nonholonomic(), right = *testing::mixed();
  left.name = "left";
  right.name = "right";
  const Columns row{{0.0, 2.0, 0.0, -1.0, 0.0, 0.5}};  // of both scenes' coordinates
  const Scene whole = interconnection("whole", left, right, {linear_rows(row)});
  // Ports: the velocities that the row joins.
  const Columns at_left = Columns{{0.0}, {1.0}, {0.0}},
                at_right = Columns{{1.0, 0.0}, {0.0, 0.0}, {0.0, 1.0}};
  const FlowEffortSpace joint = distribution_structure(Columns{{2.0, -1.0, 0.5}});
  const FlowEffortSpace a = DiracStructure(left.constraints, 3).with_ports(0.0, left.start.q, at_left);
  // D_B has its ports in front.
  const FlowEffortSpace b = DiracStructure(right.constraints, 3).with_ports(0.0, right.start.q, at_right);
  expect_dirac(a, 7);
  expect_dirac(b, 8);
  Columns front = Columns::Zero(8, 8);
  front.block(0, 6, 2, 2).setIdentity();
  front.block(2, 0, 6, 6).setIdentity();
  const FlowEffortSpace composed =
      composition(composition(a, joint, 1),
                  FlowEffortSpace::image_of(front * b.image_flows(), front * b.image_efforts()), 2);
  expect_dirac(composed, 12);
  Vector q(6);
  q << left.start.q, right.start.q;
  expect_equal(composed, structure_of_parts(whole, 3, q));
  const Scene loose = interconnection("loose", left, right, {});
  EXPECT_GT(composed.outside(structure_of_parts(loose, 3, q)), 0.1) << "the row counts for nothing";
  expect_equal(direct_sum(DiracStructure(left.constraints, 3).at(0.0, left.start.q),
                          DiracStructure(right.constraints, 3).at(0.0, right.start.q)),
               structure_of_parts(loose, 3, q));
}

TEST(CompositionOfDiracStructures, OfTwoCircuitsOverAWireIsTheStructureOfTheWhole) {
  // Both circuits are open at one node; there each has a port, which carries the current that leaves it.
  const Scene whole = circuit("whole", {inductor("L1", "0", "a", 0.5), capacitor("C1", "a", "0", 1.0),
                                        capacitor("C2", "a", "0", 0.25), inductor("L2", "a", "0", 2.0)});
  const Columns first_port{{-1.0}, {1.0}}, second_port{{1.0}, {1.0}};
  const Vector q = Vector::Zero(2);
  const FlowEffortSpace a = DiracStructure({}, 2).with_ports(0.0, q, first_port);
  const FlowEffortSpace b = DiracStructure({}, 2).with_ports(0.0, q, second_port);
  Columns front = Columns::Zero(5, 5);
  front(0, 4) = 1.0;
  front.block(1, 0, 4, 4).setIdentity();
  // A wire: both currents add up to zero, both ends have the same potential.
  const FlowEffortSpace joined =
      composition(composition(a, distribution_structure(Columns{{1.0, 1.0}}), 1),
                  FlowEffortSpace::image_of(front * b.image_flows(), front * b.image_efforts()), 1);
  expect_dirac(joined, 8);
  expect_equal(joined, structure_of_parts(whole, 2, Vector::Zero(4)));
}

TEST(CompositionOfDiracStructures, OverNoPortsIsTheDirectSumAndOverATransformerScales) {
  const FlowEffortSpace a = distribution_structure(Columns{{1.0, 2.0}}),
                        b = distribution_structure(Columns(0, 1));
  expect_equal(composition(a, b, 0), direct_sum(a, b));
  // 1:3 transformer (f1 = 3 f2 with power kept) behind an open end: no flow passes.
  const FlowEffortSpace open = distribution_structure(Columns{{1.0}});
  const FlowEffortSpace transformer =
      FlowEffortSpace::kernel_of(Columns{{1.0, 3.0}, {0.0, 0.0}}, Columns{{0.0, 0.0}, {3.0, -1.0}});
  expect_dirac(transformer, 2);
  expect_equal(composition(transformer, open, 1), open);
}

}  // namespace
}  // namespace diracstep
