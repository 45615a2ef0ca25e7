#pragma once

#include <diracstep/scene_format/compiler/formula_parser.hpp>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace diracstep::scene_compiler {

/// Values a parameter may take.
struct Limits {
  std::optional<double> min, max;      ///< allowed themselves
  std::optional<double> above, below;  ///< not allowed themselves

  bool allow(double value) const;
  std::string text() const;  ///< "above 0", "in [0, 1)"
};

/// A scene file as data: every formula still a text, with the place where it stands.
struct SceneDocument {
  struct Coordinate {
    std::string name;
    std::string unit, meaning;
    std::optional<FormulaText> loops;  ///< "i = 1..N" of a repeated coordinate
    bool cyclic = false;
    Place place = {};
    double tolerance = 0.0;  ///< of Scene::tolerances; 0 where none is stated
  };
  struct Parameter {
    std::string name;
    std::string unit, meaning;
    std::vector<double> values;  ///< one, or those of an array
    bool array = false;
    bool size = false;  ///< a whole number that sets how much of the scene there is
    Limits limits;
    Place place = {};
  };
  struct Row {
    std::string name;
    FormulaText equation;
    std::optional<FormulaText> loops;
    Place place;
    std::optional<FormulaText> compliance = {};                    ///< of a spring in place of the row
    bool on = true;                                                ///< at the start
    std::string extension() const { return "extension_" + name; }  ///< its coordinate then
  };
  /// "x = …", "v_x = […]": a value, or one for each element of a repeated coordinate.
  struct Entry {
    FormulaText key;
    std::vector<FormulaText> values;
    bool array = false;
  };
  struct Reference {
    std::string kind, how;
    double digits = 0.0;
    std::optional<double> t;             ///< none: a closed form for every t
    std::map<std::string, double> with;  ///< parameters it holds for, where they are not the file's own
    std::vector<Entry> entries;
    Place place;
  };
  struct Invariant {
    std::string name;
    FormulaText formula;
    std::optional<double> value;
  };
  /// A first-order state: a coordinate without mass with v_NAME = rate.
  struct State {
    std::string name;
    FormulaText rate;
    Place place;
  };
  /// A table of the time.
  struct Input {
    enum class Kind { linear, cubic, step };
    std::string name;
    Kind kind;
    std::vector<double> times, values;
    bool hold = false;  ///< the last value is kept after the last time, the first one before the first
    Place place;
  };
  struct Event {
    enum class Direction { both, rising, falling };
    std::string name;
    std::optional<FormulaText> when;  ///< none: an event of a clock
    Direction direction = Direction::both;
    bool stop = false;
    double every = 0.0;
    std::optional<FormulaText> condition;  ///< above 0 where it holds
    std::vector<Entry> set;
    std::optional<FormulaText> restitution;
    std::vector<std::string> on, off;  ///< rows
    Place place;
  };
  struct Output {
    std::string name;
    FormulaText formula;
    Place place;
  };
  /// [control]: parameters that are chosen at each time, and what they cost.
  struct Control {
    std::vector<std::string> names;
    std::optional<FormulaText> cost, end_cost;  ///< an integral over the time, and of the end
    Place place;
  };
  /// A node of a circuit; of repeated nodes, "n[k-1]", with its index.
  struct NodeName {
    std::string name;
    std::optional<FormulaText> index = {};
  };
  /// A branch of a circuit between two nodes, or one for each turn of its loop.
  struct Branch {
    std::string kind;  ///< the element's table, such as "inductor"; "port" for the sides of a two-port
    std::string name;
    NodeName from, to;
    std::map<std::string, FormulaText, std::less<>> values;  ///< by key, such as "value"
    std::optional<FormulaText> loops;
    Place place;
    NodeName plus = {}, minus = {};  ///< inputs of an op-amp

    bool has(std::string_view key) const { return values.find(key) != values.end(); }
  };
  struct Mutual {
    std::string first, second;  ///< names of inductors
    FormulaText value;
    bool coefficient = false;  ///< the value is k of M = k √(L1 L2)
    Place place;
  };
  /// A transformer or a gyrator; its sides are branches of kind "port".
  struct TwoPort {
    std::string kind, name;
    FormulaText value;
    Place place;

    std::string side(int number) const { return name + (number == 1 ? "_1" : "_2"); }
  };
  /// Coordinates that are groups and spheres (scene_format/spaces); all empty in R^n.  Then the coordinates
  /// above are the stored numbers in their order, and the first of them stand for the velocities as well: v
  /// of number k is that of component k.
  struct Spaces {
    std::vector<std::string> kinds;                           ///< "SO3", "R1", …
    std::map<std::string, std::string, std::less<>> kind_of;  ///< by the name in the file
    std::vector<std::string> components;                      ///< names of those of a velocity
    std::map<std::string, FormulaText, std::less<>> entries;  ///< "R[1,2]", "w_R[1]"
    std::vector<FormulaText> rates;                           ///< of the stored numbers
  };
  /// A body as a picture shows it.
  struct DrawnBody {
    std::string name, shape;        ///< "box", "sphere", "cylinder", "disc", "rod", "ellipsoid"
    std::vector<FormulaText> size;  ///< three numbers, by shape (bodies::Body), of an ellipsoid half axes
    std::vector<std::string> coordinates;  ///< x, y, z, quaternion w, x, y, z; in the plane x, y, angle
    std::vector<FormulaText> fixed;        ///< of a body that stands still the seven numbers
    Place place = {};
  };
  struct Recommended {
    std::string method = "auto";
    int order = 0;           ///< 0: the method's own
    double step = 0.0;       ///< 0: the span's
    double end = 0.0;        ///< 0: the last reference
    double tolerance = 0.0;  ///< relative error in q and v that this reaches; 0: none stated
    bool stated = false;
  };

  std::string file;  ///< its name, for messages
  std::string name, kind, description, source, needs;
  std::optional<FormulaText> lagrangian, hamiltonian, dissipation;
  std::vector<Coordinate> coordinates;
  Spaces spaces;
  std::vector<Parameter> parameters;  ///< sizes first
  std::map<std::string, FormulaText, std::less<>> definitions;
  std::vector<Row> rows;
  std::vector<Input> inputs;
  std::vector<Event> events;
  std::vector<State> states;  ///< coordinates as well
  std::vector<Entry> force, start;
  std::optional<FormulaText> start_time;
  bool project = false;
  bool operating_point = false;      ///< of a circuit, where the motion starts
  std::vector<std::string> notes;    ///< of what is read otherwise than it may be meant
  std::vector<FormulaText> guesses;  ///< components of the start that projection may move: "b", "v_x[2]"
  bool drop_redundant_rows = false;
  double t_end = 0.0, step = 0.0, study_end = 0.0;
  std::vector<Reference> references;
  std::vector<Invariant> invariants;
  std::vector<Output> outputs;  ///< in the order of the file
  std::optional<Control> control;
  std::vector<Branch> branches;
  std::vector<Mutual> mutuals;
  std::vector<TwoPort> two_ports;
  std::vector<DrawnBody> bodies;
  Recommended recommended;
};

/// Reads the text of a scene file.  Throws SceneError.
SceneDocument read_document(const std::string& file, const std::string& text);

}  // namespace diracstep::scene_compiler
