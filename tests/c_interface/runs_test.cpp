#include <atomic>
#include <chrono>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <thread>

#include "c_interface.hpp"

namespace diracstep::testing {
namespace {

TEST_F(CInterface, RunsIntoArraysThatGrowAndEndsWhereAsked) {
  ASSERT_EQ(open("knife_edge"), DIRACSTEP_OK);
  diracstep_options options{};
  options.method = "type1/gl:2";
  options.step = 0.03;
  options.ends = 1;
  options.end = 2.0;
  ASSERT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
  Arrays arrays(3, 1);
  diracstep_course course{};
  course.every = 10;
  EXPECT_GE(diracstep_expect(made_, &course), 8);
  ASSERT_EQ(diracstep_run(made_, &course, &arrays.points), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(arrays.points.count, 8);  // 67 steps: 0, 10, … 60 and the end
  EXPECT_DOUBLE_EQ(arrays.t[7], 2.0);
  EXPECT_STREQ(diracstep_doubt(made_), "");
  diracstep_statistics statistics{};
  ASSERT_EQ(diracstep_read_statistics(made_, &statistics), DIRACSTEP_OK);
  EXPECT_EQ(statistics.steps, 67);
  EXPECT_STREQ(statistics.method, "type1/gl:2");

  const CatalogueScene entry = make_scene("knife_edge");
  Integrator same(entry.scene, Registry::with_built_ins(), kinsol(),
                  {.method = "type1/gl:2", .step = 2.0 / 67});
  Sample end;
  (void)run_steps(same, 67);
  (void)same.sample(Momentum::projected, end);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(arrays.last_q(i), end.q[i]);
  EXPECT_EQ(arrays.energy[7], end.energy);
  EXPECT_EQ(arrays.lambda[7], end.lambda[0]);
}

TEST_F(CInterface, ARunWithoutRoomFailsAndKeepsWhatItHas) {
  ASSERT_EQ(open("knife_edge"), DIRACSTEP_OK);
  ASSERT_EQ(create(), DIRACSTEP_OK);
  Arrays arrays(3, 1, 3);
  arrays.points.enlarge = nullptr;
  EXPECT_EQ(diracstep_run(made_, nullptr, &arrays.points), DIRACSTEP_FAILED);
  expect_message({"room for 3 points"});
  EXPECT_EQ(arrays.points.count, 3);
}

TEST_F(CInterface, RunsStopAtTheFlagAndShowTimesInBetween) {
  ASSERT_EQ(open("knife_edge"), DIRACSTEP_OK);
  ASSERT_EQ(create(), DIRACSTEP_OK);
  Arrays arrays(3, 1);
  int stop = 0;
  diracstep_course course{};
  course.stop = &stop;
  course.steps = 1'000'000'000;
  course.every = 1'000'000'000;
  std::thread other([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    std::atomic_ref<int>(stop).store(1);
  });
  EXPECT_EQ(diracstep_run(made_, &course, &arrays.points), DIRACSTEP_INTERRUPTED);
  other.join();
  expect_message({"interrupted at t = "});
  ASSERT_EQ(arrays.points.count, 2);  // the start and where it was stopped
  EXPECT_EQ(arrays.t[1], diracstep_time(made_));

  ASSERT_EQ(create(), DIRACSTEP_OK);
  const double times[] = {0.1, 0.33, 1.0};
  course = {};
  course.times = 3;
  course.time = times;
  ASSERT_EQ(diracstep_run(made_, &course, &arrays.points), DIRACSTEP_OK) << diracstep_message();
  EXPECT_EQ(arrays.points.count, 3);
  EXPECT_EQ(arrays.t[1], 0.33);
}

TEST_F(CInterface, StepsVaryAsTheLibrarysDo) {
  ASSERT_EQ(open("kepler_e06"), DIRACSTEP_OK);
  diracstep_options options{};
  options.method = "type1/gl:3";
  options.eps = 0.2;
  options.ends = 1;
  options.end = 7.0;
  ASSERT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
  Arrays arrays(2, 0);
  ASSERT_EQ(diracstep_run(made_, nullptr, &arrays.points), DIRACSTEP_OK) << diracstep_message();
  diracstep_statistics statistics{};
  ASSERT_EQ(diracstep_read_statistics(made_, &statistics), DIRACSTEP_OK);
  EXPECT_LT(statistics.smallest, 0.5 * statistics.largest);
  const CatalogueScene entry = make_scene("kepler_e06");
  AdaptiveIntegrator same(entry.scene, Registry::with_built_ins(), kinsol(),
                          {.method = "type1/gl:3", .step = entry.natural_step}, {.eps = 0.2, .end = 7.0});
  Sample end;
  (void)run_until(same, 7.0, Momentum::projected, 1, [&](const Sample& point) {
    end = point;
    return true;
  });
  EXPECT_EQ(arrays.last_q(0), end.q[0]);
  EXPECT_EQ(arrays.last_q(1), end.q[1]);
  std::size_t size = 0;
  EXPECT_EQ(diracstep_save(made_, nullptr, 0, &size), DIRACSTEP_MISUSE);
  expect_message({"fixed size"});
}

/// A current behind 1 mH and 1 kΩ: L/R is a microsecond, the motion takes 13 ms.
TEST_F(CInterface, StepsThatVaryByWhatIsUsualAreDampedWhereTheMotionIs) {
  diracstep_source source{};
  source.text =
      "name = \"load\"\nlagrangian = \"1e-3*v_q^2/2\"\n[coordinates]\nq = {}\n"
      "[force]\nq = \"5 + sin(100*pi*t) - 1000*v_q\"\n[span]\nend = 0.013\nstep = 5e-4\n";
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  diracstep_options options{};
  options.eps = std::nan("");
  options.ends = 1;
  options.end = 0.013;
  ASSERT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
  Arrays arrays(1, 0);
  ASSERT_EQ(diracstep_run(made_, nullptr, &arrays.points), DIRACSTEP_OK) << diracstep_message();
  diracstep_statistics statistics{};
  ASSERT_EQ(diracstep_read_statistics(made_, &statistics), DIRACSTEP_OK);
  EXPECT_STREQ(statistics.method, "damped/radau:3");
  EXPECT_LT(statistics.smallest, 1e-2 * statistics.largest);
  ASSERT_EQ(open("kepler_e06"), DIRACSTEP_OK);
  ASSERT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(diracstep_read_statistics(made_, &statistics), DIRACSTEP_OK);
  EXPECT_EQ(std::string(statistics.method).find("damped"), std::string::npos) << statistics.method;
}

TEST_F(CInterface, SearchesForAnErrorAndTellsWhatItFound) {
  diracstep_source source{};
  source.text = spring;
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  Arrays arrays(1, 0);
  diracstep_error error{};
  error.error = 1e-8;
  diracstep_found found{};
  ASSERT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_OK)
      << diracstep_message();
  EXPECT_NEAR(arrays.last_q(0), std::cos(6.0), 1e-8);
  EXPECT_LT(found.estimate, 1e-8);
  EXPECT_NE(std::string(found.method).find("type1/"), std::string::npos);
  EXPECT_GE(found.runs.rows, 2);
  ASSERT_EQ(create(), DIRACSTEP_OK);
  for (int k = 0; k < 7; ++k) EXPECT_STREQ(diracstep_doubt(made_), "");  // texts of earlier calls are gone
  ASSERT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_OK);
  EXPECT_EQ(std::string(found.method).rfind("type1/", 0), 0u);
  EXPECT_NE(std::string(found.reason).find("order"), std::string::npos);
  error.max_solves = 1;
  EXPECT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_FAILED);
  error.steps = 7;
  EXPECT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_MISUSE);
}

TEST_F(CInterface, AnEnsembleHasTheEndsOfItsMembersForAnyNumberOfThreads) {
  diracstep_source source{};
  source.text = spring;
  ASSERT_EQ(open(source), DIRACSTEP_OK);
  std::vector<double> starts(50);
  for (std::size_t k = 0; k < starts.size(); ++k) starts[k] = 0.1 * static_cast<double>(k);
  diracstep_options options{};
  options.ends = 1;
  options.end = 2.0;
  diracstep_ensemble ensemble{};
  ensemble.members = 50;
  ensemble.q = starts.data();
  std::vector<std::vector<double>> ends;
  for (const int threads : {1, 3}) {
    ensemble.threads = threads;
    Arrays arrays(1, 0, 50);
    diracstep_table failures{};
    ASSERT_EQ(diracstep_run_ensemble(model_, &options, &ensemble, &arrays.points, &failures), DIRACSTEP_OK)
        << diracstep_message();
    EXPECT_EQ(failures.rows, 0);
    ends.push_back(arrays.q);
  }
  EXPECT_EQ(ends[0], ends[1]);
  for (std::size_t k = 0; k < starts.size(); ++k) EXPECT_NEAR(ends[0][k], starts[k] * std::cos(2.0), 1e-5);
  Arrays few(1, 0, 49);
  EXPECT_EQ(diracstep_run_ensemble(model_, &options, &ensemble, &few.points, nullptr), DIRACSTEP_MISUSE);
  const int stop = 1;
  ensemble.stop = &stop;
  Arrays arrays(1, 0, 50);
  EXPECT_EQ(diracstep_run_ensemble(model_, &options, &ensemble, &arrays.points, nullptr),
            DIRACSTEP_INTERRUPTED);
}

}  // namespace
}  // namespace diracstep::testing
