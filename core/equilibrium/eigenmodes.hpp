#pragma once

#include <complex>
#include <diracstep/core/equilibrium/linearisation.hpp>
#include <vector>

namespace diracstep {

/// A solution δq = Re(shape e^{eigenvalue t}) of linear equations.
struct Mode {
  std::complex<double> eigenvalue;  ///< imaginary part 0 or above: of a pair one
  Eigen::VectorXcd shape;           ///< n numbers, the largest 1
  double round_off = 0.0;           ///< what it may make of the real part
};

/// What the eigenvalues say of small motions.
enum class Stability {
  asymptotic,  ///< all real parts are negative
  unstable,    ///< one is positive
  neutral,     ///< none is positive, some are zero: higher terms decide
  undecided    ///< none is positive for sure, but a real eigenvalue may be: it is as small as its round-off
};

struct Eigenmodes {
  std::vector<Mode> modes;  ///< of the eigenvalues that are not zero, by imaginary and then by real part
  int zeros = 0;            ///< eigenvalues 0: nothing draws such a motion back
  /// The fastest rate that may be behind one of them, since round-off of forces is as large; 0: none is.
  double zeros_below = 0.0;
  /// Directions in which an equilibrium goes on as a family, to first order: n numbers each, the largest 1
  /// and 0 in the others.  By full matrices alone.
  Columns free_directions;
  Stability stability = Stability::neutral;
};

/// Eigenvalues and modes.  Those that are zero are split off one kernel after the other instead of being
/// computed, for a chain of them (a coordinate that nothing depends on, and its velocity) would come out as
/// the root of round-off.  Conservative equations are solved as the symmetric problem that they are, so that
/// their eigenvalues are real or imaginary, and again for their slow ones alone (Ritz), so that a slow growth
/// beside fast vibrations is told from 0 as far as round-off of the stiffness allows.
Eigenmodes eigenmodes(const Linearisation& linear);

/// Puts modes in their order and reads the stability off them.
void finish(Eigenmodes& found);

const char* describe(Stability stability);

}  // namespace diracstep
