#pragma once

#include <diracstep/constraints/linear.hpp>
#include <diracstep/core/system/scene.hpp>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// A branch of a circuit from one node to another.  Its coordinate is the charge that has passed, its
/// velocity the current.
struct Branch {
  enum class Kind { inductor, capacitor, resistor, voltage_source, current_source };
  Kind kind;
  std::string name, from, to;
  double value = 0.0;    ///< inductance in H, capacitance in F, resistance in Ω
  Waveform source = {};  ///< voltage in V, current in A
};

Branch inductor(std::string name, std::string from, std::string to, double henry);
Branch capacitor(std::string name, std::string from, std::string to, double farad);
Branch resistor(std::string name, std::string from, std::string to, double ohm);
/// A positive voltage drives a positive current.
Branch voltage_source(std::string name, std::string from, std::string to, Waveform volt);
Branch current_source(std::string name, std::string from, std::string to, Waveform ampere);

/// The scene of a circuit from its incidence:
///
///   L = Σ ½ L v² − Σ q²/2C + Σ V(t) q,   f = −R v,   Kirchhoff's current law as rows "node_NAME"
///
/// and a row "NAME" with v = I(t) for each current source.  One node of each connected part has no row,
/// "ground" or "0" where there is one: its row follows from the others.  The coordinates are "q" and the
/// branch's name; the start is at zero, and is the caller's to change.  The forces Λ of the node rows are the
/// potentials of the nodes in V, against the node left out; Kirchhoff's voltage law is that they exist.  A
/// circuit may be degenerate (loops without inductors), see hidden_rows.hpp.  Throws Misuse for no branches,
/// a name given twice, a branch from a node to itself, and a value that is not positive (resistances may be
/// zero).
Scene circuit(const std::string& name, const std::vector<Branch>& branches);

/// The nodes with a row, of a circuit given by the two ends of each branch: all but one of each connected
/// part.
std::vector<std::string> nodes_with_rows(const std::vector<std::pair<std::string, std::string>>& ends);

}  // namespace diracstep
