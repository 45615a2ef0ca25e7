#pragma once

#include <array>
#include <diracstep/core/system/event.hpp>
#include <diracstep/core/system/scene.hpp>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

using Parameters = std::map<std::string, double>;

/// A point of the true motion.
struct ReferencePoint {
  Vector q;
  Vector v;
};

/// What the errors of a study are taken against.
struct Reference {
  std::string kind;  ///< "exact": a closed form; "published": digits from a source; "own": computed by the
                     ///< authors of the scene
  std::string how;   ///< the closed form or the source in a line
  double self_error = 0.0;  ///< relative error of the reference itself
  /// The true motion at time t; empty where the reference does not reach t.
  std::function<std::optional<ReferencePoint>(double t)> at;
};

/// Values of some coordinates and velocities at one time, from a reference.
struct KnownState {
  struct Component {
    std::string name;  ///< "x", "v_x_64"
    int index;         ///< of the coordinate
    bool velocity;
    double value;
  };
  double t = 0.0;
  std::string kind, how;  ///< as in Reference; also "own": computed by the authors of the scene
  double digits = 0.0;    ///< that are good
  std::vector<Component> components;
};

/// Something that the true motion keeps.
struct Invariant {
  std::string name;
  std::function<double(double t, ConstVectorRef q, ConstVectorRef v)>
      at;                       ///< p in place of v without a Lagrangian
  std::optional<double> value;  ///< as stated
};

/// Times outside which an input of the scene has no value.
struct InputRange {
  std::string name;
  double first, last;
};

/// A number of the user's own along a motion, a column of its file.
struct Output {
  std::string name;
  PointFunction at;
};

/// A rigid body as a picture shows it.
struct DrawnBody {
  std::string name;
  std::string shape;             ///< "box", "sphere", "cylinder", "disc", "rod"; "ellipsoid" of the inertia
  std::array<double, 3> size;    ///< edges; radius; radius, length along z; radius; length along z; half axes
  std::vector<int> coordinates;  ///< in q: x, y, z, quaternion w, x, y, z; in the plane x, y, angle
  std::array<double, 7> fixed = {};  ///< x, y, z, w, x, y, z of one that stands still, without coordinates
};

/// Where a value of a start is from.
enum class StartOrigin { left_out, given, guess, rate };  ///< rate: that of a state

/// A start as the file gives it, before guesses are moved onto the rows.
struct StatedStart {
  Start start;
  std::vector<StartOrigin> q, v;  ///< v: of momenta where the start is by these
};

/// A method that suits the scene, and what it reaches.
struct Recommendation {
  std::string method = "auto";  ///< as IntegratorOptions::method
  int order = 0;                ///< 0: the method's own
  double step = 0.0;
  double end = 0.0;
  double tolerance = 0.0;  ///< error at `end`, relative to the largest component; 0 where none is stated
  bool stated = false;     ///< by the file; else these are what a check takes for want of better
};

/// A symbol of the scene as its author describes it.
struct SymbolNote {
  std::string name, unit, meaning;
};

/// A scene as the command and the studies know it.
struct CatalogueScene {
  std::shared_ptr<const Scene> scene;
  std::string kind;  ///< "unconstrained", "holonomic", "large, holonomic", …
  std::string description;
  std::string source;         ///< where the data come from
  Parameters parameters;      ///< as used, after changes
  double t_end = 0.0;         ///< where studies end
  double natural_step = 0.0;  ///< a coarse but sensible step: the start of a study's ladder
  Reference reference;
  std::string needs = {};  ///< what the integrators lack to run it, empty where they run it: "degenerate"
  std::vector<KnownState> known = {};  ///< references that hold for the parameters, as the file lists them
  std::vector<Invariant> invariants = {};
  std::vector<Output> outputs = {};
  std::vector<InputRange> input_ranges = {};
  std::vector<Event> events = {};
  std::vector<DrawnBody> bodies = {};
  /// The scene with the rows that are off at the start as well, where events switch some, or with the
  /// redundant ones that are left out; else null.
  std::shared_ptr<const Scene> all_rows = {};
  /// Of the columns of its motions: all_rows or the scene itself.
  const Scene& shown() const { return all_rows ? *all_rows : *scene; }
  std::optional<StatedStart> stated_start = {};  ///< none for scenes that are not from files
  Recommendation recommended = {};
  std::vector<SymbolNote> notes = {};  ///< coordinates, sizes and parameters
  /// What a scene file says of the motion, entry by entry; none for scenes that are not from files.
  std::vector<std::pair<std::string, std::string>> definition = {};
  std::string code = {};                  ///< how the formulas are computed: compiled, or interpreted and why
  std::vector<std::string> changes = {};  ///< what is not as given: a start that was moved, rows left out
};

/// Names of the scenes that come with the library, sorted.
std::vector<std::string> scene_names();

/// A scene by name or by the path of its file (NAME.toml), some of its parameters and sizes changed.  Throws
/// Misuse for an unknown scene or parameter, listing the known ones, for a value the scene cannot have, and
/// for a file that is wrong, with the line and column.
CatalogueScene make_scene(const std::string& name, const Parameters& changes = {});

/// Throws Misuse where an input of the scene has no value at the end of a motion; `what` names the end.
void require_inputs_until(const CatalogueScene& entry, double end, const std::string& what);

/// Leaves out the redundant constraints (redundant_rows.hpp) where they stay so, also where the scene refuses
/// them, and notes which; their forces are still shown (shown_forces).  Beside events, which may switch rows,
/// they stay in the scene, and EventSteps leaves out what is redundant of the rows that are on.
void drop_redundant_rows(CatalogueScene& entry);

/// The forces of the rows that are shown, of those of the rows of `scene` at a point: as forces_of_whole()
/// without events; beside events EventSteps has given them so.
Vector shown_forces(const CatalogueScene& entry, double t, const Vector& q, const Vector& lambda);

/// Sets Scene::tolerances of the coordinates named.  Throws Misuse for a name that is none, and for a value
/// that is not above 0 and finite.
void set_tolerances(CatalogueScene& entry, const Parameters& tolerances);

}  // namespace diracstep
