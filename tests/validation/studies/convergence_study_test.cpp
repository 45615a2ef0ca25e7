#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/studies/converged_reference.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

namespace diracstep {
namespace {

Study study_of(const std::string& scene, const StudyOptions& options, const StudyObserver& observer = {}) {
  const Registry registry = Registry::with_built_ins();
  const SolverFactory solvers = kinsol();
  return convergence_study(make_scene(scene), registry, solvers, options, observer);
}

/// Short motions on which the steps below are asymptotic; an odd length, so that no scene is at rest at its
/// end.
StudyOptions short_study(const std::string& scene) {
  const CatalogueScene entry = make_scene(scene);
  const double h = entry.natural_step;
  StudyOptions options;
  options.orders = {2};
  options.steps = {h / 8.0, h / 16.0, h / 32.0, h / 64.0};
  options.rtols = {};
  options.repeats = 1;
  options.t_end = 37.0 * h;
  return options;
}

const std::vector<std::string> catalogue = {"kepler_e06", "knife_edge", "nonholonomic_particle_free",
                                            "pendulum_cartesian"};

TEST(Conclude, ComparesWithIdaOnlyWhereBothGetThere) {
  Study study;
  study.measured_orders = {{"ours", 2, {}, 0, {}}, {"ours", 4, {}, 0, {}}};
  const auto row = [](const std::string& method, int order, double error, double seconds) {
    StudyRow made{.method = method, .order = order, .step = 1.0 / seconds};
    made.error_q = error;
    made.error_p = 0.5 * error;
    made.cpu_seconds = {seconds, seconds, seconds, 1};
    return made;
  };
  study.rows = {row("ours", 2, 1e-2, 1.0),  row("ours", 2, 1e-4, 100.0),   row("ours", 4, 1e-2, 1.0),
                row("ours", 4, 1e-7, 32.0), row(ida_method, 0, 1e-2, 2.0), row(ida_method, 0, 1e-4, 200.0)};
  conclude(study);
  ASSERT_EQ(study.at_error.size(), 8u);
  EXPECT_TRUE(study.at_error[0].best);
  EXPECT_EQ(study.at_error[0].order, 4);
  EXPECT_NEAR(*study.at_error[0].ratio, 10.0, 1e-9);  // IDA 20 s, order 4 32^(1/5) = 2 s
  EXPECT_NEAR(*study.at_error[1].ratio, 2.0, 1e-9);
  EXPECT_TRUE(study.at_error[2].cpu_seconds.has_value());  // 1e-6: order 4 only
  EXPECT_FALSE(study.at_error[2].ida_cpu_seconds.has_value());
  EXPECT_FALSE(study.at_error[2].ratio.has_value());
  EXPECT_FALSE(study.at_error[3].cpu_seconds.has_value());
  for (std::size_t i : {4u, 5u, 6u, 7u}) {
    EXPECT_FALSE(study.at_error[i].cpu_seconds.has_value());  // 1e-9 and 1e-12: nobody
    EXPECT_FALSE(study.at_error[i].best);
  }
  const auto json = nlohmann::json::parse(studies_json({study}));
  EXPECT_TRUE(json["studies"][0]["at_error"][5]["cpu_seconds"].is_null());
  EXPECT_TRUE(json["studies"][0]["at_error"][2]["ratio"].is_null());
}

TEST(Conclude, TakesTheTimeOfTheCoarsestRunOnEverySideWhereThatIsExactEnough) {
  Study study;
  study.measured_orders = {{"ours", 2, {}, 0, {}}};
  for (const char* method : {"ours", ida_method, erk_method}) {
    StudyRow row{.method = method, .order = study.rows.empty() ? 2 : 0, .step = 0.1};
    row.error_q = row.error_p = 1e-7;
    row.cpu_seconds = {1.0, 1.0, 1.0, 1};
    study.rows.push_back(row);
  }
  conclude(study);
  EXPECT_EQ(study.at_error[0].ratio, 1.0);
  EXPECT_EQ(study.at_error[0].erk_ratio, 1.0);
}

TEST(Conclude, ReadsNothingOffErrorsBelowThatOfTheReference) {
  Study study;
  study.reference_error = 2e-8;
  study.measured_orders = {{"ours", 2, {}, 0, {}}};
  for (int k = 0; k < 12; ++k) {
    const double h = 0.1 * std::pow(0.5, k);
    StudyRow row{.method = "ours", .order = 2, .step = h};
    row.error_q = row.error_p = k < 9 ? 0.1 * h * h : 1e-12;
    row.cpu_seconds = {1.0 / h, 1.0 / h, 1.0 / h, 1};
    study.rows.push_back(row);
  }
  conclude(study);
  EXPECT_TRUE(study.at_error[1].cpu_seconds.has_value()) << "1e-6";
  EXPECT_FALSE(study.at_error[2].cpu_seconds.has_value()) << "1e-9 is below the error of the reference";
  ASSERT_TRUE(study.measured_orders[0].slope.has_value());
  EXPECT_NEAR(*study.measured_orders[0].slope, 2.0, 1e-9);
}

TEST(ConvergenceStudy, ALadderThatReachesTheReferenceSaysSo) {
  CatalogueScene entry = make_scene("knife_edge");
  entry.reference.self_error = 1e-9;
  StudyOptions options;
  options.series = {{"type1/gl:4", 8}};
  options.rtols = {};
  options.repeats = 1;
  const Study study = convergence_study(entry, Registry::with_built_ins(), kinsol(), options);
  EXPECT_NE(study.measured_orders[0].ladder_end.find("reference"), std::string::npos)
      << study.measured_orders[0].ladder_end;
}

TEST(ConvergenceStudy, ATimeLimitEndsTheLadders) {
  StudyOptions options;
  options.repeats = 1;
  options.time_limit = 0.05;
  options.rtols = {1e-4, 1e-6, 1e-8, 1e-10};
  const Study study = study_of("kepler_e06", options);
  for (const MeasuredOrder& m : study.measured_orders)
    EXPECT_TRUE(m.ladder_end.find("share of the time") != std::string::npos ||
                m.ladder_end.find("next run would take") != std::string::npos)
        << m.ladder_end;
  EXPECT_LT(std::ranges::count_if(study.rows, &StudyRow::is_baseline), 8) << "both baselines end early";
}

class SceneStudy : public testing::TestWithParam<std::string> {};

TEST_P(SceneStudy, MidpointHasOrderTwoInPositionAndProjectedMomentum) {
  Study study = study_of(GetParam(), short_study(GetParam()));
  ASSERT_EQ(study.measured_orders.size(), 1u);
  EXPECT_TRUE(confirms_order(study.measured_orders[0])) << study_table(study);
  for (StudyRow& row : study.rows) row.error_p = 0.0;
  conclude(study);
  EXPECT_TRUE(confirms_order(study.measured_orders[0])) << "q alone\n" << study_table(study);
  Study of_p = study_of(GetParam(), short_study(GetParam()));
  for (StudyRow& row : of_p.rows) row.error_q = 0.0;
  conclude(of_p);
  EXPECT_TRUE(confirms_order(of_p.measured_orders[0])) << "p alone\n" << study_table(of_p);
}

TEST_P(SceneStudy, CompositionHasOrderFour) {
  StudyOptions options = short_study(GetParam());
  options.orders = {4};
  for (double& step : options.steps) step *= 4.0;
  const Study study = study_of(GetParam(), options);
  EXPECT_TRUE(confirms_order(study.measured_orders[0])) << study_table(study);
}

INSTANTIATE_TEST_SUITE_P(Catalogue, SceneStudy, testing::ValuesIn(catalogue),
                         [](const auto& scene) { return scene.param; });

TEST(ConvergenceStudy, OneSidedConstraintRuleIsNotTakenForOrderTwo) {
  for (const char* scene : {"knife_edge", "nonholonomic_particle_free"}) {
    StudyOptions options = short_study(scene);
    ASSERT_TRUE(confirms_order(study_of(scene, options).measured_orders[0]));
    for (double& step : options.steps) step /= 16.0;  // so that the larger errors are below 1e-2
    options.constraint_rule = StepRule::left;
    const Study planted = study_of(scene, options);
    EXPECT_FALSE(confirms_order(planted.measured_orders[0])) << study_table(planted);
    ASSERT_TRUE(planted.measured_orders[0].slope.has_value()) << study_table(planted);
    EXPECT_NEAR(*planted.measured_orders[0].slope, 1.0, 0.1) << study_table(planted);
  }
}

TEST(ConvergenceStudy, MomentumBeforeTheImpulseIsOfOrderOne) {
  StudyOptions options = short_study("knife_edge");
  options.momentum = Momentum::plus;
  for (double& step : options.steps) step /= 16.0;
  const Study study = study_of("knife_edge", options);
  ASSERT_TRUE(study.measured_orders[0].slope.has_value()) << study_table(study);
  EXPECT_NEAR(*study.measured_orders[0].slope, 1.0, 0.1);
}

TEST(ConvergenceStudy, LadderRunsFromCoarseErrorsToRoundOff) {
  StudyOptions options;
  options.orders = {8};
  options.rtols = {};
  options.repeats = 1;
  const Study study = study_of("knife_edge", options);
  EXPECT_GT(study.rows.front().error(), 1e-2);
  EXPECT_LT(study.rows.back().error(), 1e-10);
  EXPECT_NE(study.measured_orders[0].ladder_end.find("round-off"), std::string::npos);
  for (std::size_t i = 1; i < study.rows.size(); ++i) EXPECT_LT(study.rows[i].step, study.rows[i - 1].step);
  for (const double error : {1e-6, 1e-9}) {
    const auto at = std::ranges::find(study.at_error, error, &AtError::error);
    ASSERT_NE(at, study.at_error.end());
    EXPECT_TRUE(at->cpu_seconds.has_value()) << error;
    EXPECT_FALSE(at->ida_cpu_seconds.has_value()) << "no IDA was asked for";
  }
}

TEST(ConvergenceStudy, BudgetEndsTheLadderAndSaysSo) {
  StudyOptions options;
  options.orders = {2};
  options.rtols = {};
  options.repeats = 1;
  options.run_budget = 1e-3;
  const Study study = study_of("knife_edge", options);
  EXPECT_NE(study.measured_orders[0].ladder_end.find("would take"), std::string::npos);
  for (const StudyRow& row : study.rows) EXPECT_TRUE(row.ok());
}

TEST(ConvergenceStudy, RowsOfTheBaselinesCarryTheirOwnErrorEstimate) {
  StudyOptions options = short_study("knife_edge");
  options.rtols = {1e-8, 1e-5};
  options.ida_formulation = DaeFormulation::rates;
  const Study study = study_of("knife_edge", options);
  std::vector<StudyRow> baselines;
  for (const StudyRow& row : study.rows)
    if (row.is_baseline()) baselines.push_back(row);
  ASSERT_EQ(baselines.size(), 4u);
  EXPECT_EQ(baselines[0].method, ida_method);
  EXPECT_EQ(baselines[2].method, erk_method);
  EXPECT_EQ(baselines[0].rtol, 1e-5);
  for (const StudyRow& row : baselines) {
    EXPECT_TRUE(row.ok()) << row.status;
    // An estimate by a ten to a thousand times tighter run has the size of the error itself.
    EXPECT_LT(row.self_error, 10.0 * row.error());
    EXPECT_GT(row.self_error, 0.1 * row.error());
    EXPECT_GT(row.cpu_seconds.median, 0.0);
  }
}

TEST(ConvergenceStudy, WithoutReferenceAConvergedOneOfOurOwnTakesItsPlace) {
  CatalogueScene entry = make_scene("knife_edge");
  entry.reference = {};
  const Registry registry = Registry::with_built_ins();
  const Study study = convergence_study(entry, registry, kinsol(), short_study("knife_edge"));
  EXPECT_EQ(study.reference_kind, "converged");
  EXPECT_LT(study.reference_error, 1e-13);
  EXPECT_TRUE(confirms_order(study.measured_orders[0])) << study_table(study);
}

TEST(ConvergenceStudy, IdaIsTheLastResortWhereOurOwnReferenceGetsNoTime) {
  CatalogueScene entry = make_scene("knife_edge");
  entry.reference = {};
  StudyOptions options = short_study("knife_edge");
  options.reference_budget = 0.0;
  EXPECT_EQ(convergence_study(entry, Registry::with_built_ins(), kinsol(), options).reference_kind, "ida");
}

/// 1e8 radians, which IDA takes hours for; our own runs come to the end with steps that say nothing.
TEST(ConvergenceStudy, AReferenceByIdaHasABudget) {
  const CatalogueScene entry = scene_from_text(
      "fast.toml",
      "name = \"fast\"\nlagrangian = \"(v_x^2 - 1e10*x^4)/2\"\n[coordinates]\nx = {}\n[start]\nx = 1\n"
      "[span]\nend = 1000\nstep = 50\n");
  StudyOptions options;
  options.methods = {"type1/midpoint"};
  options.orders = {2};
  options.steps = {50.0};
  options.rtols = {};
  options.repeats = 1;
  options.reference_budget = 0.0;
  options.run_budget = 0.05;
  const Study study = convergence_study(entry, Registry::with_built_ins(), kinsol(), options);
  EXPECT_NE(study.reference_how.find("IDA has not come to the end within 0.05 s"), std::string::npos)
      << study_table(study);
}

TEST(ConvergedReference, LiesWithinItsOwnErrorOfAClosedForm) {
  const Registry registry = Registry::with_built_ins();
  for (const char* name :
       {"knife_edge", "pendulum_cartesian", "kepler_e06", "mass_spring_torn", "lc_circuit"}) {
    const CatalogueScene entry = make_scene(name);
    const double end = 0.1 * entry.t_end;
    const ReferenceEnd found = converged_reference(entry, registry, kinsol(), end, 10.0);
    const ReferenceEnd known = *known_point(entry, end);
    ASSERT_EQ(found.missing, "") << name;
    Sample at;
    at.q = known.q;
    at.p = known.p;
    EXPECT_LT(found.self_error, 1e-11) << name << ": " << found.how;
    // The stated error is a difference of two runs; the closed form has its own rounding.
    EXPECT_LT(found.distance(at), 3.0 * found.self_error + 10.0 * known.self_error)
        << name << ": " << found.how;
  }
}

TEST(ConvergedReference, SaysSoWhereItIsNotConverged) {
  const CatalogueScene entry = make_scene("chaotic_quartic");
  const Registry registry = Registry::with_built_ins();
  const ReferenceEnd hurried = converged_reference(entry, registry, kinsol(), entry.t_end, 0.02);
  if (hurried.missing.empty()) {
    EXPECT_GT(hurried.self_error, 1e-9) << hurried.how;
  }
  const ReferenceEnd none = converged_reference(entry, registry, kinsol(), entry.t_end, 0.0);
  EXPECT_NE(none.missing.find("two methods"), std::string::npos) << none.missing;
}

TEST(ConvergenceStudy, FailedRunIsARowThatSaysWhy) {
  StudyOptions options = short_study("pendulum_cartesian");
  options.t_end = 29.7;
  options.steps = {0.2, 0.01};
  const Study study = study_of("pendulum_cartesian", options);
  ASSERT_EQ(study.rows.size(), 2u);
  EXPECT_NE(study.rows[0].status.find("no convergence"), std::string::npos) << study.rows[0].status;
  EXPECT_NE(study.rows[0].status.find("constraint residual"), std::string::npos) << study.rows[0].status;
  EXPECT_TRUE(study.rows[1].ok());
  const auto json = nlohmann::json::parse(studies_json({study}))["studies"][0]["rows"];
  EXPECT_TRUE(json[0]["error_q"].is_null());
  EXPECT_TRUE(json[0]["cpu_seconds"]["median"].is_null());
  EXPECT_FALSE(json[1]["error_q"].is_null());
}

TEST(ConvergenceStudy, OrderThatDoesNotFitIsARowBesideOnesThatDo) {
  StudyOptions options = short_study("knife_edge");
  options.orders = {3, 2};
  const Study study = study_of("knife_edge", options);
  ASSERT_EQ(study.rows.size(), 1u + options.steps.size());
  EXPECT_EQ(study.rows[0].order, 3);
  EXPECT_NE(study.rows[0].status.find("orders are"), std::string::npos) << study.rows[0].status;
  options.orders = {3};
  EXPECT_THROW(study_of("knife_edge", options), Misuse);
}

TEST(ConvergenceStudy, ObserverEndsItWithTheRowsSoFar) {
  std::set<std::string> runs;
  const auto observer = [&](double part, const std::string& run) {
    EXPECT_GE(part, 0.0);
    EXPECT_LE(part, 1.0);
    return runs.insert(run).first != runs.end() && runs.size() <= 3;
  };
  const Study study = study_of("knife_edge", short_study("knife_edge"), observer);
  EXPECT_TRUE(study.interrupted);
  EXPECT_EQ(study.rows.size(), 2u);
}

TEST(ConvergenceStudy, RefusesWhatAllowsNoRun) {
  const auto refused = [](auto change) {
    StudyOptions options = short_study("knife_edge");
    change(options);
    EXPECT_THROW(study_of("knife_edge", options), Misuse);
  };
  refused([](StudyOptions& o) { o.methods.clear(); });
  refused([](StudyOptions& o) { o.methods = {"type1/none"}; });
  refused([](StudyOptions& o) { o.steps = {0.0}; });
  refused([](StudyOptions& o) { o.steps = {NAN}; });
  refused([](StudyOptions& o) { o.steps = {-0.1}; });
  refused([](StudyOptions& o) { o.rtols = {1.0}; });
  refused([](StudyOptions& o) { o.rtols = {NAN}; });
  refused([](StudyOptions& o) { o.repeats = 0; });
  refused([](StudyOptions& o) { o.run_budget = 0.0; });
  refused([](StudyOptions& o) { o.t_end = 0.0; });
  refused([](StudyOptions& o) { o.t_end = INFINITY; });
}

TEST(Report, CsvHasOneLineForEachRowAndAsManyFieldsAsItsHeader) {
  StudyOptions options = short_study("knife_edge");
  options.rtols = {1e-6};
  const Study study = study_of("knife_edge", options);
  std::istringstream csv(studies_csv({study}));
  std::vector<std::string> lines;
  for (std::string line; std::getline(csv, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), study.rows.size() + 1);
  for (const auto& line : lines)
    EXPECT_EQ(std::ranges::count(line, ','), std::ranges::count(lines[0], ',')) << line;
}

TEST(Report, QuotesCsvFieldsThatNeedIt) {
  EXPECT_EQ(csv_field("plain"), "plain");
  EXPECT_EQ(csv_field("a,b"), "\"a,b\"");
  EXPECT_EQ(csv_field("say \"x\""), "\"say \"\"x\"\"\"");
}

}  // namespace
}  // namespace diracstep
