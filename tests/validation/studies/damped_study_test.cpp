/// Studies of motions that are damped, with IDA beside them, and of springs as rows.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/methods/registry.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <diracstep/validation/studies/damped_motion.hpp>
#include <diracstep/validation/studies/stability_cases.hpp>

namespace diracstep {
namespace {

/// 1 MΩ, 1 nF and 1 µs behind it: rates of 1e3 and 1e6, charges of 1e-9 C.
const char* const filter = R"toml(
name = "filter"
[[source_voltage]]
name = "V"
nodes = ["ground", "a"]
value = "sin(2*pi*200*t)"
[[resistor]]
name = "R"
nodes = ["a", "b"]
value = 1e6
[[capacitor]]
name = "C"
nodes = ["b", "ground"]
value = 1e-9
[[resistor]]
name = "R2"
nodes = ["b", "c"]
value = 1e3
[[capacitor]]
name = "C2"
nodes = ["c", "ground"]
value = 1e-9
[span]
end = 0.01
step = 1e-4
)toml";

TEST(DampedStudies, IdaIsSolvedToPartsOfWhatTheMotionIsLarge) {
  const CatalogueScene entry = scene_from_text("filter.toml", filter);
  StudyOptions options;
  options.series = {{"type1/gl:3", 6}, {"type1/gl:4", 8}};
  options.rtols = {1e-3, 1e-6, 1e-9};
  options.baselines = {ida_method};
  options.repeats = 1;
  const Study study = convergence_study(entry, Registry::with_built_ins(), kinsol(), options);
  EXPECT_LT(study.reference_error, 1e-9) << study.reference_how;
  double damped = 1.0, gl4 = 1.0;
  for (const StudyRow& row : study.rows) {
    if (row.method == ida_method && row.ok()) {
      EXPECT_LT(row.error(), 100.0 * row.rtol) << row.rtol;
    }
    if (row.method == "damped/radau:3 adaptive" && row.ok()) damped = std::min(damped, row.error());
    if (row.method == "type1/gl:4") gl4 = 0.0;
  }
  EXPECT_LT(damped, 1e-8);
  EXPECT_EQ(gl4, 1.0) << "a method that does not damp";
}

TEST(DampedStudies, WithoutAForceNothingIsSurveyed) {
  const CatalogueScene entry = make_scene("double_pendulum");
  EXPECT_FALSE(surveyed_motion(entry.scene, Registry::with_built_ins(), kinsol(), 1.0, entry.natural_step));
}

/// One step for every stiffness, conservative and damped.
TEST(StabilityCases, SpringsAsRowsAreAccurateAtEveryStiffness) {
  std::vector<StabilityCase> cases = stability_cases(false);
  std::erase_if(cases,
                [](const StabilityCase& that) { return that.name.find(" row k=") == std::string::npos; });
  ASSERT_EQ(cases.size(), 8U);
  EXPECT_EQ(cases.back().name, "stiff_spring_pendulum row k=inf");
  const std::vector<StabilityMethod> methods{{"type1/gl:3", 6}, {"damped/radau:3", 5}};
  for (const StabilityResult& result :
       stability_study(cases, Registry::with_built_ins(), kinsol(), methods, false, nullptr))
    for (const StabilityRow& row : result.rows) {
      EXPECT_EQ(row.outcome, StabilityOutcome::accurate) << result.that.name << ", " << row.method;
      EXPECT_LT(row.error, 1e-4) << result.that.name << ", " << row.method;
      EXPECT_LT(row.watches.front().band, 1e-5) << result.that.name << ", " << row.method;
    }
}

}  // namespace
}  // namespace diracstep
