#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/integrator/step_solver.hpp>
#include <diracstep/core/methods/registry.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "combinations.hpp"

namespace diracstep {
namespace {

/// The step of a method with the solver around it.
struct Stepper {
  Stepper(const testing::ScenePointer& scene, const std::string& method, bool compensated)
      : reader(scene, kinsol(), true), solver(problem(*scene, method, compensated), kinsol(), reader) {
    start.q = scene->start.q;
    start.v = scene->start.v;
    start.p.setZero(start.v.size());
    Vector lq(start.v.size());
    scene->lagrangian->gradient(0.0, start.q, start.v, lq, start.p);
    x.setZero(solver.problem().size());
  }
  static std::unique_ptr<StepProblem> problem(const Scene& scene, const std::string& method,
                                              bool compensated) {
    auto problem = Registry::with_built_ins().method(method).make_step(scene, {.dense = true});
    if (compensated) {
      EXPECT_TRUE(problem->compensate());
    }
    return problem;
  }

  bool solve(double t, double h) {
    return solver.solve({{t, h}, start, predictor, Guess::predicted, false}, x, work).ok();
  }
  void accept() {
    start = solver.end().at;
    solver.accept_step();
    predictor.accept_step(x);
  }
  std::string memory() const {
    Snapshot to;
    solver.save(to);
    predictor.save(to);
    return to.bytes();
  }

  PointReader reader;
  StepSolver solver;
  Predictor predictor{solver.problem().traits(), solver.problem().size()};
  State start;
  Vector x;
  Work work;
};

TEST(StepSolver, ASolveLeavesNoTraceUntilItIsAccepted) {
  for (const auto& scene : testing::every_constraint_class())
    for (const char* method : {"type1/trapezoidal", "type3/legendre(type1/midpoint)", "type1/gl:2"})
      for (const bool compensated : {false, true}) {
        if (compensated && std::string(method) != "type1/gl:2") continue;
        Stepper plain(scene, method, compensated), tried(scene, method, compensated);
        for (int k = 0; k < 8; ++k) {
          const double t = 0.05 * k;
          const std::string before = tried.memory();
          for (const double h : {0.02, -0.03, 0.11}) ASSERT_TRUE(tried.solve(t, h));
          EXPECT_TRUE(tried.memory() == before) << scene->name << ", " << method;
          for (Stepper* stepper : {&plain, &tried}) ASSERT_TRUE(stepper->solve(t, 0.05));
          for (Stepper* stepper : {&plain, &tried}) stepper->accept();
          EXPECT_EQ(tried.start.q, plain.start.q) << scene->name << ", " << method << ", step " << k;
          EXPECT_EQ(tried.start.p, plain.start.p);
          EXPECT_EQ(tried.start.rest.q, plain.start.rest.q);
          EXPECT_TRUE(tried.memory() == plain.memory());
          EXPECT_FALSE(tried.memory() == before) << "nothing was accepted, so nothing is tested";
        }
      }
}

TEST(Predictor, AStepWithdrawnIsForgotten) {
  const auto scene = testing::mixed();
  Stepper once(scene, "type1/gl:2", false), twice(scene, "type1/gl:2", false);
  for (int k = 0; k < 20; ++k) {
    Vector x = Vector::LinSpaced(once.x.size(), std::sin(0.3 * k), std::cos(0.2 * k));
    once.predictor.accept_step(x);
    const std::string before = twice.memory();
    const Vector other =
        k % 2 == 0 ? Vector(2.0 * x) : Vector(x.cwiseInverse());  // of which another rule is best
    twice.predictor.accept_step(other);
    Vector withdrawn(x.size());
    twice.predictor.withdraw_step(withdrawn);
    EXPECT_EQ(withdrawn, other);
    EXPECT_TRUE(twice.memory() == before) << k;
    twice.predictor.accept_step(x);
    EXPECT_TRUE(once.memory() == twice.memory()) << k;
  }
}

/// A plane pendulum on the circle itself, by the midpoint rule in its angle:  q = (sin θ, cos θ) is stored in
/// two numbers, velocities and momenta have one.  Unknown V:  V + h/2 sin(θ0 + hV/2) = p0.
class CircleStep final : public StepProblem {
 public:
  int size() const override { return 1; }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }
  StepTraits traits() const override { return {"V (1)", 1}; }
  void begin(Interval step, const State& start, const StepMemory&) override {
    step_ = step;
    start_ = &start;
  }
  void guess(ConstVectorRef v0, VectorRef x) override { x = v0; }
  void residual(ConstVectorRef x, VectorRef f) override {
    f[0] = x[0] + 0.5 * step_.size * turned(0.5 * step_.size * x[0])[0] - start_->p[0];
  }
  void jacobian(ConstVectorRef x, VectorRef values) override {
    values[0] = 1.0 + 0.25 * step_.size * step_.size * turned(0.5 * step_.size * x[0])[1];
  }
  void finish(ConstVectorRef x, StepEnd& end) override {
    end.at.q = turned(step_.size * x[0]);
    end.at.p = 2.0 * x - start_->p;
    end.at.v = x;
    end.impulse.resize(0);
    end.memory.known = true;
  }

 private:
  Vector turned(double angle) const {
    const double sin = std::sin(angle), cos = std::cos(angle);
    return Vector{{start_->q[0] * cos + start_->q[1] * sin, start_->q[1] * cos - start_->q[0] * sin}};
  }
  SparsityPattern pattern_ = SparsityPattern::dense(1, 1);
  std::vector<ResidualBlock> blocks_{{"momentum", 1}};
  Interval step_{0.0, 1.0};
  const State* start_ = nullptr;
};

TEST(StepSolver, TakesConfigurationsThatAreStoredInMoreNumbersThanTheyMoveIn) {
  Scene scene = testing::particle("angle");
  scene.coordinates = {"angle"};
  scene.lagrangian = lagrangian<1>([](const auto& q, const auto& v) {
    using std::cos;
    return 0.5 * v[0] * v[0] + cos(q[0]);
  });
  scene.start = {0.0, Vector{{1.0}}, Vector{{0.0}}};
  const auto shared = std::make_shared<const Scene>(scene);
  const IntegratorOptions options{.method = "type1/midpoint", .step = 0.1};
  Integrator in_the_angle = testing::integrator_for(shared, options);
  PointReader reader(shared, kinsol(), true);
  StepSolver solver(std::make_unique<CircleStep>(), kinsol(), reader);
  Predictor predictor(solver.problem().traits(), 1);
  State at{Vector{{std::sin(1.0), std::cos(1.0)}}, Vector{{0.0}}, Vector{{0.0}}};
  Vector x = Vector::Zero(1);
  Work work;
  for (int k = 0; k < 100; ++k) {
    ASSERT_TRUE(solver.solve({{0.1 * k, 0.1}, at, predictor, Guess::predicted, false}, x, work).ok());
    at = solver.end().at;
    solver.accept_step();
    predictor.accept_step(x);
    ASSERT_TRUE(in_the_angle.step().ok());
    EXPECT_NEAR(std::atan2(at.q[0], at.q[1]), in_the_angle.position()[0], 1e-12) << k;
    EXPECT_NEAR(at.p[0], in_the_angle.momentum()[0], 1e-12);
  }
  EXPECT_LT(work.iterations, 3 * work.solves) << "the predictor is of no use";
}

}  // namespace
}  // namespace diracstep
