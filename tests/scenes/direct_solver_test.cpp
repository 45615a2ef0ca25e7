#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/steps/gauss_lobatto/step.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/direct_solver.hpp>
#include <random>
#include <string>
#include <vector>

namespace diracstep {
namespace {

/// Whether its step is compiled for its size.
bool is_small(const Scene& scene) {
  return !scene.lagrangian->structure().phase_space() && scene.dimension() <= 4;
}

std::string as_name(const ::testing::TestParamInfo<std::string>& info) { return info.param; }

double apart(const Vector& a, const Vector& b) {
  return (a - b).lpNorm<Eigen::Infinity>() / std::max(1.0, b.lpNorm<Eigen::Infinity>());
}

class DirectSolver : public ::testing::TestWithParam<std::string> {};

/// Solves to a residual of round-off differ by round-off over the conditioning of a step; so they stay for a
/// few steps of a motion that is not chaotic within them.
TEST_P(DirectSolver, TakesTheStepsOfKinsol) {
  constexpr double round_off = 2e-13;
  constexpr int steps = 12;
  const CatalogueScene entry = make_scene(GetParam());
  for (const char* method : {"auto", "type1/gl:1", "type1/gl:2", "type1/gl:3"}) {
    IntegratorOptions options{.method = method, .step = entry.natural_step / 4.0};
    Integrator by_kinsol(entry.scene, Registry::with_built_ins(), kinsol(), options);
    Integrator direct_steps(entry.scene, Registry::with_built_ins(), direct(), options);
    for (int k = 1; k <= steps; ++k) {
      ASSERT_TRUE(by_kinsol.step().ok()) << method;
      const StepReport report = direct_steps.step();
      ASSERT_TRUE(report.ok()) << method << ": " << report.failure;
      ASSERT_LT(apart(direct_steps.position(), by_kinsol.position()), round_off * k)
          << method << ", step " << k;
    }
    Sample one, other;
    ASSERT_TRUE(by_kinsol.sample(Momentum::projected, one).ok());
    ASSERT_TRUE(direct_steps.sample(Momentum::projected, other).ok());
    EXPECT_LT(apart(other.v, one.v), 100.0 * round_off) << method;
  }
}

/// A run that is interrupted and restored goes on with the same bits, whatever the solver keeps.
TEST_P(DirectSolver, GoesOnFromASnapshotWithTheSameBits) {
  const CatalogueScene entry = make_scene(GetParam());
  const IntegratorOptions options{.method = "auto", .step = entry.natural_step / 4.0};
  Integrator whole(entry.scene, Registry::with_built_ins(), direct(), options);
  Integrator second_half(entry.scene, Registry::with_built_ins(), direct(), options);
  for (int k = 0; k < 15; ++k) ASSERT_TRUE(whole.step().ok());
  second_half.restore(whole.save());
  for (int k = 0; k < 5; ++k) {
    ASSERT_TRUE(whole.step().ok());
    ASSERT_TRUE(second_half.step().ok());
  }
  EXPECT_EQ(second_half.position(), whole.position());
}

/// What an iteration leaves of a residual has the same sign in one step after the other, and would drive the
/// energy two to three times as far as Newton's method does.
TEST(DirectSolverOverManySteps, RoundOffDrivesTheEnergyAsFarAsWithKinsol) {
  const CatalogueScene entry = make_scene("kepler_e06");
  const auto drift = [&](const SolverFactory& solver) {
    Integrator integrator(entry.scene, Registry::with_built_ins(), solver,
                          {.method = "type1/gl:6", .step = 0.1});
    Sample start, end;
    EXPECT_TRUE(integrator.sample(Momentum::projected, start).ok());
    for (int k = 0; k < 200000; ++k)
      if (!integrator.step().ok()) return HUGE_VAL;
    EXPECT_TRUE(integrator.sample(Momentum::projected, end).ok());
    return std::abs(end.energy - start.energy);
  };
  EXPECT_LT(drift(direct()), 1.8 * drift(kinsol()));
}

/// A step GL(s) of sizes that are known when it is compiled has the residual, the Jacobian and the splitting
/// of the one that serves all sizes, which a sparse Jacobian asks for.
class StagesOfFixedSize : public ::testing::TestWithParam<std::string> {};

TEST_P(StagesOfFixedSize, HaveTheSystemOfThoseOfAnySize) {
  const CatalogueScene entry = make_scene(GetParam());
  const Scene& scene = *entry.scene;
  if (scene.space || !is_small(scene))
    return;  // loading every scene to name these takes a second in each process
  std::mt19937 random(7);
  std::uniform_real_distribution<double> part(-0.1, 0.1);
  const Start& start = scene.start;
  Vector p(scene.dimension()), lq(scene.dimension());
  scene.lagrangian->gradient(start.time, start.q, start.v, lq, p);
  const State state{start.q, p, start.v};
  Vector qq(scene.lagrangian->pattern().nonzeros()), qv = qq, vv = qq;
  scene.lagrangian->hessian(start.time, start.q, start.v, qq, qv, vv);
  const bool mass_is_regular = Eigen::FullPivLU<Columns>(scene.lagrangian->pattern().full(vv)).isInvertible();
  for (int s = 1; s <= 6; ++s) {
    const auto fixed = gauss_lobatto_step(s, scene, true), any = gauss_lobatto_step(s, scene, false);
    for (const double h : {0.1 * entry.natural_step, 0.05 * entry.natural_step}) {
      Vector x(fixed->size()), f = x, g = x;
      for (StepProblem* step : {fixed.get(), any.get()}) {
        step->begin({start.time, h}, state, {});
        step->guess(start.v, x);
      }
      for (double& entry_of_x : x) entry_of_x += part(random);
      fixed->residual(x, f);
      any->residual(x, g);
      const double size = g.lpNorm<Eigen::Infinity>();
      EXPECT_LT((f - g).lpNorm<Eigen::Infinity>(), 1e-14 * (1.0 + size)) << "residual of GL(" << s << ")";
      Vector full(fixed->pattern().nonzeros()), values(any->pattern().nonzeros());
      fixed->jacobian(x, full);
      any->jacobian(x, values);
      const Columns jacobian = any->pattern().full(values);
      const double largest = jacobian.lpNorm<Eigen::Infinity>();
      EXPECT_LT((fixed->pattern().full(full) - jacobian).lpNorm<Eigen::Infinity>(), 1e-14 * (1.0 + largest))
          << "Jacobian of GL(" << s << ")";
      fixed->solve_splitting(f);
      any->solve_splitting(g);
      if (mass_is_regular) {
        EXPECT_LT((f - g).lpNorm<Eigen::Infinity>(), 1e-10 * (1.0 + g.lpNorm<Eigen::Infinity>()))
            << "splitting of GL(" << s << ")";
      }
      StepEnd one, other;
      fixed->finish(x, one);
      any->finish(x, other);
      EXPECT_LT(apart(one.at.q, other.at.q), 1e-14);
      EXPECT_LT(apart(one.at.p, other.at.p), 1e-14);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Catalogue, DirectSolver, ::testing::ValuesIn(scene_names()), as_name);
INSTANTIATE_TEST_SUITE_P(Catalogue, StagesOfFixedSize, ::testing::ValuesIn(scene_names()), as_name);

}  // namespace
}  // namespace diracstep
