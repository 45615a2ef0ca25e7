#pragma once

#include <diracstep/command/session.hpp>
#include <diracstep/core/runs/run.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

/// What the verbs have in common that look for a motion between two ends: boundary and control.
namespace diracstep::command {

struct MotionSearchArguments {
  std::string scene, guess, out;
  std::vector<std::string> from, to, set;
  bool json = false;
  MethodChoice method;
  std::optional<double> end, step;
};

/// Those that are the same in each verb: all but the scene, the two ends, the guess and --out.
void add_search_options(CLI::App& verb, Session& session, MotionSearchArguments& arguments);

/// The scene, and the steps to its end; a method that the scene recommends is taken into the arguments.
/// Throws Misuse for events and for curved spaces; `verb` names it there.
CatalogueScene searched_scene(MotionSearchArguments& arguments, Session& session, const std::string& verb);
StepGrid searched_steps(const MotionSearchArguments& arguments, const CatalogueScene& entry);

/// A motion that was found: one column a point.
struct FoundMotion {
  const Vector& times;
  const Columns &q, &v, &p;
};

/// "kepler from t = 0 to 10: 100 steps with type1/gl:3, 7 iterations".
std::string first_line(const Scene& scene, const Vector& times, long steps, const std::string& method,
                       int iterations);

/// A CSV file of t, coordinates, v_NAME, p_NAME and further columns: their names, and their values at point
/// k.
void write_motion(const std::string& path, const Scene& scene, const FoundMotion& motion,
                  const std::vector<std::string>& further = {},
                  const std::function<Vector(Eigen::Index k)>& values = {});

}  // namespace diracstep::command
