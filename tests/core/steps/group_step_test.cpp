#include <gtest/gtest.h>

#include <diracstep/core/methods/composition.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <diracstep/core/steps/groups/step.hpp>
#include <diracstep/core/steps/groups/trapezoidal_step.hpp>
#include <diracstep/core/system/consistent_start.hpp>

#include "differences.hpp"
#include "group_scenes.hpp"
#include "methods.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using group_scenes::GroupScene;
using spaces::Retraction;
using testing::gl;

Integrator integrator_of(const std::shared_ptr<const Scene>& scene, const std::string& method, double step,
                         bool compensated = false) {
  return Integrator(scene, Registry::with_built_ins(), kinsol(),
                    {.method = method, .step = step, .compensated_sums = compensated});
}

double error_at(const GroupScene& of, const Vector& truth, double T, int steps, const std::string& method) {
  const Sample end = testing::samples_of(of.scene, {.method = method, .step = T / steps}, steps,
                                         Momentum::projected, Registry::with_built_ins(), steps)
                         .back();
  return (of.observe(end.q, end.v) - truth).lpNorm<Eigen::Infinity>();
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
  steps.push_back(group_trapezoidal_step(scene()));
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
  const Vector truth = group_scenes::reference(GetParam(), T);
  ASSERT_LT((truth - group_scenes::reference(GetParam(), T, 120)).lpNorm<Eigen::Infinity>(), 1e-14);
  for (int s = 1; s <= 4; ++s) {
    const int n = steps[static_cast<std::size_t>(s - 1)];
    const double coarse = error_at(GetParam(), truth, T, n, gl(s)),
                 fine = error_at(GetParam(), truth, T, 2 * n, gl(s));
    EXPECT_NEAR(std::log2(coarse / fine), 2.0 * s, tolerance)
        << "s = " << s << ": " << coarse << " to " << fine;
  }
  const double coarse = error_at(GetParam(), truth, T, 80, "type1/trapezoidal"),
               fine = error_at(GetParam(), truth, T, 160, "type1/trapezoidal");
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
    for (const std::string& method : {gl(1), gl(2), gl(3), std::string("type1/trapezoidal")})
      EXPECT_LT(symplectic_defect(of, method, 0.25), 2e-9) << of.name << " " << method;
}

/// The potential of the top depends on γ = Rᵀe₃ alone, so that turns about e₃ leave it: γ·p is kept.
TEST(GroupStepLaws, KeepsTheMomentumMap) {
  for (const auto& on : {group_scenes::rotations(), group_scenes::rotations<Retraction::cayley>()})
    for (const std::string& method : {gl(1), gl(2), gl(3), std::string("type1/trapezoidal")}) {
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

std::shared_ptr<const Scene> free_body(const Eigen::Matrix3d& inertia, Vector omega,
                                       std::shared_ptr<const Space> on = group_scenes::rotations()) {
  return group_scenes::scene_of(
      "free body", std::move(on),
      lagrangian<4>([=]<class T>(const std::array<T, 4>&, const std::array<T, 4>& w) {
        return group_scenes::quadratic<T>(inertia, {w[0], w[1], w[2]});
      }),
      group_scenes::generic_rotation(), std::move(omega));
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

/// Jacobi's sn, cn, dn of u with parameter m, by descending Landen transformations.
std::array<double, 3> jacobi(double u, double m) {
  std::array<double, 20> a{1.0}, c{std::sqrt(m)};
  double b = std::sqrt(1.0 - m);
  std::size_t n = 0;
  while (std::abs(c[n]) > 1e-17 && n + 1 < a.size()) {
    a[n + 1] = 0.5 * (a[n] + b);
    c[n + 1] = 0.5 * (a[n] - b);
    b = std::sqrt(a[n] * b);
    ++n;
  }
  double phi = std::ldexp(a[n] * u, static_cast<int>(n));
  for (std::size_t k = n; k > 0; --k) phi = 0.5 * (std::asin(c[k] / a[k] * std::sin(phi)) + phi);
  const double sn = std::sin(phi);
  return {sn, std::cos(phi), std::sqrt(1.0 - m * sn * sn)};
}

TEST(GroupStepClosedForms, FreeBodyTurnsByJacobisFunctions) {
  // Landau, Lifshitz, Mechanics, § 37, from ω2 = 0 on and with 2 E I2 < M²
  const double i1 = 1.0, i2 = 1.7, i3 = 2.4, w1 = 0.5, w3 = 1.2;
  const double energy2 = i1 * w1 * w1 + i3 * w3 * w3, m2 = i1 * i1 * w1 * w1 + i3 * i3 * w3 * w3;
  ASSERT_GT(m2, energy2 * i2);
  const double rate = std::sqrt((i3 - i2) * (m2 - energy2 * i1) / (i1 * i2 * i3));
  const double k2 = (i2 - i1) * (energy2 * i3 - m2) / ((i3 - i2) * (m2 - energy2 * i1));
  const double T = 5.0;
  const auto [sn, cn, dn] = jacobi(rate * T, k2);
  const Vector exact =
      (Vector(3) << w1 * cn, std::sqrt((energy2 * i3 - m2) / (i2 * (i3 - i2))) * sn, w3 * dn).finished();
  const auto scene =
      free_body(Eigen::Vector3d(i1, i2, i3).asDiagonal(), (Vector(3) << w1, 0.0, w3).finished());
  std::array<double, 2> errors{};
  for (const int k : {0, 1}) {
    const int steps = 20 << k;
    const Sample end = testing::samples_of(scene, {.method = gl(4), .step = T / steps}, steps,
                                           Momentum::projected, Registry::with_built_ins(), steps)
                           .back();
    errors[static_cast<std::size_t>(k)] = (end.v - exact).norm();
  }
  EXPECT_LT(errors[0], 1e-9);
  EXPECT_LT(errors[1], 1e-11);
}

/// ω₃ = 0 and no gravity: with ψ the angle of (√A ω₁, √B ω₂), ψ' = C/√(AB) cos(ψ − ψ₀), a Gudermannian.
TEST(GroupStepClosedForms, SuslovTendsToItsSteadyRotation) {
  const double a = 1.0, b = 1.7, j13 = 0.3, j23 = -0.2;
  Eigen::Matrix3d inertia;
  inertia << a, 0.0, j13, 0.0, b, j23, j13, j23, 2.4;
  const auto on = group_scenes::rotations();
  auto scene = std::make_shared<Scene>(*free_body(inertia, (Vector(3) << -0.6, 0.9, 0.0).finished(), on));
  scene->constraints = {on_space(on, pfaffian<4, 1>([]<class T>(const std::array<T, 4>&) {
                                   return std::array<std::array<T, 4>, 1>{{{T(0.0), T(0.0), T(1.0), T(0.0)}}};
                                 }))};
  EXPECT_TRUE(reduced_on_group(*scene));
  const double w1 = -0.6, w2 = 0.9, size = std::sqrt(a * w1 * w1 + b * w2 * w2);
  const double c1 = j13 * size / std::sqrt(a), c2 = j23 * size / std::sqrt(b);
  const double C = std::hypot(c1, c2), psi0 = std::atan2(c2, c1);
  const double psi = std::atan2(std::sqrt(b) * w2, std::sqrt(a) * w1);
  const double T = 4.0;
  // u = asinh(tan(ψ − ψ₀)) on the branch where cos(ψ − ψ₀) has its sign
  const double sign = std::cos(psi - psi0) < 0.0 ? -1.0 : 1.0;
  const double reduced = sign < 0.0 ? psi - psi0 - std::acos(-1.0) : psi - psi0;
  const double u = std::asinh(std::tan(reduced)) + sign * C / std::sqrt(a * b) * T;
  const double end_psi = psi0 + 2.0 * std::atan(std::tanh(0.5 * u)) + (sign < 0.0 ? std::acos(-1.0) : 0.0);
  const Sample end = testing::samples_of(scene, {.method = gl(4), .step = T / 40}, 40, Momentum::projected,
                                         Registry::with_built_ins(), 40)
                         .back();
  EXPECT_NEAR(end.v[0], size / std::sqrt(a) * std::cos(end_psi), 1e-11);
  EXPECT_NEAR(end.v[1], size / std::sqrt(b) * std::sin(end_psi), 1e-11);
  EXPECT_NEAR(end.v[2], 0.0, 1e-13);
}

/// The heavy top of Brüls and Cardona, with the numbers of Hante's RATTLie: own reference by extrapolation at
/// t = 1.
TEST(GroupStepClosedForms, HeavyTopOfBrulsAndCardona) {
  const auto top = [](double w) { return 15.0 * 9.81 * w; };
  const double across = 0.234375 + 15.0, along = 0.46875;
  const auto scene = group_scenes::scene_of(
      "heavy top of Bruels and Cardona", group_scenes::rotations(),
      lagrangian<4>([=]<class T>(const std::array<T, 4>& q, const std::array<T, 4>& w) {
        const auto R = group_scenes::matrix_of<4>(q);
        return 0.5 * (across * (w[0] * w[0] + w[2] * w[2]) + along * w[1] * w[1]) - top(1.0) * R[2][1];
      }),
      (Vector(4) << 1.0, 0.0, 0.0, 0.0).finished(), (Vector(3) << 0.0, 150.0, -4.61538).finished());
  const Sample end = testing::samples_of(scene, {.method = gl(4), .step = 4e-3}, 250, Momentum::projected,
                                         Registry::with_built_ins(), 250)
                         .back();
  const auto R = spaces::rotation_matrix(end.q[0], end.q[1], end.q[2], end.q[3]);
  EXPECT_NEAR(R[0][1], 0.17334396410, 5e-10);
  EXPECT_NEAR(R[1][1], 0.64008859207, 5e-10);
  EXPECT_NEAR(R[2][1], -0.74849079113, 5e-10);
  EXPECT_NEAR(end.v[0], -0.8220781017, 2e-8);
  EXPECT_NEAR(end.v[1], 150.0, 1e-10);
  EXPECT_NEAR(end.v[2], -5.923291348, 2e-8);
}

/// One scene on SO(3) and as a unit quaternion with a row in R^4, where L sees ω = 2 q̄ q'.
TEST(GroupStepClosedForms, AgreesWithTheQuaternionAndItsRowToTheErrorsOfBoth) {
  const GroupScene top = group_scenes::heavy_top();
  auto flat = std::make_shared<Scene>();
  flat->name = "top by a quaternion";
  flat->coordinates = {"a", "b", "c", "d"};
  flat->lagrangian = lagrangian<4>(
      [J = group_scenes::generic_inertia()]<class T>(const std::array<T, 4>& q, const std::array<T, 4>& v) {
        const std::array<T, 4> conjugate{q[0], -q[1], -q[2], -q[3]};
        const std::array<T, 4> half = spaces::SO3::product(conjugate, v);
        const auto R = group_scenes::matrix_of<4>(q);
        // a mass along q as well, where the row keeps it still
        T value = group_scenes::quadratic<T>(J, {2.0 * half[1], 2.0 * half[2], 2.0 * half[3]}) +
                  2.0 * half[0] * half[0];
        for (std::size_t i = 0; i < 3; ++i)
          value -= group_scenes::top_k[i] * R[2][i] + 0.5 * group_scenes::top_K[i] * R[2][i] * R[2][i];
        return value;
      });
  flat->constraints = {holonomic<4, 1>([]<class T>(const std::array<T, 4>& q) {
    return std::array<T, 1>{0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0)};
  })};
  const Start& start = top.scene->start;
  const std::array<double, 4> q{start.q[0], start.q[1], start.q[2], start.q[3]},
      w{0.0, start.v[0], start.v[1], start.v[2]};
  const std::array<double, 4> v = spaces::SO3::product(q, w);
  flat->start = {0.0, start.q, 0.5 * Vector::Map(v.data(), 4)};
  const double T = 2.0;
  const Vector truth = group_scenes::reference(top, T);
  const auto end_of_flat = [&](int steps) {
    const Sample end = testing::samples_of(flat, {.method = gl(3), .step = T / steps}, steps,
                                           Momentum::projected, Registry::with_built_ins(), steps)
                           .back();
    const std::array<double, 4> conjugate{end.q[0], -end.q[1], -end.q[2], -end.q[3]},
        rate{end.v[0], end.v[1], end.v[2], end.v[3]};
    const std::array<double, 4> half = spaces::SO3::product(conjugate, rate);
    return top.observe(end.q, 2.0 * Vector::Map(half.data() + 1, 3));
  };
  for (const int steps : {16, 32, 128}) {
    const double of_group = error_at(top, truth, T, steps, gl(3)),
                 of_flat = (end_of_flat(steps) - truth).lpNorm<Eigen::Infinity>();
    EXPECT_LT(of_group, of_flat) << steps;
    if (steps == 128) {
      EXPECT_LT(of_flat, 1e-9);
    }
  }
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
  const Vector truth = group_scenes::reference(top, T);
  const auto composed = [&](int steps) {
    const Sample end =
        testing::samples_of(top.scene, {.method = "type1/midpoint", .order = 4, .step = T / steps}, steps,
                            Momentum::projected, Registry::with_built_ins(), steps)
            .back();
    return (top.observe(end.q, end.v) - truth).lpNorm<Eigen::Infinity>();
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
  const ConsistentStart moved = project_start(*top.scene, off, kinsol());
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
  for (const char* method : {"type1/left", "type2/euler", "damped/radau:2", "type2/legendre(type1/midpoint)"})
    testing::expect_misuse([&] { integrator_of(scene, method, 0.1); }, {"on SO3", "known in R^n only"});
  testing::expect_misuse([&] { integrator_of(scene, gl(2), 0.1, true); }, {"no compensated sums"});
}

/// The RATTLE-like step of Lie groups (Hante, Arnold 2021) of a top with x = R r, by hand: unknowns are the
/// velocity of the half step and λ⁺, then λ⁻ puts v1 on the rows.
struct Rattle {
  Eigen::Vector3d inertia{1.0, 1.7, 2.4}, arm{0.2, -0.1, 0.6};
  double mass = 1.2, gravity = 1.5;

  struct Point {
    Eigen::Matrix3d R;
    Eigen::Vector3d x;
    Eigen::Matrix<double, 6, 1> p;  // in the body, and m x'
  };
  static Eigen::Matrix3d hat(const Eigen::Vector3d& w) {
    return (Eigen::Matrix3d() << 0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0).finished();
  }
  static Eigen::Matrix3d exponential(const Eigen::Vector3d& w) {
    return Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix();
  }
  static Eigen::Matrix3d tangent(const Eigen::Vector3d& w) {
    const double a = w.norm();
    return Eigen::Matrix3d::Identity() - (1.0 - std::cos(a)) / (a * a) * hat(w) +
           (a - std::sin(a)) / (a * a * a) * hat(w) * hat(w);
  }
  Eigen::Matrix<double, 3, 6> rows(const Eigen::Matrix3d& R) const {
    Eigen::Matrix<double, 3, 6> b;
    b << R * hat(arm), Eigen::Matrix3d::Identity();
    return b;
  }
  Eigen::Matrix<double, 6, 1> force() const {
    return (Eigen::Matrix<double, 6, 1>() << 0, 0, 0, 0, 0, -mass * gravity).finished();
  }
  Eigen::Matrix<double, 6, 1> masses() const {
    return (Eigen::Matrix<double, 6, 1>() << inertia, mass, mass, mass).finished();
  }

  Point step(const Point& from, double h) const {
    Vector unknowns = Vector::Zero(9);
    unknowns.head(6) = from.p.cwiseQuotient(masses());
    const auto residual = [&](const Vector& y) {
      const Eigen::Vector3d w = y.head(3);
      Eigen::Matrix<double, 6, 1> half = masses().cwiseProduct(y.head(6));
      const Eigen::Matrix<double, 6, 1> known =
          from.p + 0.5 * h * force() - 0.5 * h * rows(from.R).transpose() * y.tail(3);
      half.head(3) -= tangent(-h * w).transpose() * known.head(3);
      half.tail(3) -= known.tail(3);
      Vector f(9);
      f << half, (from.x + h * y.segment(3, 3) - from.R * exponential(h * w) * arm) / h;
      return f;
    };
    for (int k = 0; k < 12; ++k)
      unknowns -= testing::difference_jacobian(residual, unknowns, 1e-6)
                      .partialPivLu()
                      .solve(residual(unknowns))
                      .eval();
    const Eigen::Vector3d w = unknowns.head(3);
    Point to{from.R * exponential(h * w), from.x + h * unknowns.segment(3, 3),
             masses().cwiseProduct(unknowns.head(6))};
    to.p.head(3) = tangent(h * w).transpose().partialPivLu().solve(to.p.head(3)).eval();
    to.p += 0.5 * h * force();
    const Eigen::Matrix<double, 3, 6> b = rows(to.R);
    const Eigen::Matrix<double, 6, 3> response = masses().cwiseInverse().asDiagonal() * b.transpose();
    const Eigen::Vector3d lambda = (b * response).partialPivLu().solve(b * to.p.cwiseQuotient(masses()));
    to.p -= b.transpose() * lambda;
    return to;
  }
};

TEST(GroupTrapezoidalStep, IsTheRattleOfLieGroups) {
  const Rattle rattle;
  const auto on = space(spaces::SO3{}, spaces::R<3>{});
  Vector q(7), v(6);
  q << group_scenes::generic_rotation(), 0.0, 0.0, 0.0;
  q = on->normalised(q);
  const Eigen::Matrix3d R = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  const Eigen::Vector3d w(0.6, -1.2, 1.4);
  q.tail(3) = R * rattle.arm;
  v << w, R * w.cross(rattle.arm);
  auto scene = group_scenes::scene_of(
      "top", on, lagrangian<7>([rattle]<class T>(const std::array<T, 7>& at, const std::array<T, 7>& u) {
        return 0.5 * (rattle.inertia[0] * u[0] * u[0] + rattle.inertia[1] * u[1] * u[1] +
                      rattle.inertia[2] * u[2] * u[2]) +
               0.5 * rattle.mass * (u[3] * u[3] + u[4] * u[4] + u[5] * u[5]) -
               rattle.mass * rattle.gravity * at[6];
      }),
      q, v);
  scene->constraints = {on_space(on, holonomic<7, 3>([rattle]<class T>(const std::array<T, 7>& at) {
                                   const auto M = group_scenes::matrix_of<7>(at);
                                   std::array<T, 3> phi;
                                   for (std::size_t i = 0; i < 3; ++i)
                                     phi[i] = at[4 + i] - (M[i][0] * rattle.arm[0] + M[i][1] * rattle.arm[1] +
                                                           M[i][2] * rattle.arm[2]);
                                   return phi;
                                 }))};
  const double h = 0.1;
  Rattle::Point point{R, q.tail(3),
                      (Eigen::Matrix<double, 6, 1>() << rattle.masses().cwiseProduct(v)).finished()};
  for (const Sample& sample : testing::samples_of(scene, {.method = "type1/trapezoidal", .step = h}, 20)) {
    const Eigen::Matrix3d here =
        Eigen::Quaterniond(sample.q[0], sample.q[1], sample.q[2], sample.q[3]).toRotationMatrix();
    EXPECT_LT((here - point.R).cwiseAbs().maxCoeff(), 2e-13) << sample.time;
    EXPECT_LT((sample.q.tail(3) - point.x).norm(), 2e-13) << sample.time;
    EXPECT_LT((sample.p - point.p).norm(), 1e-12) << sample.time;
    point = rattle.step(point, h);
  }
}

}  // namespace
}  // namespace diracstep
