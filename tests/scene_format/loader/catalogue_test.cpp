#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/references/ida_reference.hpp>
#include <diracstep/validation/references/published_cases.hpp>

/// The catalogue as a test: each scene meets its references within its stated tolerance with its recommended
/// method.
namespace diracstep {
namespace {

void expect_reference_met(const CatalogueScene& entry) {
  EXPECT_GT(entry.recommended.tolerance, 0.0) << "no stated tolerance";
  for (const PublishedCase& one : run_published_cases(entry, Registry::with_built_ins(), kinsol())) {
    EXPECT_TRUE(one.passed()) << one.scene << ", " << one.kind << ", " << one.source << ": error "
                              << one.error << ", allowed " << one.allowed << " " << one.failure;
    std::printf("  %s %s: error %.2e, allowed %.1e\n", one.scene.c_str(), one.kind.c_str(), one.error,
                one.allowed);
  }
}

class Catalogue : public ::testing::TestWithParam<std::string> {};
const auto name_of = [](const auto& scene) { return scene.param; };

TEST_P(Catalogue, MeetsItsReferenceWithItsRecommendedMethod) { expect_reference_met(make_scene(GetParam())); }

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
      EXPECT_LE(relative_error(known, sample), 3.0 * std::pow(10.0, -known.digits) + 1e-13)
          << known.kind << " at " << known.t;
    }
  for (const Invariant& invariant : entry.invariants) {
    if (!invariant.value) continue;
    const double value = invariant.at(start.time, start.q, start.v), stated = *invariant.value;
    EXPECT_NEAR(value, stated, 1e-14 + 1e-14 * std::abs(stated)) << invariant.name;
  }
  EXPECT_NO_THROW(require_consistent(*entry.scene, start));
}

TEST(PublishedCases, AWrongValueOrAWrongMotionFails) {
  CatalogueScene entry = make_scene("lc_circuit");
  entry.known.front().components.front().value += 1e-6;
  const auto cases = run_published_cases(entry, Registry::with_built_ins(), kinsol());
  EXPECT_FALSE(std::ranges::all_of(cases, &PublishedCase::passed));
  entry.known.clear();
  EXPECT_FALSE(run_published_cases(entry, Registry::with_built_ins(), kinsol()).front().passed());
  entry.recommended.method = "type1/unknown";
  EXPECT_NE(run_published_cases(entry, Registry::with_built_ins(), kinsol()).front().failure.find("unknown"),
            std::string::npos);
}

TEST(DegenerateCircuit, IdaMeetsTheClosedFormToo) {
  const CatalogueScene entry = make_scene("lc_circuit");
  const ReferenceRun ida = integrate_with_ida(*entry.scene, 10.0, {.rtol = 1e-11});
  ASSERT_TRUE(ida.ok()) << ida.failure;
  const auto exact = entry.reference.at(10.0);
  ASSERT_TRUE(exact.has_value());
  EXPECT_LT((ida.end.q - exact->q).lpNorm<Eigen::Infinity>(), 1e-7);
  EXPECT_LT((ida.end.v - exact->v).lpNorm<Eigen::Infinity>(), 1e-7);
}

TEST(CatalogueScenes, EveryCaseIsThere) { EXPECT_EQ(scene_names().size(), 66u); }

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
