#pragma once

#include <diracstep/scene_format/compiler/formula_graph.hpp>
#include <diracstep/scene_format/compiler/formula_parser.hpp>
#include <diracstep/scene_format/compiler/kernel.hpp>
#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace diracstep::scene_compiler {

/// What a function of the scene is, and with it which kernels its pieces have:
///
///   phase      value; gradient; hessian; ∂(f_y)/∂t; ∂(f_x)/∂t   one output, f
///   rows       φ; A and b; ∂(A w + s b)/∂q; ∂(A w + b)/∂t; ∂(Aᵀλ)/∂q   an output for each row
///   force      f; ∂f/∂q and ∂f/∂v                               an output for each component
enum class FunctionKind { phase, rows, force };

/// Number of the kernel of rows that works on `curvature`; all others work on `entries`.
inline constexpr std::size_t annihilator_kernel = 4;

/// A part of a function, written once and repeated over its loops: the function is the sum of all instances.
struct Piece {
  std::vector<int> loops;          ///< outermost first
  std::size_t counting_loops = 0;  ///< the first so many number the rows
  std::vector<Node> outputs;
  std::vector<int> groups;    ///< rows: the group of each output
  std::vector<Node> targets;  ///< force: the coordinate of each output
  std::vector<Node> slots;    ///< the coordinates it reads, as leaves of role position
  PieceLayout layout;
  std::vector<std::pair<int, int>> entries;    ///< (slot, slot), or for rows (output, slot), of derivatives
  std::vector<std::pair<int, int>> curvature;  ///< rows: (slot, slot) of ∂(Aᵀλ)/∂q
  Constants instance;
  std::vector<Kernel> kernels;

  int instance_width() const { return static_cast<int>(instance.nodes().size()); }
  int position_width(FunctionKind kind, std::size_t kernel) const {
    return static_cast<int>(kind == FunctionKind::rows && kernel == annihilator_kernel ? curvature.size()
                                                                                       : entries.size());
  }
};

/// Rows from one [[rows]] entry: one, or one for each turn of its loops.
struct RowGroup {
  std::string name;
  std::vector<int> loops;
  Place place;
  std::string origin = {};  ///< of rows that the file does not hold
};

/// A function of the scene as a sum of pieces, and what is known of its second derivatives.
struct SceneFunction {
  FunctionKind kind;
  bool holonomic = false;
  std::vector<Piece> pieces = {};
  std::vector<RowGroup> groups = {};
  bool separable = true, y_hessian_constant = true, y_hessian_diagonal = true, quadratic = true,
       y_hessian_zero = true;
  bool x_absent = true;    ///< coordinates do not enter
  bool autonomous = true;  ///< t does not enter
  bool workless = true;    ///< rows: and b = 0
};

/// A value by coordinate: the start, or a reference.
struct NamedValue {
  int family;
  Node index;  ///< none for the whole family or a single coordinate
  Role role;
  bool momentum;             ///< of role second: p, not v
  std::vector<Node> values;  ///< one formula, or one for each element
  Place place;
};

struct ReferenceProgram {
  std::vector<NamedValue> values;
};

struct InvariantProgram {
  std::string name;
  SceneFunction function;
  std::optional<double> value;
};

struct OutputProgram {
  std::string name;
  SceneFunction function;
};

/// The rate of a state, whose row is v − rate = 0.
struct StateProgram {
  int family;
  SceneFunction rate;
};

/// Where the formulas are not smooth or change fast (core/system/kinks.hpp), each with one output for each
/// row of its groups.
struct KinkProgram {
  SceneFunction kinks{FunctionKind::rows}, ramps{FunctionKind::rows};  ///< switching functions
  SceneFunction events{FunctionKind::rows};       ///< functions of the time whose zeros are instants,
  SceneFunction widths{FunctionKind::rows};       ///< and how wide each is there, row by row
  SceneFunction phase_rates{FunctionKind::rows};  ///< of sines of the time
  std::set<double> knots;  ///< of tables of the time: kinks at times that need not be looked for
};

/// [[events]], as in the document.
struct EventProgram {
  std::optional<SceneFunction> when, condition, restitution;
  std::optional<SceneFunction> contact;  ///< `when` as a holonomic row
  std::vector<NamedValue> set;           ///< the components that are set,
  std::vector<SceneFunction> values;     ///< and to what
};

/// A scene file compiled: everything but the numbers.
struct SceneProgram {
  SceneProgram(SceneDocument scene, bool as_written, const SizeLimits& limits)
      : document(std::move(scene)), graph(as_written, limits) {}
  SceneDocument document;
  FormulaGraph graph;
  Symbols symbols;
  Constants known;
  std::optional<SceneFunction> lagrangian, hamiltonian, force;
  std::optional<SceneFunction> cost, end_cost;  ///< of [control], where parameters are differentiated
  std::vector<SceneFunction> rows;  ///< holonomic and nonholonomic, in the order they first appear
  std::vector<NamedValue> start;
  std::vector<NamedValue> guesses;  ///< without values of use: the components of the start that may be moved
  bool start_by_momentum = false;
  /// Parameters that are coordinates as well, after those of the file, and the start differentiated by each.
  std::vector<std::string> differentiated;
  std::vector<std::vector<NamedValue>> start_derivatives;
  Node start_time = none;
  std::vector<ReferenceProgram> references;  ///< as in the document
  std::vector<InvariantProgram> invariants;
  std::vector<OutputProgram> outputs;
  std::vector<StateProgram> states;
  std::vector<EventProgram> events;      ///< as in the document
  std::vector<std::vector<Node>> drawn;  ///< sizes of each of the document's bodies, then its fixed place
  KinkProgram kinks;
  std::string source;  ///< C for all kernels
  std::string name;    ///< of the source, by its content; the table in it is diracstep_kernels_NAME

  /// All functions that have kernels, in the order of the table.
  std::vector<const SceneFunction*> functions() const;
};

/// Reads, checks and differentiates a scene.  `as_written`: see FormulaGraph.  Parameters that are named in
/// `differentiated` are coordinates in what is mechanical (sensitivities/parametric_scene.hpp), with Σ v²/2
/// of them in L and Σ p²/2 in H.  Throws SceneError; Misuse for a name that is no single parameter.
std::unique_ptr<SceneProgram> compile_scene(const std::string& file, const std::string& text,
                                            bool as_written = false,
                                            const std::vector<std::string>& differentiated = {});

}  // namespace diracstep::scene_compiler
