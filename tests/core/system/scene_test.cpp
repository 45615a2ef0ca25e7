#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/system/scene.hpp>
#include <limits>

#include "misuse.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;

const double nan = std::numeric_limits<double>::quiet_NaN();

/// What an integrator asks of a scene.
void check(const Scene& scene) {
  const auto complete = completed(std::make_shared<const Scene>(scene));
  require_consistent(*complete, complete->start);
}

template <class Change>
void expect_refused(Scene scene, Change change, std::initializer_list<std::string> parts) {
  EXPECT_NO_THROW(check(scene));
  change(scene);
  expect_misuse([&] { check(scene); }, parts);
}

TEST(Scene, EveryTestSceneIsConsistent) {
  for (const auto& scene : testing::every_constraint_class()) EXPECT_NO_THROW(check(*scene)) << scene->name;
}

TEST(Scene, AStartIsCompletedByItsMomentum) {
  const auto scene = testing::nonholonomic();
  Start start = scene->start;
  Vector lq(3), p(3);
  scene->lagrangian->gradient(start.time, start.q, start.v, lq, p);
  start.v.resize(0);
  start.p = p;
  EXPECT_LT((completed_start(*scene, start).v - scene->start.v).norm(), 1e-13);
  EXPECT_NO_THROW(require_consistent(*scene, start));
  start.p[0] += 0.1;
  expect_misuse([&] { require_consistent(*scene, start); }, {"row 'contact'", "off the distribution"});
  start.p.resize(2);
  expect_misuse([&] { (void)completed_start(*scene, start); }, {"'nonholonomic'", "the start p", "2", "3"});
  EXPECT_EQ(completed_start(*scene, scene->start).v, scene->start.v);
}

TEST(Scene, NoSceneIsRefused) {
  expect_misuse([] { (void)completed(nullptr); }, {"no scene"});
}

TEST(Scene, MissingPartsAreNamed) {
  expect_refused(*testing::unconstrained(), [](Scene& s) { s.lagrangian = nullptr; },
                 {"'unconstrained'", "neither a Lagrangian nor a Hamiltonian"});
  expect_refused(*testing::unconstrained(), [](Scene& s) { s.coordinates.clear(); },
                 {"'unconstrained'", "no coordinates"});
}

TEST(Scene, SizesThatDisagreeAreNamedWithBothNumbers) {
  const auto two = lagrangian<2>([](const auto&, const auto& v) { return v[0] * v[1]; });
  const auto two_h = hamiltonian<2>([](const auto&, const auto& p) { return p[0] * p[1]; });
  const auto rows = pfaffian<2, 1>([]<class T>(const std::array<T, 2>&) {
    return std::array<std::array<T, 2>, 1>{{{T(1.0), T(0.0)}}};
  });
  const Scene scene = *testing::nonholonomic();
  expect_refused(scene, [&](Scene& s) { s.lagrangian = two; },
                 {"'nonholonomic'", "the Lagrangian", "2", "3"});
  expect_refused(scene, [&](Scene& s) { s.hamiltonian = two_h; }, {"the Hamiltonian", "2", "3"});
  expect_refused(scene, [&](Scene& s) { s.constraints.push_back(rows); }, {"a constraint row", "2", "3"});
  expect_refused(scene, [](Scene& s) { s.start.q.resize(4); }, {"the start q", "4", "3"});
  expect_refused(scene, [](Scene& s) { s.start.v.resize(2); }, {"the start v", "2", "3"});
  expect_refused(scene, [](Scene& s) { s.start.v.resize(0); }, {"the start v", "0", "3"});
}

TEST(Scene, StartThatIsNotFiniteNamesTheCoordinate) {
  const Scene scene = *testing::nonholonomic();
  expect_refused(scene, [](Scene& s) { s.start.q[1] = nan; }, {"'nonholonomic'", "q_y = nan"});
  expect_refused(scene, [](Scene& s) { s.start.v[2] = INFINITY; }, {"v_z = inf"});
  expect_refused(scene, [](Scene& s) { s.start.time = nan; }, {"start time"});
}

TEST(Scene, StartOffAHolonomicRowNamesTheRowAndTheAmount) {
  expect_refused(*testing::mixed(), [](Scene& s) { s.start.q[1] = 0.5 + 1.0 / 64.0; },
                 {"'mixed'", "row 'sphere'", "φ(q) = 0.0158691"});  // (1/64)² + 1/64, shown to six digits
}

TEST(Scene, StartOffTheDistributionNamesTheRowAndTheAmount) {
  expect_refused(*testing::nonholonomic(), [](Scene& s) { s.start.v[0] += 0.125; },
                 {"'nonholonomic'", "row 'contact'", "A v + b = 0.125"});
  expect_refused(*testing::holonomic_sphere(), [](Scene& s) { s.start.v[0] -= 0.25; },
                 {"'holonomic'", "row 'sphere'", "A v + b = -0.5"});
}

TEST(Scene, RoundOffOfTheStartIsAllowed) {
  Scene scene = *testing::mixed();
  scene.start.q[0] += 1e-12;
  scene.start.v[0] -= 1e-12;
  EXPECT_NO_THROW(check(scene));
}

TEST(Scene, StartIsCheckedAgainstTimeDependentRowsAtItsTime) {
  Scene scene = testing::particle("moving");
  scene.constraints = {holonomic<3, 1>(
      []<class T>(const std::array<T, 3>& q, const T& t) { return std::array<T, 1>{q[0] - t * t}; },
      {"wall"})};
  scene.start.time = 3.0;
  scene.start.q[0] = 9.0;
  scene.start.v[0] = 6.0;
  expect_refused(scene, [](Scene& s) { s.start.time = 2.0; }, {"row 'wall'", "φ(q) = 5"});
  expect_refused(scene, [](Scene& s) { s.start.v[0] = 0.0; }, {"row 'wall'", "A v + b = -6"});
}

TEST(Scene, RowNamesOfAllBlocksComeInOrder) {
  EXPECT_EQ(testing::mixed()->row_names(), (std::vector<std::string>{"sphere", "contact"}));
  EXPECT_EQ(testing::mixed()->rows(), 2);
  EXPECT_TRUE(testing::unconstrained()->row_names().empty());
}

TEST(Scene, EnergyIsThatOfTheLegendreTransform) {
  // Of L = ½ m(x) v² + x v − x²/2 the term linear in v drops out.
  Scene scene;
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([](const auto& q, const auto& v) {
    return 0.5 * (1.0 + q[0] * q[0]) * v[0] * v[0] + q[0] * v[0] - 0.5 * q[0] * q[0];
  });
  const Vector q = Vector::Constant(1, 2.0), v = Vector::Constant(1, 3.0);
  EXPECT_NEAR(scene.energy(0.0, q, v), 0.5 * 5.0 * 9.0 + 2.0, 1e-14);
}

/// H = p_x²/2 + p_x x p_y + p_y² (1 + x²) + x² y², so that ∂H/∂p = (p_x + x p_y, x p_x + 2 (1 + x²) p_y).
Scene hamiltonian_scene() {
  Scene scene;
  scene.name = "from H";
  scene.coordinates = {"x", "y"};
  scene.hamiltonian = hamiltonian<2>([](const auto& q, const auto& p) {
    return 0.5 * p[0] * p[0] + q[0] * p[0] * p[1] + (1.0 + q[0] * q[0]) * p[1] * p[1] +
           q[0] * q[0] * q[1] * q[1];
  });
  scene.start = {.time = 0.0, .q = Vector{{2.0, 1.0}}, .v = Vector(), .p = Vector{{0.5, 0.25}}};
  return scene;
}

TEST(Scene, StartGivenByMomentumGetsItsVelocityAndLagrangianFromTheHamiltonian) {
  const auto complete = completed(std::make_shared<const Scene>(hamiltonian_scene()));
  ASSERT_NE(complete->lagrangian, nullptr);
  EXPECT_LT((complete->start.v - Vector{{1.0, 3.5}}).norm(), 1e-14);
  Vector lq(2), lv(2);
  complete->lagrangian->gradient(0.0, complete->start.q, complete->start.v, lq, lv);
  EXPECT_LT((lv - complete->start.p).norm(), 1e-14);
  const double energy = complete->hamiltonian->value(0.0, complete->start.q, complete->start.p);
  EXPECT_NEAR(complete->energy(0.0, complete->start.q, complete->start.v), energy, 1e-13);
}

TEST(Scene, CompleteScenesAreLeftAsTheyAre) {
  const auto scene = testing::mixed();
  EXPECT_EQ(completed(scene), scene);
}

TEST(Scene, MomentumStartNeedsTheRightSize) {
  expect_refused(hamiltonian_scene(), [](Scene& s) { s.start.p.resize(1); },
                 {"'from H'", "the start p", "1", "2"});
  expect_refused(hamiltonian_scene(), [](Scene& s) { s.start.q.resize(3); },
                 {"'from H'", "the start q", "3", "2"});
}

TEST(Scene, MomentumStartOfALagrangianGivesItsVelocity) {
  auto scene = std::make_shared<Scene>(*testing::unconstrained());
  const Vector v = scene->start.v;
  Vector lq(3);
  scene->start.p.resize(3);
  scene->lagrangian->gradient(0.0, scene->start.q, v, lq, scene->start.p);
  scene->start.v.resize(0);
  EXPECT_LT((completed(scene)->start.v - v).norm(), 1e-15);
}

TEST(Scene, MomentumStartOffTheDistributionIsRefused) {
  Scene scene = hamiltonian_scene();
  scene.constraints = {pfaffian<2, 1>(
      []<class T>(const std::array<T, 2>&) {
        return std::array<std::array<T, 2>, 1>{{{T(3.5), T(-1.0)}}};
      },
      {"slope"})};
  expect_refused(scene, [](Scene& s) { s.start.p[0] = 0.0; }, {"row 'slope'", "A v + b = -0.75"});
}

TEST(Scene, DegenerateHamiltonianHasNoLagrangian) {
  Scene scene = hamiltonian_scene();
  scene.hamiltonian = hamiltonian<2>([](const auto& q, const auto& p) { return p[0] * p[0] + q[1] * p[1]; });
  const auto complete = completed(std::make_shared<const Scene>(scene));
  EXPECT_EQ(complete->lagrangian, nullptr);
  EXPECT_LT((complete->start.v - Vector{{1.0, 1.0}}).norm(), 1e-15);
  EXPECT_TRUE(complete->by_hamiltonian());
  testing::expect_misuse([&] { (void)lagrangian_of(*complete); },
                         {"'from H'", "degenerate", "along the momenta of 'y'"});
}

TEST(Scene, RegularHamiltonianGetsItsLagrangianButIsSteppedByItself) {
  const auto complete = completed(std::make_shared<const Scene>(hamiltonian_scene()));
  EXPECT_TRUE(complete->by_hamiltonian());
  EXPECT_EQ(&complete->stepped_function(), complete->hamiltonian.get());
  EXPECT_FALSE(with_lagrangian(*complete)->by_hamiltonian());
  EXPECT_NEAR(complete->energy(complete->start), complete->energy(0.0, complete->start.q, complete->start.v),
              1e-13);
}

}  // namespace
}  // namespace diracstep
