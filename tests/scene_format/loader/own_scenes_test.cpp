#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/system/row_subset.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

/// Scenes written from docs/scene_format.md alone, examples/scenes: a mechanism, a rolling body, a circuit,
/// vortices.
namespace diracstep {
namespace {

class OwnScenes : public ::testing::TestWithParam<std::string> {};

TEST_P(OwnScenes, MeetTheirClosedForms) {
  const CatalogueScene entry = make_scene(DIRACSTEP_EXAMPLES "/" + GetParam() + ".toml");
  const Recommendation& advice = entry.recommended;
  const StepGrid grid = fit_steps(entry.scene->start.time, advice.end, advice.step);
  Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(),
                        {advice.method, advice.order, grid.step, {}});
  for (long k = 0; k < grid.steps; ++k) ASSERT_TRUE(integrator.step().ok());
  const Vector exact = entry.reference.at(advice.end)->q;
  Sample end;
  ASSERT_TRUE(integrator.sample(Momentum::projected, end).ok());
  const double error = (end.q - exact).lpNorm<Eigen::Infinity>() / exact.lpNorm<Eigen::Infinity>();
  // Degenerate scenes have no stated tolerance yet: order 2 at 800 steps a turn.
  EXPECT_LT(error, entry.needs.empty() ? advice.tolerance : 1e-2);
}

INSTANTIATE_TEST_SUITE_P(Examples, OwnScenes,
                         ::testing::Values("trammel", "coin_on_incline", "rlc_circuit", "vortex_ring",
                                           "relativistic_charge", "canonical_vortices", "turning_skate",
                                           "first_order_nonholonomic", "first_order_holonomic",
                                           "mixed_orders", "massless_slider", "moving_kernel",
                                           "pendulum_tension", "canonical_pendulum", "stewart_platform"),
                         [](const auto& of) { return of.param; });

Sample end_at_order_6(const std::shared_ptr<const Scene>& scene, double end, double step) {
  const StepGrid grid = fit_steps(scene->start.time, end, step);
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(), {.order = 6, .step = grid.step});
  for (long k = 0; k < grid.steps; ++k) EXPECT_TRUE(integrator.step().ok());
  Sample sample;
  EXPECT_TRUE(integrator.sample(Momentum::projected, sample).ok());
  return sample;
}

/// Eight legs carry what six could: A w = G for the 6 momenta, whose solution of least norm is A⁺ G, with A
/// and G by hand from the motion that the lengths are of.
TEST(StewartPlatform, ForcesOfItsLegsAreTheLeastThatDriveIt) {
  const CatalogueScene entry = make_scene(DIRACSTEP_EXAMPLES "/stewart_platform.toml");
  EXPECT_EQ(entry.scene->rows(), 6);
  const double t = 1.0, g = 9.81, m = 3.0, inertia = 0.5;
  const Sample end = end_at_order_6(entry.scene, t, 0.05);
  const double b = 0.1 * std::sin(t), v_b = 0.1 * std::cos(t), a_b = -b;
  const double c = 0.3 * std::sin(2 * t), v_c = 0.6 * std::cos(2 * t), a_c = -4.0 * c;
  const double x = 0.2 * (1 - std::cos(t)), z = 2 + 0.2 * std::sin(t);
  Vector wrench(6);  // d/dt ∂L/∂v − ∂L/∂q at a = v_a = 0
  wrench << m * 0.2 * std::cos(t), 0.0, m * (g - 0.2 * std::sin(t)),
      -inertia * (std::cos(b) * v_b * v_c + std::sin(b) * a_c), inertia * a_b, inertia * a_c;
  Columns legs(6, 8);  // by leg the derivative of its squared length
  for (int i = 1; i <= 8; ++i) {
    const double foot = 2 * M_PI * i / 8, joint = foot + (i % 2 == 0 ? 0.4 : -0.4);
    const double px = std::cos(joint), py = std::sin(joint);
    const Eigen::Vector3d turned(std::cos(b) * px, py, -std::sin(b) * px);
    const Eigen::Matrix3d yaw = Eigen::AngleAxisd(c, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const Eigen::Vector3d leg = Eigen::Vector3d(x, 0.0, z) + yaw * turned -
                                2.0 * Eigen::Vector3d(std::cos(foot), std::sin(foot), 0.0);
    const Eigen::Vector3d by_a = yaw * Eigen::Vector3d(std::sin(b) * py, 0.0, std::cos(b) * py);
    const Eigen::Vector3d by_b = yaw * Eigen::Vector3d(-std::sin(b) * px, 0.0, -std::cos(b) * px);
    const Eigen::Vector3d by_c = Eigen::Vector3d::UnitZ().cross(yaw * turned);
    legs.col(i - 1) << 2.0 * leg, 2.0 * leg.dot(by_a), 2.0 * leg.dot(by_b), 2.0 * leg.dot(by_c);
  }
  const Columns products = legs * legs.transpose();
  const Vector least = legs.transpose() * products.ldlt().solve(wrench);
  const Vector forces = shown_forces(entry, end.time, end.q, end.lambda);
  ASSERT_EQ(forces.size(), 8);
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(forces[i], least[i], 1e-9) << "leg " << i + 1;
}

/// Five rows of rank 4.  Without one of them the others carry their forces and its; two such sets differ by
/// the combination of forces that does nothing, to which the least ones are orthogonal.
TEST(Bricard, ForcesOfItsRowsAreTheLeastOnes) {
  const CatalogueScene entry = make_scene(DIRACSTEP_EXAMPLES "/bricard.toml");
  const std::vector<std::string> names = entry.all_rows->row_names();
  ASSERT_EQ(names.size(), 5u);
  EXPECT_EQ(entry.scene->rows(), 4);
  const Sample end = end_at_order_6(entry.scene, 1.0, 0.01);
  for (const auto& known : entry.known.front().components)
    EXPECT_NEAR((known.velocity ? end.v : end.q)[known.index], known.value, 1e-9) << known.name;
  const auto forces_without = [&](int left_out) {
    const auto others = without_rows(*entry.all_rows, {names[static_cast<std::size_t>(left_out)]});
    const Vector lambda = end_at_order_6(others, 1.0, 0.01).lambda;
    Vector all = Vector::Zero(5);
    for (int k = 0; k < 4; ++k) all[k < left_out ? k : k + 1] = lambda[k];
    return all;
  };
  const Vector first = forces_without(3), nothing = (first - forces_without(4)).normalized();
  const Vector least = first - nothing * nothing.dot(first);
  const Vector forces = shown_forces(entry, end.time, end.q, end.lambda);
  ASSERT_EQ(forces.size(), 5);
  for (int k = 0; k < 5; ++k) EXPECT_NEAR(forces[k], least[k], 1e-8) << names[static_cast<std::size_t>(k)];
}

/// Every key of the format stands in the schema for editors, and no other.
TEST(Schema, HasTheKeysOfTheReader) {
  std::ifstream file(DIRACSTEP_SCHEMA);
  const auto schema = nlohmann::json::parse(file)["properties"];
  for (const char* key :
       {"name",        "class",       "description", "source",   "needs",          "lagrangian",
        "hamiltonian", "dissipation", "coordinates", "sizes",    "parameters",     "definitions",
        "rows",        "force",       "start",       "span",     "reference",      "invariants",
        "recommended", "inductor",    "capacitor",   "resistor", "source_voltage", "mutual",
        "redundant",   "inputs",      "states",      "outputs",  "events",         "source_current",
        "diode",       "switch",      "transformer", "gyrator",  "opamp",          "field",
        "gravity",     "body",        "joint",       "wheel",    "rolling",        "spring",
        "control"})
    EXPECT_TRUE(schema.contains(key)) << key;
  EXPECT_EQ(schema.size(), 43u);
}

/// The keys of a table in the schema, whatever its form.
std::set<std::string> keys_of(const nlohmann::json& schema) {
  std::set<std::string> keys;
  if (!schema.is_object()) return keys;
  if (schema.contains("properties"))
    for (const auto& [key, value] : schema["properties"].items()) keys.insert(key);
  for (const char* inside : {"items", "additionalProperties"})
    if (schema.contains(inside)) keys.merge(keys_of(schema[inside]));
  for (const char* choice : {"oneOf", "anyOf"})
    if (schema.contains(choice))
      for (const auto& one : schema[choice]) keys.merge(keys_of(one));
  return keys;
}

/// The keys of a table that the reader knows, as it tells them beside one that is none.
std::set<std::string> keys_known_beside(const std::string& table) {
  const std::string none = "qwxzqwxz", told = "; known are ";
  std::string refusal;
  try {
    (void)scene_from_text("s.toml", "name = \"s\"\n" + table + '\n' + none + " = 1\n");
  } catch (const Misuse& misuse) {
    refusal = misuse.what();
  }
  std::set<std::string> keys;
  const std::size_t at = refusal.find(told);
  if (refusal.find(none) == std::string::npos || at == std::string::npos) {
    ADD_FAILURE() << table << ": " << refusal;
    return keys;
  }
  std::istringstream words(refusal.substr(at + told.size()));
  for (std::string word; words >> word;) keys.insert(word);
  return keys;
}

TEST(Schema, HasTheKeysOfTheTablesOfTheReader) {
  std::ifstream file(DIRACSTEP_SCHEMA);
  const auto schema = nlohmann::json::parse(file)["properties"];
  for (const char* kind : {"inductor", "capacitor", "resistor", "source_voltage", "source_current", "diode",
                           "switch", "opamp", "transformer", "gyrator", "mutual", "rows"})
    EXPECT_EQ(keys_known_beside(std::string("[[") + kind + "]]"), keys_of(schema[kind])) << kind;
  EXPECT_EQ(keys_known_beside("[span]"), keys_of(schema["span"]));
  const std::string span = "[span]\nend = 1\nstep = 0.1\n[coordinates]\nx = {}\n";
  EXPECT_EQ(keys_known_beside(span + "[recommended]"), keys_of(schema["recommended"]));
  EXPECT_EQ(keys_known_beside(span + "[control]"), keys_of(schema["control"]));
  EXPECT_EQ(keys_known_beside(span + "[[events]]"), keys_of(schema["events"]));
  for (const char* part : {"states", "inputs", "parameters", "invariants"})
    EXPECT_EQ(keys_known_beside(span + "[" + part + ".a]"), keys_of(schema[part])) << part;
}

}  // namespace
}  // namespace diracstep
