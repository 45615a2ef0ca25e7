#include <gtest/gtest.h>

#include <algorithm>
#include <diracstep/reports/report.hpp>
#include <diracstep/reports/series_style.hpp>
#include <diracstep/reports/study_comparison.hpp>
#include <diracstep/reports/study_page.hpp>
#include <diracstep/reports/study_plot.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <string>

#include "misuse.hpp"
#include "temporary_folder.hpp"

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
  const History history = record_history(scene, Registry::with_built_ins(), kinsol(), study, 500);
  EXPECT_EQ(history.method, "type1/midpoint");
  EXPECT_EQ(history.order, 4);
  EXPECT_EQ(history.step, 0.1);  // the cheaper one of the two below 1e-6
  EXPECT_EQ(history.time.size(), 101u);
  EXPECT_EQ(history.time.front(), 0.0);
  EXPECT_EQ(history.time.back(), 10.0);
  ASSERT_EQ(history.constraint.size(), history.time.size());
  EXPECT_EQ(history.energy.front(), 0.0);
  for (const double violation : history.constraint) EXPECT_LT(violation, 1e-13);
  EXPECT_FALSE(history.plan.empty());
  EXPECT_TRUE(history.failure.empty());
  EXPECT_EQ(history.track_time.size(), 6001u) << "the picture takes shorter steps";
  ASSERT_EQ(history.positions.size(), history.track_time.size());
  EXPECT_EQ(history.positions.back().size(), 3);
}

TEST(History, ErrorOverTimeEndsInTheErrorOfTheStudyAgainstAClosedFormAndAgainstHalfTheStep) {
  for (const char* name : {"knife_edge", "double_pendulum"}) {
    const CatalogueScene scene = make_scene(name);
    const Study study = small_study(scene);
    const History history = record_history(scene, Registry::with_built_ins(), kinsol(), study, 500);
    ASSERT_EQ(history.error.size(), history.time.size()) << name;
    EXPECT_EQ(history.error.front(), 0.0) << name;
    const auto row = std::ranges::find_if(study.rows, [&](const StudyRow& r) {
      return r.method == history.method && r.order == history.order && r.step == history.step;
    });
    ASSERT_NE(row, study.rows.end()) << name;
    EXPECT_GT(history.error.back(), 0.2 * row->error()) << name;  // over the largest q and p of the run,
    EXPECT_LT(history.error.back(), 1.1 * row->error()) << name;  // not over those of the end
  }
}

TEST(History, KeepsFewNumbersOfALargeScene) {
  const CatalogueScene scene = make_scene("toda_200");
  StudyOptions options;
  options.steps = {1.0};
  options.orders = {2};
  options.baselines = {};
  options.repeats = 1;
  options.t_end = 20.0;
  const Study study = convergence_study(scene, Registry::with_built_ins(), kinsol(), options);
  const History history = record_history(scene, Registry::with_built_ins(), kinsol(), study, 2000);
  EXPECT_LT(history.positions.size() * static_cast<std::size_t>(history.positions[0].size()), 100'000u);
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
  expect_parts(page, {"<!DOCTYPE html>", "id=\"knife_edge\"", "a &lt; b &amp; &quot;c&quot;", "explicit",
                      "What type1/midpoint does here", "SUNDIALS 6", "</html>"});
  for (const char* outside : {"src=\"http", "src=\"/", "href=\"http", "href=\"/", "url(http", "@import"})
    EXPECT_EQ(page.find(outside), std::string::npos) << outside;
}

TEST(StudyPage, DataCannotEndTheElementTheyStandIn) {
  PageEntry entry;
  entry.study.scene = "</script><b>";
  const std::string page = study_page({entry}, {}, "/nonexistent");
  EXPECT_EQ(page.find("</script><b>"), std::string::npos);
  EXPECT_NE(page.find("\\u003c/script>"), std::string::npos);
}

TEST(StudyPage, ShowsTheStandInOfEachPictureWhereThereIsOne) {
  const testing::TemporaryFolder folder;
  (void)folder.write("knife_edge.svg", "<svg id=\"100%\"/>");
  const CatalogueScene scene = make_scene("knife_edge");
  const PageEntry entry{small_study(scene), {}, scene.kind, scene.description, scene.source};
  const std::string page = study_page({entry}, {}, folder.path());
  EXPECT_NE(page.find("data:image/svg+xml;charset=utf-8,%3Csvg id=%22100%25%22/%3E"), std::string::npos);
}

TEST(StudyPlot, CoordinatesAreDrawnOverTheTimesOfTheirOwnPoints) {
  const testing::TemporaryFolder folder;
  History history;
  history.method = "m";
  history.time = {0.0, 1000.0};  // of the run whose energy is shown
  history.energy = history.error = {0.0, 1e-9};
  history.motion.coordinates = {{0, "angle", "rad"}};
  history.track_time = {0.0, 1.0, 2.0};  // of the motion
  history.positions = {Vector::Constant(1, 0.0), Vector::Constant(1, 1.0), Vector::Constant(1, 4.0)};
  const std::string failure = draw_history(history, "s", "s", {}, folder.path());
  if (failure.find("gnuplot was not found") != std::string::npos) GTEST_SKIP() << failure;
  EXPECT_EQ(failure, "");
  const std::string picture = testing::contents(folder.path("s-motion.svg"));
  EXPECT_NE(picture.find("angle"), std::string::npos);
  EXPECT_EQ(picture.find("1000"), std::string::npos) << "the time axis is that of the motion";
}

TEST(SeriesStyle, GivesAMethodOneColourOnAllScenesAndEachCurveAMarkerOfItsOwn) {
  Study first, second;
  first.measured_orders = {{"a", 2, {}, 0, {}}, {"a", 4, {}, 0, {}}, {"b", 6, {}, 0, {}}};
  second.measured_orders = {{"c", 2, {}, 0, {}}, {"b", 6, {}, 0, {}}, {"a", 6, {}, 0, {}}};
  const auto styles = series_styles({first, second});
  ASSERT_EQ(styles.size(), 5u);
  EXPECT_EQ(styles[0].colour, styles[1].colour);
  EXPECT_NE(styles[0].marker, styles[1].marker);
  EXPECT_EQ(styles[2].colour, 1u);
  EXPECT_EQ(styles[3].label(), "c, order 2");
  EXPECT_EQ(styles[3].colour, 2u);
  EXPECT_EQ(styles[4].colour, 0u);
  for (std::size_t i = 0; i < styles.size(); ++i) EXPECT_EQ(styles[i].marker, i);
}

TEST(SummaryMarkdown, HasALineForEachSceneAndError) {
  Study study;
  study.scene = "s";
  study.at_error = {{.error = 1e-6,
                     .method = "m",
                     .order = 4,
                     .best = true,
                     .cpu_seconds = 0.002,
                     .ida_cpu_seconds = 0.005,
                     .ratio = 2.5},
                    {.error = 1e-6, .method = "n", .order = 4, .cpu_seconds = 0.003}};
  const std::string text = summary_markdown({study}, true);
  expect_parts(text,
               {"Times with SUNDIALS", "| `s` | 1e-06 | `m`, order 4 | 2.00 ms | 5.00 ms | 2.50 | - | - |"});
  EXPECT_EQ(text.find("`n`"), std::string::npos);
  const std::string without = summary_markdown({study}, false);
  expect_parts(without, {"| `s` | 1e-06 | `m`, order 4 | 2.00 ms | 5.00 ms | - |", "known to be optimised"});
  EXPECT_EQ(without.find("2.50"), std::string::npos);
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
