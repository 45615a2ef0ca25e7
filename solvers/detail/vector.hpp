#pragma once

#include <diracstep/solvers/detail/sundials.hpp>

namespace diracstep::detail {

/// A serial vector whose operations are loops of this build, of fixed length for up to 16 entries.  Clones
/// inherit them.  At the few unknowns of a step the library's own ones, behind checks and pointers and in the
/// packages of some distributions compiled without optimisation, take longer than the arithmetic of a step.
VectorHandle make_vector(int size, SUNContext context);

inline double* data_of(N_Vector x) { return static_cast<N_VectorContent_Serial>(x->content)->data; }

}  // namespace diracstep::detail
