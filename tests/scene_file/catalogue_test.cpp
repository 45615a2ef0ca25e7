#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/scene_catalogue.hpp>
#include <stdexcept>

/// The catalogue as a test: each scene meets its references within its stated tolerance with its recommended
/// method.
namespace diracstep {
namespace {

Sample run_as_recommended(const CatalogueScene& entry) {
  const Recommendation& advice = entry.recommended;
  const StepGrid grid = fit_steps(entry.scene->start.time, advice.end, advice.step);
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(),
                        {advice.method, advice.order, grid.step, {}});
  Sample end;
  const RunReport report =
      run(integrator, grid.steps, Momentum::projected, grid.steps, [&](const Sample& sample) {
        end = sample;
        return true;
      });
  if (!report.ok()) throw std::runtime_error(report.last.failure);
  return end;
}

/// The largest difference in positions, and in velocities, each relative to the largest of them.
double error(const KnownState& known, const Sample& end) {
  double differences[2] = {0.0, 0.0}, sizes[2] = {0.0, 0.0};
  for (const auto& component : known.components) {
    const double value = (component.velocity ? end.v : end.q)[component.index];
    const int kind = component.velocity ? 1 : 0;
    differences[kind] = std::max(differences[kind], std::abs(value - component.value));
    sizes[kind] = std::max(sizes[kind], std::abs(component.value));
  }
  double largest = 0.0;
  for (const int kind : {0, 1})
    if (differences[kind] > 0.0)
      largest = std::max(largest, differences[kind] / std::max(sizes[kind], 1e-300));
  return largest;
}

void expect_reference_met(const CatalogueScene& entry) {
  const Recommendation& advice = entry.recommended;
  const Sample end = run_as_recommended(entry);
  int compared = 0;
  for (const KnownState& known : entry.known) {
    if (std::abs(known.t - advice.end) > 1e-9 * std::max(1.0, std::abs(known.t))) continue;
    ++compared;
    const double digits = std::pow(10.0, -known.digits), allowed = std::max(advice.tolerance, 3.0 * digits);
    const double reached = error(known, end);
    EXPECT_LE(reached, allowed) << known.kind << ", " << known.how;
    std::printf("  %s %s: error %.2e, allowed %.1e\n", entry.scene->name.c_str(), known.kind.c_str(), reached,
                allowed);
  }
  EXPECT_GT(compared, 0) << "no reference at t = " << advice.end;
  EXPECT_GT(advice.tolerance, 0.0) << "no stated tolerance";
}

class Catalogue : public ::testing::TestWithParam<std::string> {};
const auto name_of = [](const auto& scene) { return scene.param; };

TEST_P(Catalogue, MeetsItsReferenceWithItsRecommendedMethod) {
  const CatalogueScene entry = make_scene(GetParam());
  if (entry.needs.empty())
    expect_reference_met(entry);
  else
    EXPECT_EQ(entry.needs, "degenerate");
}

INSTANTIATE_TEST_SUITE_P(Scenes, Catalogue, ::testing::ValuesIn(scene_names()), name_of);

/// Closed forms agree with digits that were computed elsewhere, and stated invariants hold at the start.
TEST_P(Catalogue, StatesNothingThatContradictsItself) {
  const CatalogueScene entry = make_scene(GetParam());
  const Start& start = entry.scene->start;
  if (entry.reference.at)
    for (const KnownState& known : entry.known) {
      const auto point = entry.reference.at(known.t);
      if (!point) continue;
      Sample sample;
      sample.q = point->q;
      sample.v = point->v;
      EXPECT_LE(error(known, sample), 3.0 * std::pow(10.0, -known.digits) + 1e-13)
          << known.kind << " at " << known.t;
    }
  for (const Invariant& invariant : entry.invariants) {
    if (!invariant.value) continue;
    const double value = invariant.at(start.time, start.q, start.v), stated = *invariant.value;
    EXPECT_NEAR(value, stated, 1e-14 + 1e-14 * std::abs(stated)) << invariant.name;
  }
  EXPECT_NO_THROW(require_consistent(*entry.scene, start));
}

TEST(CatalogueScenes, AllTwentySixCasesAreThere) { EXPECT_EQ(scene_names().size(), 26u); }

TEST(CatalogueScenes, ParametersThatHaveReferencesOfTheirOwn) {
  EXPECT_EQ(make_scene("stiff_spring_pendulum", {{"k", 1e6}}).known.size(), 1u);
  EXPECT_TRUE(make_scene("stiff_spring_pendulum", {{"k", 12345.0}}).known.empty());
  const CatalogueScene chain = make_scene("hanging_chain", {{"N", 4}});
  ASSERT_EQ(chain.known.size(), 1u);
  EXPECT_EQ(chain.known[0].components.front().name, "x_4");
  EXPECT_EQ(chain.scene->rows(), 4);
  EXPECT_TRUE(make_scene("n_four_bar", {{"N", 7}}).reference.at(3.0).has_value());
}

TEST(CatalogueScenes, SmallerChainsMeetTheirReferences) {
  for (const double links : {4.0, 16.0}) expect_reference_met(make_scene("hanging_chain", {{"N", links}}));
}

}  // namespace
}  // namespace diracstep
