#pragma once

#include <diracstep/solvers/detail/sundials.hpp>

namespace diracstep::detail {

/// A serial vector of another's numbers, once set_data() says whose; its clones have their own.  Operations
/// are those KINSOL needs around a direct linear solver, as loops of this build, of fixed length for up to 16
/// entries: at the few unknowns of a step the library's own ones, behind checks and pointers and in the
/// packages of some distributions compiled without optimisation, take longer than the arithmetic of a step.
VectorHandle make_view(int size, SUNContext context);

inline double*& data_of(N_Vector x) { return static_cast<N_VectorContent_Serial>(x->content)->data; }

}  // namespace diracstep::detail
