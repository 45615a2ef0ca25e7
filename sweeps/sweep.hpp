#pragma once

#include <cstdint>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// A number that a sweep draws: a + (b − a) u, a (b/a)^u, or a + b Φ⁻¹(u) for u in (0, 1).
struct Drawn {
  enum class Law { uniform, log_uniform, normal };
  std::string name;
  Law law = Law::uniform;
  double a = 0.0, b = 1.0;  ///< the ends; of the normal law the mean and the standard deviation
};

/// A scene that is run for many values of its parameters and starts, and what is kept of each run.
///
/// Names are those of parameters and sizes of the scene, and "start.x", "start.v_x" and "start.p_x" for the
/// start of a coordinate x.  A member is a combination of one value of each axis, one line of the table and
/// one draw: grid.size() × table.size() × draws members in all, numbered from 0, the draw counting fastest,
/// then the table, then the last axis.
struct Sweep {
  std::string file;  ///< for messages
  std::string text;  ///< of the file, which the sweep is known by
  std::string scene;
  Parameters set;  ///< the same for all members

  std::string method = "auto";
  int order = 0;
  std::optional<std::string> rule;
  double step = 0.0;  ///< 0: the scene's
  std::optional<double> end;
  std::optional<double> error;  ///< solve_to_error() for each member, in place of steps
  bool project = false;         ///< starts are moved onto the constraints, but for what the sweep gives
  bool checks = true;           ///< members are held to the checks of a run (core/runs/run_checks.hpp)
  long block = 0;               ///< members of a block; 0: as many as take about ten seconds

  struct Axis {
    std::string name;
    std::vector<double> values;
  };
  std::vector<Axis> grid;
  std::vector<std::string> table_names;
  std::vector<std::vector<double>> table;
  std::vector<Drawn> drawn;
  long draws = 1;
  std::uint64_t seed = 0;
  bool sobol = false;  ///< a Sobol sequence shifted by the seed, in place of independent numbers

  /// At the end: columns of a trajectory, "x", "v_x", "p_x", "lambda_ROW", "energy", "invariant_NAME", and
  /// the scene's outputs.  Empty: all coordinates and velocities.
  std::vector<std::string> values;
  std::vector<std::string> extrema;  ///< their smallest and largest values over the nodes of the run
  std::vector<std::string> events;   ///< of the scene: the time of the first, and how many there were

  std::vector<std::string> derivatives;  ///< at the end, of the discrete motion: "d(x)/d(m)", "d(v_x)/d(m)"

  long members() const;
  std::vector<std::string> names() const;  ///< of all that varies: axes, table, draws
  /// The values of these for one member, in this order: the same bits whoever asks, and when.
  std::vector<double> member(long number) const;
};

/// Reads the file of a sweep (docs/sweeps.md); a scene file and a table named in it are found beside it.
/// Throws Misuse, with the line and column, for what is wrong in it.
Sweep read_sweep(const std::string& path);

}  // namespace diracstep
