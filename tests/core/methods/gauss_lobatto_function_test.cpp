#include <gtest/gtest.h>

#include <diracstep/core/dirac/dirac_structure.hpp>
#include <diracstep/core/methods/gauss_lobatto.hpp>
#include <diracstep/core/numerics/errors.hpp>

#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

constexpr double h = 0.2;
constexpr GeneratingType types[] = {GeneratingType::one, GeneratingType::two, GeneratingType::three};

std::unique_ptr<GeneratingFunction> function(GeneratingType type, int s) {
  return gauss_lobatto_function(type, s, testing::unconstrained()->lagrangian);
}

Vector start_momentum(const Scene& scene) {
  Vector lq(scene.dimension()), p(scene.dimension());
  scene.lagrangian->gradient(0.0, scene.start.q, scene.start.v, lq, p);
  return p;
}

/// End of one step of a problem.
PhasePoint end_of(StepProblem& problem, const PhasePoint& start, const Vector& v0) {
  const auto solver = kinsol()(problem);
  Vector x(problem.size());
  problem.begin({0.0, h}, {start.q, start.p, v0}, {});
  problem.guess(v0, x);
  EXPECT_TRUE(solver->solve(x).ok());
  StepEnd end;
  problem.finish(x, end);
  return {end.at.q, end.at.p};
}

TEST(GaussLobattoFunction, TheStepOfEveryTypeIsTheGaussLobattoStep) {
  const auto kept = testing::unconstrained();
  const Scene& scene = *kept;
  const PhasePoint start{scene.start.q, start_momentum(scene)};
  for (const int s : {1, 2, 3, 4}) {
    const auto stages =
        Registry::with_built_ins().method("type1/gl:" + std::to_string(s)).make_step(scene, {true});
    const PhasePoint expected = end_of(*stages, start, scene.start.v);
    for (const GeneratingType type : types) {
      const auto graph = dirac_step(function(type, s), scene, StepRule::midpoint, true);
      const PhasePoint end = end_of(*graph, start, scene.start.v);
      EXPECT_LT((end.q - expected.q).lpNorm<Eigen::Infinity>(), 5e-15) << s << " " << static_cast<int>(type);
      EXPECT_LT((end.p - expected.p).lpNorm<Eigen::Infinity>(), 5e-15) << s << " " << static_cast<int>(type);
    }
  }
}

/// The columns of S for a step, its inner ones stationary.
Columns columns_of(GeneratingFunction& s, const PhasePoint& start, const PhasePoint& end) {
  const GraphOf graph = graph_of(s.type());
  Columns y(s.dimension(), s.columns());
  y.col(0) = graph.starts_from_position ? start.q : start.p;
  y.col(1) = graph.ends_at_position ? end.q : end.p;
  const Vector v = (end.q - start.q) / h;
  s.guess_inner({0.0, h}, start.q, start.p, v, y.rightCols(s.inner_columns()));
  EXPECT_TRUE(make_stationary(s, {0.0, h}, y));
  return y;
}

TEST(GaussLobattoFunction, TypesTwoAndThreeAreTheLegendreTransformsOfTypeOne) {
  const auto kept = testing::unconstrained();
  const Scene& scene = *kept;
  const PhasePoint start{scene.start.q, start_momentum(scene)};
  for (const int s : {1, 2, 3}) {
    const auto problem =
        Registry::with_built_ins().method("type1/gl:" + std::to_string(s)).make_step(scene, {true});
    const PhasePoint end = end_of(*problem, start, scene.start.v);
    double value[3];
    for (const GeneratingType type : types) {
      const auto f = function(type, s);
      value[static_cast<int>(type) - 1] = f->value({0.0, h}, columns_of(*f, start, end));
    }
    EXPECT_NEAR(value[1], end.p.dot(end.q) - value[0], 1e-14) << s;
    EXPECT_NEAR(value[2], -start.p.dot(start.q) - value[0], 1e-14) << s;
  }
}

TEST(GaussLobattoFunction, EveryStepIsAMemberOfTheDiscreteDiracStructure) {
  const auto kept = testing::unconstrained();
  const Scene& scene = *kept;
  const PhasePoint start{scene.start.q, start_momentum(scene)};
  DiscreteDiracStructure structure(scene.constraints, 3, StepRule::midpoint);
  for (const int s : {2, 3}) {
    const auto problem =
        Registry::with_built_ins().method("type1/gl:" + std::to_string(s)).make_step(scene, {true});
    PhasePoint end = end_of(*problem, start, scene.start.v);
    for (const GeneratingType type : types) {
      const auto f = function(type, s);
      const Columns y = columns_of(*f, start, end);
      Columns g(3, f->columns());
      f->gradient({0.0, h}, y, g);
      const Covector d{y.col(0), y.col(1), g.col(0), g.col(1)};
      if (type != GeneratingType::three) {
        const Covector plus = type == GeneratingType::one ? gamma_plus(d) : d;
        EXPECT_LT(structure.plus({0.0, h}, start, end, plus).annihilator, 2e-14) << s;
        PhasePoint wrong = end;
        wrong.q[0] += 1e-6;
        EXPECT_GT(structure.plus({0.0, h}, start, wrong, plus).annihilator, 5e-7) << "nothing is tested";
      }
      if (type != GeneratingType::two) {
        const Covector minus = type == GeneratingType::one ? gamma_minus(d) : d;
        EXPECT_LT(structure.minus({0.0, h}, start, end, minus).annihilator, 2e-14) << s;
      }
    }
  }
}

TEST(GaussLobattoFunction, TypeFourAndBadNumbersOfStagesAreRefused) {
  EXPECT_THROW(function(GeneratingType::four, 2), Misuse);
  for (const int s : {0, 21}) EXPECT_THROW(function(GeneratingType::two, s), Misuse);
}

}  // namespace
}  // namespace diracstep
