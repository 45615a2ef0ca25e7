#include <gtest/gtest.h>

#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/report.hpp>
#include <diracstep/validation/study_comparison.hpp>
#include <diracstep/validation/study_page.hpp>
#include <string>

#include "misuse.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::expect_parts;

Study small_study(const CatalogueScene& scene) {
  StudyOptions options;
  options.orders = {2, 4};
  options.steps = {0.1, 0.05};
  options.rtols = {1e-6, 1e-8};
  options.repeats = 1;
  return convergence_study(scene, Registry::with_built_ins(), kinsol(), options);
}

TEST(History, RepeatsTheRunOfAStudyWithWhatShouldStay) {
  const CatalogueScene scene = make_scene("knife_edge");
  const Study study = small_study(scene);
  const History history = record_history(scene, Registry::with_built_ins(), kinsol(), study, 50);
  EXPECT_EQ(history.method, "type1/midpoint");
  EXPECT_EQ(history.order, 4);
  EXPECT_EQ(history.step, 0.1);  // the cheaper one of the two below 1e-6
  EXPECT_EQ(history.time.front(), 0.0);
  EXPECT_EQ(history.time.back(), 10.0);
  ASSERT_EQ(history.positions.size(), history.time.size());
  ASSERT_EQ(history.constraint.size(), history.time.size());
  EXPECT_EQ(history.energy.front(), 0.0);
  for (const double violation : history.constraint) EXPECT_LT(violation, 1e-13);
  EXPECT_FALSE(history.plan.empty());
  EXPECT_TRUE(history.failure.empty());
}

TEST(History, IsEmptyWhereNoRunSucceeded) {
  const CatalogueScene scene = make_scene("knife_edge");
  EXPECT_TRUE(record_history(scene, Registry::with_built_ins(), kinsol(), Study{}).method.empty());
}

TEST(StudyPage, NeedsNoOtherFileAndEscapesWhatItShows) {
  const CatalogueScene scene = make_scene("knife_edge");
  PageEntry entry{small_study(scene), {}, scene.kind, "a < b & \"c\"", scene.source};
  entry.history = record_history(scene, Registry::with_built_ins(), kinsol(), entry.study, 50);
  const std::string page = study_page({entry}, {{"methods", "type1/midpoint"}}, "/nonexistent");
  expect_parts(page, {"<!DOCTYPE html>", "id=\"knife_edge\"", "a &lt; b &amp; &quot;c&quot;", "IDA / ours",
                      "What type1/midpoint does here", "SUNDIALS 6", "</html>"});
  for (const char* outside : {"src=\"http", "src=\"/", "href=\"http", "href=\"/", "url(http", "@import"})
    EXPECT_EQ(page.find(outside), std::string::npos) << outside;
}

TEST(StudyComparison, TellsFasterSlowerAndLessExactApartFromNoise) {
  Study before;
  before.scene = "s";
  before.rows = {{.method = "m", .order = 2, .step = 0.1, .error_q = 1e-5, .error_p = 1e-6}};
  before.at_error = {{.error = 1e-3, .method = "m", .order = 2, .cpu_seconds = 2.0},
                     {.error = 1e-6, .method = "m", .order = 2, .cpu_seconds = 2.0}};
  Study now = before;
  now.at_error[0].cpu_seconds = 1.0;
  now.at_error[1].cpu_seconds = 2.1;
  now.rows[0].error_q = 2e-5;
  const auto changes = compare_studies({now}, studies_json({before}));
  ASSERT_EQ(changes.size(), 3u);
  EXPECT_EQ(changes[0].verdict, "faster");
  EXPECT_NEAR(changes[0].ratio, 2.0, 1e-12);
  EXPECT_EQ(changes[1].verdict, "");
  EXPECT_EQ(changes[2].verdict, "less exact");
  expect_parts(comparison_table(changes), {"faster", "less exact", "1 of 3 comparisons within the noise"});
  now.at_error[0].cpu_seconds = 4.0;
  EXPECT_EQ(compare_studies({now}, studies_json({before}))[0].verdict, "slower");
}

TEST(StudyComparison, RefusesWhatIsNoStudyOrSharesNothing) {
  Study study;
  study.scene = "s";
  expect_misuse([&] { (void)compare_studies({study}, "{"); }, {"studies"});
  expect_misuse([&] { (void)compare_studies({study}, R"({"studies": [{"scene": 3}]})"); }, {"lacks"});
  expect_misuse([&] { (void)compare_studies({study}, R"({"studies": []})"); }, {"shares no scene"});
}

}  // namespace
}  // namespace diracstep
