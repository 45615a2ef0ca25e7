#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/energy_check.hpp>
#include <diracstep/reports/stability_report.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/references/scaled_rows.hpp>
#include <diracstep/validation/studies/stability_cases.hpp>
#include <map>
#include <ostream>

namespace diracstep {

/// For GoogleTest's messages.
static void PrintTo(const StabilityCase& that, std::ostream* out) { *out << that.name; }

namespace {

StabilityRow run_case(const StabilityCase& that, const std::string& method, int order = 0) {
  return run_stability_case(that, Registry::with_built_ins(), kinsol(), {method, order});
}

LinearStability linear(const std::string& method, int order) {
  return linear_stability(Registry::with_built_ins(), kinsol(), method, order);
}

TEST(LinearStability, LimitsOfTheClassicalMethods) {
  for (const char* method : {"type1/left", "type1/right", "type2/euler", "type3/euler"})
    EXPECT_NEAR(linear(method, 1).oscillator_limit, 2.0, 1e-4) << method;
  EXPECT_NEAR(linear("type1/trapezoidal", 2).oscillator_limit, 2.0, 1e-4);
  for (const char* method : {"type1/midpoint", "type1/gl:2", "type1/gl:3", "type1/gl:4"}) {
    const LinearStability stability = linear(method, 0);
    EXPECT_EQ(stability.oscillator_limit, largest_tested_step) << method;
    EXPECT_EQ(stability.damping_limit, largest_tested_step) << method;
    for (const GrowthPoint& point : stability.growth)
      EXPECT_NEAR(point.oscillator, 1.0, growth_tolerance) << method << ' ' << point.step;
  }
}

TEST(LinearStability, GrowthHasItsClosedForm) {
  for (const GrowthPoint& point : linear("type1/trapezoidal", 2).growth) {
    const double half_trace = 1.0 - 0.5 * point.step * point.step;
    const double root = half_trace * half_trace - 1.0;
    const double expected = root > 0.0 ? std::abs(half_trace) + std::sqrt(root) : 1.0;
    EXPECT_NEAR(point.oscillator / expected, 1.0, 1e-7) << point.step;
  }
  for (const GrowthPoint& point : linear("type1/midpoint", 2).growth)
    EXPECT_NEAR(point.damping, std::abs((2.0 - point.step) / (2.0 + point.step)), 1e-10) << point.step;
  for (const GrowthPoint& point : linear("type1/left", 1).growth)
    EXPECT_NEAR(point.damping * (1.0 + point.step), 1.0, 1e-9) << point.step;
  EXPECT_NEAR(linear("type1/right", 1).damping_limit, 2.0, 1e-4);
}

TEST(LinearStability, ACompositionWithNegativeStepsMeetsItsPoleUnderDamping) {
  // Suzuki's five steps: the middle one of -0.6579… h makes the midpoint rule divide by 1 - 0.3289… hγ.
  const double middle = 1.0 - 4.0 / (4.0 - std::cbrt(4.0));
  const LinearStability four = linear("type1/midpoint", 4);
  EXPECT_EQ(four.oscillator_limit, largest_tested_step);
  EXPECT_NEAR(four.damping_limit, -2.0 / middle, 0.01 * four.damping_limit);
  const LinearStability eight = linear("type1/midpoint", 8);
  EXPECT_EQ(eight.oscillator_limit, largest_tested_step);
  EXPECT_LT(eight.damping_limit, 10.0);
}

TEST(LinearStability, AMethodWithoutForcesHasNoDampingLimit) {
  EXPECT_TRUE(std::isnan(linear("type4/legendre(type1/midpoint)", 2).damping_limit));
  EXPECT_THROW((void)linear("type1/gl:2", 5), Misuse);
}

StabilityCase knife_edge(long steps) {
  StabilityCase that = stability_case(make_scene("knife_edge"));
  that.step = 0.01;
  that.t_end = that.step * static_cast<double>(steps);
  return that;
}

TEST(StabilityRun, TheDriftOfAKnownFunctionLiesInItsConfidenceInterval) {
  StabilityCase that = knife_edge(800);
  const auto wave = [](double t) { return 0.01 * std::sin(40.0 * t); };
  that.watches = {
      {.name = "drifting",
       .at = [&](double t, ConstVectorRef, ConstVectorRef) { return 2.0 + 0.6 * t + wave(t); },
       .scale = 2.0,
       .bound = 1e9},
      {.name = "steady", .at = [&](double t, ConstVectorRef, ConstVectorRef) { return 2.0 + wave(t); }}};
  const StabilityRow row = run_case(that, "type1/midpoint");
  ASSERT_EQ(row.watches.size(), 2u);
  EXPECT_NEAR(row.watches[0].drift, 0.3, row.watches[0].drift_half_width);
  EXPECT_LT(row.watches[0].drift_half_width, 1e-3);
  EXPECT_TRUE(row.watches[0].drifts());
  EXPECT_NEAR(row.watches[0].band, 2.4, 0.01);
  EXPECT_FALSE(row.watches[1].drifts());
  EXPECT_NEAR(row.watches[1].band, 0.01, 1e-3);
}

TEST(StabilityRun, TellsHowLongAWatchStaysBounded) {
  StabilityCase that = knife_edge(400);
  that.scene.reference = {};
  that.watches = {
      {.name = "time", .at = [](double t, ConstVectorRef, ConstVectorRef) { return t; }, .bound = 1.005}};
  const StabilityRow row = run_case(that, "type1/midpoint");
  EXPECT_NEAR(row.watches[0].bounded_until, 1.0, 1e-12);
  EXPECT_EQ(row.outcome, StabilityOutcome::wrong) << "the energy is kept, so nobody says a word";
}

TEST(StabilityRun, EveryOutcomeCanBeReached) {
  StabilityCase that = knife_edge(100);
  EXPECT_EQ(run_case(that, "type1/gl:3").outcome, StabilityOutcome::accurate);
  that.accuracy = 0.0;
  EXPECT_EQ(run_case(that, "type1/gl:3").outcome, StabilityOutcome::bounded);
  EXPECT_EQ(run_case(that, "type1/gl:3", 7).outcome, StabilityOutcome::refused);
  const StabilityRow refused = run_case(that, "type1/no such method");
  EXPECT_EQ(refused.outcome, StabilityOutcome::refused);
  EXPECT_NE(refused.message.find("no such method"), std::string::npos);

  StabilityCase stiff = stability_case(make_scene("stiff_spring_pendulum", {{"k", 1e6}}));
  stiff.t_end = 0.06;
  const StabilityRow doubted = run_case(stiff, "type1/trapezoidal");
  EXPECT_EQ(doubted.outcome, StabilityOutcome::doubted);
  EXPECT_NE(doubted.message.find("energy"), std::string::npos);
  stiff.t_end = 10.0;
  const StabilityRow stopped = run_case(stiff, "type1/trapezoidal");
  EXPECT_EQ(stopped.outcome, StabilityOutcome::stopped);
  EXPECT_EQ(stopped.failed_solves, 1);
  EXPECT_LT(stopped.t_reached, 10.0);
  EXPECT_FALSE(stopped.message.empty());
}

TEST(StabilityStudy, IdaStandsBesideEveryRowAtItsCost) {
  const auto results = stability_study({knife_edge(1000)}, Registry::with_built_ins(), kinsol(),
                                       {{"type1/midpoint", 2}, {"type1/midpoint", 8}}, true, {});
  ASSERT_EQ(results.size(), 1u);
  ASSERT_FALSE(results[0].ida.empty());
  for (const StabilityRow& row : results[0].rows) {
    ASSERT_TRUE(row.ida.has_value());
    EXPECT_TRUE(row.ida->ok()) << row.ida->status;
    EXPECT_GT(row.ida->error, 0.0);
    EXPECT_LT(row.ida->error, 0.1);
    double cheapest = HUGE_VAL;
    for (const IdaBeside& ida : results[0].ida) cheapest = std::min(cheapest, ida.cpu_seconds);
    EXPECT_TRUE(row.ida->cpu_seconds <= row.cpu_seconds || row.ida->cpu_seconds == cheapest);
  }
}

TEST(StabilityStudy, EndsWhereTheObserverSaysSo) {
  const auto going_on = [](double, const std::string& what) {
    return what.find("gl:2") == std::string::npos;  // the first run goes through, the second is not begun
  };
  const auto results = stability_study({knife_edge(10), knife_edge(10)}, Registry::with_built_ins(), kinsol(),
                                       {{"type1/midpoint", 2}, {"type1/gl:2", 4}}, false, going_on);
  ASSERT_EQ(results.size(), 1u);
  EXPECT_EQ(results[0].rows.size(), 1u);
  int looks = 0;
  const StabilityRow row = run_stability_case(knife_edge(400), Registry::with_built_ins(), kinsol(),
                                              {"type1/midpoint", 2}, [&] { return ++looks < 11; });
  EXPECT_EQ(row.steps, 10);
}

TEST(ScaledRows, AreTheSameConstraintInOtherUnits) {
  const auto entry = make_scene("n_four_bar");
  const auto& rows = entry.scene->constraints.front();
  constexpr double factor = 1e8;
  const auto scaled = scaled_rows(rows, factor, ", scaled");
  EXPECT_EQ(scaled->names().front(), rows->names().front() + ", scaled");
  const Vector q = Vector::LinSpaced(6, 0.3, 1.1), w = Vector::LinSpaced(6, -0.5, 0.7);
  const Vector forces = Vector::LinSpaced(rows->rows(), 1.0, 2.0);
  const auto expect_scaled = [&](Eigen::Index size, auto evaluate) {
    Vector plain(size), times(size);
    evaluate(*rows, plain);
    evaluate(*scaled, times);
    EXPECT_GT(plain.norm(), 0.0);
    EXPECT_LT((times - factor * plain).norm(), 1e-12 * times.norm());
  };
  const auto nonzeros = rows->pattern().nonzeros(), curved = rows->curvature_pattern().nonzeros();
  expect_scaled(rows->rows(), [&](const ConstraintRows& r, Vector& x) { r.position(0.0, q, x); });
  expect_scaled(nonzeros, [&](const ConstraintRows& r, Vector& x) {
    Vector b(r.rows());
    r.coefficients(0.0, q, x, b);
  });
  expect_scaled(nonzeros, [&](const ConstraintRows& r, Vector& x) { r.derivative(0.0, q, w, 1.0, x); });
  expect_scaled(curved,
                [&](const ConstraintRows& r, Vector& x) { r.annihilator_derivative(0.0, q, forces, x); });
  EXPECT_THROW((void)scaled_rows(rows, 0.0, ""), Misuse);
  EXPECT_THROW((void)scaled_rows(rows, std::nan(""), ""), Misuse);
}

TEST(EnergyCheck, IsSilentForDampedAndDrivenScenes) {
  EXPECT_TRUE(keeps_energy(*make_scene("kepler_e06").scene));
  EXPECT_FALSE(keeps_energy(*make_scene("flyball_governor").scene));
  EXPECT_FALSE(keeps_energy(*make_scene("ball_turntable").scene));
}

TEST(EnergyCheck, NamesTheWorstPoint) {
  const auto entry = make_scene("kepler_e06");
  const Scene& scene = *entry.scene;
  EnergyCheck doubt(scene);
  Sample point{.time = 0.0,
               .q = scene.start.q,
               .v = scene.start.v,
               .p = {},
               .lambda = {},
               .impulse = {},
               .energy = -0.5};
  doubt.see(point);
  point.time = 1.0;
  point.energy = -0.49;
  doubt.see(point);
  EXPECT_EQ(doubt.text(), "");
  point.energy = std::nan("");
  doubt.see(point);
  EXPECT_NE(doubt.text().find("t = 1:"), std::string::npos) << doubt.text();
}

/// What the methods below do on a case, a letter each: A accurate, B bounded, t told (a reported failure, or
/// a doubt the user is told of), r refused by Misuse.  Where it is chance, both letters stand.  W, a wrong
/// number without a word, stands nowhere.
const std::vector<StabilityMethod> tabled_methods{
    {"type1/midpoint", 2}, {"type1/gl:3", 6}, {"type1/trapezoidal", 2}, {"type2/euler", 1}};
const std::map<std::string, std::vector<std::string>> expected{
    {"stiff_spring_pendulum k=1e2", {"B", "A", "B", "B"}},
    {"stiff_spring_pendulum k=1e4", {"B", "A", "B", "B"}},
    {"stiff_spring_pendulum k=1e6", {"B", "A", "t", "t"}},
    {"stiff_spring_pendulum k=1e8", {"t", "A", "t", "t"}},
    {"stiff_spring_pendulum k=1e8 h/5", {"A", "A", "t", "t"}},
    {"stiff_spring_pendulum k=1e10 h/5", {"A", "A", "t", "t"}},
    {"stiff_spring_pendulum k=1e12 h/5", {"t", "A", "t", "t"}},
    {"stiff_spring_pendulum k=1e10", {"t", "t", "t", "t"}},
    {"stiff_spring_pendulum k=1e12", {"t", "t", "t", "t"}},
    {"stiff_spring_pendulum row k=1e2", {"B", "A", "B", "r"}},
    {"stiff_spring_pendulum row k=1e4", {"B", "A", "t", "r"}},
    {"stiff_spring_pendulum row k=1e6", {"B", "A", "t", "r"}},
    {"stiff_spring_pendulum row k=1e8", {"B", "A", "t", "r"}},
    {"stiff_spring_pendulum row k=1e10", {"B", "A", "t", "r"}},
    {"stiff_spring_pendulum row k=1e12", {"B", "A", "t", "r"}},
    {"stiff_spring_pendulum row k=1e14", {"B", "A", "t", "r"}},
    {"stiff_spring_pendulum row k=inf", {"B", "A", "B", "r"}},
    {"fput om=50", {"B", "A", "B", "B"}},
    {"fput om=500", {"B", "B", "t", "t"}},
    {"fput om=5000", {"B", "B", "t", "t"}},
    {"fput om=50000", {"B", "B", "t", "t"}},
    {"flyball_governor h=0.005", {"A", "A", "A", "A"}},
    {"flyball_governor h=0.001", {"A", "A", "A", "A"}},
    {"flyball_governor h=0.0001", {"A", "A", "A", "A"}},
    {"kepler_e099 h=0.001", {"t", "B", "t", "t"}},
    {"kepler_e099 h=0.0001", {"B", "A", "B", "t"}},
    {"n_four_bar h=0.01", {"B", "A", "B", "B"}},
    {"n_four_bar h=0.005", {"A", "A", "A", "B"}},
    {"n_four_bar h=0.002", {"A", "A", "A", "B"}},
    {"n_four_bar 0.1 before flat", {"A", "A", "A", "B"}},
    {"n_four_bar 0.0001 before flat", {"A", "A", "A", "B"}},
    {"n_four_bar 1e-08 before flat", {"A", "A", "A", "B"}},
    {"n_four_bar 1e-12 before flat", {"r", "r", "r", "r"}},
    {"n_four_bar 0 before flat", {"r", "r", "r", "r"}},
    {"kepler from pericentre 0.01", {"t", "B", "t", "t"}},
    {"kepler from pericentre 0.0001", {"t", "t", "t", "t"}},
    {"kepler from pericentre 1e-06", {"t", "t", "t", "t"}},
    {"kepler from pericentre 1e-08", {"t", "t", "t", "t"}},
    {"knife_edge m/J=1e-12", {"A", "A", "A", "B"}},
    {"mass_spring_torn m3/m1=1e-12", {"B", "B", "t", "t"}},
    {"double_pendulum m2/m1=1e-12", {"B", "B", "B", "B"}},
    {"knife_edge m/J=1e-06", {"A", "A", "A", "B"}},
    {"mass_spring_torn m3/m1=1e-06", {"B", "B", "t", "t"}},
    {"double_pendulum m2/m1=1e-06", {"B", "B", "B", "B"}},
    {"knife_edge m/J=1e+06", {"A", "A", "A", "t"}},
    {"mass_spring_torn m3/m1=1e+06", {"B", "B", "B", "B"}},
    {"double_pendulum m2/m1=1e+06", {"t", "t", "t", "t"}},
    {"knife_edge m/J=1e+12", {"A", "A", "A", "t"}},
    {"mass_spring_torn m3/m1=1e+12", {"B", "B", "B", "B"}},
    {"double_pendulum m2/m1=1e+12", {"t", "t", "t", "t"}},
    {"pendulum_cartesian rows*1e-08", {"B", "A", "B", "B"}},
    {"pendulum_cartesian rows*0.0001", {"B", "A", "B", "B"}},
    {"pendulum_cartesian rows*10000", {"B", "A", "B", "B"}},
    {"pendulum_cartesian rows*1e+08", {"B", "A", "B", "B"}},
    {"knife_edge rows*1e-08", {"A", "A", "A", "t"}},
    {"knife_edge rows*0.0001", {"A", "A", "A", "t"}},
    {"knife_edge rows*10000", {"A", "A", "A", "t"}},
    {"knife_edge rows*1e+08", {"A", "A", "A", "t"}},
    {"n_four_bar rows*1e-08", {"A", "A", "A", "A"}},
    {"n_four_bar rows*0.0001", {"A", "A", "A", "A"}},
    {"n_four_bar rows*10000", {"A", "A", "A", "A"}},
    {"n_four_bar rows*1e+08", {"A", "A", "A", "A"}},
    {"pendulum_cartesian row twice, refused", {"r", "r", "r", "r"}},
    {"pendulum_cartesian row twice", {"B", "A", "B", "B"}},
    {"knife_edge row twice, refused", {"r", "r", "r", "r"}},
    {"knife_edge row twice", {"A", "A", "A", "t"}},
    {"n_four_bar row twice, refused", {"r", "r", "r", "r"}},
    {"n_four_bar row twice", {"A", "A", "A", "A"}},
    {"pendulum_cartesian step*1e-12", {"A", "A", "A", "A"}},
    {"pendulum_cartesian step*1e-9", {"A", "A", "A", "A"}},
    {"pendulum_cartesian step*1e-6", {"A", "A", "A", "A"}},
    {"pendulum_cartesian step*1e-3", {"A", "A", "A", "A"}},
    {"pendulum_cartesian step*1e0", {"B", "A", "B", "B"}},
    {"pendulum_cartesian step*1e1", {"t", "Bt", "t", "t"}},
    {"pendulum_cartesian step*1e2", {"t", "t", "t", "t"}},
    {"knife_edge step*1e-12", {"A", "A", "A", "A"}},
    {"knife_edge step*1e-9", {"A", "A", "A", "A"}},
    {"knife_edge step*1e-6", {"A", "A", "A", "A"}},
    {"knife_edge step*1e-3", {"A", "A", "A", "A"}},
    {"knife_edge step*1e0", {"B", "A", "B", "t"}},
    {"knife_edge step*1e1", {"t", "B", "t", "t"}},
    {"knife_edge step*1e2", {"t", "t", "t", "t"}},
    {"kepler_e06 step*1e-12", {"A", "A", "A", "A"}},
    {"kepler_e06 step*1e-9", {"A", "A", "A", "A"}},
    {"kepler_e06 step*1e-6", {"A", "A", "A", "A"}},
    {"kepler_e06 step*1e-3", {"A", "A", "A", "A"}},
    {"kepler_e06 step*1e0", {"B", "A", "B", "B"}},
    {"kepler_e06 step*1e1", {"t", "B", "t", "t"}},
    {"kepler_e06 step*1e2", {"t", "t", "t", "t"}},
};

char letter(StabilityOutcome outcome) {
  switch (outcome) {
    case StabilityOutcome::accurate:
      return 'A';
    case StabilityOutcome::bounded:
      return 'B';
    case StabilityOutcome::doubted:
    case StabilityOutcome::stopped:
      return 't';
    case StabilityOutcome::refused:
      return 'r';
    case StabilityOutcome::wrong:
      return 'W';
  }
  return '?';
}

class StabilityCases : public ::testing::TestWithParam<StabilityCase> {};

TEST_P(StabilityCases, EndAsStated) {
  const auto line = expected.find(GetParam().name);
  ASSERT_NE(line, expected.end()) << "no outcome is stated for this case";
  for (std::size_t k = 0; k < tabled_methods.size(); ++k) {
    const StabilityRow row =
        run_stability_case(GetParam(), Registry::with_built_ins(), kinsol(), tabled_methods[k]);
    EXPECT_NE(line->second[k].find(letter(row.outcome)), std::string::npos)
        << row.method << ": " << name(row.outcome) << ", error " << row.error << ", not " << line->second[k]
        << "; " << row.message;
    const bool told = row.outcome == StabilityOutcome::doubted || row.outcome == StabilityOutcome::stopped ||
                      row.outcome == StabilityOutcome::refused;
    EXPECT_EQ(told, !row.message.empty()) << row.method;
    if (row.outcome == StabilityOutcome::accurate) {
      EXPECT_LE(row.error, GetParam().accuracy);
    }
  }
}

std::string test_name(const ::testing::TestParamInfo<StabilityCase>& info) {
  std::string name = info.param.name;
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name + '_' + std::to_string(info.index);
}

INSTANTIATE_TEST_SUITE_P(Quick, StabilityCases, ::testing::ValuesIn(stability_cases(false)), test_name);

TEST(StabilityCasesOfTheTable, AllAreRun) {
  const auto cases = stability_cases(false);
  EXPECT_EQ(expected.size(), cases.size());
}

bool is_long(const StabilityCase& that) { return that.name.find("1e7 steps") != std::string::npos; }

TEST(StabilityCasesLong_slow, TenMillionStepsDriftByLessThanATenthOfTheBandOrRoundOff) {
  for (const StabilityCase& that : stability_cases(true)) {
    if (!is_long(that)) continue;
    for (const StabilityMethod& method : {StabilityMethod{"type1/midpoint", 2}, {"type1/gl:3", 6}}) {
      const StabilityRow row = run_stability_case(that, Registry::with_built_ins(), kinsol(), method);
      ASSERT_EQ(row.steps, 10'000'000) << that.name << ' ' << method.name << ": " << row.message;
      const WatchResult& energy = row.watches.front();
      EXPECT_LT(energy.band, 0.3) << that.name << ' ' << method.name;
      EXPECT_LT(std::abs(energy.drift) * that.t_end, 0.1 * energy.band + 1e-10)
          << that.name << ' ' << method.name;
      EXPECT_LT(row.constraint, 1e-12);
    }
  }
}

TEST(StabilityCasesLong_slow, NoFullCaseEndsWrongWithoutAWord) {
  for (const StabilityCase& that : stability_cases(true)) {
    if (is_long(that)) continue;
    for (const StabilityMethod& method : {StabilityMethod{"type1/midpoint", 2}, {"type1/gl:4", 8}}) {
      const StabilityRow row = run_stability_case(that, Registry::with_built_ins(), kinsol(), method);
      EXPECT_NE(row.outcome, StabilityOutcome::wrong) << that.name << " " << method.name;
    }
  }
}

}  // namespace
}  // namespace diracstep
