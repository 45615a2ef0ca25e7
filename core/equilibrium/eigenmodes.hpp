#pragma once

#include <complex>
#include <diracstep/core/equilibrium/linearisation.hpp>
#include <vector>

namespace diracstep {

/// A solution δq = Re(shape e^{eigenvalue t}) of linear equations.
struct Mode {
  std::complex<double> eigenvalue;  ///< imaginary part 0 or above: of a pair one
  Eigen::VectorXcd shape;           ///< n numbers, the largest 1
};

/// What the eigenvalues say of small motions.
enum class Stability {
  asymptotic,  ///< all real parts are negative
  unstable,    ///< one is positive
  neutral      ///< none is positive, some are zero: higher terms decide
};

struct Eigenmodes {
  std::vector<Mode> modes;  ///< of the eigenvalues that are not zero, by imaginary and then by real part
  int zeros = 0;            ///< eigenvalues 0: nothing draws such a motion back
  Stability stability = Stability::neutral;
};

/// Eigenvalues and modes.  Those that are zero are split off one kernel after the other instead of being
/// computed, for a chain of them (a coordinate that nothing depends on, and its velocity) would come out as
/// the root of round-off.  Conservative equations are solved as the symmetric problem that they are, so that
/// their eigenvalues are real or imaginary.
Eigenmodes eigenmodes(const Linearisation& linear);

/// Puts modes in their order and reads the stability off them.
void finish(Eigenmodes& found);

const char* describe(Stability stability);

}  // namespace diracstep
