#pragma once

#include <diracstep/solvers/detail/sundials.hpp>
#include <span>

namespace diracstep::detail {

/// A serial vector of another's numbers, once set_data() says whose; its clones have their own.  Operations
/// are those KINSOL needs around a direct linear solver, as loops of this build, of fixed length for up to 16
/// entries: at the few unknowns of a step the library's own ones, behind checks and pointers and in the
/// packages of some distributions compiled without optimisation, take longer than the arithmetic of a step.
VectorHandle make_view(int size, SUNContext context);

inline double*& data_of(N_Vector x) { return static_cast<N_VectorContent_Serial>(x->content)->data; }

/// So many equal entries.
struct Run {
  long length;
  double value;
};

/// Scales for vectors like this one, the only weights that KINSOL then takes with them.  They are equal over
/// long runs, at most four: of a long vector only these are kept.
VectorHandle make_weights(N_Vector vector);
void set_weights(N_Vector weights, std::span<const Run> runs);
/// Weights that are all different, the inverses of these scales, which must stay where they are.
void set_weights(N_Vector weights, const double* scales);

}  // namespace diracstep::detail
