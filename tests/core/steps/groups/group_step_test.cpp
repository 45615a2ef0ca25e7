#include <gtest/gtest.h>

#include <diracstep/core/methods/composition.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <diracstep/core/steps/groups/quadrature_step.hpp>
#include <diracstep/core/steps/groups/step.hpp>
#include <diracstep/core/system/consistent_start.hpp>

#include "differences.hpp"
#include "group_stepping.hpp"
#include "methods.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using group_scenes::error_at;
using group_scenes::free_body;
using group_scenes::GroupScene;
using spaces::Retraction;
using testing::gl;

Integrator integrator_of(const std::shared_ptr<const Scene>& scene, const std::string& method, double step,
                         bool compensated = false) {
  return Integrator(scene, Registry::with_built_ins(), kinsol(),
                    {.method = method, .step = step, .compensated_sums = compensated});
}

std::vector<GroupScene> with_both_retractions() {
  std::vector<GroupScene> all = group_scenes::all_scenes();
  for (GroupScene& scene : group_scenes::all_scenes<Retraction::cayley>()) {
    scene.name += ", Cayley";
    all.push_back(std::move(scene));
  }
  return all;
}

std::string test_name(const ::testing::TestParamInfo<GroupScene>& of) {
  return testing::test_name(of.param.name);
}

class GroupStep : public ::testing::TestWithParam<GroupScene> {
 protected:
  const Scene& scene() const { return *GetParam().scene; }
};

TEST_P(GroupStep, JacobianAgreesWithDifferences) {
  const Start& start = scene().start;
  State at{start.q, Vector::Zero(scene().dimension()), start.v};
  Vector force(scene().dimension());
  scene().lagrangian->gradient(0.0, start.q, start.v, force, at.p);
  std::vector<std::unique_ptr<StepProblem>> steps;
  for (const int s : {1, 2, 3}) steps.push_back(group_step(s, scene()));
  for (const StepRule& rule : {StepRule::left, StepRule::right, StepRule::trapezoidal})
    steps.push_back(group_quadrature_step(rule, scene()));
  for (const auto& step : steps) {
    step->begin({0.0, 0.3}, at, {});
    Vector x(step->size());
    step->guess(start.v, x);
    for (Eigen::Index i = 0; i < x.size(); ++i) x[i] += 0.3 * std::sin(1.0 + 2.3 * static_cast<double>(i));
    EXPECT_LT(testing::jacobian_error(*step, x), 2e-8) << step->traits().unknowns;
  }
}

/// Slopes at the end of T = 2 between the two step sizes.
TEST_P(GroupStep, HasTheOrderOfItsStages) {
  constexpr double T = 2.0;
  constexpr std::array<int, 4> steps{40, 20, 16, 10};
  // Errors of Cayley's retraction have terms of the next orders of their size at these steps.
  const double tolerance = GetParam().name.ends_with("Cayley") ? 0.3 : 0.2;
  const Vector reference = group_scenes::reference(GetParam(), T);
  ASSERT_LT((reference - group_scenes::reference(GetParam(), T, 120)).lpNorm<Eigen::Infinity>(), 1e-14);
  for (int s = 1; s <= 4; ++s) {
    const int n = steps[static_cast<std::size_t>(s - 1)];
    const double coarse = error_at(GetParam(), reference, T, n, gl(s)),
                 fine = error_at(GetParam(), reference, T, 2 * n, gl(s));
    EXPECT_NEAR(std::log2(coarse / fine), 2.0 * s, tolerance)
        << "s = " << s << ": " << coarse << " to " << fine;
  }
  const double coarse = error_at(GetParam(), reference, T, 80, "type1/trapezoidal"),
               fine = error_at(GetParam(), reference, T, 160, "type1/trapezoidal");
  EXPECT_NEAR(std::log2(coarse / fine), 2.0, 0.2) << "trapezoidal: " << coarse << " to " << fine;
}

/// A step back from the end of a step leads to its start.
TEST_P(GroupStep, IsSelfAdjoint) {
  for (const std::string& method : {gl(1), gl(2), gl(3), std::string("type1/trapezoidal")}) {
    Integrator integrator = integrator_of(GetParam().scene, method, 0.25);
    Sample before, after;
    for (int k = 0; k < 3; ++k) ASSERT_TRUE(integrator.step().ok());
    ASSERT_TRUE(integrator.sample(Momentum::projected, before).ok());
    ASSERT_TRUE(integrator.step(0.25).ok());
    ASSERT_TRUE(integrator.step(-0.25).ok());
    ASSERT_TRUE(integrator.sample(Momentum::projected, after).ok());
    const double defect = (GetParam().observe(before.q, before.v) - GetParam().observe(after.q, after.v))
                              .lpNorm<Eigen::Infinity>();
    EXPECT_LT(defect, 3e-14) << method;
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, GroupStep, ::testing::ValuesIn(with_both_retractions()), test_name);

/// D(q, p) ↦ (q1, p1) by differences, in left-trivialised columns (η, ν).
Columns tangent_map(Integrator& integrator, const Scene& scene, const Vector& q, const Vector& p,
                    const Vector& v, double h) {
  const Space& space = *scene.space;
  const Eigen::Index n = scene.dimension();
  const auto image = [&](const Vector& x) -> std::pair<Vector, Vector> {
    integrator.restart(0.0, space.moved(q, Vector(x.head(n))), p + x.tail(n), v);
    EXPECT_TRUE(integrator.step(h).ok());
    return {integrator.position(), integrator.momentum()};
  };
  const auto [q1, p1] = image(Vector::Zero(2 * n));
  Columns map(2 * n, 2 * n);
  const double delta = 1e-5;
  for (Eigen::Index j = 0; j < 2 * n; ++j) {
    const auto [qa, pa] = image(delta * Vector::Unit(2 * n, j));
    const auto [qb, pb] = image(-delta * Vector::Unit(2 * n, j));
    map.col(j) << (space.difference(q1, qa) - space.difference(q1, qb)).head(n) / (2.0 * delta),
        (pa - pb) / (2.0 * delta);
  }
  return map;
}

/// The symplectic form of T*G at momentum p in left-trivialised columns: ν2·η1 − ν1·η2 + p·[η1, η2].
Columns symplectic_form(const Space& space, const Vector& p) {
  const Eigen::Index n = p.size();
  Columns form = Columns::Zero(2 * n, 2 * n);
  form.topRightCorner(n, n).setIdentity();
  form.bottomLeftCorner(n, n) = -Columns::Identity(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      form(i, j) = p.dot(space.bracket(Vector::Unit(n, i), Vector::Unit(n, j)));
  return form;
}

double symplectic_defect(const GroupScene& of, const std::string& method, double h) {
  const Scene& scene = *of.scene;
  Integrator integrator = integrator_of(of.scene, method, h);
  const Vector q = integrator.position(), p = integrator.momentum(), v = scene.start.v;
  const Columns map = tangent_map(integrator, scene, q, p, v, h);
  integrator.restart(0.0, q, p, v);
  EXPECT_TRUE(integrator.step(h).ok());
  return (map.transpose() * symplectic_form(*scene.space, integrator.momentum()) * map -
          symplectic_form(*scene.space, p))
      .cwiseAbs()
      .maxCoeff();
}

TEST(GroupStepLaws, IsSymplectic) {
  for (const GroupScene& of :
       {group_scenes::heavy_top(), group_scenes::heavy_top(group_scenes::rotations<Retraction::cayley>()),
        group_scenes::body_on_spring()})
    for (const std::string& method : {gl(1), gl(2), gl(3), std::string("type1/trapezoidal"),
                                      std::string("type2/euler"), std::string("type3/euler")})
      EXPECT_LT(symplectic_defect(of, method, 0.25), 2e-9) << of.name << " " << method;
}

/// The potential of the top depends on γ = Rᵀe₃ alone, so that turns about e₃ leave it: γ·p is kept.
TEST(GroupStepLaws, KeepsTheMomentumMap) {
  for (const auto& on : {group_scenes::rotations(), group_scenes::rotations<Retraction::cayley>()})
    for (const std::string& method : {gl(1), gl(2), gl(3), std::string("type1/trapezoidal"),
                                      std::string("type2/euler"), std::string("type3/euler")}) {
      Integrator integrator = integrator_of(group_scenes::heavy_top(on).scene, method, 0.25);
      const auto vertical = [&] {
        const Vector& q = integrator.position();
        const auto R = spaces::rotation_matrix(q[0], q[1], q[2], q[3]);
        return R[2][0] * integrator.momentum()[0] + R[2][1] * integrator.momentum()[1] +
               R[2][2] * integrator.momentum()[2];
      };
      const double at_start = vertical();
      double largest = 0.0;
      for (int k = 0; k < 400; ++k) {
        ASSERT_TRUE(integrator.step().ok());
        largest = std::max(largest, std::abs(vertical() - at_start));
      }
      EXPECT_LT(largest, 1e-13) << method;
    }
}

TEST(ReducedGroupStep, KeepsCasimirsAndMomentaInSpaceAndSaysSoInThePlan) {
  const auto scene = free_body(group_scenes::generic_inertia(), (Vector(3) << 0.8, -1.3, 0.9).finished());
  EXPECT_TRUE(reduced_on_group(*scene));
  EXPECT_FALSE(reduced_on_group(*group_scenes::heavy_top().scene));
  Integrator integrator = integrator_of(scene, gl(2), 0.2);
  bool said = false;
  for (const PlanLine& line : integrator.plan())
    said = said || (line.item == "space" && line.decision == "SO3" &&
                    line.reason.find("reduced") != std::string::npos);
  EXPECT_TRUE(said);
  const auto in_space = [&] {
    const Vector& q = integrator.position();
    const auto R = spaces::rotation_matrix(q[0], q[1], q[2], q[3]);
    Vector m(3);
    for (std::size_t i = 0; i < 3; ++i)
      m[static_cast<Eigen::Index>(i)] = R[i][0] * integrator.momentum()[0] +
                                        R[i][1] * integrator.momentum()[1] +
                                        R[i][2] * integrator.momentum()[2];
    return m;
  };
  const Vector start = in_space();
  for (int k = 0; k < 1000; ++k) ASSERT_TRUE(integrator.step().ok());
  EXPECT_NEAR(integrator.momentum().norm(), start.norm(), 2e-13);
  EXPECT_LT((in_space() - start).norm(), 1e-12);
}

TEST(GroupStepOfR, IsTheStepInRnToRoundOff) {
  const auto formula = lagrangian<2>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + (1.0 + q[0] * q[0]) * v[1] * v[1]) - cos(q[0] - q[1]) - q[1] * q[1];
  });
  Scene flat;
  flat.name = "flat";
  flat.coordinates = {"x", "y"};
  flat.lagrangian = formula;
  flat.start = {0.0, (Vector(2) << 0.3, -0.8).finished(), (Vector(2) << 1.1, 0.4).finished()};
  const auto on = group_scenes::scene_of("on R2", space(spaces::R<2>{}), formula, flat.start.q, flat.start.v);
  for (const std::string& method : {gl(1), gl(3), std::string("type1/trapezoidal")}) {
    const auto one = testing::samples_of(std::make_shared<Scene>(flat), {.method = method, .step = 0.1}, 30),
               other = testing::samples_of(on, {.method = method, .step = 0.1}, 30);
    EXPECT_LT((one.back().q - other.back().q).norm() + (one.back().p - other.back().p).norm(), 2e-13)
        << method;
  }
}

TEST(GroupStepInARun, ComposesRestartsProjectsAndPassesTheChecks) {
  const GroupScene top = group_scenes::top_with_rows();
  const double T = 1.0;
  const Vector reference = group_scenes::reference(top, T);
  const auto composed = [&](int steps) {
    const Sample end =
        testing::samples_of(top.scene, {.method = "type1/midpoint", .order = 4, .step = T / steps}, steps,
                            Momentum::projected, Registry::with_built_ins(), steps)
            .back();
    return (top.observe(end.q, end.v) - reference).lpNorm<Eigen::Infinity>();
  };
  EXPECT_NEAR(std::log2(composed(20) / composed(40)), 4.0, 0.3);
  Integrator integrator = integrator_of(top.scene, gl(3), 0.05);
  RunChecks checks(integrator, 40);
  EXPECT_TRUE(run_steps(
                  integrator, 40, Momentum::projected, 1, [](const Sample&) { return true; }, &checks)
                  .ok());
  EXPECT_EQ(checks.text(), "");
  const Snapshot snapshot = integrator.save();
  ASSERT_TRUE(integrator.step().ok());
  const Vector q = integrator.position(), p = integrator.momentum();
  integrator.restore(snapshot);
  ASSERT_TRUE(integrator.step().ok());
  EXPECT_EQ(integrator.position(), q);
  EXPECT_EQ(integrator.momentum(), p);
  Start off = top.scene->start;
  off.q[4] += 1e-3;
  off.v[3] -= 1e-2;
  const ProjectedStart moved = project_start(*top.scene, off, kinsol());
  EXPECT_GT(moved.position_moved, 1e-4);
  EXPECT_LT(moved.position_moved, 2e-3);
  EXPECT_NO_THROW(require_consistent(*top.scene, moved.start));
  EXPECT_THROW(require_consistent(*top.scene, off), InconsistentStart);
}

TEST(GroupStepInARun, FailsWithTheReasonBeyondTheInjectivityOfTheRetraction) {
  // A ball turns at its constant rate, by 4 from the middle of this step to its ends.
  const auto scene = free_body(Eigen::Matrix3d::Identity(), (Vector(3) << 4.8, 0.0, 6.4).finished());
  Integrator integrator = integrator_of(scene, gl(2), 1.0);
  const StepReport report = integrator.step();
  ASSERT_FALSE(report.ok());
  testing::expect_parts(report.failure, {"more than its retraction is injective on", "take a smaller one"});
  EXPECT_TRUE(integrator.step(0.02).ok());
}

TEST(GroupStepInARun, RefusesMethodsOfRn) {
  const auto scene = group_scenes::heavy_top().scene;
  testing::expect_misuse([&] { integrator_of(scene, "damped/radau:2", 0.1); },
                         {"on SO3", "known in R^n only"});
  testing::expect_misuse([&] { integrator_of(scene, "type4/legendre(type1/midpoint)", 0.1); },
                         {"on SO3", "no configuration"});
  testing::expect_misuse([&] { integrator_of(scene, gl(2), 0.1, true); }, {"no compensated sums"});
}

}  // namespace
}  // namespace diracstep
