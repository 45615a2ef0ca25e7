#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/core/adaptive/adaptive_event_steps.hpp>
#include <diracstep/core/runs/event_steps.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "misuse.hpp"

/// EventSteps as a program calls it.
namespace diracstep {
namespace {

using testing::expect_misuse;

/// A pendulum of length 1 as a row, from the horizontal.
std::shared_ptr<const Scene> rod() {
  Scene scene;
  scene.name = "rod";
  scene.coordinates = {"x", "y"};
  scene.lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    return (v[0] * v[0] + v[1] * v[1]) - 2.0 * 9.81 * q[1];  // a mass of 2
  });
  scene.constraints = {holonomic<2, 1>(
      [](const auto& q) { return std::array{decltype(q[0] * q[0])(q[0] * q[0] + q[1] * q[1] - 1.0)}; },
      {"rod"})};
  scene.start = {0.0, Vector::Unit(2, 0), Vector::Zero(2)};
  return std::make_shared<const Scene>(scene);
}

/// A wall at x = 0, that gives back half of the speed.
Event wall() {
  Event event;
  event.name = "wall";
  event.at = [](const MotionPoint& point) { return point.q[0]; };
  event.direction = Event::Direction::falling;
  event.contact = holonomic<2, 1>([](const auto& q) { return std::array{q[0] + 0.0 * q[1]}; });
  event.restitution = [](const MotionPoint&) { return 0.5; };
  return event;
}

const IntegratorOptions small_steps{.method = "type1/gl:3", .step = 0.02};

template <class Stepper, class Make>
void expect_half_of_the_speed(const Make& make, double tolerance) {
  EventSteps<Stepper> motion(rod(), nullptr, {wall()}, kinsol(), Momentum::projected, make);
  while (motion.hits().size() < 3) ASSERT_TRUE(motion.step().ok());
  double speed = std::sqrt(2.0 * 9.81);
  for (const EventHit& hit : motion.hits()) {
    EXPECT_NEAR(hit.sample.v[0], -speed, tolerance);
    ASSERT_TRUE(hit.after);
    EXPECT_NEAR(hit.after->v[0], 0.5 * speed, tolerance);
    EXPECT_NEAR(hit.after->v[1], 0.0, tolerance) << "the rod holds";
    EXPECT_NEAR(hit.impulse, 2.0 * 1.5 * speed, 2.0 * tolerance);
    EXPECT_NEAR(hit.after->q.norm(), 1.0, 1e-13);
    speed *= 0.5;
  }
}

TEST(EventSteps, AnImpactKeepsTheOtherRows) {
  const Registry registry = Registry::with_built_ins();
  expect_half_of_the_speed<Integrator>(integrators(registry, kinsol(), small_steps), 1e-9);
  expect_half_of_the_speed<AdaptiveIntegrator>(
      [&](const std::shared_ptr<const Scene>& scene) {
        return std::make_unique<AdaptiveIntegrator>(scene, registry, kinsol(), small_steps,
                                                    AdaptiveOptions{.eps = 0.05, .end = 3.0});
      },
      1e-8);
}

TEST(EventSteps, RunsToItsEndOrToTheEventThatStopsIt) {
  const Registry registry = Registry::with_built_ins();
  Event stop = wall();
  stop.stop = true;
  EventSteps<Integrator> motion(rod(), nullptr, {stop}, kinsol(), Momentum::projected,
                                integrators(registry, kinsol(), small_steps));
  Sample end;
  std::vector<long> taken;
  const auto before = [&](long k) { taken.push_back(k); };
  ASSERT_TRUE(motion.run(3, end, before).ok());
  EXPECT_EQ(taken, (std::vector<long>{0, 1, 2}));
  EXPECT_FALSE(motion.stopped());
  EXPECT_NEAR(end.time, 0.06, 1e-15);
  ASSERT_TRUE(motion.run(1000, end).ok());
  EXPECT_TRUE(motion.stopped());
  EXPECT_NEAR(end.q[0], 0.0, 1e-12);
  EXPECT_NEAR(end.v[0], 0.5 * std::sqrt(2.0 * 9.81), 1e-9) << "behind the impact";
}

/// The name of the scene must not be taken for its end.
TEST(EventSteps, AMotionSetOffItsRowsFailsWithTheRow) {
  const Registry registry = Registry::with_built_ins();
  auto scene = std::make_shared<Scene>(*rod());
  scene->name = "Ann's rod";
  Event event = wall();
  event.contact = nullptr;
  event.restitution = nullptr;
  event.set = {{.index = 0, .second = false, .value = [](const MotionPoint&) { return 0.5; }}};
  EventSteps<Integrator> motion(scene, nullptr, {event}, kinsol(), Momentum::projected,
                                integrators(registry, kinsol(), small_steps));
  Sample end;
  const StepReport report = motion.run(1000, end);
  EXPECT_FALSE(report.ok());
  EXPECT_TRUE(report.failure.starts_with("event 'wall' at t = ")) << report.failure;
  EXPECT_NE(report.failure.find("behind it: it violates row 'rod': φ(q) = 0.25"), std::string::npos)
      << report.failure;
}

TEST(EventSteps, BadEventsAreMisuse) {
  const Registry registry = Registry::with_built_ins();
  const auto with = [&](Event event) {
    EventSteps<Integrator> motion(rod(), nullptr, {std::move(event)}, kinsol(), Momentum::projected,
                                  integrators(registry, kinsol(), small_steps));
  };
  Event event = wall();
  event.off = {"rope"};
  expect_misuse([&] { with(event); }, {"'rope'"});
  event = wall();
  event.contact = nullptr;
  expect_misuse([&] { with(event); }, {"'wall'", "contact"});
  event = wall();
  event.set = {{.index = 2, .second = false, .value = event.restitution}};
  expect_misuse([&] { with(event); }, {"'wall'", "coordinate 2 of 2"});
}

}  // namespace
}  // namespace diracstep
