#include <gtest/gtest.h>

#include <array>
#include <diracstep/core/integrator/point_reader.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

namespace diracstep {
namespace {

std::shared_ptr<const Scene> scene_of(std::shared_ptr<const Lagrangian> lagrangian) {
  auto scene = std::make_shared<Scene>();
  scene->name = "scene";
  scene->coordinates = {"x", "y"};
  scene->lagrangian = std::move(lagrangian);
  scene->start = {0.0, Vector::Constant(2, 0.3), Vector::Ones(2)};
  return scene;
}

/// KINSOL, counting solves.
SolverFactory counted(int& solves) {
  struct Counted final : NonlinearSolver {
    Counted(NonlinearProblem& problem, int& count) : solver(kinsol()(problem)), solves(count) {}
    SolveReport solve(VectorRef x) override {
      ++solves;
      return solver->solve(x);
    }
    void reset() override { solver->reset(); }
    std::string description() const override { return solver->description(); }
    std::unique_ptr<NonlinearSolver> solver;
    int& solves;
  };
  return [&solves](NonlinearProblem& problem) { return std::make_unique<Counted>(problem, solves); };
}

/// v from p and back; how many systems that took.
int solves_to_read(const std::shared_ptr<const Scene>& scene) {
  int solves = 0;
  PointReader reader(scene, counted(solves), true);
  const Vector q = Vector::LinSpaced(2, 0.4, 0.9), v = Vector::LinSpaced(2, -0.7, 1.1);
  Vector lq(2), p(2), again(2);
  scene->lagrangian->gradient(0.0, q, v, lq, p);
  for (int k = 0; k < 3; ++k) {
    Sample sample;
    EXPECT_TRUE(reader.read(0.0, {q, p, Vector::Zero(2)}, Momentum::projected, sample).ok());
    EXPECT_LT((sample.v - v).lpNorm<Eigen::Infinity>(), 1e-14);
    EXPECT_LT((sample.p - p).lpNorm<Eigen::Infinity>(), 1e-14);
    EXPECT_EQ(sample.lambda.size(), 0);
    EXPECT_NEAR(sample.energy, scene->energy(0.0, q, v), 1e-14);
  }
  return solves;
}

TEST(PointReader, TakesTheVelocityOfAConstantDiagonalMassWithoutASystem) {
  EXPECT_EQ(solves_to_read(scene_of(lagrangian<2>([](const auto& q, const auto& v) {
              return 0.5 * v[0] * v[0] + 1.5 * v[1] * v[1] - q[0] * q[0] * q[1];
            }))),
            0);
  EXPECT_EQ(solves_to_read(scene_of(lagrangian<2>([](const auto& q, const auto& v) {  // in a magnetic field
              return 0.5 * v[0] * v[0] + 1.5 * v[1] * v[1] + q[0] * q[0] * v[1];
            }))),
            0);
}

TEST(PointReader, SolvesForTheVelocityOfOtherMasses) {
  EXPECT_EQ(solves_to_read(scene_of(lagrangian<2>([](const auto& q, const auto& v) {
              return 0.5 * v[0] * v[0] + (1.0 + q[0] * q[0]) * v[1] * v[1];
            }))),
            3);
  EXPECT_EQ(solves_to_read(scene_of(lagrangian<2>(
                [](const auto&, const auto& v) { return v[0] * v[0] + v[0] * v[1] + v[1] * v[1]; }))),
            3);
}

}  // namespace
}  // namespace diracstep
