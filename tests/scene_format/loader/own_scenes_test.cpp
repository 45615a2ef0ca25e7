#include <gtest/gtest.h>

#include <diracstep/core/runs/run.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

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
  const double error =
      (integrator.position() - exact).lpNorm<Eigen::Infinity>() / exact.lpNorm<Eigen::Infinity>();
  // Degenerate scenes have no stated tolerance yet: order 2 at 800 steps a turn.
  EXPECT_LT(error, entry.needs.empty() ? advice.tolerance : 1e-2);
}

INSTANTIATE_TEST_SUITE_P(Examples, OwnScenes,
                         ::testing::Values("trammel", "coin_on_incline", "rlc_circuit", "vortex_ring",
                                           "relativistic_charge", "canonical_vortices", "turning_skate"),
                         [](const auto& of) { return of.param; });

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

}  // namespace
}  // namespace diracstep
