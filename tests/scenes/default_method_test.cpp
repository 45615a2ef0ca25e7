/// Whoever chooses a method on a scene of the catalogue chooses the same one.
#include <gtest/gtest.h>

#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/methods/default_method.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

namespace diracstep {
namespace {

class DefaultMethodOf : public ::testing::TestWithParam<std::string> {
 protected:
  CatalogueScene entry = make_scene(GetParam());
  std::shared_ptr<const Scene> scene = completed(entry.scene);
  Registry registry = Registry::with_built_ins();
};

TEST_P(DefaultMethodOf, DependsOnTheOrderAndNotOnWhatTheOrderComesFrom) {
  for (const double error : {1e-3, 1e-6, 1e-9, 1e-11}) {
    const DefaultMethod for_error = default_method(*scene, {.error = error});
    const DefaultMethod for_order = default_method(*scene, {.order = for_error.order});
    EXPECT_EQ(for_error.method, for_order.method) << error;
    EXPECT_EQ(for_error.order, for_order.order) << error;
  }
}

TEST_P(DefaultMethodOf, IsThatOfEveryIntegrator) {
  const DefaultMethod choice = default_method(*scene, {});
  const IntegratorOptions options{.step = entry.natural_step, .drop_redundant_rows = true};
  const Integrator fixed(scene, registry, kinsol(), options);
  EXPECT_EQ(fixed.options().method, choice.method);
  EXPECT_EQ(fixed.options().order, choice.order);
  if (!has_accelerations(*scene)) return;
  const AdaptiveIntegrator variable(scene, registry, kinsol(), options, {.scales = {1.0, 0.1}});
  EXPECT_EQ(variable.options().method, choice.method);
  EXPECT_EQ(variable.options().order, choice.order);
}

TEST_P(DefaultMethodOf, IsThatOfASearchForAnError) {
  ErrorControlOptions asked{.error = 1e-6, .go_on = [] { return false; }};  // one run, the coarsest
  if (!has_accelerations(*scene)) asked.first_step = std::abs(entry.natural_step);
  const double end = scene->start.time + 2.0 * entry.natural_step;
  const ErrorControlReport report = solve_to_error(scene, registry, kinsol(), end, asked);
  const DefaultMethod choice = default_method(*scene, {.error = asked.error});
  EXPECT_EQ(report.method, choice.method);
  EXPECT_EQ(report.order, choice.order);
  EXPECT_EQ(report.method_reason, choice.reason);
}

/// What keeps its energy is not even looked at; of what is damped, the governor alone has stiff dampers.
TEST_P(DefaultMethodOf, IsOfTheDampingFamilyOnlyWhereDampersAreStiff) {
  const IntegratorOptions options{.drop_redundant_rows = true};
  const DefaultMethod choice = default_method_of_motion(scene, registry, kinsol(), entry.t_end,
                                                        std::abs(entry.natural_step), options, {});
  const bool damped = registry.method(choice.method).info.damped;
  EXPECT_EQ(damped, GetParam() == "flyball_governor") << choice.reason;
  if (damped)
    EXPECT_TRUE(scene->force);
  else
    EXPECT_EQ(choice.method, default_method(*scene, {}).method);
}

INSTANTIATE_TEST_SUITE_P(EveryScene, DefaultMethodOf, ::testing::ValuesIn(scene_names()),
                         [](const auto& test) { return test.param; });

TEST(DefaultMethodOfTheCatalogue, TheTodaLatticeOf200IsSteppedExplicitlyForAnyError) {
  const auto scene = make_scene("toda_200").scene;
  for (const double error : {0.0, 1e-3, 1e-6, 1e-9})
    EXPECT_EQ(default_method(*completed(scene), {.error = error}).method, "type1/trapezoidal") << error;
}

}  // namespace
}  // namespace diracstep
