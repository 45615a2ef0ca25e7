#include <diracstep/sensitivities/sensitivities.hpp>

#include "derivatives.hpp"

namespace diracstep {
namespace {

using namespace testing;

/// Every step that the library has, on scenes of every class where it takes them.
template <class Check>
void for_every_step(Check check) {
  std::vector<ScenePointer> scenes(every_constraint_class().begin(), every_constraint_class().end());
  for (const auto& scene : {unconstrained(), nonholonomic(), mixed()}) scenes.push_back(forced(scene));
  scenes.push_back(driven());
  std::vector<IntegratorOptions> kinds = every_kind_of_step();
  for (const char* method :
       {"damped/radau:2", "damped/radau:3", "type1/gl:3", "type2/legendre(type1/midpoint)", "type1/left",
        "type3/euler", "type4/legendre(type1/midpoint)"})
    kinds.push_back({.method = method, .step = 0.05});
  for (const auto& scene : scenes)
    for (IntegratorOptions options : kinds)
      for (const int limit : {40, 0}) {
        if (scene->force && options.method.starts_with("type4")) continue;
        options.dense_limit = limit;
        SCOPED_TRACE(describe(scene, options));
        check(scene, options);
      }
}

void expect_as_differences(const ScenePointer& scene, const IntegratorOptions& options, double bound) {
  constexpr long steps = 4;
  Integrator integrator = integrator_for(scene, options);
  const StartPoint start = start_of(integrator);
  const int n = scene->dimension();
  const Vector dq = some_vector(n, 0.3), dp = some_vector(n, 1.1);
  Directions z(2 * n, 1);
  z << dq, dp;
  Sensitivities sensitivities(integrator, Registry::with_built_ins());
  ASSERT_TRUE(sensitivities.jvp(steps, z).ok());
  const Vector exact = stacked(sensitivities.read(z), 0);
  const Vector approximate = difference([&](double s) {
    return end_of_steps(integrator, {start.q + s * dq, start.p + s * dp, start.v}, steps);
  });
  EXPECT_LT(distance(exact, approximate), bound * std::max(1.0, exact.lpNorm<Eigen::Infinity>()));
}

TEST(Sensitivities, AreThoseOfDifferencesForEveryStepAndClass) {
  for_every_step([](const ScenePointer& scene, const IntegratorOptions& options) {
    expect_as_differences(scene, options, 1e-9);
  });
}

TEST(Sensitivities, OfOtherRulesForTheRows) {
  for (const auto& scene : {nonholonomic(), forced(mixed())})
    for (const StepRule& rule : {StepRule::left, StepRule::trapezoidal}) {
      SCOPED_TRACE(scene->name + ", " + name(rule));
      expect_as_differences(scene, {.method = "type1/midpoint", .step = 0.05, .constraint_rule = rule}, 1e-9);
      expect_as_differences(
          scene, {.method = "type1/left", .order = 2, .step = 0.05, .constraint_rule = rule}, 1e-9);
    }
}

TEST(Sensitivities, OfPhaseSpaceLagrangiansAlongTheirConstraint) {
  for (const char* method : {"type1/midpoint", "type1/gl:2", "type1/gl:3", "damped/radau:3"}) {
    SCOPED_TRACE(method);
    Integrator integrator = integrator_for(phase_space(), {.method = method, .step = 0.05});
    const StartPoint start = start_of(integrator);
    const Lagrangian& l = *integrator.scene().lagrangian;
    const Vector dq = some_vector(2, 0.3);
    Sensitivities sensitivities(integrator, Registry::with_built_ins());
    Directions z = sensitivities.from_velocities(dq, Columns::Zero(2, 1), Columns::Zero(0, 1));
    ASSERT_TRUE(sensitivities.jvp(4, z).ok());
    const Vector exact = stacked(sensitivities.read(z), 0);
    const Vector approximate = difference([&](double s) {
      const Vector q = start.q + s * dq;
      Vector lq(2), p(2);
      l.gradient(0.0, q, start.v, lq, p);
      return end_of_steps(integrator, {q, p, start.v}, 4);
    });
    EXPECT_LT(distance(exact, approximate), 1e-8);
  }
}

TEST(Sensitivities, OfADiscreteMotionInPartsAndWithCompensatedSums) {
  expect_as_differences(mixed(), {.method = "type1/gl:2", .step = 0.05, .compensated_sums = true}, 1e-9);
}

TEST(Sensitivities, TheAdjointIsTheTranspose) {
  for_every_step([](const ScenePointer& scene, const IntegratorOptions& options) {
    constexpr long steps = 7;
    const int n = scene->dimension();
    Integrator integrator = integrator_for(scene, options);
    Sensitivities sensitivities(integrator, Registry::with_built_ins());
    const Snapshot start = integrator.save();
    const Vector dq = some_vector(n, 0.4), dv = some_vector(n, 2.0);
    Directions z = sensitivities.from_velocities(dq, dv, Columns::Zero(0, 1));
    ASSERT_TRUE(sensitivities.jvp(steps, z).ok());
    const ReadDirections moved = sensitivities.read(z);
    ReadDirections weights{some_vector(n, 0.1), some_vector(n, 0.7), some_vector(n, 1.9)};
    const double forward = (weights.q.transpose() * moved.q + weights.v.transpose() * moved.v +
                            weights.p.transpose() * moved.p)(0);
    for (const long every : {0L, 1L, 3L}) {
      integrator.restore(start);
      const auto back =
          sensitivities.gradient(steps, [&](long, const Sample&) { return weights; }, 0, {every});
      ASSERT_TRUE(back.report.ok());
      const double adjoint = back.by_start.q0.col(0).dot(dq) + back.by_start.v0.col(0).dot(dv);
      EXPECT_NEAR(forward, adjoint, 1e-12 * std::max(1.0, std::abs(forward))) << "every " << every;
    }
  });
}

TEST(Sensitivities, OfASumAlongTheMotion) {
  const auto scene = mixed();
  constexpr long steps = 8;
  Integrator integrator = integrator_for(scene, {.method = "type1/gl:2", .step = 0.05});
  const Vector dq = some_vector(3, 0.4), dv = some_vector(3, 2.0);
  double forward = 0.0;
  const auto weights = [](long k) { return ReadDirections{some_vector(3, double(k)), {}, {}}; };
  Sensitivities sensitivities(integrator, Registry::with_built_ins());
  const Snapshot start = integrator.save();
  Directions z = sensitivities.from_velocities(dq, dv, Columns::Zero(0, 1));
  forward += weights(0).q.col(0).dot(dq);
  for (long k = 1; k <= steps; ++k) {
    ASSERT_TRUE(sensitivities.step(z).ok());
    if (k % 3 == 0 || k == steps) forward += weights(k).q.col(0).dot(z.col(0).head(3));
  }
  for (const long every : {0L, 3L, 4L}) {
    integrator.restore(start);
    const auto back =
        sensitivities.gradient(steps, [&](long k, const Sample&) { return weights(k); }, 3, {every});
    EXPECT_NEAR(forward, back.by_start.q0.col(0).dot(dq) + back.by_start.v0.col(0).dot(dv), 1e-12);
  }
}

TEST(Sensitivities, TheMotionHasTheSameBits) {
  for (const auto& scene : every_constraint_class())
    for (const IntegratorOptions& options : every_kind_of_step()) {
      const std::vector<Sample> plain = samples_of(scene, options, 10);
      Integrator integrator = integrator_for(scene, options);
      Sensitivities sensitivities(integrator, Registry::with_built_ins());
      Directions z = sensitivities.by_position();
      std::vector<Sample> with(1);
      ASSERT_TRUE(integrator.sample(Momentum::projected, with[0]).ok());
      while (with.size() < plain.size()) {
        ASSERT_TRUE(sensitivities.step(z).ok());
        ASSERT_TRUE(integrator.sample(Momentum::projected, with.emplace_back()).ok());
        (void)sensitivities.read(z);
      }
      EXPECT_TRUE(same_bits(plain, with)) << describe(scene, options);
    }
}

TEST(Sensitivities, OfASymplecticStepAreSymplectic) {
  for (const char* method : {"type1/midpoint", "type1/gl:3", "type1/trapezoidal", "type2/euler",
                             "type3/legendre(type1/midpoint)", "type1/left"}) {
    Integrator integrator = integrator_for(unconstrained(), {.method = method, .step = 0.1});
    Sensitivities sensitivities(integrator, Registry::with_built_ins());
    Columns omega = Columns::Zero(6, 6);
    omega.topRightCorner(3, 3).setIdentity();
    omega.bottomLeftCorner(3, 3) = -Columns::Identity(3, 3);
    Directions m = Directions::Identity(6, 6);
    ASSERT_TRUE(sensitivities.step(m).ok());
    EXPECT_LT((m.transpose() * omega * m - omega).lpNorm<Eigen::Infinity>(), 1e-13) << method;
    EXPECT_GT((m - Directions::Identity(6, 6)).norm(), 0.1) << method;
  }
}

/// Of T*N with N = {φ = 0}: directions tangent to it, and momenta of their classes.
TEST(Sensitivities, AreSymplecticOnTheCotangentBundleOfTheConstraint) {
  Integrator integrator = integrator_for(holonomic_sphere(), {.method = "type1/gl:2", .step = 0.1});
  Sensitivities sensitivities(integrator, Registry::with_built_ins());
  const auto normal = [&](const Vector& q) { return Vector{{2.0 * q[0], 2.0 * q[1], q[2]}}; };
  const Vector a = normal(integrator.position());
  Directions z(6, 2);
  for (int k = 0; k < 2; ++k) {
    Vector dq = some_vector(3, k);
    dq -= a * a.dot(dq) / a.squaredNorm();
    z.col(k) << dq, some_vector(3, 3.0 + k);
  }
  // The form of T*N: momenta count along N only, and both directions keep to that of a constraint on p.
  const auto form = [](const Directions& d) {
    return d.col(0).head(3).dot(d.col(1).tail(3)) - d.col(1).head(3).dot(d.col(0).tail(3));
  };
  const double before = form(z);
  for (int k = 0; k < 20; ++k) ASSERT_TRUE(sensitivities.step(z).ok());
  EXPECT_NEAR(form(z), before, 1e-13 * z.norm() * z.norm());
  const Vector end = normal(integrator.position());
  EXPECT_LT((end.transpose() * z.topRows(3)).lpNorm<Eigen::Infinity>(), 1e-12 * z.norm());
}

TEST(Sensitivities, RefuseWhatTheyDoNotKnow) {
  Integrator integrator = integrator_for(unconstrained(), {.method = "type1/gl:2", .step = 0.1});
  Sensitivities sensitivities(integrator, Registry::with_built_ins());
  Directions wrong = Directions::Zero(5, 1);
  EXPECT_THROW((void)sensitivities.step(wrong), Misuse);
  EXPECT_THROW((void)sensitivities.gradient(0, [](long, const Sample&) { return ReadDirections{}; }), Misuse);
  EXPECT_THROW((void)sensitivities.from_velocities(Columns::Zero(2, 1), Columns::Zero(3, 1), Columns(0, 1)),
               Misuse);
  ParametricScene without;
  without.scene = unconstrained();
  without.parameters = Vector::Ones(1);
  EXPECT_THROW(Sensitivities(integrator, Registry::with_built_ins(), without), Misuse);
}

}  // namespace
}  // namespace diracstep
